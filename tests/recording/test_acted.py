"""Our own recordings read as their commands acted; anybody else's left alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.follow import follow
from rtcomp.jobs.replay import replay
from rtcomp.jobs.simulate import closed_loop
from rtcomp.recording.acted import as_acted
from rtcomp.recording.reader import Recording, read

CONFIG = Path(__file__).parents[2] / "configs" / "leuven.yaml"


def recording(metadata: dict[str, object], rate: float = 100.0, **columns: list[float]) -> Recording:
    made = {"time": np.arange(6) / rate, "position": np.arange(6.0), "voltage": np.arange(1.0, 7.0)}
    made |= {name: np.array(values) for name, values in columns.items()}
    return Recording(made, rate, metadata)


@pytest.mark.parametrize(
    ("ticks", "made_at", "expected"),
    [
        (0, 100.0, [1, 2, 3, 4, 5, 6]),
        (1, 100.0, [0, 1, 2, 3, 4, 5]),
        ("2", "100.0", [0, 0, 1, 2, 3, 4]),
        (1, 50.0, [0, 0, 1, 2, 3, 4]),
        (1, 200.0, [0.5, 1.5, 2.5, 3.5, 4.5, 5.5]),
    ],
)
def test_commands_move_to_where_they_acted(ticks, made_at, expected):
    """Also where the recording was resampled since: a delay is a time."""
    own = recording({"rtcomp_version": "0", "delay_ticks": ticks, "rate_hz": made_at})
    acted = as_acted(own)
    assert acted.voltage.tolist() == expected
    assert own.voltage.tolist() == [1, 2, 3, 4, 5, 6]
    assert as_acted(acted).voltage.tolist() == expected


def test_rows_not_measured_at_their_time_are_doubtful():
    own = recording(
        {"rtcomp_version": "0"}, status=[0, 1, 0, 0, 0, 0], overrun=[0, 0, 1, 2, 0, 0], gap=[0, 0, 0, 0, 1, 0]
    )
    acted = as_acted(own)
    assert acted.trusted.tolist() == [True, False, False, False, False, True]
    assert any("3 rows" in note for note in acted.notes)


def test_a_strangers_recording_is_left_alone():
    """Its column `status` may be a drive's status word."""
    other = recording({"delay_ticks": 1}, status=[1591.0] * 6)
    assert as_acted(other) is other


def test_a_recording_over_a_link_balances(tmp_path):
    config = Configuration.load(CONFIG).changed(
        device={"driver": "simulated", "delay_ticks": 1},
        reference={
            "kind": "multisine",
            "frequencies": [1.0, 7.0],
            "amplitudes": [1e-4, 3e-5],
            "duration": 4.0,
        },
    )
    follow(config, "", path=tmp_path / "link.h5")
    link = read(tmp_path / "link.h5")
    plain = Recording(link.columns, link.rate_hz)
    done = replay(config.stage, link)
    assert done.relative_force_error < 0.01
    assert replay(config.stage, plain).relative_force_error > 3 * done.relative_force_error
    assert np.array_equal(done.columns["voltage"], link.voltage), "a replay gives the recording's own column"


def test_without_a_delay_nothing_moves(tmp_path):
    closed_loop(Configuration.load(CONFIG), path=tmp_path / "run.h5")
    own = read(tmp_path / "run.h5")
    acted = as_acted(own)
    assert np.array_equal(acted.voltage, own.voltage) and acted.trusted.all() == own.trusted.all()
    assert acted.notes == own.notes
