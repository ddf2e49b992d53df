"""Dahl and LuGre: closed forms, steady states, and steps of any size."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rtcomp.physics.dahl import Dahl
from rtcomp.physics.lugre import LuGre
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION

STIFFNESS, COULOMB = 1e6, 3.0
SLIDING = {"stiffness": 1e6, "damping": 300.0, "coulomb": 3.0, "static": 4.0, "stribeck_velocity": 2e-3}


def force(effect, positions, step=1e-3):
    return over_rows([effect], motion_rows(np.array(positions, dtype=float), step))[:, FRICTION]


def test_dahl_virgin_curve_and_reversal_are_exponentials_for_exponent_1():
    x = np.linspace(0.1e-6, 20e-6, 50)
    effect = Dahl(stiffness=STIFFNESS, coulomb=COULOMB)
    np.testing.assert_allclose(force(effect, x), COULOMB * (1 - np.exp(-STIFFNESS * x / COULOMB)), rtol=1e-12)
    turn = force(effect, [20e-6])[0]
    back = force(effect, [20e-6, *(20e-6 - x)])[1:]
    np.testing.assert_allclose(
        back, -COULOMB + (COULOMB + turn) * np.exp(-STIFFNESS * x / COULOMB), rtol=1e-9
    )


@pytest.mark.parametrize("exponent", [0.3, 0.5, 1.0, 1.5, 2.0, 4.0])
def test_dahl_closed_form_solves_its_equation(exponent):
    """Differences of the closed form over 1 nm against the slope that the equation gives."""
    x = np.arange(1, 6001) * 1e-9
    effect = Dahl(stiffness=STIFFNESS, coulomb=COULOMB, exponent=exponent)
    for sign in (1.0, -1.0):
        f = force(effect, [-4e-6, *(sign * x + -4e-6)])
        u = 1 - sign * (f[1:] + f[:-1]) / 2 / COULOMB
        slope = STIFFNESS * np.abs(u) ** exponent * np.sign(u)
        far = np.abs(u) > 0.01
        np.testing.assert_allclose(np.diff(f)[far] / (sign * 1e-9), slope[far], rtol=1e-3)


def test_dahl_with_exponent_0_is_one_stop_element():
    x = np.array([1e-6, 5e-6, 4e-6, -3e-6, -2e-6])
    f = force(Dahl(stiffness=STIFFNESS, coulomb=COULOMB, exponent=0.0), x)
    np.testing.assert_allclose(f, [1.0, 3.0, 2.0, -3.0, -2.0], rtol=1e-12)


@settings(deadline=None)
@given(
    exponent=st.floats(0, 5),
    path=st.lists(st.floats(-1e-4, 1e-4), min_size=1, max_size=8),
    pieces=st.integers(2, 20),
)
def test_dahl_is_exact_however_a_displacement_is_split(exponent, path, pieces):
    effect = Dahl(stiffness=STIFFNESS, coulomb=COULOMB, exponent=exponent)
    corners = [0.0, *path]
    fine = [a + (b - a) * (j + 1) / pieces for a, b in pairwise(corners) for j in range(pieces)]
    whole = force(effect, path)
    assert np.max(np.abs(whole)) <= COULOMB * (1 + 1e-12)
    np.testing.assert_allclose(force(effect, fine)[pieces - 1 :: pieces], whole, atol=1e-6 * COULOMB)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("speed", [1e-5, 1e-3, 2e-3, 5e-3, 0.1])
def test_lugre_settles_on_the_stribeck_curve_and_viscous_part(speed, sign):
    effect = LuGre(**SLIDING, viscous=5.0)
    travel = np.linspace(0, 200e-6, 200)[1:]
    settled = force(effect, sign * travel, step=(travel[1] - travel[0]) / speed)[-1]
    level = 3.0 + (4.0 - 3.0) * math.exp(-((speed / 2e-3) ** 2))
    assert settled == pytest.approx(sign * (level + 5.0 * speed), rel=1e-9)


def test_lugre_solves_its_equation_at_changing_speed():
    effect = LuGre(**SLIDING, viscous=5.0)
    duration, count = 0.4, 40_000

    def speed(t):
        return 3e-3 * np.sin(2 * np.pi * 5 * t) * np.sin(2 * np.pi * 1.3 * t)

    def level(v):
        return 3.0 + np.exp(-((v / 2e-3) ** 2))

    def rate(t, z):
        v = speed(t)
        return v - 1e6 * abs(v) * z / level(v)

    t = (np.arange(count) + 1) * duration / count
    solution = solve_ivp(
        rate, (0, duration), [0.0], method="LSODA", t_eval=t, rtol=1e-8, atol=1e-13, max_step=1e-3
    )
    z, v = solution.y[0], speed(t)
    expected = 1e6 * z + 300.0 * rate(t, z) + 5.0 * v
    # The position that this speed gives, by integrating it finely.
    fine = speed((np.arange(count * 4) + 0.5) * duration / (count * 4))
    position = np.cumsum(fine)[3::4] * duration / (count * 4)
    np.testing.assert_allclose(force(effect, position, duration / count), expected, atol=0.02)


@settings(deadline=None)
@given(step=st.floats(1e-6, 1.0), speed=st.floats(1e-4, 1.0))
def test_lugre_never_leaves_its_level_in_sliding_however_long_the_step(step, speed):
    """An explicit step diverges where dt > 2 Fc / (stiffness |v|)."""
    effect = LuGre(**{**SLIDING, "damping": 0.0})
    f = force(effect, speed * step * np.arange(1, 50), step)
    assert np.all(f <= 4.0 + 1e-9)
    assert np.all(f > 0)


@settings(deadline=None)
@given(path=st.lists(st.floats(-1e-3, 1e-3), min_size=1, max_size=10), factor=st.floats(1e-3, 1e3))
def test_dahl_is_rate_independent(path, factor):
    effect = Dahl(stiffness=STIFFNESS, coulomb=COULOMB, exponent=1.5)
    assert force(effect, path).tolist() == force(effect, path, step=1e-3 * factor).tolist()
