"""What every friction model of the catalogue must do, whatever its equations."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp import physics
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION, MOVED, REACH, SCALE, VELOCITY

NAMES = ["maxwell-slip", "dahl", "lugre", "gms", "leuven", "modified-leuven"]
every = pytest.mark.parametrize("name", NAMES)
AT_ONE_LEVEL = {"static": 3.0, "damping": 0.0, "viscous": 0.0}
LEVEL = {"maxwell-slip": 4.4}
"""Level (N) of the examples at one level; 3 N where not said."""


def model(name, **changes):
    text = dict(physics.entry(name).example)
    return physics.entry(name).from_dict({**text, **{k: v for k, v in changes.items() if k in text}})


def force(effect, position, step=1e-3):
    return over_rows([effect], motion_rows(np.asarray(position, dtype=float), step))[:, FRICTION]


def path_of(corners, pieces=60):
    corners = [0.0, *corners]
    return np.concatenate([np.linspace(a, b, pieces + 1)[1:] for a, b in itertools.pairwise(corners)])


@every
@settings(max_examples=30, deadline=None)
@given(corners=st.lists(st.floats(-2e-5, 2e-5), min_size=1, max_size=10))
def test_passive_it_gives_back_no_more_than_it_was_given(name, corners):
    """From rest the work taken is never negative; in steps fine enough for the trapezoid rule."""
    x = path_of(corners, 200)
    f = np.concatenate([[0.0], force(model(name, **AT_ONE_LEVEL), x)])
    work = np.cumsum(np.diff(x, prepend=0.0) * (f[1:] + f[:-1]) / 2)
    assert np.min(work) >= -1e-3 * LEVEL.get(name, 3.0) * np.sum(np.abs(np.diff(x, prepend=0.0)))


@every
@settings(max_examples=30, deadline=None)
@given(
    corners=st.lists(st.floats(-1e-2, 1e-2), min_size=1, max_size=20),
    step=st.sampled_from([1e-6, 1e-4, 1e-2, 1.0]),
)
def test_never_above_its_level_however_large_the_steps(name, corners, step):
    f = force(model(name, damping=0.0, viscous=0.0), corners, step)
    assert np.all(np.isfinite(f))
    highest = 4.4 if name == "maxwell-slip" else 3.0 if name == "dahl" else 4.0
    assert np.max(np.abs(f)) <= highest * (1 + 1e-9)


@every
def test_steps_of_a_recording_and_of_a_simulation_agree(name):
    """100 Hz rows, tens of micrometres a row, against 100 kHz; rows next to a reversal left out."""
    t = np.arange(1, 200_001) * 1e-5
    x = 1e-3 * np.sin(2 * np.pi * 0.5 * t)
    effect = model(name, **AT_ONE_LEVEL)
    fine, coarse = force(effect, x, 1e-5)[999::1000], force(effect, x[999::1000], 1e-2)
    speed = np.abs(np.cos(2 * np.pi * 0.5 * t[999::1000]))
    np.testing.assert_allclose(coarse[speed > 0.1], fine[speed > 0.1], rtol=2e-3)


@every
def test_holds_its_force_and_state_at_rest_and_infers_no_direction_from_zero(name):
    effect = model(name)
    p, s = effect.vector(), effect.initial_state()
    for w in motion_rows(path_of([3e-6, -1e-6, 2e-6]), 1e-3):
        effect.kernel(p, s, w)
    kept, seen = s.copy(), set()
    for zero in (0.0, -0.0) * 500:
        w = motion_rows(np.zeros(1), 1e-3)[0]
        w[MOVED], w[VELOCITY] = zero, -zero
        effect.kernel(p, s, w)
        seen.add(w[FRICTION])
    np.testing.assert_array_equal(s, kept)
    assert len(seen) == 1


@every
def test_mirrored_motion_gives_mirrored_force(name):
    x = path_of([3e-6, -1e-5, 2e-6, 1e-4, -3e-4])
    np.testing.assert_allclose(force(model(name), -x), -force(model(name), x), rtol=1e-9, atol=1e-12)


@every
@pytest.mark.parametrize("speed", [0.02, -0.02])
def test_reach_widens_the_level_and_scale_multiplies_it(name, speed):
    rows = motion_rows(speed * 1e-3 * np.arange(1, 1001), 1e-3)
    rows[:, REACH], rows[:, SCALE] = 1.3, 0.7
    level = LEVEL.get(name, 3.0)
    got = over_rows([model(name, **AT_ONE_LEVEL)], rows)[-1, FRICTION]
    assert got == pytest.approx(np.sign(speed) * level * 1.3 * 0.7, rel=1e-6)


@every
def test_initial_slope_is_the_stiffness_whatever_the_reach(name):
    rows = motion_rows(np.array([1e-10]), 1e-3)
    plain = over_rows([model(name, **AT_ONE_LEVEL)], rows.copy())[0, FRICTION]
    rows[:, REACH] = 2.0
    assert over_rows([model(name, **AT_ONE_LEVEL)], rows)[0, FRICTION] == pytest.approx(plain, rel=1e-3)


@every
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_fall_of_the_level_is_followed_also_out_of_a_minor_loop(name, sign):
    """The level halves on the way back up inside a minor loop, as a Stribeck effect would make it."""
    back = [99.5e-6, 99.9e-6]
    x = np.concatenate([1e-6 * np.arange(1, 101), back, back[-1] + 1e-6 * np.arange(1, 501)])
    rows = motion_rows(sign * x, 1e-3)
    rows[102:, REACH] = 0.5
    f = sign * over_rows([model(name, **AT_ONE_LEVEL)], rows)[:, FRICTION]
    level = LEVEL.get(name, 3.0)
    assert f[99] == pytest.approx(level, rel=1e-2)
    assert f[-1] == pytest.approx(level / 2, rel=1e-3)
    assert np.all(np.diff(f[102:]) <= 1e-9)
    assert np.all(f[102:] >= level / 2 * (1 - 1e-9))
