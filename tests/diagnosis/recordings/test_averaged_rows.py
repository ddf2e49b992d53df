"""Means of rows: what their second differences see of a held command is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.diagnosis.forces.kinematics import acted, second_difference
from rtcomp.diagnosis.recordings.data import Data, Segment, averaged
from rtcomp.stage.balance import forces
from rtcomp.stage.stage import Stage

RATE = 1000.0


@settings(deadline=None)
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
    path = np.zeros((4, segment.time.size))
    stage = Stage.from_dict({"stage": {"mass": 2.0, "force_constant": 2.0, "voltage_limit": 10.0}})
    given = np.append(segment.voltage[:1], segment.voltage[:-1])
    drive = acted(forces(stage, [*stage.chain], segment.time, *path[:3], given), segment, data, 2.0)
    needed = 2.0 * second_difference(segment.position, data.rate)
    assert drive[1:-1] == pytest.approx(needed[1:-1], abs=1e-9)
