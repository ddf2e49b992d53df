"""The Leuven models: the stack of reversals, the modified model, and how both pass into sliding."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rtcomp.errors import ConfigError
from rtcomp.physics.approach import advance, longest
from rtcomp.physics.leuven import DEPTH, Leuven
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.modified_leuven import ModifiedLeuven
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION, REACH

MODELS = [Leuven, ModifiedLeuven]
ELEMENTS = [(8e5, 1e-6), (4e5, 3e-6), (2e5, 10e-6)]  # 4 N
LEVELS = {"coulomb": 3.0, "static": 4.0, "stribeck_velocity": 2e-3, "sharpness": 3.0}
HARD = {"coulomb": 4.0, "static": 4.0, "sharpness": 100.0}
both = pytest.mark.parametrize("model", MODELS)


def force(effect, positions, step=1e-3):
    return over_rows([effect], motion_rows(np.array(positions, dtype=float), step))[:, FRICTION]


def inside(path):
    """A path within presliding, far enough below the level for |q|^100 to vanish."""
    return [x * 3e-6 for x in path]


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("start", [-1.0, -0.5, 0.0, 0.6, 0.99, 1.2])
def test_the_approach_solves_its_equation(n, start):
    travel = np.arange(1, 60) * longest(n)
    q, got = start, []
    for _ in travel:
        q = advance(q, n, longest(n))
        got.append(q)
    exact = solve_ivp(
        lambda _, y: 1 - np.sign(y) * np.abs(y) ** n, (0, travel[-1] + 1e-9), [start],
        t_eval=travel, method="Radau", rtol=1e-7, atol=1e-9,
    ).y[0]  # fmt: skip
    np.testing.assert_allclose(got, exact, atol=1e-2 if n > 5 else 2e-3)


@settings(deadline=None)
@given(q=st.floats(-1e6, 1e6), n=st.floats(1, 100), h=st.floats(0, 1e6))
def test_the_approach_never_passes_the_level(q, n, h):
    new = advance(q, n, h)
    assert math.isfinite(new)
    assert new <= 1.0 if q <= 1.0 else new >= 1.0


@both
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("speed", [1e-4, 2e-3, 0.05])
def test_settles_on_the_stribeck_curve(model, speed, sign):
    effect = model(ELEMENTS, **LEVELS, damping=200.0, viscous=5.0)
    f = force(effect, sign * speed * 1e-3 * np.arange(1, 4001))[-1]
    level = 3.0 + math.exp(-((speed / 2e-3) ** 2))
    assert f == pytest.approx(sign * (level + 5.0 * speed), rel=1e-6)


@both
def test_it_has_hysteresis(model):
    """With the bracket written v ((1 - sgn) |.|^n) there is none at all."""
    x = 3e-6 * np.sin(2 * np.pi * np.arange(1, 2001) / 1000)
    f = force(model(ELEMENTS, **LEVELS), x)[1000:]
    loop = np.sum(np.diff(x[1000:]) * (f[1:] + f[:-1]) / 2)
    bank = MaxwellSlip(ELEMENTS)
    g = force(bank, x)[1000:]
    assert loop == pytest.approx(np.sum(np.diff(x[1000:]) * (g[1:] + g[:-1]) / 2), rel=0.25)


@settings(deadline=None)
@given(path=st.lists(st.floats(-1, 1), min_size=1, max_size=12))
def test_leuven_is_the_bank_in_presliding(path):
    """The stack of reversals and the virgin curve doubled are the Maxwell-slip bank, by Masing."""
    expected = force(MaxwellSlip(ELEMENTS), inside(path))
    np.testing.assert_allclose(force(Leuven(ELEMENTS, **HARD), inside(path)), expected, atol=0.004)


@settings(deadline=None)
@given(path=st.lists(st.floats(-1, 1), min_size=1, max_size=6))
def test_modified_leuven_is_the_bank_in_presliding(path):
    expected = force(MaxwellSlip(ELEMENTS), inside(path))
    np.testing.assert_allclose(force(ModifiedLeuven(ELEMENTS, **HARD), inside(path)), expected, atol=0.004)


@settings(deadline=None)
@given(path=st.lists(st.floats(-1, 1), min_size=1, max_size=8), inner=st.lists(st.floats(0, 1), max_size=4))
def test_leuven_closes_loops_and_forgets_them(path, inner):
    effect = Leuven(ELEMENTS, **HARD)
    low, high = min([0.0, *path]), max([0.0, *path])
    outer, after = [high, low - 0.1], [low - 0.1, low - 0.2, high]
    loop = [low - 0.1 + f * (high - low) for f in inner]
    with_loop = force(effect, inside([*path, *outer, *loop, *after]))[-1]
    assert with_loop == pytest.approx(force(effect, inside([*path, *outer, *after]))[-1], abs=0.01)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_more_reversals_than_the_memory_holds_cost_only_the_innermost_loops(seed):
    """A spiral of nested reversals, three times as many as fit, and then back out of it."""
    random = np.random.default_rng(seed)
    sizes = np.cumprod(random.uniform(0.9, 1.0, 3 * DEPTH)) * np.where(np.arange(3 * DEPTH) % 2, -1.0, 1.0)
    path = [*inside(sizes), -2.9e-6, 3e-6]
    effect = Leuven(ELEMENTS, **HARD)
    got, expected = force(effect, path), force(MaxwellSlip(ELEMENTS), path)
    assert np.max(np.abs(got)) <= 4.0
    # Back on the outermost loop it is as if nothing had been lost, but for a loop that was on its way out.
    np.testing.assert_allclose(got[-2:], expected[-2:], atol=0.1)
    # Inside, the error is at most the size of the loops that did not fit.
    lost = 2 * abs(sizes[DEPTH - 2]) * 3e-6 * 1.4e6
    assert np.max(np.abs(got - expected)) <= lost


def test_leuven_memory_is_bounded():
    effect = Leuven(ELEMENTS, **LEVELS)
    assert effect.initial_state().size == 3 + DEPTH
    t = np.arange(1, 20001)
    x = 5e-6 * np.exp(-t / 8000) * np.where(t % 2, 1.0, -1.0)
    s = effect.initial_state()
    guard = np.concatenate([s, np.full(8, 7.0)])
    p = effect.vector()
    for w in motion_rows(x, 1e-3)[:500]:
        effect.kernel(p, guard, w)
    assert np.all(guard[s.size :] == 7.0), "wrote past its state"


def test_leuven_memory_stays_nested_when_it_overflows():
    """Reversals alternate, each within the two before it, however many there have been."""
    effect = Leuven(ELEMENTS, **HARD)
    p, s = effect.vector(), effect.initial_state()
    sizes = 0.99 ** np.arange(3 * DEPTH) * np.where(np.arange(3 * DEPTH) % 2, -3e-6, 3e-6)
    for w in motion_rows(sizes, 1e-3):
        effect.kernel(p, s, w)
        held = int(s[1])
        steps = np.diff(np.array([*s[3 : 3 + held], s[2]]))
        assert held <= DEPTH
        assert np.all(steps[1:] * steps[:-1] < 0)
        assert np.all(np.abs(steps[1:]) < np.abs(steps[:-1]) + 1e-12)
    assert held >= DEPTH - 2


@both
@settings(max_examples=30, deadline=None)
@given(
    path=st.lists(st.floats(-1e-4, 1e-4), min_size=1, max_size=6),
    n=st.sampled_from([1.0, 2.0, 4.0, 10.0]),
    pieces=st.integers(2, 40),
)
def test_splitting_a_displacement_changes_little(model, path, n, pieces):
    effect = model(ELEMENTS, coulomb=3.5, static=3.5, sharpness=n)
    corners = [0.0, *path]
    fine = [a + (b - a) * (j + 1) / pieces for a, b in pairwise(corners) for j in range(pieces)]
    np.testing.assert_allclose(
        force(effect, fine)[pieces - 1 :: pieces], force(effect, path), atol=0.02 * 3.5
    )


@both
def test_a_fall_of_the_level_is_followed(model):
    """The level halves while the mass slides on, as a Stribeck effect in front of the model would make it."""
    effect = model(ELEMENTS, coulomb=3.0, static=3.0, sharpness=3.0)
    rows = motion_rows(1e-6 * np.arange(1, 101), 1e-3)
    rows[50:, REACH] = 0.5
    f = over_rows([effect], rows)[:, FRICTION]
    assert f[49] == pytest.approx(3.0, rel=1e-3)
    assert f[-1] == pytest.approx(1.5, rel=1e-3)
    assert np.all(np.diff(f[50:]) <= 1e-9)


def test_leuven_goes_on_past_the_last_reach_at_its_last_slope():
    effect = Leuven([(1e5, 1e-6), (1e5, 1e-6), (1e5, 2e-6)], coulomb=1e3, static=1e3, sharpness=100.0)
    np.testing.assert_allclose(force(effect, [1e-6, 2e-6, 5e-6]), [0.3, 0.4, 0.7], rtol=1e-9)


def test_modified_leuven_refuses_a_bank_too_weak_for_its_level():
    with pytest.raises(ConfigError, match=r"yield at 4 N, below the level of 4\.5 N"):
        ModifiedLeuven(ELEMENTS, coulomb=3.0, static=4.5)
