"""Bouc-Wen hysteresis against its differential equation, integrated at twenty times the rate."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rtcomp import physics
from rtcomp.kernels import Floats, compiled
from rtcomp.physics.bouc_wen import LARGEST
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION, MOVED, STEP, VELOCITY
from rtcomp.stage.balance import forces
from rtcomp.stage.stage import Stage

RATE, TIMES, COUNT = 750.0, 20, 4096
M, C, K = 2.0, 10.0, 5e4
BENCHMARK = {"alpha": 5e4, "beta": 1e3, "gamma": 0.8, "delta": -1.1}


@compiled
def _slopes(y: Floats, u: float, p: Floats, out: Floats) -> None:
    v, z = y[1], y[2]
    out[0] = v
    out[1] = (u - C * v - K * y[0] - z) / M
    size = abs(z) ** (p[4] - 1.0)
    out[2] = p[0] * v - p[1] * (p[2] * abs(v) * size * z + p[3] * v * size * abs(z))


@compiled
def _rk4(u: Floats, h: float, p: Floats, out: Floats) -> None:
    """Fill `out` with position, velocity and z; `u` has two values a step."""
    y, k = np.zeros(3), np.zeros((4, 3))
    for i in range(out.shape[0]):
        out[i] = y
        _slopes(y, u[2 * i], p, k[0])
        _slopes(y + 0.5 * h * k[0], u[2 * i + 1], p, k[1])
        _slopes(y + 0.5 * h * k[1], u[2 * i + 1], p, k[2])
        _slopes(y + h * k[2], u[2 * i + 2], p, k[3])
        y = y + h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3])


def effect(**changes: float) -> physics.Effect:
    return physics.build({"name": "bouc-wen", **BENCHMARK, **changes})


def reference(**changes: float) -> Floats:
    """Position, velocity and z under a multisine of 5 to 150 Hz and 50 N rms, at TIMES the rate, settled."""
    size = 2 * TIMES * COUNT
    lines = np.arange(size // 2 + 1) * RATE / COUNT
    random = np.random.default_rng(1)
    spectrum = np.where((lines >= 5) & (lines <= 150), np.exp(2j * np.pi * random.random(lines.size)), 0.0)
    u = np.fft.irfft(spectrum, size)
    u *= 50.0 / np.std(u)
    out = np.zeros((2 * TIMES * COUNT, 3))
    _rk4(np.concatenate([u, u, u[:1]]), 1.0 / (RATE * TIMES), effect(**changes).vector(), out)
    return out


def force(hysteresis: physics.Effect, x: Floats, v: Floats) -> Floats:
    """z along rows of 1 / RATE."""
    rows = motion_rows(x, 1.0 / RATE)
    rows[:, VELOCITY] = v
    rows[0, [MOVED, STEP]] = 0.0
    return over_rows([hysteresis], rows)[:, FRICTION]


def error(found: Floats, true: Floats) -> float:
    """Rms of the difference over the rms, on the second period."""
    half = slice(found.size // 2, None)
    return float(np.sqrt(np.mean((found[half] - true[half]) ** 2) / np.mean(true[half] ** 2)))


@pytest.mark.parametrize(
    ("changes", "allowed"),
    [
        ({}, 2e-4),  # the benchmark: 1.2e-4
        ({"delta": 0.2, "beta": 1e4}, 1e-3),  # it slides: 5e-4
        ({"gamma": 0.5, "delta": 0.5, "exponent": 2.0}, 1e-3),
        ({"gamma": 0.5, "delta": 0.1, "exponent": 1.3}, 1e-3),
    ],
)
def test_rows_of_a_fifth_of_a_period_are_fine_enough(changes: dict[str, float], allowed: float) -> None:
    """Ten times worse with velocities from central differences, a per cent with straight lines."""
    x, v, z = reference(**changes)[::TIMES].T
    hysteresis = effect(**changes)
    assert error(force(hysteresis, x, v), z) < allowed
    assert error(force(hysteresis, x, np.gradient(x, 1.0 / RATE)), z) < 10.0 * allowed
    lines = np.diff(x, prepend=x[0]) * RATE
    assert error(force(hysteresis, x, lines), z) > 7e-3


def test_the_balance_of_a_stage_takes_it_as_exactly() -> None:
    x, v, z = reference()[::TIMES].T
    stage = Stage.from_dict({"stage": {"mass": M, "force_constant": 1.0, "voltage_limit": 1e3}, "rate": RATE})
    time = np.arange(x.size) / RATE
    found = forces(stage, [effect()], time, x, v, np.gradient(v, 1.0 / RATE), np.zeros_like(x))
    assert error(found.friction, z) < 5e-4


@pytest.mark.parametrize(("n", "allowed"), [(1.0, 1e-12), (1.5, 1e-3), (3.0, 1e-3)])
def test_a_stroke_in_one_step_is_one_in_many(n: float, allowed: float) -> None:
    places = np.array([1e-3, -4e-4, -3e-4, -1e-3, 5e-5])
    hysteresis = effect(exponent=n, beta=1e4 if n == 1.0 else 1e4 / 50.0 ** (n - 1.0), delta=0.1)
    ends = np.concatenate([[0.0], places])
    lines = [np.linspace(a, b, 2001)[1:] for a, b in itertools.pairwise(ends)]
    coarse, fine = motion_rows(places, 1.0), motion_rows(np.concatenate(lines), 1.0)
    coarse[:, VELOCITY] = fine[:, VELOCITY] = 0.0  # straight lines: no motion is made up around their ends
    found = over_rows([hysteresis], coarse)[:, FRICTION]
    np.testing.assert_allclose(found, over_rows([hysteresis], fine)[1999::2000, FRICTION], rtol=allowed)


def test_it_settles_at_its_level_and_is_linear_in_alpha() -> None:
    x = np.linspace(0.0, 1e-2, 200)
    slid = over_rows([effect(delta=0.2)], motion_rows(x, 1e-3))[-1, FRICTION]
    assert slid == pytest.approx(5e4 / 1e3, rel=1e-3)
    bent = over_rows([effect(delta=0.2, exponent=2.0)], motion_rows(x, 1e-3))[-1, FRICTION]
    assert bent == pytest.approx(np.sqrt(5e4 / 1e3), rel=1e-3)
    twice = over_rows([effect(delta=0.2, alpha=1e5)], motion_rows(x, 1e-3))[:, FRICTION]
    once = over_rows([effect(delta=0.2)], motion_rows(x, 1e-3))[:, FRICTION]
    np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-12)


def test_loops_dissipate_what_gamma_says() -> None:
    t = np.linspace(0.0, 4.0, 4001)
    x = 1e-3 * np.sin(2 * np.pi * t)
    for delta in (-1.1, 0.2):
        z = over_rows([effect(delta=delta)], motion_rows(x, 1e-3))[:, FRICTION]
        assert np.sum(0.5 * (z[1:] + z[:-1]) * np.diff(x)) > 0.0


def test_a_force_that_grows_with_itself_stays_a_number() -> None:
    x = np.linspace(0.0, 1e3, 50)
    for n in (1.0, 2.0, 5.0):
        z = over_rows([effect(exponent=n)], motion_rows(x, 1e-3))[:, FRICTION]
        assert np.all(np.isfinite(z)) and np.max(np.abs(z)) <= LARGEST
