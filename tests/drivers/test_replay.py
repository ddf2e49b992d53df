"""A recording plays the stage row by row, and says when it is over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create

from rtcomp.errors import ConfigError
from rtcomp.loop.device import INVALID, OK, EndOfRun


@dataclass
class Table:
    columns: dict


def table(rows=20, **changes):
    time = np.arange(rows) * 1e-3
    columns = {"time": time, "position": np.sin(time), "voltage": np.cos(time), **changes}
    return Table({name: values for name, values in columns.items() if values is not None})


def replay(recording):
    device = create({"driver": "replay"}, Bench(recording=recording))
    device.open()
    return device


def test_rows_come_back_whatever_is_commanded():
    recording = table()
    device = replay(recording)
    assert len(device) == 20
    for row in range(20):
        sample = device.exchange(7.0 * row)
        assert sample == (recording.columns["position"][row], recording.columns["time"][row], row + 1, OK)
        assert device.voltage == recording.columns["voltage"][row]
        assert np.isnan(device.reference)
    with pytest.raises(EndOfRun, match="20 rows"):
        device.exchange(0.0)


def test_a_recorded_reference_is_offered():
    device = replay(table(reference=np.arange(20.0)))
    device.exchange(0.0)
    device.exchange(0.0)
    assert device.reference == 1.0


def test_rows_without_a_position_are_invalid_and_keep_the_last():
    position = np.arange(20.0)
    position[[0, 5]] = np.nan
    device = replay(table(position=position))
    samples = [device.exchange(0.0) for _ in range(7)]
    assert [s.status for s in samples] == [INVALID, OK, OK, OK, OK, INVALID, OK]
    assert [s.position for s in samples] == [0.0, 1.0, 2.0, 3.0, 4.0, 4.0, 6.0]


def test_a_recording_without_the_columns_is_refused():
    with pytest.raises(ConfigError, match=r"voltage; the recording has time, position"):
        replay(table(voltage=None))
