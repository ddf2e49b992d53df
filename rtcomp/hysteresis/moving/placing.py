"""Where the intervals belong: to where the virgin curve bends, one interval at a time, never a step.

A slope of the branch is measured in every cell, apart from the weights: force over way while the front
passes it. From these slopes follows what N straight pieces make of the curve, and which change helps it
most: two neighbours merged, and the number made up by splitting the interval that is worst, or the same two
by moving the boundary between them. An interval is split for nothing: both parts take its weight over. Two
are merged (weights by the integral, so that the virgin curve's height stays) only while both are saturated
alike for the identifier and for the compensator: there the output is their integral, and stays to the last
bit but rounding. What a change must gain rises with the noise, so that places come to rest.
"""

from __future__ import annotations

import numpy as np

from rtcomp.hysteresis.moving import places as at
from rtcomp.hysteresis.moving.branch_slopes import NOISE_MEMORY, slopes
from rtcomp.hysteresis.moving.pieces import best_split, of_noise, piece
from rtcomp.kernels import Floats, compiled, placing_kernel

START_EACH = 10.0
"""Updates an interval before the first change: until then the slopes say little."""
PATIENT_EACH = 100.0
"""And before intervals that nothing has reached are taken for elsewhere: it may be reached yet."""
OF_MEAN = 0.02
"""A change must gain this share of the mean cost of an interval."""
OF_PAIR = 0.1
"""And this share of what its two intervals cost, where a boundary is to move."""
OF_NOISE, LONG = 5.0, 2000.0
"""And this many times what noise makes of a weight learned over so many updates: to learn anew costs that."""
OF_HEIGHT = 1e-4
"""And the square of this share of the branch's height over all of its way: less is rounding."""
OF_SLOPES = 10.0
"""And this many times what the noise of the slopes makes of a corner of the branch."""
_SMALL = 1e-9


def room(count: int, cells: int, gate: float) -> Floats:
    """Return the memory of the placing for so many intervals and cells; `gate` (m): of motion an update."""
    memory = np.zeros(at.ARRAYS + 2 * cells + 2 * (cells + 1) + 6 * count)
    memory[at.GATE] = gate
    return memory


@compiled
def look(p: Floats, m: Floats, j: int) -> None:
    """Find what splitting interval `j`, and merging it with the one before or moving their boundary, does."""
    count, cells = int(p[at.COUNT]), int(p[at.CELLS])
    variance, y, q = at.ARRAYS + cells, at.ARRAYS + 2 * cells, at.ARRAYS + 3 * cells + 1
    x, cost = at.EDGES + count + 1, at.ARRAYS + 4 * cells + 2
    gain, split, loss = cost + count, cost + 2 * count, cost + 3 * count
    shift, to = cost + 4 * count, cost + 5 * count
    reached = int(m[at.DEEPEST])
    low, high = int(p[at.EDGES + j]), int(p[at.EDGES + j + 1])
    for c in range(low, high):
        known = m[variance + c] > 0.0
        width = p[x + c + 1] - p[x + c]
        slope = m[at.ARRAYS + c] if known or c == 0 else (m[y + c] - m[y + c - 1]) / (p[x + c] - p[x + c - 1])
        m[y + c + 1] = m[y + c] + width * slope
        m[q + c + 1] = m[q + c] + width * width * m[variance + c]
    top = min(high, reached)
    m[cost + j] = piece(p, m, low, top)
    m[gain + j] = -np.inf
    least, corner = best_split(p, m, low, top)
    if corner > low:
        m[gain + j] = m[cost + j] - least - OF_SLOPES * of_noise(p, m, low, top)
        m[split + j] = float(corner)
    if j == 0:
        return
    # With the interval before: beyond what was reached both are straight, as far as anybody knows.
    before = int(p[at.EDGES + j - 1])
    m[loss + j - 1], m[shift + j - 1] = 0.0, -np.inf
    if low < reached:
        m[loss + j - 1] = piece(p, m, before, top) - m[cost + j - 1] - m[cost + j]
        least, corner = best_split(p, m, before, top)
        both = m[cost + j - 1] + m[cost + j]
        if corner not in (low, before) and least < (1.0 - OF_PAIR) * both:
            gained = both - least - OF_SLOPES * of_noise(p, m, before, top)
            m[shift + j - 1], m[to + j - 1] = gained, float(corner)


@compiled
def alike(p: Floats, x: Floats, j: int) -> bool:
    """Tell whether intervals `j` and the next are both saturated, and in the same direction."""
    corner = at.EDGES + int(p[at.COUNT]) + 1
    a, b, c = int(p[at.EDGES + j]), int(p[at.EDGES + j + 1]), int(p[at.EDGES + j + 2])
    one = x[j] / (p[corner + b] - p[corner + a])
    two = x[j + 1] / (p[corner + c] - p[corner + b])
    return bool(abs(abs(one) - 0.5) < _SMALL and abs(one - two) < _SMALL)


