"""The interval operator with shape: loops that are asymmetric, not congruent, or have a reversible part.

Everything it adds is a function of the interval operator's own state, linear in its weights. So wiping-out
holds, loops close exactly, nothing can drift, and any learner works, all by construction. With

    xi_i = x_i - a_i / 2,    z = sum_i xi_i,    p_k = z - sum_{i <= k} xi_i

z is the presliding deflection, a stop of half the range R, and p_k the play operator whose reach is the
travel at which interval k is full. What is activated of the intervals j < i <= k lies between p_k and p_j;
the paper's operator need not know where, its weights being constant, but the state tells. The parts are

    position    B_m(p_j) - B_m(p_k) for a group of intervals: a weight that depends on the place in the range
    reversible  B_m(z): the same for intervals of no width, a single-valued curve of the deflection
    output      o^2 and o |o|: the output bends itself, o in [-1, 1] being that of falling weights
    branches    by how much o leans, in two forms, and that times |o|: branches up and down that differ, see
                `madelung`

B_m(q) is the integral from 0 to q of the hat function about the m-th of `places` points of the range, so that
weights vary linearly between points; the hat in the middle is left out, for the sum of all of them is xi
itself. All are brought to the amplitude a / 2 of an interval of the mean width, so that gradients
learn them as fast. Position (with reversible) is the Preisach model, whose loops may be asymmetric but are
congruent; output makes them non-congruent, as Kuhnen's dead zones do. Branches make them asymmetric from the
reversal on, wherever it was; loops close all the same.

`skew` differs in kind: the operator sees a motion that counts more in one direction, see `skew`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from inspect import signature
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError, nearest
from rtcomp.grain import beyond_grain
from rtcomp.hysteresis.basis import Basis, checked_keys, register_basis
from rtcomp.hysteresis.interval import AMOUNTS, INPUT, STARTED, IntervalBasis, advance
from rtcomp.hysteresis.madelung import FORMS, LEANS, STATES, lean
from rtcomp.hysteresis.smoothness import Term, correlation
from rtcomp.kernels import Floats, basis_kernel, compiled

PARTS = ("reversible", "position", "output", "branches")
USUAL = PARTS[:3]
"""The parts unless told."""
BY_OUTPUT = ("output", "branches")
"""Parts that know the output, and so take a shape of it."""
PLACES, GROUPS = 5, 4
"""Points of the range at which weights may differ, and groups of intervals whose weights do, unless told."""
SKEW, GRAIN, SPACING, UNIT, REVERSIBLE, CELLS, OUTPUT, BRANCHES, TABLE = range(9)
"""Places in the parameters, after N and the widths: skew (1); grain (m); distance of two points (m); a / 2
(m); number of reversible regressors, and of cells; whether output and branches are on. From here on point
(m) and gain (1) of each reversible regressor; first interval, interval after the last, point (m) and gain
(1) of each cell; the shape c_i (1/m) of the output."""
_SETTINGS = ("parts", "places", "groups", "skew", "grain", "shape", "smooth")
_FALL = 3.0
"""Over the range the shape of the output falls by exp(-3), unless told."""
_WORTH = 0.1
"""Share of a point's neighbourhood that a group of intervals must be able to touch to get a weight there."""


@compiled
def integral(q: float, point: float, spacing: float) -> float:
    """Return the integral (m) from 0 to `q` (m) of the hat function about `point`, zero `spacing` away."""
    total = 0.0
    for sign, at in ((1.0, q), (-1.0, 0.0)):
        s = min(max((at - point) / spacing, -1.0), 1.0)
        total += sign * (0.5 * (1.0 + s) * (1.0 + s) if s < 0.0 else 1.0 - 0.5 * (1.0 - s) * (1.0 - s))
    return spacing * total


@basis_kernel
def shaped_interval_operator(p: Floats, s: Floats, x: Floats, u: float) -> None:
    """p: N, widths (m), then the places above. s: the interval operator's, the last input (m), the
    place within the grain (m), the direction of motion beyond it (1; 0 before there was any), and with
    branches what `madelung` keeps.

    x: xi_i, reversible, cells, output, branches (m). A step costs all intervals and all that is added.
    """
    count = int(p[0])
    at = 1 + count
    last = AMOUNTS + count
    if s[STARTED] == 0.0:
        s[STARTED] = 1.0
        s[last] = u
        return
    step = u - s[last]
    s[last] = u
    if step == 0.0:
        return
    step += p[at + SKEW] * abs(beyond_grain(s, last + 1, step, p[at + GRAIN]))
    s[INPUT] = 0.0  # the operator sees displacements, so that a skewed one accumulates nothing
    advance(p, s, x, step)
    z = 0.0
    for i in range(count):
        z += x[i]
    spacing = p[at + SPACING]
    out = count
    entry = at + TABLE
    for _ in range(int(p[at + REVERSIBLE])):
        x[out] = p[entry + 1] * integral(z, p[entry], spacing)
        out += 1
        entry += 2
    i = 0
    outer = z
    inner = z
    for _ in range(int(p[at + CELLS])):
        first, end = int(p[entry]), int(p[entry + 1])
        if first >= i:  # a new group: its activated part lies between these plays
            outer = inner
            while i < end:
                inner -= x[i]
                i += 1
            if i == count:
                inner = 0.0  # exactly: the play of the whole range never moves
        point = p[entry + 2]
        x[out] = p[entry + 3] * (integral(outer, point, spacing) - integral(inner, point, spacing))
        out += 1
        entry += 4
    if p[at + OUTPUT] == 0.0 and p[at + BRANCHES] == 0.0:
        return
    o = 0.0
    for j in range(count):
        o += p[entry + j] * x[j]
    if p[at + OUTPUT] > 0.0:
        x[out] = p[at + UNIT] * o * o
        x[out + 1] = p[at + UNIT] * o * abs(o)
        out += 2
    if p[at + BRANCHES] > 0.0:
        lean(s, last + 3, o)
        for form in range(FORMS):
            x[out + form] = p[at + UNIT] * s[last + 3 + LEANS + form]
            x[out + FORMS + form] = abs(o) * x[out + form]


