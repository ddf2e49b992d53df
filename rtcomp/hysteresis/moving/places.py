"""What stands where in the arrays of the self-placing intervals: numbers only, for its two kernels."""

from __future__ import annotations

COUNT, CELLS, EDGES = range(3)
"""Parameters: number of intervals N; of cells M; from here on the first cell of each interval and M, then
the corners of the cells (m), M + 1."""

STARTED, INPUT, DIRECTION, FRONT, OWN, PATH, FIRST, LAST, BEGUN, AMOUNTS = range(10)
"""State: has seen an input; that input (m); direction of motion; the first cell not yet saturated in this
direction, and the interval that it is in; the way (m) since the last reversal or the last look of the
placing, the first and the last cell passed in it, and whether it began with a reversal; from here on the
amounts of the cells (m), M, then how much of each was passed on that way (m), M."""

(
    UPDATES, TURN, FORCE, PEAK, BASE, DEEPEST, STEP_NOISE, STEPS, NOISE, ERRORS, GATE, MOVES, ARRAYS,
) = range(13)  # fmt: skip
"""Memory of the placing: updates of the weights seen; the interval looked at next; force (N) of the last
sample, the largest, and where the present way began; cells ever reached; mean square (N^2) of what the slopes
did not foresee of a way's force, and their number; mean square (N^2) of what the model did not foresee, and
their number; shortest way (m) that a slope is taken from; how often an interval moved; from here on the
arrays, in this order: slope of the branch in each cell (N/m), M, and its variance, M, 0 where it was never
passed; the branch (N) at each corner, M + 1, and the variance of its noise (N^2), M + 1; then of each
interval, N each, what `placing` found on its last look: cost, gain of a split, the cell to split at, loss of
a merger with the next, gain of moving the boundary to the next, and the cell to move it to."""

INTERVALS, MERGED, SPLIT, SHARE, PART, CHANGED = range(6)
"""A change: number of intervals; which took in its next; which then was split; the share of the one in their
width; the share of the first part in the split one's; whether there was any change."""
CHANGE_WIDTH = 6
