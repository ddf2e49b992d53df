"""What makes a claim of the paper true: criteria on made-up curves whose answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtcomp.jobs.paper.claim import Spread, cycles_until, participation, ratio
from rtcomp.jobs.paper.closed_loop import bumps_of
from rtcomp.jobs.paper.minor import roughness
from rtcomp.jobs.paper.shape import apart, branches, mirrored, since_reversal, to_and_back
from rtcomp.report.paper_page import spread


def circle(turns: float = 1.0, rows: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    """A round loop, from low to low, symmetric and congruent."""
    t = np.linspace(0.0, turns, rows)
    return -np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)


def test_cycles_count_from_one_and_must_stay() -> None:
    assert cycles_until([0.2, 0.04, 0.2, 0.04, 0.03, 0.02], 0.05, 3) == 4.0
    assert cycles_until([0.01] * 10, 0.05, 10) == 1.0
    assert cycles_until([0.01] * 9, 0.05, 10) == math.inf
    assert cycles_until([math.nan, math.inf, 0.05], 0.05, 1) == 3.0
    assert cycles_until([], 0.05, 1) == math.inf


def test_what_never_happened_compares_as_the_longest() -> None:
    assert ratio(30.0, 20.0) == 1.5
    assert ratio(math.inf, 20.0) == math.inf
    assert ratio(20.0, math.inf) == 0.0
    assert ratio(math.inf, math.inf) == 1.0


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([3.0, 1.0, 2.0], (2.0, 1.0, 3.0)),
        ([1.0, 2.0, 3.0, 4.0], (2.5, 1.0, 4.0)),
        ([1.0, math.inf, math.inf], (math.inf, 1.0, math.inf)),
        ([1.0, 1.0, math.inf, math.inf], (math.inf, 1.0, math.inf)),
        ([math.inf] * 4, (math.inf,) * 3),
    ],
)
def test_a_spread_has_median_and_range(values: list[float], expected: tuple[float, ...]) -> None:
    assert Spread.of(values) == expected


def test_a_change_is_local_where_one_weight_takes_it() -> None:
    assert participation([0.0, 0.0, -3.0, 0.0]) == pytest.approx(0.25)
    assert participation([2.0, -2.0, 2.0, -2.0]) == pytest.approx(1.0)
    assert participation([0.0, 0.0]) == 0.0


def test_weights_that_only_fall_are_smooth() -> None:
    assert roughness(np.array([4.0, 3.0, 1.0, 99.0])) == pytest.approx(1.0)
    assert roughness(np.array([4.0, 1.0, 4.0, 1.0, 99.0])) == pytest.approx(3.0)


def test_way_begins_anew_at_every_reversal() -> None:
    way = since_reversal(np.array([0.0, 1.0, 2.0, 2.0, 1.5, 0.5, 1.0]))
    assert way == pytest.approx([0.0, 1.0, 2.0, 2.0, 0.5, 1.5, 0.5])


def test_a_symmetric_loop_is_its_own_mirror_image() -> None:
    x, y = circle()
    assert mirrored(x, y)[2] == pytest.approx(0.0, abs=1e-4)
    assert mirrored(x, np.where(y > 0, 1.2 * y, y))[2] == pytest.approx(
        0.2 * (1 - np.sqrt(1 - 0.9**2)) / 1.1,
        rel=0.01,  # largest where a twentieth is left out at the ends
    )


def test_branches_of_one_shape_are_congruent() -> None:
    x, y = circle(3.0, 6001)
    found = branches(x, y, 0.5)
    assert len(found) == 4
    assert apart(found) < 0.01
    stretched = [found[0], (found[1][0], 1.1 * found[1][1])]
    assert apart(stretched) == pytest.approx(0.1 / 1.1, rel=0.05)
    there, back = to_and_back(*circle())
    assert there[0][0] == back[0][0] == 0.0 and back[0][-1] == pytest.approx(2.0)


def test_a_bump_is_found_where_it_lies() -> None:
    t = np.arange(4000) / 1000
    reference = -np.cos(2 * np.pi * t)
    way = since_reversal(reference)
    found = bumps_of(reference, np.exp(-(((way - 0.3) / 0.05) ** 2)), 0.5)
    assert found.way == pytest.approx(0.3, abs=0.01)
    assert found.size == pytest.approx(1.0, abs=0.01)
    assert found.steep_share == pytest.approx(1 / 3, abs=0.01)


def test_numbers_that_never_came_are_said_so() -> None:
    assert spread(Spread(1.5, 1.0, math.inf), "times") == "1.5 times (1 to never)"
    assert spread(Spread(math.inf, math.inf, math.inf), "times") == "never reached"
    assert spread(Spread(52.0, 52.0, 52.0), "cycles") == "52 cycles"
