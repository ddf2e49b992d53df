"""Leuven friction (2000): transition curves between reversal points that are kept on a stack.

The hysteresis force is Fh = Fb + Fd, with Fb the force at the last reversal and Fd the transition curve from
there. The virgin curve f is given by stop elements, and transition curves are the virgin curve doubled,
2 f(z/2) (Masing). As Fd grows strictly with z, z is eliminated: with y = |Fd| and S = s(v) the equation reads

    dy/d|x| = slope(y) (1 - sgn(q) |q|^n),  q = y / (S - sgn(v) Fb),

so that the whole memory is the force and the stack of reversal forces.

- A reversal pushes the force on the stack. When the force comes back to where the last loop began, the loop
  is closed: two reversals are popped and the outer curve goes on. When it comes back to the opposite of the
  first reversal, the virgin curve goes on.
- Sliding forgets: where the level has fallen below the force (the Stribeck curve), the stack is emptied and
  the force follows the level along the virgin curve.
- The stack holds DEPTH reversals. One more takes the place of the innermost loop (the two newest), which is
  the smallest, so the force stays continuous and the outer loops close as before; lost is only where that
  loop would have closed.
- As in the original, sigma_1 dz/dt jumps where a loop closes. The modified model was made to mend that.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.approach import SHARPNESS, STEPS, advance, flow, longest
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Parameter, Place
from rtcomp.physics.level import LEVEL, VISCOUS, speed_midway, stribeck_level, viscous_speed
from rtcomp.physics.lists import ListEffect
from rtcomp.physics.modified_leuven import DAMPING
from rtcomp.physics.softening import softened
from rtcomp.physics.wires import (
    FRICTION,
    GRIP,
    GRIP_LEVEL,
    GRIP_STIFFNESS,
    LATE,
    MOVED,
    REACH,
    SCALE,
    SOFTENS,
    VELOCITY,
)  # fmt: skip

DEPTH: Final = 32
"""Reversals that the memory holds."""

# Places in the state: direction of motion, number of reversals held, force, then the reversals' forces.
_DIRECTION, _HELD, _FORCE, _STACK = 0, 1, 2, 3
# Places in the parameters.
_COUNT = 7


@effect_kernel
def leuven(p: Floats, s: Floats, w: Floats) -> None:
    """p: coulomb, static, Stribeck velocity, exponent, sharpness, damping, viscous, count, then stretches.

    Stretches of the virgin curve are their end (N) and slope (N/m) each; s: direction, number of reversals
    held, force (N), forces at the reversals (N).
    """
    v = w[VELOCITY]
    n = p[4]
    nominal = stribeck_level(p[0], p[1], p[2], p[3], speed_midway(w))
    level = nominal * w[REACH]
    cut = longest(n)
    left = abs(w[MOVED])
    if left > 0.0:
        direction = math.copysign(1.0, w[MOVED])
        held = int(s[_HELD])
        if direction != s[_DIRECTION]:
            if held > 0 or s[_FORCE] != 0.0:
                if held == DEPTH:
                    held -= 2
                s[_STACK + held] = s[_FORCE]
                held += 1
            s[_DIRECTION] = direction
        along = s[_FORCE] * direction
        count = int(p[_COUNT])
        steps = 0
        while left > 0.0:
            if along >= level:
                held = 0
            opposite = math.inf  # force along the motion at which the present loop closes
            while held > 0:
                opposite = -direction * s[_STACK] if held == 1 else direction * s[_STACK + held - 2]
                if along < opposite - 1e-12 * level:
                    break
                held -= 1 if held == 1 else 2
                opposite = math.inf
            start = direction * s[_STACK + held - 1] if held > 0 else 0.0
            doubled = 2.0 if held > 0 else 1.0
            span = level - start
            done = along - start
            i = 0
            while i < count - 1 and done >= doubled * p[_COUNT + 1 + 2 * i] * (1.0 - 1e-12):
                i += 1
            corner = doubled * p[_COUNT + 1 + 2 * i] if i < count - 1 else math.inf
            slope = p[_COUNT + 2 + 2 * i]
            q = done / span
            if abs(q - 1.0) < 1e-15:
                break
            h = left * slope / span
            steps += 1
            if h > cut and steps < STEPS:
                h = cut
            new = advance(q, n, h) * span
            event = min(corner, opposite - start)
            if new > event > done and steps < STEPS:
                h *= (event - done) / (new - done)
                new = event
            along = start + new
            left -= h * span / slope
            if steps >= STEPS:
                break
        s[_HELD] = held
        s[_FORCE] = along * direction
    rate = v
    if v * s[_DIRECTION] > 0.0:  # against the last motion a new curve would begin, with dz/dt = v
        held = int(s[_HELD])
        start = s[_DIRECTION] * s[_STACK + held - 1] if held > 0 else 0.0
        span = stribeck_level(p[0], p[1], p[2], p[3], v - w[LATE]) * w[REACH] - start
        done = s[_DIRECTION] * s[_FORCE] - start
        rate = v * flow(done / span, n) if span > 0.0 else 0.0
    w[GRIP] = softened(s[_FORCE], nominal * w[REACH], w[SOFTENS]) * w[SCALE]
    w[GRIP_LEVEL] = nominal
    w[GRIP_STIFFNESS] = p[_COUNT + 2]
    w[FRICTION] += w[GRIP] + p[5] * rate * w[SCALE] + p[6] * viscous_speed(w)


@register
class Leuven(ListEffect):
    """The integrated friction structure of Leuven; `elements` lists {stiffness, reach}: the virgin curve.

    Past the largest reach the curve goes on at its last slope, so that this reach itself is without effect:
    yielding is made by the level s(v).
    """

    name = "leuven"
    place = Place.FRICTION
    parameters = (*LEVEL, SHARPNESS, DAMPING, VISCOUS)
    element = (
        Parameter("stiffness", "N/m", 0.0, 1e12, "slope it adds to the virgin curve", open_low=True),
        Parameter("reach", "m", 0.0, 1e3, "travel up to which it adds it", open_low=True),
    )
    kernel = leuven
    states = 3 + DEPTH
    says = "presliding hysteresis that remembers its reversals on a stack, passing into sliding"
    equation = (
        "dz/dt = v (1 - sgn(q) |q|^n), q = F_d(z) / (s(v) - F_b), s signed by v; "
        "F = F_b + F_d(z) + sigma_1 dz/dt + sigma_2 v"
    )
    source = "Swevers, Al-Bender, Ganseman, Prajogo (2000), IEEE TAC 45(4)"
    signature = (
        "presliding loops whose branches are the virgin curve doubled, then sliding that falls with speed"
    )
    experiment = "nested presliding reversals, then constant speeds around the Stribeck velocity"
    example = {
        "coulomb": 3.0, "static": 4.0, "stribeck_velocity": 2e-3, "exponent": 2.0, "sharpness": 3.0,
        "damping": 200.0, "viscous": 5.0,
        "elements": [{"stiffness": 8e5, "reach": 2e-6}, {"stiffness": 4e5, "reach": 7e-6}],
    }  # fmt: skip
    linear = ("damping", "viscous")
    searchable = False

    def vector(self) -> Floats:
        """Return the plain parameters, the count, then each stretch of the virgin curve: end (N), slope."""
        plain = np.array([self.values[q.name] for q in self.parameters])
        reach, same = np.unique([r for _, r in self.elements], return_inverse=True)
        stiffness = np.bincount(same, weights=[k for k, _ in self.elements])
        slopes = np.cumsum(stiffness[::-1])[::-1]
        ends = np.cumsum(slopes * np.diff(reach, prepend=0.0))
        return np.concatenate([plain, [float(len(reach))], np.column_stack([ends, slopes]).ravel()])

    def stiffness(self) -> float:
        """Return the steepest slope of the virgin curve (N/m)."""
        return float(sum(k for k, _ in self.elements))

    def damping(self) -> float:
        """Return sigma_1 and sigma_2 together (N s/m)."""
        return self.values["damping"] + self.values["viscous"]
