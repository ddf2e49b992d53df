"""What is told beside the answer."""

from __future__ import annotations

import pytest

from rtcomp.diagnosis.notes import SOFTER, known_here, or_else
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.physics import catalogue


def reach(factor: float) -> Retuned:
    after = 3e-6 * factor
    return Retuned("friction.reach", 3e-6, Value(after, 0.98 * after, 1.02 * after, "m"))


def test_a_reach_beyond_belief_may_be_contacts_that_soften() -> None:
    assert catalogue.entry(SOFTER)
    (note,) = or_else([reach(1.54)], [])
    assert note.startswith("friction.reach, 1.54 times") and SOFTER in note


@pytest.mark.parametrize(
    ("factor", "named"), [(1.1, []), (0.7, []), (1.54, [{"name": SOFTER, "softening": 0.2}])]
)
def test_a_reach_as_believed_or_shorter_or_beside_that_name_is_only_a_reach(
    factor: float, named: list[dict[str, object]]
) -> None:
    assert or_else([reach(factor)], named) == []


def test_forces_that_do_not_go_along_the_way_are_known_everywhere() -> None:
    assert known_here([{"name": "stribeck"}], None, "linear") == []  # type: ignore[arg-type]
