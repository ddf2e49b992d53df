"""The classical Preisach plane, its density constant in each of L (L + 1) / 2 cells.

A relay switches up when the input rises above alpha and down when it falls below beta <= alpha. The plane
of relays is divided into squares of side h = 2 R / L (triangles on the diagonal). A regressor is the signed
share of its cell that is up, times h, counted from the virgin state. The line between up and down is
followed exactly through the cells, not in jumps from cell to cell, so that the output is continuous.

Positive densities make the output lag the input, as magnetisation does. Friction leads: force against
position needs positive densities on the diagonal and negative ones off it (stop = input - play), so a learner
that keeps weights non-negative cannot find it here.

The plane covers +-R about the starting point; beyond it the model is saturated. Falling is rising in the
plane mirrored at alpha = -beta, so that there is one routine: (alpha, beta) -> (-beta, -alpha).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import Basis, checked_keys, register_basis
from rtcomp.kernels import Floats, basis_kernel, compiled

STARTED, ORIGIN, INPUT, DIRECTION, COUNT, EXTREMES = range(6)
"""Places in the state: has seen an input; that input (m); the newest, from there and clipped to +-R (m);
direction of motion; number of remembered extremes; from here on those, outermost first, maxima and minima in
turn (m). An extreme is forgotten when the input passes it (wiping-out)."""

DEPTH = 8
"""Extremes remembered for each division. A staircase of 8 L corners has a notch below h^2 / 16: when the
memory is full the smallest notch is filled, and the output stays consistent."""


@compiled
def _cell(row: int, column: int, divisions: int, sign: float) -> int:
    """Return the place of a cell; for sign -1 row and column are those of the mirrored plane."""
    if sign < 0.0:
        row, column = divisions - 1 - column, divisions - 1 - row
    return row * (row + 1) // 2 + column


@compiled
def _division(value: float, reach: float, side: float, divisions: int) -> int:
    """Return the division in which `value` (m) lies, the upper one on a border."""
    index = min(max(int((value + reach) / side), 0), divisions - 1)
    if index < divisions - 1 and value >= side * (index + 1) - reach:
        index += 1
    return index


@compiled
def _sweep(p: Floats, x: Floats, start: float, end: float, floor: float, virgin: bool, sign: float) -> None:
    """Switch up the relays of alpha in (start, end], beta from `floor` (virgin: from -alpha) to alpha."""
    divisions, reach, side = int(p[0]), p[1], p[2]
    row = _division(start, reach, side, divisions)
    at = start
    while at < end:
        top = side * (row + 1) - reach
        whole = end >= top or (row == divisions - 1 and end >= reach)
        to = min(top, end) if row < divisions - 1 else end
        middle = 0.5 * (at + to)
        low = -middle if virgin else floor
        first = divisions - 1 - row if virgin else _division(floor, reach, side, divisions)
        for column in range(first, row + 1):
            cell = _cell(row, column, divisions, sign)
            if whole:
                # Exactly full: rounding of partial steps does not accumulate.
                balance = row + column - (divisions - 1)
                virgin_sign = 1.0 if balance < 0 else (-1.0 if balance > 0 else 0.0)
                share = 0.5 if row == column else 1.0
                x[cell] = sign * share * side * (1.0 - virgin_sign)
            else:
                upper = middle if column == row else side * (column + 1) - reach
                lower = low if column == first else side * column - reach
                x[cell] += sign * 2.0 * (to - at) * (upper - lower) / side
        at = to
        row += 1


@compiled
def _rise(p: Floats, s: Floats, x: Floats, start: float, end: float, sign: float) -> None:
    """Follow a rising input (in the mirrored plane for sign -1), forgetting the extremes it passes."""
    at = start
    while at < end:
        count = int(s[COUNT])
        if count == 0:
            _sweep(p, x, at, end, 0.0, True, sign)
            return
        floor = sign * s[EXTREMES + count - 1]
        # The outermost extreme's partner is its mirror image: there the virgin line begins.
        ceiling = sign * s[EXTREMES + count - 2] if count > 1 else -floor
        to = min(end, ceiling)
        if to > at:
            _sweep(p, x, at, to, floor, False, sign)
        if end >= ceiling:
            s[COUNT] = max(count - 2, 0)
        at = max(to, at)


@compiled
def _forget_smallest(p: Floats, s: Floats, x: Floats, sign: float) -> None:
    """Fill the smallest notch of the staircase; `sign` is +1 where the last extreme is a minimum."""
    divisions, reach, side = int(p[0]), p[1], p[2]
    count = int(s[COUNT])
    best, smallest = 0, np.inf
    for k in range(count - 3):
        e = EXTREMES + k
        area = abs(s[e] - s[e + 2]) * abs(s[e + 1] - s[e + 3])
        if area < smallest:
            best, smallest = k, area
    # Towards a maximum remembered at `best` the notch was down and becomes up, and the reverse.
    up = sign if (count - 1 - best) % 2 == 1 else -sign
    e = EXTREMES + best
    a1, a2 = up * s[e + 2], up * s[e]
    b1, b2 = up * s[e + 1], up * s[e + 3]
    for row in range(_division(a1, reach, side, divisions), _division(a2, reach, side, divisions) + 1):
        height = min(a2, side * (row + 1) - reach) - max(a1, side * row - reach)
        first = _division(b1, reach, side, divisions)
        last = min(_division(b2, reach, side, divisions), row)
        for column in range(first, last + 1):
            width = min(b2, side * (column + 1) - reach) - max(b1, side * column - reach)
            if height > 0.0 and width > 0.0:
                x[_cell(row, column, divisions, up)] += up * 2.0 * height * width / side
    for k in range(best + 1, count - 2):
        s[EXTREMES + k] = s[EXTREMES + k + 2]
    s[COUNT] = count - 2


@basis_kernel
def preisach_plane(p: Floats, s: Floats, x: Floats, u: float) -> None:
    """p: L, R (m), h (m), room for extremes. x: share that is up of each cell, times h, from virgin (m).

    A step costs the cells whose relays it switches.
    """
    if s[STARTED] == 0.0:
        s[STARTED] = 1.0
        s[ORIGIN] = u
        return
    value = min(max(u - s[ORIGIN], -p[1]), p[1])
    before = s[INPUT]
    if value == before:
        return
    sign = 1.0 if value > before else -1.0
    if s[DIRECTION] != sign:
        if s[DIRECTION] != 0.0:
            if s[COUNT] >= p[3]:
                _forget_smallest(p, s, x, -sign)
            s[EXTREMES + int(s[COUNT])] = before
            s[COUNT] += 1.0
        s[DIRECTION] = sign
    _rise(p, s, x, sign * before, sign * value, sign)
    s[INPUT] = value


@register_basis
class PreisachBasis(Basis):
    """Preisach plane over +-`reach` (m) about the starting point, `divisions` to a side.

    Cells are counted row by row: alpha from low to high, within a row beta from low to alpha. Weights are
    densities (N/m): all equal to w, a sweep of the whole plane changes the output by w times h L^2.
    Raises ConfigError for a reach that is not above 0 or divisions outside 1 to 200.
    """

    name = "preisach"
    kernel = preisach_plane
    source = "Preisach (1935), Zeitschrift fuer Physik 94; Mayergoyz (1991)"

    def __init__(self, divisions: int, reach: float) -> None:
        if isinstance(divisions, bool) or int(divisions) != divisions or not 1 <= divisions <= 200:
            raise ConfigError(
                f"preisach model: divisions is {divisions}; allowed is a whole number, 1 to 200",
                key=("divisions",),
            )
        if not (np.isfinite(reach) and reach > 0):
            raise ConfigError(f"preisach model: reach is {reach:g} m; it must be above 0", key=("reach",))
        self.divisions = int(divisions)
        self.reach = float(reach)

    @classmethod
    def over(cls, count: int, total: float, spacing: float = 1.0) -> PreisachBasis:
        """Cover +-total / 2 (m) about the start with at most `count` cells, all equal (`spacing` must be 1).

        Give the range of the motion: unlike the other operators the plane does not move along with it.
        """
        if spacing != 1.0:
            raise ConfigError(
                f"preisach model: spacing is {spacing:g}; its cells are equal, so it must be 1",
                key=("spacing",),
            )
        return cls(max(int((np.sqrt(8.0 * count + 1.0) - 1.0) / 2.0), 1), 0.5 * total)

    @property
    def side(self) -> float:
        """Side h of a cell (m)."""
        return 2.0 * self.reach / self.divisions

    @property
    def size(self) -> int:
        """Number of cells."""
        return self.divisions * (self.divisions + 1) // 2

    def vector(self) -> Floats:
        """Return L, R, h and the room for extremes."""
        return np.array([self.divisions, self.reach, self.side, self._room], dtype=np.float64)

    @property
    def _room(self) -> int:
        return DEPTH * self.divisions + 4

    def initial_state(self) -> Floats:
        """Return the demagnetised state: relays with alpha + beta below 0 are up, no extremes."""
        return np.zeros(EXTREMES + self._room)

    def scales(self) -> Floats:
        """Return half the range of each cell: h, and h / 2 for the triangles on the diagonal."""
        rows, columns = np.tril_indices(self.divisions)
        return np.where(rows == columns, 0.5, 1.0) * self.side

    def to_dict(self) -> dict[str, Any]:
        """Return name, divisions and reach."""
        return {"model": self.name, "divisions": self.divisions, "reach": self.reach}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> PreisachBasis:
        """Build from ``{divisions: ..., reach: ...}``."""
        checked_keys(entry, cls.name, ["divisions", "reach"])
        return cls(**entry)