@compiled
def choose(p: Floats, x: Floats, lead_x: Floats, w: Floats, m: Floats, change: Floats) -> bool:
    """Write the best change that costs no step now into `change`, its corner in CHANGED; or say no."""
    count, cells = int(p[at.COUNT]), int(p[at.CELLS])
    cost = at.ARRAYS + 4 * cells + 2
    gain, split, loss = cost + count, cost + 2 * count, cost + 3 * count
    shift, to = cost + 4 * count, cost + 5 * count
    corner, height, reached = at.EDGES + count + 1, at.ARRAYS + 2 * cells, int(m[at.DEEPEST])
    total, worst = 0.0, 0
    for j in range(count):
        total += m[cost + j]
        if m[gain + j] > m[gain + worst]:
            worst = j
    least = OF_MEAN * total / count
    least += (OF_HEIGHT * m[height + reached]) ** 2 * p[corner + reached]
    least += OF_NOISE * m[at.NOISE] * p[corner + reached] / min(max(m[at.UPDATES], 1.0), LONG)
    best = least
    found, patient = False, m[at.UPDATES] > PATIENT_EACH * count
    for j in range(count - 1):
        blank = patient and int(p[at.EDGES + j + 1]) >= reached and w[j] == w[j + 1]
        if not blank and not (alike(p, x, j) and alike(p, lead_x, j)):
            continue
        if m[shift + j] > best and not blank:
            best, found = m[shift + j], True
            change[at.MERGED], change[at.SPLIT], change[at.CHANGED] = float(j), float(j), m[to + j]
        elsewhere = m[gain + worst] - m[loss + j]
        if worst not in (j, j + 1) and elsewhere > best:
            best, found = elsewhere, True
            change[at.MERGED], change[at.SPLIT], change[at.CHANGED] = float(j), float(worst), m[split + worst]
    return found


@compiled
def regroup(p: Floats, s: Floats, x: Floats) -> None:
    """Sum the cells' amounts anew into the regressors, and say which interval the front is in."""
    count = int(p[at.COUNT])
    corner = at.EDGES + count + 1
    s[at.OWN] = float(count)
    for j in range(count):
        total = 0.0
        for c in range(int(p[at.EDGES + j]), int(p[at.EDGES + j + 1])):
            total += s[at.AMOUNTS + c] - 0.5 * (p[corner + c + 1] - p[corner + c])
        x[j] = total
        if p[at.EDGES + j] <= s[at.FRONT] < p[at.EDGES + j + 1]:
            s[at.OWN] = float(j)


@compiled
def carry(w: Floats, change: Floats, count: int) -> None:
    """Carry weights over a change: a merger by the integral, a split by taking over."""
    i, k, share = int(change[at.MERGED]), int(change[at.SPLIT]), change[at.SHARE]
    w[i] = share * w[i] + (1.0 - share) * w[i + 1]
    for j in range(i + 1, count - 1):
        w[j] = w[j + 1]
    for j in range(count - 1, k, -1):
        w[j] = w[j - 1]


@compiled
def move(p: Floats, change: Floats) -> None:
    """Move the boundaries as `change` says, whose CHANGED is the corner to split at; fill in its shares."""
    count = int(p[at.COUNT])
    corner = at.EDGES + count + 1
    i, here = int(change[at.MERGED]), change[at.CHANGED]
    k = int(change[at.SPLIT])
    a, b, c = int(p[at.EDGES + i]), int(p[at.EDGES + i + 1]), int(p[at.EDGES + i + 2])
    change[at.SHARE] = (p[corner + b] - p[corner + a]) / (p[corner + c] - p[corner + a])
    for j in range(i + 1, count - 1):
        p[at.EDGES + j] = p[at.EDGES + j + 1]
    if k > i:
        k -= 1
    for j in range(count - 1, k + 1, -1):
        p[at.EDGES + j] = p[at.EDGES + j - 1]
    p[at.EDGES + k + 1] = here
    a, b, c = int(p[at.EDGES + k]), int(here), int(p[at.EDGES + k + 2])
    change[at.PART] = (p[corner + b] - p[corner + a]) / (p[corner + c] - p[corner + a])
    change[at.SPLIT] = float(k)
    change[at.CHANGED] = 1.0


@placing_kernel
def place(
    p: Floats, s: Floats, x: Floats, lead_s: Floats, lead_x: Floats, w: Floats, begun: Floats,
    scales: Floats, m: Floats, change: Floats, force: float, error: float,
) -> None:  # fmt: skip
    """Learn from one sample where the intervals belong, and move one of them where that pays.

    p, s, x: the operator's parameters (changed where an interval moves), the identifier's state and
    regressors; lead_s, lead_x: the compensator's. w (N/m) and `begun`, the weights that a diverged
    identifier goes back to. scales: half the widths (m). m: what is remembered. change: see `places`.
    force (N) of the sample, not a number where it does not count; error (N): what the weights were changed
    by; not a number where they were not.
    """
    change[at.INTERVALS], change[at.CHANGED] = p[at.COUNT], 0.0
    slopes(p, s, m, force)
    m[at.FORCE] = force
    if abs(force) < np.inf:
        m[at.PEAK] = max(m[at.PEAK], abs(force))
    if not abs(error) < np.inf:
        return
    count = int(p[at.COUNT])
    m[at.UPDATES] += 1.0
    m[at.ERRORS] = min(m[at.ERRORS] + 1.0, NOISE_MEMORY)
    m[at.NOISE] += (error * error - m[at.NOISE]) / m[at.ERRORS]
    if m[at.UPDATES] < START_EACH * count or count < 3:
        return
    look(p, m, int(m[at.TURN]))
    m[at.TURN] += 1.0
    if m[at.TURN] < count:
        return
    m[at.TURN] = 0.0
    if not choose(p, x, lead_x, w, m, change):
        change[at.CHANGED] = 0.0
        return
    move(p, change)
    m[at.MOVES] += 1.0
    carry(w, change, count)
    carry(begun, change, count)
    regroup(p, s, x)
    regroup(p, lead_s, lead_x)
    corner = at.EDGES + count + 1
    for j in range(count):
        scales[j] = 0.5 * (p[corner + int(p[at.EDGES + j + 1])] - p[corner + int(p[at.EDGES + j])])
