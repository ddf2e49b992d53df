"""The trial's friction against what hysteresis with nonlocal memory must do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.trial.friction import H, advance, fresh, stop_elements

REACH, SHAPE = 1e-5, 3.0


def path(
    places: list[float], up: float = SHAPE, down: float = SHAPE, softening: float = 0.0, parts: int = 7
) -> np.ndarray:
    """h at each of `places` (in reaches), in `parts` steps between."""
    z, at, out = fresh(), 0.0, []
    for place in places:
        for _ in range(parts):
            step = (place - at) * REACH / parts
            advance(z, step, REACH, up, down, softening)
        at = place
        out.append(float(z[H]))
    return np.array(out)


def bank(places: list[float], count: int) -> np.ndarray:
    """The same of `count` stop elements, computed by themselves."""
    k, r = np.array(stop_elements(1.0, REACH, SHAPE, count)).T
    z, at, out = np.zeros(count), 0.0, []
    for place in places:
        z = np.clip(z + (place - at) * REACH, -r, r)
        at = place
        out.append(float(k @ z))
    return np.array(out)


travel = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=30)


@settings(max_examples=60, deadline=None)
@given(travel)
def test_with_one_shape_it_is_a_bank_of_stop_elements_at_the_limit_of_many(places: list[float]) -> None:
    fine = bank(places, 400)
    assert np.max(np.abs(path(places) - fine)) < 1e-4


@settings(max_examples=60, deadline=None)
@given(travel, st.floats(-0.4, 0.4), st.floats(0.0, 2.0))
def test_loops_close_and_are_forgotten(places: list[float], skew: float, softening: float) -> None:
    shapes = (SHAPE * (1 + skew), SHAPE * (1 - skew), softening)
    there = path([*places, 3.5, -0.4], *shapes)[-1]
    around = path([*places, 3.5, -0.4, -0.1, -0.25, -0.15, -0.4], *shapes)[-1]
    assert around == pytest.approx(there, abs=1e-9)
    assert np.all(np.abs(path(places, *shapes)) <= 1.0 + 1e-12)


def test_branches_up_and_down_differ_where_asked() -> None:
    up, down = (abs(path([s * 5.0, -s * 5.0, -s * 4.0], 4.0, 2.0)[-1]) for s in (1.0, -1.0))
    assert abs(up - down) > 0.05


def test_softening_makes_equal_loops_differ_by_the_force_they_start_at() -> None:
    def height(start: list[float], softening: float) -> float:
        a, b = path([5.0, *start], SHAPE, SHAPE, softening)[-2:]
        return abs(a - b)

    # A fifth of the reach up again, from low and from high on the falling branch of a big loop.
    for softening, differ in ((0.0, False), (1.5, True)):
        low, high = height([3.3, 3.5], softening), height([4.2, 4.4], softening)
        assert (abs(low / high - 1.0) > 0.03) == differ


@pytest.mark.parametrize("count", [6, 18])
def test_stop_elements_have_the_level_and_miss_the_curve_by_little(count: int) -> None:
    k, r = np.array(stop_elements(5.0, REACH, SHAPE, count)).T
    assert np.all(k > 0.0) and k @ r == pytest.approx(5.0)
    u = np.linspace(0.0, 1.0, 1000)
    chords = np.minimum(u[:, None] * REACH, r) @ k
    assert np.max(np.abs(chords - 5.0 * (1.0 - (1.0 - u) ** SHAPE))) < 5.0 / count**2
