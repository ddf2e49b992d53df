"""What of a drawn case can be told from a belief that is wrong anyway."""

from __future__ import annotations

import pytest

from rtcomp.trial.friction import ELEMENTS
from rtcomp.trial.plant import Physics
from rtcomp.trial.stagefile import Believed

PLANT = Physics(2.0, 4.0, 10.0, 20.0, 100.0, 1e-3, 3.0, 2e-5, 4.0)


def believed(mass: float = 1.0, viscous: float = 1.0, level: float = 1.0) -> Believed:
    wrong = PLANT._replace(mass=mass * PLANT.mass, viscous=viscous * PLANT.viscous)
    return Believed(wrong, (level,) * ELEMENTS)


@pytest.mark.parametrize("gain", [0.8, 1.25])
def test_a_gain_is_hidden_by_a_belief_that_is_as_wrong(gain: float) -> None:
    """Only force over voltage is seen: a stage that is lighter and rubs less looks stronger."""
    everything = ("mass", "viscous", "level")
    true = PLANT._replace(force_constant=gain * PLANT.force_constant)
    assert believed().off(true, everything)
    assert not believed(1.0 / gain, 1.0 / gain, 1.0 / gain).off(true, everything)
    assert believed(1.0 / gain, 1.0 / gain, 1.0).off(true, everything)


def test_what_a_belief_is_never_wrong_by_is_not_hidden_by_it() -> None:
    assert not believed(mass=1.1).off(PLANT, ("mass",))
    assert believed(mass=1.2).off(PLANT, ("mass",))
    assert believed().off(PLANT._replace(back_emf=5.0), ("viscous",))
    assert believed(mass=1.2).off(PLANT, ())
