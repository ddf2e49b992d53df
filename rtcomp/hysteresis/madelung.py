"""Branches that differ by direction and close: what a little asymmetry of each does to a symmetric output.

An output o in [-1, 1] goes from the reversal o_s of its branch to where that leads, o_t: the reversal before,
or +-1. By how much u = |o - o_s| / 2 of the whole range it has come, of u_t, the output leans by

    l = l_s + (l_t - l_s) u / u_t + 2 (psi(u) - psi(u_t) u / u_t),    psi(0) = psi(1) = 0

to one side, the same for branches up and down, which by it come to differ; l_s and l_t are what it leaned by
at either end. To first order that is a branch with the exponent 1 + a up and 1 - a down where psi(u) is
-(1 - u) ln(1 - u), and a its weight; u (1 - u) is the other form here, which is less steep at the reversal.
Reversals are forgotten in pairs when a branch comes to the one before it, from where the older branch goes on
(Madelung's rules): every loop closes, and l = 0 where all slides, so that it cannot drift. Madelung (1905),
Ann. Phys. 322(10); exponents of branches: Dahl (1976), AIAA J. 14(12).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rtcomp.kernels import Floats, compiled

FORMS: Final = 2
DEPTH: Final = 64
"""Reversals remembered; of more, the smallest loops are forgotten."""
HELD, WAY, COUNT, SLID, LEANS = range(5)
"""State: the output, its direction, reversals kept, whether it ever slid, and by how much it leans in each
form; from here on the outputs at the reversals, then how it leaned there, form by form."""
_TURNS: Final = LEANS + FORMS
STATES: Final = _TURNS + (1 + FORMS) * DEPTH
_SLIDES, _LEAST = 1.0 - 1e-9, 1e-12


@compiled
def psi(form: int, part: float) -> float:
    """Return how far a branch in this form is ahead of itself, where it has come by `part`, 0 to 1."""
    rest = 1.0 - min(max(part, 0.0), 1.0)
    if form == 1:
        return float(rest * (1.0 - rest))
    return float(-rest * np.log(rest)) if rest > 0.0 else 0.0


@compiled
def _keep(s: Floats, at: int, n: int, output: float, mirrored: bool) -> None:
    """Keep a reversal as number `n`; how the output leans there is as at hand, or as mirrored: the same."""
    s[at + _TURNS + n] = -output if mirrored else output
    for form in range(FORMS):
        s[at + _TURNS + (1 + form) * DEPTH + n] = s[at + LEANS + form]


@compiled
def lean(s: Floats, at: int, output: float) -> None:
    """Follow the output (-1 to 1); how it leans then stands in s[at + LEANS] and on, the state in s[at:]."""
    if output == s[at + HELD]:
        return
    way = 1.0 if output > s[at + HELD] else -1.0
    if s[at + WAY] == -way:
        n = int(s[at + COUNT])
        if n == 0 and s[at + SLID] == 0.0:  # the virgin curve turns for its mirror image
            _keep(s, at, 0, s[at + HELD], True)
            n = 1
        elif n >= DEPTH - 1:
            n -= 2
        _keep(s, at, n, s[at + HELD], False)
        s[at + COUNT] = float(n + 1)
    s[at + WAY], s[at + HELD] = way, output
    if way * output >= _SLIDES:
        s[at + COUNT], s[at + SLID] = 0.0, 1.0
        for form in range(FORMS):
            s[at + LEANS + form] = 0.0
        return
    n = int(s[at + COUNT])
    while n > 1 and abs(output - s[at + _TURNS + n - 1]) >= abs(
        s[at + _TURNS + n - 2] - s[at + _TURNS + n - 1]
    ):
        n -= 2
    if n == 1 and s[at + SLID] == 0.0:  # beyond the first reversal ever the virgin curve goes on
        n = 0
    s[at + COUNT] = float(n)
    if n == 0:
        for form in range(FORMS):
            s[at + LEANS + form] = psi(form, abs(output)) if s[at + SLID] == 0.0 else 0.0
        return
    start = s[at + _TURNS + n - 1]
    to = s[at + _TURNS + n - 2] if n > 1 else way
    gone, whole = 0.5 * abs(output - start), max(0.5 * abs(to - start), _LEAST)
    share = gone / whole
    for form in range(FORMS):
        turns = at + _TURNS + (1 + form) * DEPTH
        begun = s[turns + n - 1]
        end = s[turns + n - 2] if n > 1 else 0.0
        ahead = psi(form, gone) - share * psi(form, whole)
        s[at + LEANS + form] = begun + (end - begun) * share + 2.0 * ahead
