"""What happened in a run stands in its recording: changes of the state from the rows, the rest as told."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from rtcomp.loop.ring import WRITTEN, Ring
from rtcomp.loop.states import State
from rtcomp.recording.convert import convert
from rtcomp.recording.events import EVENT_BYTES, Event
from rtcomp.recording.reader import read
from rtcomp.recording.recorder import Recorder

COLUMNS = ["time", "position", "voltage", "state"]
STATES = [State.CONNECTED] * 30 + [State.RUNNING] * 470 + [State.DEGRADED] * 100 + [State.RUNNING] * 400
CHANGES = [
    Event(0.0, 1, "CONNECTED"),
    Event(0.03, 4, "RUNNING"),
    Event(0.5, 5, "DEGRADED"),
    Event(0.6, 4, "RUNNING"),
]


def write(ring: Ring, states: list[State]) -> None:
    for state in states:
        row = int(ring.header[WRITTEN])
        ring.rows[row % ring.capacity] = (row / 1000.0, 1e-6 * row, -row, state)
        ring.header[WRITTEN] += 1


@pytest.fixture()
def recorded(tmp_path: Path) -> Path:
    ring = Ring.create(4096, len(COLUMNS))
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {})
    write(ring, STATES)
    recorder.tell(1.0, State.FAULT, "the axis ran away; " + "x" * 500)
    ring.close()
    assert recorder.finish().complete
    ring.release()
    return tmp_path / "run.h5"


def test_states_and_what_was_told_are_read_back_in_order(recorded: Path) -> None:
    *changes, told = read(recorded).events
    assert changes == CHANGES
    assert told[:2] == (1.0, 7) and told.text.startswith("the axis ran away; xxx")
    assert len(told.text) == EVENT_BYTES


def test_what_was_told_before_the_end_is_never_lost(tmp_path: Path) -> None:
    """Told, then at once closed: twenty times over."""
    for number in range(20):
        ring = Ring.create(64, len(COLUMNS))
        recorder = Recorder.start(tmp_path / f"{number}.h5", ring, COLUMNS, {})
        write(ring, [State.RUNNING] * 20)
        recorder.tell(0.02, State.FAULT, "cable pulled")
        ring.close(2)
        recorder.finish()
        ring.release()
        assert read(tmp_path / f"{number}.h5").events[-1] == (0.02, 7, "cable pulled")


def test_after_a_kill_of_the_recorder_they_are_there_up_to_the_last_flush(tmp_path: Path) -> None:
    ring = Ring.create(4096, len(COLUMNS))
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {})
    write(ring, STATES)
    end = time.monotonic() + 10.0
    while recorder.rows_flushed < len(STATES):
        assert time.monotonic() < end
        time.sleep(0.01)
    os.kill(recorder.pid, signal.SIGKILL)
    os.waitid(os.P_PID, recorder.pid, os.WEXITED | os.WNOWAIT)  # dead, and not yet asked for
    recorder.tell(1.0, State.FAULT, "nobody hears this")
    ring.close(2)
    assert recorder.finish().problem
    ring.release()
    assert read(tmp_path / "run.h5").events == CHANGES


def test_they_go_along_to_hdf5_and_are_said_to_be_missing_elsewhere(recorded: Path, tmp_path: Path) -> None:
    events = read(recorded).events
    assert convert(recorded, tmp_path / "again.h5").events == events
    again = read(tmp_path / "again.h5")
    assert again.events == events and set(again.columns) == set(COLUMNS)
    for name in ("run.csv", "run.mat"):
        notes = convert(recorded, tmp_path / name).notes
        assert f"the events of the run are not in {name}: only HDF5 holds them" in notes
        assert read(tmp_path / name).events == []


def test_a_recording_without_them_has_none(tmp_path: Path) -> None:
    import h5py

    columns = {"time": np.arange(50) / 1e3, "position": np.arange(50.0), "voltage": np.ones(50)}
    with h5py.File(tmp_path / "old.h5", "w") as file:
        for name, column in columns.items():
            file[name] = column
        file.attrs["format"] = "rtcomp recording 1"
    assert read(tmp_path / "old.h5").events == []
