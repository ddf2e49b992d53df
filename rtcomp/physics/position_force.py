"""A force that depends on position in a shape no other entry has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from rtcomp.errors import ConfigError, nearest
from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.wires import POSITION, PUSH

KNOT = Parameter("knots", "m", -1e6, 1e6, "positions, rising")
VALUE = Parameter("values", "N", -1e9, 1e9, "force on the mass at each knot")
MOST: Final = 100_000
"""Knots that an entry may have."""


@effect_kernel
def position_force(p: Floats, s: Floats, w: Floats) -> None:
    """p: count, knots (m), values (N)."""
    x = w[POSITION]
    count = int(p[0])
    if x <= p[1]:
        w[PUSH] += p[1 + count]
    elif x >= p[count]:
        w[PUSH] += p[2 * count]
    else:
        low, high = 0, count - 1
        while high - low > 1:
            middle = (low + high) // 2
            if p[1 + middle] <= x:
                low = middle
            else:
                high = middle
        share = (x - p[1 + low]) / (p[1 + high] - p[1 + low])
        w[PUSH] += (1.0 - share) * p[1 + count + low] + share * p[1 + count + high]


@register
class PositionForce(Effect):
    """A force along the stroke by its values at knots, lines between, the end values beyond.

    Lines, because the force is then linear in its values: they are found by linear least squares.
    """

    name = "position-force"
    place = Place.MECHANICS
    parameters = ()
    kernel = position_force
    says = "a force that depends on position, in a shape given point by point"
    equation = "F = line through (knots, values)"
    source = "de Boor (2001), A Practical Guide to Splines, order 2"
    signature = "residual force that depends on position, alike in both directions and at all speeds"
    experiment = "slow strokes over the whole travel in both directions"
    example = {"knots": [-8e-4, -2e-4, 1e-4, 7e-4], "values": [0.5, -1.0, 1.5, 0.4]}
    searchable = False

    def __init__(self, knots: Sequence[Any] = (), values: Sequence[Any] = ()) -> None:
        super().__init__()
        self.knots, self.forces = self._numbers(KNOT, knots), self._numbers(VALUE, values)
        if not 2 <= len(self.knots) <= MOST:
            raise ConfigError(
                f"{self.name}: knots holds {len(self.knots)} positions; allowed is [2, {MOST}]",
                key=("knots",),
            )
        if len(self.knots) != len(self.forces):
            raise ConfigError(
                f"{self.name}: values holds {len(self.forces)} forces for {len(self.knots)} knots; "
                "give one for each",
                key=("values",),
            )
        for i, rise in enumerate(np.diff(self.knots)):
            if rise <= 0.0:
                raise ConfigError(
                    f"{self.name}: knots[{i + 1}] is {self.knots[i + 1]:g} m, not above the knot before; "
                    "order them from lowest to highest",
                    key=("knots", i + 1),
                )

    def _numbers(self, parameter: Parameter, numbers: Any) -> list[float]:
        if not isinstance(numbers, Sequence | np.ndarray) or isinstance(numbers, str):
            raise ConfigError(
                f"{self.name}: {parameter.name} is {numbers!r}; it must be a list of numbers "
                f"({parameter.unit})",
                key=(parameter.name,),
            )
        found = []
        for i, number in enumerate(numbers):
            try:
                found.append(parameter.check(number, f"{self.name}, number {i}"))
            except ConfigError as error:
                error.key = (parameter.name, i)
                raise
        return found

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> PositionForce:
        """Build the effect from a stage file's entry (without its name)."""
        names = [KNOT.name, VALUE.name]
        for key in entry:
            if key not in names:
                raise ConfigError(f"{cls.name}: unknown parameter {key!r}; {nearest(key, names)}", key=(key,))
        return cls(**entry)

    def vector(self) -> Floats:
        """Return the count, the knots and the values."""
        return np.array([len(self.knots), *self.knots, *self.forces])

    def stiffness(self) -> float:
        """Return the steepest slope (N/m)."""
        return float(np.max(np.abs(np.diff(self.forces) / np.diff(self.knots))))

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as a stage file's ``effects`` lists it."""
        return {"name": self.name, "knots": list(self.knots), "values": list(self.forces)}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.knots)} knots)"