@register_basis
class ShapedIntervalBasis(Basis):
    """Intervals of the given widths (m) with some of the `parts` reversible, position, output, branches.

    `places` (odd, 3 to 25) points of the range and `groups` of intervals say how finely position and the
    reversible part are resolved. `skew` (-0.9 to 0.9) makes it stiffer in one direction, for motion beyond
    `grain` (m). `shape` (N entries, any unit) are weights near the true ones, by which the output that bends
    itself is known. `smooth` (0 to 10, in halves of the range) is the length over which weights are expected
    to be alike, 0 for each on its own. Raises ConfigError for what is outside these ranges.
    """

    name = "shaped-interval"
    kernel = shaped_interval_operator
    source = (
        "Krejci (1996), Hysteresis, Convexity and Dissipation (Preisach from plays); Mayergoyz (1991); "
        "Kuhnen (2003), European J. Control 9(4)"
    )

    def __init__(
        self,
        widths: Sequence[float] | Floats,
        parts: Sequence[str] = USUAL,
        places: int = PLACES,
        groups: int | None = None,
        skew: float = 0.0,
        grain: float = 0.0,
        shape: Sequence[float] | Floats | None = None,
        smooth: float = 0.0,
    ) -> None:
        self.widths = IntervalBasis(widths).widths
        self.parts = checked_parts(parts)
        if isinstance(places, bool) or places not in range(3, 26, 2):
            raise ConfigError(
                f"{self.name} model: places is {places!r}; allowed is an odd number, 3 to 25", key=("places",)
            )
        n = self.widths.size
        groups = min(GROUPS, n) if groups is None else groups
        if isinstance(groups, bool) or int(groups) != groups or not 1 <= groups <= n:
            raise ConfigError(
                f"{self.name} model: groups is {groups!r}; allowed is a whole number, 1 to the {n} intervals",
                key=("groups",),
            )
        if not -0.9 <= skew <= 0.9:
            raise ConfigError(f"{self.name} model: skew is {skew:g}; allowed is -0.9 to 0.9", key=("skew",))
        if not 0.0 <= grain < float(self.widths.sum()):
            raise ConfigError(
                f"{self.name} model: grain is {grain:g} m; allowed is 0 to the range", key=("grain",)
            )
        if not 0.0 <= smooth <= 10.0:
            raise ConfigError(
                f"{self.name} model: smooth is {smooth:g} halves of the range; allowed is 0 to 10",
                key=("smooth",),
            )
        self.places, self.groups, self.smooth = int(places), int(groups), float(smooth)
        self.skew, self.grain = float(skew), float(grain)
        fall = np.exp(-_FALL * np.cumsum(self.widths) / self.widths.sum())
        self.shape = np.array(fall if shape is None else shape, dtype=np.float64).reshape(-1)
        level = float(self.shape @ self.widths) / 2 if self.shape.size == n else np.nan
        if not (np.isfinite(level) and level > 0.0):
            raise ConfigError(
                f"{self.name} model: shape must be {n} finite numbers, one an interval, whose sum over "
                "the range is above 0",
                key=("shape",),
            )
        self._points, self._cells = self._table()

    @classmethod
    def over(cls, count: int, total: float, spacing: float = 1.0, **settings: Any) -> ShapedIntervalBasis:
        """Divide `total` (m) into `count` intervals as the interval model; `settings` as for the class."""
        return cls(IntervalBasis.over(count, total, spacing).widths, **settings)

    @property
    def half(self) -> float:
        """Half the range (m): the deflection at which everything slides."""
        return float(self.widths.sum()) / 2

    @property
    def spacing(self) -> float:
        """Distance of two points of the range (m)."""
        return 2.0 * self.half / (self.places - 1)

    def _table(self) -> tuple[list[tuple[float, float]], list[tuple[int, int, float, float]]]:
        """Return point and gain of the reversible part; of each cell worth having ends, point and gain."""
        points = np.delete(np.linspace(-self.half, self.half, self.places), self.places // 2)
        amplitude, reversible, cells = self.widths.mean() / 2, [], []
        for point in points if "reversible" in self.parts else []:
            reversible.append((float(point), float(amplitude / abs(integral(point, point, self.spacing)))))
        groups = np.array_split(np.arange(self.widths.size), self.groups)
        for group in groups if "position" in self.parts else []:
            first, end = int(group[0]), int(group[-1]) + 1
            room = self.half - self.widths[:first].sum() / 2  # how far out the play before it goes
            for point in points:
                touched = abs(integral(float(np.copysign(room, point)), float(point), self.spacing))
                if touched >= _WORTH * self.spacing:
                    most = min(touched, self.widths[first:end].sum() / 2)
                    cells.append((first, end, float(point), float(amplitude / most)))
        return reversible, cells

    @property
    def takes_shape(self) -> bool:
        """Whether a shape of the output, taken from weights once learned, makes it better."""
        return any(part in self.parts for part in BY_OUTPUT)

    @property
    def _of_output(self) -> int:
        return 2 * ("output" in self.parts) + 2 * FORMS * ("branches" in self.parts)

    @property
    def size(self) -> int:
        """Number of intervals and of what the parts add."""
        return int(self.widths.size) + len(self._points) + len(self._cells) + self._of_output

    def vector(self) -> Floats:
        """Return N, the widths, and the table of the parts (see the places above)."""
        counts = [len(self._points), len(self._cells), "output" in self.parts, "branches" in self.parts]
        return np.concatenate(
            [
                [
                    self.widths.size,
                    *self.widths,
                    self.skew,
                    self.grain,
                    self.spacing,
                    self.widths.mean() / 2,
                    *counts,
                ],
                np.ravel(self._points),
                np.ravel(self._cells),
                self.shape / (self.shape @ self.widths / 2),
            ]
        )

    def initial_state(self) -> Floats:
        """Return the anhysteretic state (5): every interval half activated."""
        kept = STATES if "branches" in self.parts else 0
        return np.concatenate([np.zeros(AMOUNTS), self.widths / 2, np.zeros(3 + kept)])

    def scales(self) -> Floats:
        """Return half the widths, and half the mean width for each that the parts add (m)."""
        return np.append(self.widths / 2, np.full(self.size - self.widths.size, self.widths.mean() / 2))

    def likeness(self) -> Floats | None:
        """Return the correlation (size, size) of weights by their reaches and places; see `smoothness`."""
        if not self.smooth:
            return None
        reaches = np.cumsum(self.widths) / 2 - self.widths / 4
        stiffness: list[list[Term]] = [[(r, 0.0, 1.0)] for r in reaches]
        for first, end, point, _ in self._cells:
            middle = float(reaches[first:end].mean())
            stiffness.append([(middle, point, 1.0), (middle, 0.0, -1.0)])
        curve = [[(0.0, point, 1.0), (0.0, 0.0, -1.0)] for point, _ in self._points]
        bends = [[[(0.0, 0.0, 1.0)]] for _ in range(self._of_output)]
        found = correlation([stiffness, curve, *bends], self.smooth * self.half)
        # In the order of the regressors: intervals, reversible, position, output.
        n, cells = self.widths.size, len(self._cells)
        order = np.r_[
            0:n, n + cells : n + cells + len(curve), n : n + cells, n + cells + len(curve) : self.size
        ]
        return np.asarray(found[np.ix_(order, order)])

    def changed(self, **settings: Any) -> ShapedIntervalBasis:
        """Return the basis with other settings, those of the class by their names."""
        own = {name: getattr(self, name) for name in signature(ShapedIntervalBasis).parameters}
        return ShapedIntervalBasis(**{**own, **settings})

    def to_dict(self) -> dict[str, Any]:
        """Return name, widths, parts and settings."""
        entry: dict[str, Any] = {
            "model": self.name,
            "widths": [float(a) for a in self.widths],
            "parts": list(self.parts),
            "places": self.places,
            "groups": self.groups,
            "skew": self.skew,
            "grain": self.grain,
            "smooth": self.smooth,
        }
        return {**entry, "shape": [float(c) for c in self.shape]} if self.takes_shape else entry

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> ShapedIntervalBasis:
        """Build from ``{widths: [...], parts: [...], ...}``; all but the widths may be left out."""
        checked_keys(entry, cls.name, ["widths"], _SETTINGS)
        return cls(**entry)


def checked_parts(parts: Sequence[str]) -> tuple[str, ...]:
    """Return the parts in their own order, each once, or raise ConfigError naming the nearest."""
    if isinstance(parts, str) or not isinstance(parts, Sequence):
        raise ConfigError(
            f"shaped-interval model: parts is {parts!r}; it must be a list of {', '.join(PARTS)}",
            key=("parts",),
        )
    for i, part in enumerate(parts):
        if part not in PARTS:
            raise ConfigError(
                f"shaped-interval model: no part is named {part!r}; {nearest(str(part), PARTS)}",
                key=("parts", i),
            )
    return tuple(part for part in PARTS if part in parts)
