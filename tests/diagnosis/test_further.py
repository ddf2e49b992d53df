"""What counts beside names: a jump, another name where a free curve does not, a number further off."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recorded import run
from recorded import stage as axis
from test_alike import reference

from rtcomp.diagnosis.accept import is_the_rest
from rtcomp.diagnosis.addition import Addition
from rtcomp.diagnosis.base import BELIEVED, fit_base
from rtcomp.diagnosis.further import ONCE, further_entry, further_off, jumped, may_have_jumped
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import refine
from rtcomp.kernels import Floats

BLOCKS = 20
ALL = np.ones(BLOCKS, dtype=np.bool_)


def even(total: float) -> Floats:
    """Squared errors of blocks, all alike but for a little."""
    chance = np.random.default_rng(5).uniform(0.9, 1.1, BLOCKS)
    return np.asarray(total * chance / chance.sum())


def left(errors: Floats, *names: str, seen: Any = ALL) -> Any:
    """Entries at work that leave these errors."""
    fitted = SimpleNamespace(errors=errors, ledger=SimpleNamespace(seen=seen))
    return SimpleNamespace(entries=[{"name": n} for n in names], errors=errors, fitted=fitted)


@pytest.mark.parametrize(
    ("off", "jumped", "does"),
    [
        (7, {7}, True),
        (7, {8}, False),  # far off, but where no reading jumped
        (None, {7}, False),
        (7, {3}, False),  # put aside: nothing is fitted there
    ],
)
def test_a_stretch_in_which_the_sensor_jumped_is_looked_into_by_itself(
    off: int | None, jumped: set[int], does: bool
) -> None:
    seen = np.arange(BLOCKS) != 3
    floor = even(1.0)[seen]
    errors = floor.copy()
    if off is not None:
        errors[np.flatnonzero(np.flatnonzero(seen) == off)] *= 2.0 * ONCE
    fitted: Any = SimpleNamespace(errors=errors, ledger=SimpleNamespace(seen=seen))
    motion: Any = SimpleNamespace(jumped=jumped)
    assert may_have_jumped(motion, fitted, floor) is does


@pytest.mark.parametrize(("rest", "does"), [(1.0, True), (100.0, True), (700.0, False)])
@pytest.mark.parametrize("name", ["sensor-jump", "cogging"])
def test_a_jump_brings_its_stretch_to_the_rest_however_much_else_is_missing(
    name: str, rest: float, does: bool
) -> None:
    motion: Any = SimpleNamespace(jumped={7})
    floor, after = even(1.0), even(rest)
    before = after.copy()
    before[7] = 130.0  # much more than the rest leaves, unless that leaves as much everywhere
    found = jumped(motion, left(before).fitted, left(after, name), floor)
    assert found is (does and name == "sensor-jump")
    assert not jumped(motion, left(before).fitted, left(before, name), floor)  # no jump of that size


NOTHING: Any = SimpleNamespace(jumped=set())


@pytest.mark.parametrize(
    ("curve", "name", "counts"),
    [
        (6.6, 7.4, "drive-offset"),  # the curve trims, the name may be what it trims
        (6.6, 9.5, None),  # not nearly the curve
        (14.5, 14.5, None),  # explains nothing
    ],
)
def test_where_a_free_curve_does_not_count_the_name_that_does_nearly_as_much_may(
    curve: float, name: float, counts: str | None
) -> None:
    floor = even(6.9)
    first = left(even(14.7), "load-dependent-friction")
    added = Addition(
        left(even(curve), "load-dependent-friction", "position-force"),
        [left(even(name), "load-dependent-friction", "drive-offset")],
        [],
        {},
    )
    found = further_entry(NOTHING, first.fitted, added, floor, (285.0, 0.0), lambda: None)
    assert (found and found.entries[-1]["name"]) == counts


def test_a_free_curve_that_counts_needs_no_name() -> None:
    curve = left(even(20.0), "creep", "position-force")
    added = Addition(curve, [left(even(25.0), "creep", "cogging")], [], {})
    assert (
        further_entry(NOTHING, left(even(100.0), "creep").fitted, added, even(1.0), (50.0, 0.0), lambda: None)
        is curve
    )


def test_one_number_is_most_of_the_rest_where_it_matters_and_nothing_elsewhere() -> None:
    floor, before = np.full(BLOCKS, 0.18), np.full(BLOCKS, 0.2)
    before[[4, 5, 8, 9]] = 0.34, 0.36, 0.72, 0.61
    after = np.full(BLOCKS, 0.2)
    assert is_the_rest(before, after, floor)
    assert not is_the_rest(before, 0.9 * before, floor)  # a little of everything
    once = np.where(np.arange(BLOCKS) == 8, 6.0, 0.2)
    assert not is_the_rest(once, after, floor)  # one block may be an accident
    harmed = np.where(np.arange(BLOCKS) < 4, 0.28, after)
    assert not is_the_rest(before, harmed, floor)


@pytest.mark.parametrize("mass", [2.0, 2.4])
def test_a_mass_that_is_further_off_is_let_go_beside_a_delay(mass: float) -> None:
    """20 % heavier: at the bound of what a belief may be off, the delay would have to do for the rest."""
    believed = axis()
    late = {"name": "drive-delay", "delay": 1.5e-3}
    motion = prepare(believed, [run(axis(mass=mass, effects=[late]), reference(), seed=3)])
    base = fit_base(believed, motion)
    held = refine(base, motion, [late])
    assert ("mass" in held.fitted.at_bounds) is (mass > 2.0)
    nothing = fit_base(axis(viscous=0.0), motion)
    assert "viscous" not in nothing.at_bounds  # believed to be nothing: it may go nowhere
    found = further_off(believed, motion, [held], np.full(held.errors.size, held.errors.min()))
    if mass == 2.0:
        assert found is None
        return
    assert held.fitted.coefficients[0] == pytest.approx(2.0 * (1.0 + BELIEVED))
    assert found is not None and found.fitted.freed == {"mass"}
    assert found.fitted.coefficients[0] == pytest.approx(2.4, rel=0.01)
    assert found.entries[0]["delay"] == pytest.approx(1.5e-3, rel=0.05)
    assert found.errors.sum() < 0.5 * held.errors.sum()
