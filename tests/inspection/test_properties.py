"""Symmetry, congruency, closure and rate on hystereses whose properties are known exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loops import cut, major_and_minor, operator, sorted_kinds, walk

from rtcomp.inspection.closure import closure
from rtcomp.inspection.congruency import congruency
from rtcomp.inspection.kinds import MajorLoop, major_loop
from rtcomp.inspection.rates import rates
from rtcomp.inspection.symmetry import symmetry

X = major_and_minor()
TRUE = operator().response(X)
RANGE = float(np.ptp(TRUE))


def loop_of(x: np.ndarray, force: np.ndarray) -> MajorLoop:
    found = major_loop(sorted_kinds(x, force, least=60.0), 1.0)
    assert found is not None
    return found


def congruent(x: np.ndarray, force: np.ndarray):
    middle = 0.5 * float(force.max() + force.min())
    return congruency(sorted_kinds(x, force), float(np.ptp(force)), (0.0, middle), float(np.ptp(x)))


@given(
    weights=st.lists(st.floats(0.1, 10.0), min_size=4, max_size=4),
    widths=st.lists(st.integers(1, 40), min_size=4, max_size=4),
    offset=st.floats(-100.0, 100.0),
)
@settings(max_examples=25, deadline=None)
def test_the_interval_operator_is_symmetric_congruent_and_closes(
    weights: list[float], widths: list[int], offset: float
) -> None:
    # Widths of twice a whole number: corners of every branch lie on rows.
    force = operator(weights, [2 * w for w in widths]).response(X) + offset
    exact = 1e-9 * (float(np.ptp(force)) + abs(offset))
    mirror = symmetry(loop_of(X, force))
    assert mirror.peak < exact and mirror.compared.between < exact
    assert mirror.verdict == "holds"
    same = congruent(X, force)
    assert same.both.between < exact and same.across < exact
    assert same.verdict == "holds"
    gaps = closure(cut(X, force), float(np.ptp(force)))
    assert gaps.gaps.size >= 8 and gaps.rms < exact
    assert gaps.verdict == "holds"


def test_a_reversible_force_even_about_the_centre_is_an_asymmetry_of_known_size() -> None:
    # Mirrored, k u^2 changes its sign: the branches differ by 2 k (u^2 - mean of u^2).
    k = 1e-3 * RANGE / 60.0**2 * 60.0
    mirror = symmetry(loop_of(X, TRUE + k * X**2))
    u = mirror.travel - 60.0
    expected = 2.0 * k * (u**2 - np.mean(u**2))
    assert np.allclose(mirror.difference, expected, atol=2e-3 * np.abs(expected).max())
    assert mirror.verdict == "fails"
    assert mirror.mean_curve_share == pytest.approx(1.0, abs=1e-6)
    assert mirror.compared.systematic == pytest.approx(float(np.sqrt(np.mean(expected**2))), rel=1e-3)


def test_a_reversible_cubic_is_symmetric_about_its_own_centre_and_not_beside_it() -> None:
    k = 0.05 * RANGE / 60.0**3
    about = symmetry(loop_of(X, TRUE + k * X**3))
    assert about.verdict == "holds" and about.peak < 1e-9 * RANGE
    # Beside it, k (u + c)^3 has the even part 3 k c u^2 (and a constant).
    c = 20.0
    beside = symmetry(loop_of(X, TRUE + k * (X + c) ** 3))
    u = beside.travel - 60.0
    expected = 6.0 * k * c * (u**2 - np.mean(u**2))
    assert np.allclose(beside.difference, expected, atol=2e-3 * np.abs(expected).max())
    assert beside.verdict == "fails"


def test_a_reversible_force_does_not_part_branches_of_one_turning_point() -> None:
    # All rising branches from -60, all falling ones from 60: two trajectories, asymmetric but congruent.
    x = walk([60.0, -60.0, *(60.0, -60.0, 20.0, -60.0) * 4])
    force = operator().response(x) + 2e-3 * x**2
    rising = [k for k in sorted_kinds(x, force) if k.position == -60.0]
    found = congruency(rising, float(np.ptp(force)), (0.0, 0.0), 120.0)
    assert found.kinds == 2
    assert found.rising.between < 1e-9 * RANGE and found.verdict == "holds"
    assert symmetry(loop_of(x, force)).verdict == "fails"


@pytest.mark.parametrize("softening", [0.1, 0.3])
def test_a_bent_output_is_symmetric_and_not_congruent(softening: float) -> None:
    level = float(np.abs(TRUE).max())
    bent = TRUE * (1.0 + softening * (1.0 - np.abs(TRUE) / level))
    assert symmetry(loop_of(X, bent)).verdict == "holds"
    found = congruent(X, bent)
    assert found.verdict == "fails"
    assert found.both.within < 1e-9 * RANGE
    # The slope of the bend falls from 1 + softening at no force by twice the softening, along a line.
    assert found.with_force is not None and found.with_force.sure
    assert found.with_force.correlation < -0.95
    usual = 1.0 + softening * (1.0 - 2.0 * 0.5)
    assert found.with_force.value == pytest.approx(-2.0 * softening / usual, rel=0.35)
    assert closure(cut(X, bent), RANGE).verdict == "holds"


def test_loops_scaled_by_a_known_amount_differ_by_that_amount() -> None:
    """Minor loops of a half the size in force: at equal travel half of the force is missing."""
    x = walk([60.0, -60.0, *(60.0, 30.0, 60.0, -60.0) * 5])
    force = operator().response(x)
    kinds = sorted_kinds(x, force)
    inner = next(k for k in kinds if not k.rising and k.length == 30.0)
    for b in inner.repeats:
        b.gained[:] *= 0.9
    outer = next(k for k in kinds if not k.rising and k.length == 120.0)
    found = congruency([inner, outer], RANGE, (0.0, 0.0), 120.0)
    s = np.linspace(0.0, 0.8 * 30.0, 200)
    expected = 0.1 * float(np.sqrt(np.mean(outer.repeats[0].at(s) ** 2)))
    assert found.falling.between == pytest.approx(expected, rel=0.02)
    assert found.verdict == "fails"


def test_noise_raises_the_figure_and_the_scatter_alike_and_makes_no_verdict() -> None:
    called = {"symmetry": 0, "congruency": 0, "closure": 0}
    runs = 40
    for seed in range(runs):
        noisy = TRUE + 0.02 * RANGE * np.random.default_rng(seed).standard_normal(X.size)
        mirror = symmetry(loop_of(X, noisy))
        same = congruent(X, noisy)
        assert mirror.compared.between / mirror.compared.within == pytest.approx(1.0, abs=0.3)
        assert mirror.compared.within == pytest.approx(math.sqrt(2) * 0.02 * RANGE, rel=0.25)
        called["symmetry"] += mirror.verdict == "fails"
        called["congruency"] += same.verdict == "fails"
        called["closure"] += closure(cut(X, noisy), RANGE).verdict == "fails"
    # One in a hundred may err; of forty runs five would be one in four thousand.
    assert max(called.values()) <= 4, called


def test_an_asymmetry_under_noise_is_found_where_it_is_larger() -> None:
    found = 0
    for seed in range(10):
        chance = np.random.default_rng(seed)
        x = major_and_minor(8)
        noisy = operator().response(x) + 1.5e-5 * RANGE * x**2 + 0.01 * RANGE * chance.standard_normal(x.size)
        found += symmetry(loop_of(x, noisy)).verdict == "fails"
    assert found >= 9


def test_one_loop_alone_is_undecided() -> None:
    x = walk([60.0, -60.0, 60.0, -60.0, 20.0])
    mirror = symmetry(loop_of(x, operator().response(x) + 2e-3 * x**2))
    assert mirror.repeats == (1, 1)
    assert math.isnan(mirror.compared.within) and mirror.verdict == "undecided"


def test_a_minor_loop_that_does_not_close_is_seen_with_its_gap() -> None:
    force = TRUE.copy()
    found = cut(X, force)
    for before, inside, after in zip(found, found[1:], found[2:], strict=False):
        if inside.length < before.length and inside.length < after.length:
            force[inside.rows[0] + 1 :] += inside.sign * 0.02 * RANGE
    gaps = closure(cut(X, force), RANGE)
    assert gaps.verdict == "fails"
    assert gaps.means["rising"] == pytest.approx(-0.02 * RANGE, rel=1e-6)
    assert gaps.means["falling"] == pytest.approx(0.02 * RANGE, rel=1e-6)


def test_force_that_goes_with_speed_is_rate_dependence_of_known_size() -> None:
    points = [60.0, -60.0] * 3
    way = [walk([*points, 0.0]) for _ in range(3)]
    x = np.concatenate(way)
    time = np.concatenate([[0.0], np.cumsum(np.repeat([1.0, 0.5, 0.25], [w.size for w in way]))])[: x.size]
    speed = np.gradient(x, time)
    from rtcomp.inspection.branches import branches
    from rtcomp.inspection.kinds import kinds_of

    def of(slope: float):
        force = operator().response(x) + slope * np.sign(speed) * np.log2(np.maximum(np.abs(speed), 0.1))
        return rates(kinds_of(branches(time, x, force, 5.0), 1.0, RANGE), 0.5 * RANGE)

    assert of(0.0).verdict == "holds"
    found = of(0.02 * RANGE)
    assert found.verdict == "fails" and found.change is not None
    assert found.change.value == pytest.approx(0.02 * RANGE, rel=0.1)
    assert found.speeds == pytest.approx((1.0, 4.0), rel=0.05)


def test_what_a_recording_lacks_is_not_testable() -> None:
    x = walk([60.0, -60.0, *(60.0, -60.0) * 4])
    force = operator().response(x)
    assert closure(cut(x, force), RANGE).verdict == "not-testable"
    assert rates(sorted_kinds(x, force), RANGE).verdict == "not-testable"
    assert congruent(x, force).verdict == "not-testable"
    x = walk([60.0, 0.0, 40.0, 10.0, 30.0, 20.0])  # ever smaller: no way twice
    assert major_loop(sorted_kinds(x, operator().response(x)), 1.0) is None
