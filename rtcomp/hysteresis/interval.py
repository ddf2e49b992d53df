"""The interval operator of the paper: non-local memory in a fixed number of activations.

The input range is divided into intervals of widths a_i. Motion fills them (forward) or empties them
(backward) greedily from the first, so that the amounts x_i hold every past extreme that still matters.
Memory is one number an interval, whatever the past. In the limit of thin intervals this is the
Prandtl-Ishlinskii operator: every branch is the virgin curve doubled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import Basis, checked_keys, register_basis
from rtcomp.kernels import Floats, basis_kernel, compiled

STARTED, INPUT, DIRECTION, FRONT, AMOUNTS = range(5)
"""Places in the state: has seen an input; that input; direction of motion; the first interval not yet
saturated in this direction; from here on the activations x_i."""


@compiled
def way(s: Floats, u: float) -> float:
    """Return the way (m) from the last input to `u`, which is noted; none to the first input."""
    if s[STARTED] == 0.0:
        s[STARTED] = 1.0
        s[INPUT] = u
    distance: float = u - s[INPUT]
    s[INPUT] = u
    return distance


@compiled
def advance(p: Floats, s: Floats, x: Floats, u: float) -> None:
    """Equations (1) to (4), exactly; costs the intervals it touches, not all of them.

    p: N, a_1 .. a_N (m). s: see the places above, x_i in [0, a_i] (m). x: regressors x_i - a_i / 2 (m).
    All intervals before the front are saturated in the direction of motion, so (3) and (4) need not
    sum over them; a reversal starts again at the first.
    """
    distance = way(s, u)
    if distance == 0.0:
        return
    forward = distance > 0.0
    direction = 1.0 if forward else -1.0
    if s[DIRECTION] != direction:
        s[DIRECTION] = direction
        s[FRONT] = 0.0
    distance = abs(distance)
    count = int(p[0])
    i = int(s[FRONT])
    while i < count:
        width = p[1 + i]
        amount = s[AMOUNTS + i]
        room = width - amount if forward else amount
        if distance < room:
            amount += direction * distance
            s[AMOUNTS + i] = amount
            x[i] = amount - 0.5 * width
            break
        s[AMOUNTS + i] = width if forward else 0.0
        x[i] = 0.5 * direction * width
        distance -= room
        i += 1
    s[FRONT] = i


@basis_kernel
def interval_operator(p: Floats, s: Floats, x: Floats, u: float) -> None:
    """The interval operator, one step."""
    advance(p, s, x, u)


@compiled
def respond(p: Floats, s: Floats, weights: Floats, start: float, inputs: Floats, out: Floats) -> None:
    """Output (6) of the operator with frozen weights over a batch of inputs (K,), into `out` (K,).

    `start` is the output at the present state. The output is carried along by what each step changes,
    so a sample costs the intervals it touches.
    """
    count = int(p[0])
    force = start
    for k in range(inputs.size):
        distance = way(s, inputs[k])
        if distance != 0.0:
            forward = distance > 0.0
            direction = 1.0 if forward else -1.0
            if s[DIRECTION] != direction:
                s[DIRECTION] = direction
                s[FRONT] = 0.0
            distance = abs(distance)
            i = int(s[FRONT])
            while i < count:
                amount = s[AMOUNTS + i]
                room = p[1 + i] - amount if forward else amount
                if distance < room:
                    s[AMOUNTS + i] = amount + direction * distance
                    force += direction * weights[i] * distance
                    break
                s[AMOUNTS + i] = p[1 + i] if forward else 0.0
                force += direction * weights[i] * room
                distance -= room
                i += 1
            s[FRONT] = i
        out[k] = force


LEAST_WIDTH, LEAST_SHARE = 1e-15, 1e-12
"""m, and share of the range: narrower intervals get lost in the rounding of a position."""


@register_basis
class IntervalBasis(Basis):
    """Intervals of the given widths (m), first to last; their sum is the input range of the hysteresis.

    The range is the distance between full saturation in one direction and in the other, that is twice
    the travel of the virgin curve. Raises ConfigError for no, negative, zero or non-finite widths, and for
    such as have collapsed.
    """

    name = "interval"
    kernel = interval_operator
    source = "the paper's equations (1) to (6)"

    def __init__(self, widths: Sequence[float] | Floats) -> None:
        self.widths = np.array(widths, dtype=np.float64).reshape(-1)
        if self.widths.size == 0:
            raise ConfigError(
                "interval model: widths are empty; give at least one interval width (m)", key=("widths",)
            )
        for i, width in enumerate(self.widths):
            if not (np.isfinite(width) and width > 0):
                raise ConfigError(
                    f"interval model: widths[{i}] is {width:g} m; a width must be above 0", key=("widths", i)
                )
        least = max(LEAST_WIDTH, LEAST_SHARE * float(self.widths.sum()))
        if self.widths.min() < least:
            i = int(self.widths.argmin())
            raise ConfigError(
                f"interval model: widths[{i}] is {self.widths[i]:g} m of {self.widths.sum():g} m in all; "
                f"less than {least:g} m is no width that motion could fill: leave it out",
                key=("widths", i),
            )

    @classmethod
    def over(cls, count: int, total: float, spacing: float = 1.0) -> IntervalBasis:
        """Divide `total` (m) into `count` intervals, the last `spacing` times as wide as the first."""
        widths = np.geomspace(1.0, spacing, count)
        return cls(widths * (total / widths.sum()))

    @property
    def size(self) -> int:
        """Number of intervals."""
        return int(self.widths.size)

    def vector(self) -> Floats:
        """Return N and the widths."""
        return np.concatenate([[float(self.size)], self.widths])

    def initial_state(self) -> Floats:
        """Return the anhysteretic state (5): every interval half activated."""
        return np.concatenate([np.zeros(AMOUNTS), self.widths / 2])

    def scales(self) -> Floats:
        """Return half the widths: the regressors run over -a_i / 2 .. a_i / 2."""
        return self.widths / 2

    def to_dict(self) -> dict[str, Any]:
        """Return name and widths."""
        return {"model": self.name, "widths": [float(a) for a in self.widths]}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> IntervalBasis:
        """Build from ``{widths: [...]}``."""
        checked_keys(entry, cls.name, ["widths"])
        return cls(entry["widths"])
