"""Everything that a trial can hide: the effects by name, shapes outside the catalogue, retunings."""

from __future__ import annotations

from rtcomp.trial.hidden.drive import DRIVE
from rtcomp.trial.hidden.friction import FRICTION
from rtcomp.trial.hidden.mechanics import MECHANICS
from rtcomp.trial.hidden.outside import OUTSIDE
from rtcomp.trial.hidden.retuned import RETUNED
from rtcomp.trial.hidden.secret import Rig, Secret, Sized
from rtcomp.trial.hidden.sensor import SENSOR

__all__ = ["EFFECTS", "OUTSIDE", "RETUNED", "SECRETS", "Rig", "Secret", "Sized"]

EFFECTS: tuple[Secret, ...] = (*DRIVE, *MECHANICS, *FRICTION, *SENSOR)
"""Those that have a name in the stage file's vocabulary."""

SECRETS: dict[str, Secret] = {s.name: s for s in (*EFFECTS, *OUTSIDE, *RETUNED)}
"""All, by name."""
