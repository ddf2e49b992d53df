"""Other forms of effects: the same physics by another law than the catalogue's first.

The truth is still the effect's name. Some forms are the catalogue's own second ones, others are in none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtcomp.trial.hidden.secret import Rig, Secret, Size, Sized

Bent = Callable[[Size], Size]


@dataclass(frozen=True)
class Form:
    """One form: how it changes the effect as drawn, and its name in the catalogue, "" for none."""

    name: str
    draw: Callable[[np.random.Generator, Rig], Bent]
    catalogue: str = ""


def _with(**changes: float) -> Callable[[np.random.Generator, Rig], Bent]:
    return lambda chance, rig: lambda size: (size[0] | changes, size[1])


def _exponent(chance: np.random.Generator, rig: Rig) -> Bent:
    """Between the catalogue's 1/2, 1 and 2, near none of them."""
    exponent = chance.uniform(0.65, 0.8) if chance.random() < 0.5 else chance.uniform(1.3, 1.6)
    return lambda size: (size[0] | {"stribeck_exponent": float(exponent)}, size[1])


def _drifting(form: float) -> Callable[[np.random.Generator, Rig], Bent]:
    def draw(chance: np.random.Generator, rig: Rig) -> Bent:
        changes = {"drift_form": form, "drift_time": rig.seconds}
        return lambda size: (size[0] | changes, size[1] | {"time_constant": rig.seconds})

    return draw


def _square(chance: np.random.Generator, rig: Rig) -> Bent:
    """Stiffens with |x|: the force at the end of the stroke as drawn."""

    def bend(size: Size) -> Size:
        linear = size[0].get("spring", 0.0)
        edge = linear * rig.stroke + size[0].get("spring_cubic", 0.0) * rig.stroke**3
        return {"spring_square": edge / rig.stroke**2}, {}

    return bend


FORMS: dict[str, tuple[Form, ...]] = {
    "stribeck": (
        Form("power", _exponent),
        Form("lorentzian", _with(stribeck_exponent=0.0)),
        Form("exponential", _with(stribeck_exponent=1.0), "exponential"),
    ),
    "friction-drift": (
        Form("level-line", _drifting(1.0), "linear"),
        Form("level-there-and-back", _drifting(2.0)),
        Form("level-late", _drifting(3.0)),
    ),
    "non-congruent-friction": (
        Form("elements", _with(softening_form=1.0), "elements"),
        Form("fourth-power", _with(softening_form=2.0)),
    ),
    "cogging": (
        Form("triangle", _with(cogging_wave=1.0, cogging_second=0.0), "triangle"),
        Form("two-harmonics", _with(cogging_wave=2.0, cogging_second=0.0), "harmonics"),
    ),
    "torque-ripple": (
        Form("triangle", _with(ripple_wave=1.0), "triangle"),
        Form("two-harmonics", _with(ripple_wave=2.0)),
    ),
    "position-dependent-friction": (
        Form("triangle", _with(place_wave=1.0), "triangle"),
        Form("two-harmonics", _with(place_wave=2.0)),
    ),
    "parallel-spring": (Form("square", _square),),
}
"""Forms of each effect that has other ones."""


def is_foreign(effect: str, form: str) -> bool:
    """Say whether a form of an effect is one that the catalogue has not."""
    return any(f.name == form and not f.catalogue for f in FORMS.get(effect, ()))


def in_form(form: Form, secret: Secret, chance: np.random.Generator, rig: Rig) -> Sized:
    """Draw the effect in another form; what repeats is drawn until it does."""
    sized = secret.draw(chance, rig)
    while secret.name == "position-dependent-friction" and "place" not in sized.at(1.0)[0]:
        sized = secret.draw(chance, rig)
    bend = form.draw(chance, rig)
    return Sized(lambda strength: bend(sized.at(strength)), sized.least, sized.most)
