"""Looking one entry ahead: what gives way to what, told by errors as a search would leave them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rtcomp.diagnosis import look_ahead as looking
from rtcomp.diagnosis.addition import Addition

BLOCKS = 20


def even(total: float) -> np.ndarray:
    chance = np.random.default_rng(5).uniform(0.9, 1.1, BLOCKS)
    return np.asarray(total * chance / chance.sum())


def found(error: float, *names: str) -> Any:
    """Entries refined together that leave `error`."""
    errors = even(error)
    return SimpleNamespace(
        entries=[{"name": n} for n in names], errors=errors, fitted=SimpleNamespace(errors=errors)
    )


def looked(
    monkeypatch: pytest.MonkeyPatch, base: float, first: list[Any], beside: dict[str, Any], floor: float
) -> tuple[Addition, Addition | None]:
    """What a look ahead makes of entries that leave `first` alone, best first, and with others `beside`."""

    def best_addition(stage: Any, motion: Any, current: Any, entries: Any, *rest: Any) -> Addition:
        return Addition(beside[entries[0]["name"]], [], [], {})

    monkeypatch.setattr(looking, "best_addition", best_addition)
    best, *others = first
    anything: Any = None
    plain: Any = SimpleNamespace(errors=even(base))
    added = Addition(best, others, [], {})
    return looking.look_ahead(
        anything, anything, plain, added, even(floor), lambda part, what: None, frozenset()
    )


@pytest.mark.parametrize(
    ("second", "left", "chosen"),
    [
        ("cogging", 0.18, "parallel-spring"),  # two waves bend to a spring with a push
        ("stribeck", 0.18, "cogging"),  # two names that leave next to nothing need no others
        ("cogging", 0.04, "cogging"),  # two waves that do better are two waves
    ],
)
def test_two_waves_give_way_to_two_names_that_do_as_well(
    monkeypatch: pytest.MonkeyPatch, second: str, left: float, chosen: str
) -> None:
    alone = [found(4.1, "cogging"), found(9.9, "parallel-spring")]
    beside = {
        "cogging": found(left, "cogging", second),
        "parallel-spring": found(0.06, "parallel-spring", "drive-offset"),
    }
    added, ahead = looked(monkeypatch, 58.0, alone, beside, 0.07)
    assert added.best is not None and added.best.entries[-1]["name"] == chosen
    assert ahead is not None and ahead.best is beside[chosen]


@pytest.mark.parametrize(
    ("first", "left", "chosen"),
    [
        (169.0, 108.0, "viscous-friction"),  # most is explained, a thousand times the floor left
        (169.0, 5.0, "drive-saturation"),  # nearly all is
        (400.0, 108.0, "drive-saturation"),  # the first is no more than the nearest
    ],
)
def test_what_is_far_behind_is_tried_where_something_large_is_left(
    monkeypatch: pytest.MonkeyPatch, first: float, left: float, chosen: str
) -> None:
    """A limit of the drive and four times the damping: the limit that does for both leaves a ninth."""
    alone = [found(first, "drive-saturation"), found(922.0, "viscous-friction")]
    beside = {
        "drive-saturation": found(left, "drive-saturation", "frictional-lag"),
        "viscous-friction": found(0.11, "viscous-friction", "drive-saturation"),
    }
    added, _ = looked(monkeypatch, 1494.0, alone, beside, 0.1)
    assert added.best is not None and added.best.entries[-1]["name"] == chosen
