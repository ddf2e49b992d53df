"""Means of rows: what their second differences see of a held command is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.diagnosis.forces.kinematics import second_difference
from rtcomp.diagnosis.recordings.data import Data, Segment, averaged

RATE = 1000.0


@given(st.integers(1, 7), st.integers(0, 2**32 - 1))
def test_a_free_mass_accelerates_by_the_command_that_means_of_rows_see(factor: int, seed: int) -> None:
    """m x'' = F held from row to row has a closed form, and so have means of it, however rough F is."""
    volts = np.random.default_rng(seed).standard_normal(210)
    rise = np.cumsum(volts) / RATE
    speed = np.append(0.0, rise[:-1])
    position = np.append(0.0, np.cumsum(speed / RATE + 0.5 * volts / RATE**2)[:-1])
    whole = Segment(np.arange(210) / RATE, position, volts, None)
    segment = averaged(whole, factor) if factor > 1 else whole
    data = Data((segment,), RATE / factor, True, factor)
    held = 0.5 * (segment.voltage + np.append(segment.voltage[:1], segment.voltage[:-1]))
    needed = 2.0 * second_difference(segment.position, data.rate)
    assert data.acted(segment, 2.0 * held, 2.0)[1:-1] == pytest.approx(needed[1:-1], abs=1e-9)
