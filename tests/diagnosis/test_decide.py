"""Which further names count, and which names do not hold on what was put aside."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.diagnosis.accept import MAINLY, modelled, settles_the_rest, stands_out, worth_it
from rtcomp.diagnosis.look_ahead import most_left
from rtcomp.kernels import Floats

BLOCKS = 20


def even(total: float) -> Floats:
    """Squared errors of blocks, all alike but for a little."""
    chance = np.random.default_rng(5).uniform(0.9, 1.1, BLOCKS)
    return np.asarray(total * chance / chance.sum())


@pytest.mark.parametrize(
    ("before", "after", "counts"),
    [
        (1.5, 0.012, True),  # nearly all of the rest, however small beside the first
        (10.0, 4.0, True),  # large beside the first
        (8.0, 2.5, True),  # a twentieth of the first, and two thirds of the rest
        (2.0, 0.9, False),  # trims the first: a hundredth of it, half of the rest
    ],
)
def test_a_further_name_counts_by_what_it_explains_of_the_rest(
    before: float, after: float, counts: bool
) -> None:
    noisy = np.where(np.arange(BLOCKS) % 2, 1.8, 0.2)
    left, floor = even(before) * noisy, even(0.01)
    assert settles_the_rest(100.0 - before, left, left * after / before, floor) is counts


def test_what_is_exactly_modelled_leaves_nothing_to_trim() -> None:
    noisy = np.where(np.arange(BLOCKS) % 2, 1.8, 0.2)
    left, floor = even(0.2) * noisy, even(0.01)
    by_hysteresis = modelled(["gravity", "backlash"], [10.0, 90.0])
    assert by_hysteresis == 90.0
    assert not settles_the_rest(by_hysteresis, left, 0.5 * left, floor)
    for exact in ("quadratic-drag", "drive-saturation"):
        by_weight = modelled(["gravity", exact], [10.0, 90.0])
        assert settles_the_rest(by_weight, left, 0.4 * left, floor, exact=100.0)
        assert not settles_the_rest(by_weight, left, 0.6 * left, floor, exact=100.0)
    assert settles_the_rest(0.0, left, 0.6 * left, floor, exact=0.3)


def test_all_that_is_left_is_no_weight_of_a_free_curve() -> None:
    left, floor = even(1.5), even(0.01)
    assert settles_the_rest(98.5, left, 0.01 * left, floor)
    assert not settles_the_rest(98.5, left, 0.01 * left, floor, shapeless=True)


@pytest.mark.parametrize(
    ("part", "blocks", "does"),
    [
        (0.3, BLOCKS, True),  # gone from every block
        (0.3, 17, True),
        (0.1, BLOCKS, False),  # no more than what another kernel would trim
        (0.6, 8, False),  # gone from some: that may be an accident of theirs
    ],
)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3])
def test_an_entry_stands_out_by_what_is_gone_from_the_blocks_not_by_their_level(
    part: float, blocks: int, does: bool, unit: float
) -> None:
    quiet_and_loud = unit * np.geomspace(1.0, 50.0, BLOCKS)
    chance = np.random.default_rng(7).uniform(0.98, 1.02, BLOCKS)
    after = quiet_and_loud * np.where(np.arange(BLOCKS) >= BLOCKS - blocks, 1.0 - part, 1.0) * chance
    assert stands_out(quiet_and_loud, after) is does
    assert not stands_out(quiet_and_loud, after, MAINLY)


def test_a_small_gain_counts_where_nearly_every_block_has_it() -> None:
    floor, before = even(1.0), even(1.8)
    assert worth_it(before, before - even(0.55), floor)
    # The same gain, had in a third of the blocks only, may be an accident of the floor.
    few = np.where(np.arange(BLOCKS) % 3 == 0, 0.55 * 3 / BLOCKS, 0.0)
    assert not worth_it(before, before - few, floor)


@pytest.mark.parametrize(
    ("bending", "second", "most"),
    [
        (True, "stribeck", 9.5),
        (True, "position-force", 6.0),
        (False, "stribeck", 6.0),
    ],
)
def test_what_bends_to_anything_gives_way_to_a_name_unless_a_curve_stays_beside_that(
    bending: bool, second: str, most: float
) -> None:
    assert most_left(bending, second, 10.0, 1.0) == pytest.approx(most)


def test_two_names_at_the_floor_replace_a_free_curve_that_leaves_nearly_as_much() -> None:
    assert most_left(True, "parallel-spring", 10.0, 11.0) == pytest.approx(11.0)
    assert most_left(True, "parallel-spring", 10.0, 20.0) == pytest.approx(12.5)
