"""The catalogue of physics: a family of effects a file. Importing this package fills the catalogue."""

from rtcomp.physics import (
    dahl,
    disturbance,
    drive,
    gms,
    leuven,
    lugre,
    maxwell_slip,
    mechanics,
    modified_leuven,
    place_dependent,
    sensor,
    speed,
    wires,
)
from rtcomp.physics.catalogue import build, entries, entry, register
from rtcomp.physics.effect import Effect, Parameter, Place

__all__ = [
    "Effect",
    "Parameter",
    "Place",
    "build",
    "dahl",
    "disturbance",
    "drive",
    "entries",
    "entry",
    "gms",
    "leuven",
    "lugre",
    "maxwell_slip",
    "mechanics",
    "modified_leuven",
    "place_dependent",
    "register",
    "sensor",
    "speed",
    "wires",
]
