"""What is left of a recording where the drive was switched off for a while."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.errors import RecordingError
from rtcomp.recording.driven import driven
from rtcomp.recording.reader import Recording


def recorded(enabled: np.ndarray | None) -> Recording:
    time = np.arange(1000) / 200.0
    columns = {"time": time, "position": np.sin(time), "voltage": np.cos(time)}
    return Recording(columns if enabled is None else {**columns, "enabled": enabled}, 200.0)


def test_without_the_column_or_always_on_nothing_changes():
    for enabled in (None, np.ones(1000)):
        recording = recorded(enabled)
        assert driven(recording) == [recording]


def test_only_rows_with_the_drive_on_are_left_and_it_is_said():
    enabled = np.ones(1000)
    enabled[300:500] = 0.0
    enabled[520:900] = 0.0  # twenty rows between are too few
    first, second = driven(recorded(enabled))
    assert (len(first), len(second)) == (300, 100)
    assert second.time[0] == 900 / 200.0
    assert all(np.all(part.columns["enabled"] == 1) for part in (first, second))
    assert "switched off in 580 rows: 400 of 1000" in first.notes[-1]


def test_never_on_is_refused():
    with pytest.raises(RecordingError, match=r"switched off in 1000 of 1000 rows"):
        driven(recorded(np.zeros(1000)))
