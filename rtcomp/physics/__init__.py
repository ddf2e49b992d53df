"""The catalogue of physics: a family of effects a file. Importing this package fills the catalogue."""

from rtcomp.physics import maxwell_slip, speed
from rtcomp.physics.catalogue import build, entries, entry, register
from rtcomp.physics.effect import Effect, Parameter, Place

__all__ = ["Effect", "Parameter", "Place", "build", "entries", "entry", "maxwell_slip", "register", "speed"]
