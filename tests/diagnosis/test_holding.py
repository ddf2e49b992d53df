"""Whether names hold on what was put aside: as judged from four errors."""

from __future__ import annotations

import pytest

from rtcomp.diagnosis.holding import (
    LEAST,
    MUCH,
    does_harm,
    explains_little,
    holds,
    leaves_much,
    must_explain,
)
from rtcomp.diagnosis.result import Fit


def test_names_that_leave_much_must_explain_most_of_what_was_put_aside() -> None:
    half = Fit(0.12, 0.10, 0.07, 0.005)
    assert explains_little(half, MUCH) and not explains_little(half, LEAST)
    most = Fit(0.12, 0.10, 0.03, 0.005)
    assert not explains_little(most, MUCH)
    nothing_to_explain = Fit(0.006, 0.006, 0.006, 0.005)
    assert not explains_little(nothing_to_explain, MUCH)


@pytest.mark.parametrize(
    ("fit", "much"),
    [
        (Fit(0.8, 0.50, 0.15, 0.002), True),  # nine tenths, and 75 floors left: the nearest name
        (Fit(0.3, 0.09, 0.021, 0.009), False),  # near the floor: the name's form is not quite the axis's
        (Fit(0.9, 0.73, 0.12, 0.0015), False),  # so large that what is left is trimming
    ],
)
def test_a_lone_name_must_not_leave_far_more_than_noise(fit: Fit, much: bool) -> None:
    assert leaves_much(fit) is much


def test_several_names_may_leave_more_but_not_most_of_it() -> None:
    assert not leaves_much(Fit(0.25, 0.25, 0.05, 0.01), names=2)  # 97 %: what two kernels leave
    assert leaves_much(Fit(0.25, 0.25, 0.05, 0.01), names=1)
    assert leaves_much(Fit(0.12, 0.117, 0.08, 0.004), names=2)
    assert not leaves_much(Fit(0.12, 0.117, 0.08, 0.004), names=2, doubled=False)
    assert leaves_much(Fit(0.12, 0.117, 0.08, 0.004), names=1, doubled=False)
    assert leaves_much(Fit(0.45, 0.206, 0.05, 0.0016), names=2)  # 94 %, but 30 floors are left


def test_what_happens_once_may_harm_a_little_where_it_does_not_happen() -> None:
    slightly_worse = Fit(0.0017, 0.0072, 0.0030, 0.0015)
    assert holds(slightly_worse, once=True) and not holds(slightly_worse)
    assert not holds(Fit(0.0017, 0.0072, 0.0120, 0.0015), once=True)


def test_what_helps_in_the_typical_block_holds_though_one_block_hides_it() -> None:
    hidden_in_one = Fit(0.0048, 0.0046, 0.00456, 0.0018)
    assert not holds(hidden_in_one)
    assert holds(hidden_in_one, typical=0.84)


@pytest.mark.parametrize(
    ("fit", "little"),
    [
        (Fit(0.0235, 0.0099, 0.0086, 0.0038), True),  # a hump after reversals, named a force along the way
        (Fit(0.432, 0.0160, 0.0106, 0.0027), False),  # branches that soften strongly, named so: 59 %
        (Fit(0.0080, 0.0077, 0.00505, 0.0021), False),  # a weak constant force, named right: 69 %
    ],
)
def test_names_explain_more_than_half_where_it_is_known_how_much_there_is(fit: Fit, little: bool) -> None:
    assert explains_little(fit, must_explain(left=0.1, doubled=True)) is little
    assert not explains_little(fit, must_explain(left=0.1, doubled=False))


def test_names_that_leave_much_of_what_was_seen_must_explain_most_whatever_the_floor() -> None:
    assert must_explain(left=0.3, doubled=True) == must_explain(left=0.3, doubled=False) == MUCH


def test_a_name_that_predicts_forces_worse_does_harm() -> None:
    worse = Fit(0.3091, 0.2211, 0.2463, 0.0055)
    assert does_harm(worse) and not does_harm(worse, much=0.25)
    assert not does_harm(Fit(0.3091, 0.2211, 0.2211, 0.0055))
