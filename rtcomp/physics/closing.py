"""Branches that differ by direction or by where they begin, and still close: every loop returns to its start.

Made from what the friction model holds, whose own branches are alike. Reversals are kept on a stack, by the
model's force and by the bent one; a branch heads for the reversal before it, where both are forgotten and the
older branch goes on (Madelung's rules), so that wiping-out and return points are those of the model.

Loops that soften dissipate. Loops that differ by direction may give energy where the model's own take none:
up to 2e-3 asymmetry^2 of the level times their length.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from rtcomp.kernels import Floats, compiled, effect_kernel
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.wires import FRICTION, GRIP, GRIP_LEVEL, REACH, SCALE

ASYMMETRY = Parameter("asymmetry", "1", -0.9, 0.9, "difference of stiffness over its sum")
SOFTENING = Parameter("softening", "1", -1.0, 10.0, "loss of slope from middle to level")
DEPTH: Final = 64
"""Reversals remembered; of more, the smallest loops are forgotten."""
HELD, BENT, WAY, COUNT, SLID, TURNS = range(6)
"""State: the model's force over its level, the bent one, the direction, reversals kept, whether it ever slid;
from here on the model's force at each reversal, then the bent one."""
_SLIDES, _LEAST = 1.0 - 1e-9, 1e-12
_FLATTEST: Final = 0.05
"""Least exponent of a branch: flatter ones would be steps where they end."""


@compiled
def rise(part: float, exponent: float) -> float:
    """Return how far a branch has come, 0 to 1, where the model's own has come by `part`."""
    return float(1.0 - (1.0 - min(max(part, 0.0), 1.0)) ** exponent)


@compiled
def steepness(way: float, begin: float, asymmetry: float, softening: float) -> float:
    """Return the exponent of a branch that goes `way` from the force `begin`, -1 to 1.

    Softening of either sign makes branches steeper, those from no force or those from sliding: beside one as
    the model has it a flatter one would close loops that give energy.
    """
    held = min(abs(begin), 1.0)
    steeper = 1.0 + (softening * (1.0 - held) if softening > 0.0 else -softening * held)
    return max((1.0 + way * asymmetry) * steeper, _FLATTEST)


@compiled
def _turn(s: Floats, way: float, exponent: float) -> None:
    """Keep the reversal at hand; the branch that begins goes `way`."""
    n = int(s[COUNT])
    if n == 0 and s[SLID] == 0.0:  # the virgin curve turns for its mirror image
        s[TURNS], s[TURNS + DEPTH] = -s[HELD], way * rise(abs(s[HELD]), exponent)
        n = 1
    elif n >= DEPTH - 1:
        n -= 2
    s[TURNS + n], s[TURNS + DEPTH + n] = s[HELD], s[BENT]
    s[COUNT] = float(n + 1)
    s[WAY] = way


@compiled
def bend(s: Floats, held: float, asymmetry: float, softening: float) -> float:
    """Go on to the model's force `held`, -1 to 1, and return the bent one."""
    if held == s[HELD]:
        return float(s[BENT])
    way = 1.0 if held > s[HELD] else -1.0
    if s[WAY] == -way:
        _turn(s, way, steepness(way, 0.0, asymmetry, softening))
    s[WAY], s[HELD] = way, held
    while True:
        n = int(s[COUNT])
        if way * held >= _SLIDES:
            s[COUNT], s[SLID], s[BENT] = 0.0, 1.0, way
            return way
        if n == 1 and s[SLID] == 0.0:  # beyond the first reversal ever the virgin curve goes on
            s[COUNT] = 0.0
            n = 0
        if n == 0:
            # Past where it slid without a reversal in between: only a model that creeps back gets here.
            virgin = steepness(way, 0.0, asymmetry, softening)
            s[BENT] = way * rise(abs(held), virgin) if s[SLID] == 0.0 else held
            return float(s[BENT])
        start, bent = s[TURNS + n - 1], s[TURNS + DEPTH + n - 1]
        exponent = steepness(way, bent, asymmetry, softening)
        gone = 0.5 * abs(held - start)
        if n == 1:
            s[BENT] = bent + (way - bent) * rise(gone, exponent)
            return float(s[BENT])
        whole = 0.5 * abs(s[TURNS + n - 2] - start)
        if gone >= whole:
            s[COUNT] = float(n - 2)
            continue
        to, all_of_it = s[TURNS + DEPTH + n - 2], rise(whole, exponent)
        # Of loops as small as rounding only their ends are left.
        part = rise(gone, exponent) / all_of_it if all_of_it > _LEAST else gone / whole
        s[BENT] = bent + (to - bent) * part
        return float(s[BENT])


@effect_kernel
def closing_branches(p: Floats, s: Floats, w: Floats) -> None:
    """p: asymmetry (1), softening (1); s: see the names above."""
    level = w[GRIP_LEVEL] * w[REACH] * w[SCALE]
    if level > 0.0:
        bent = level * bend(s, min(max(w[GRIP] / level, -1.0), 1.0), p[0], p[1])
        w[FRICTION] += bent - w[GRIP]
        w[GRIP] = bent


class ClosingBranches(Effect):
    """Bends what the friction model holds. Not in the catalogue: effects of branches bring it."""

    name = "closing-branches"
    place = Place.FRICTION
    parameters = (replace(ASYMMETRY, default=0.0), replace(SOFTENING, default=0.0))
    kernel = closing_branches
    says = "presliding branches differ in shape by direction or by where they begin, and every loop closes"
    equation = (
        "h <- h_r + (h_t - h_r) phi(u) / phi(u_t),  phi(u) = 1 - (1 - u)^e,  "
        "e = (1 + asymmetry sgn(dx)) (1 + softening (1 - |h_r|)), below 0 (1 - softening |h_r|)"
    )
    source = "Madelung (1905), Ann. Phys. 322(10); Dahl (1976), AIAA J. 14(12), exponents of branches"
    signature = "that of asymmetric-friction, without a force that grows from loop to loop, or of softening"
    experiment = "loops of several sizes inside presliding, each repeated"
    example = {"asymmetry": 0.1}
    neutral = {"asymmetry": 0.0, "softening": 0.0}
    linear = ("asymmetry", "softening")
    searchable = False
    whole_friction = True
    order = 70
    states = TURNS + 2 * DEPTH
