"""Friction that changes with time: drift, ageing at rest, creep."""

from __future__ import annotations

import math
from typing import Final

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.growing import GROWTH, LEAST, grow
from rtcomp.physics.wires import GRAIN, GRIP, GRIP_STIFFNESS, MOVED, REACH, SCALE, STEP, TIME

FRESH: Final = 0.1
"""Time at rest (s) from which on the logarithm of ageing grows, unless told."""


@effect_kernel
def friction_drift(p: Floats, s: Floats, w: Floats) -> None:
    """p: change (1), time constant (s)."""
    w[SCALE] *= 1.0 + p[0] * -math.expm1(-w[TIME] / p[1])


@effect_kernel
def friction_drift_level(p: Floats, s: Floats, w: Floats) -> None:
    """p: change (1), time constant (s)."""
    w[REACH] *= max(1.0 + p[0] * -math.expm1(-w[TIME] / p[1]), LEAST)


@effect_kernel
def friction_drift_linear(p: Floats, s: Floats, w: Floats) -> None:
    """p: change (1), time constant (s)."""
    w[REACH] *= max(1.0 + p[0] * min(w[TIME] / p[1], 1.0), LEAST)


@effect_kernel
def friction_drift_late(p: Floats, s: Floats, w: Floats) -> None:
    """p: change (1), time constant (s)."""
    w[REACH] *= max(1.0 + p[0] * min(w[TIME] / p[1], 1.0) ** 3, LEAST)


@effect_kernel
def friction_drift_back(p: Floats, s: Floats, w: Floats) -> None:
    """p: change (1), time constant (s)."""
    part = min(w[TIME] / p[1], 1.0)
    w[REACH] *= max(1.0 + 4.0 * p[0] * part * (1.0 - part), LEAST)


@effect_kernel
def stiction_ageing(p: Floats, s: Floats, w: Floats) -> None:
    """p: growth, distance (m), onset (s), stiffening, following; s: age (s) of contacts, place (m) in grain.

    Exact for a step at constant speed.
    """
    inside = s[1] + w[MOVED]
    s[1] = min(max(inside, -w[GRAIN]), w[GRAIN])
    slid = abs(inside - s[1]) / p[1]
    renewed = -math.expm1(-slid)
    s[0] += w[STEP] * (renewed / slid if slid > 1e-12 else 1.0) - s[0] * renewed
    factor = 1.0 + p[0] * math.log1p(s[0] / p[2])
    grow(w, factor, factor, p[3], p[4])


@effect_kernel
def creep(p: Floats, s: Floats, w: Floats) -> None:
    """p: fraction (1), time constant (s); s: crept displacement (m).

    Implicit in the force that creeping itself takes away.
    """
    if w[GRIP_STIFFNESS] > 0.0:
        lag = -math.expm1(-w[STEP] / p[1])
        change = lag * (p[0] * w[GRIP] / w[GRIP_STIFFNESS] - s[0]) / (1.0 + p[0] * lag)
        s[0] += change
        w[MOVED] -= change


@register
class FrictionDrift(Effect):
    """Level drifts with time or temperature; not viscous friction.

    In the form `force` the whole force drifts. In the others contacts yield later or earlier at equal
    stiffness: in `level` exponentially; in `linear` along a line, in `late` with the third power, in `back`
    there and back along a parabola, which end at the time constant.
    """

    name = "friction-drift"
    place = Place.FRICTION
    parameters = (
        Parameter("change", "1", -1.0, 100.0, "relative change of the friction force in the end"),
        Parameter("time_constant", "s", 0.0, 1e7, "with which it comes, from the start", open_low=True),
    )
    kernel = friction_drift
    forms = {
        "force": friction_drift, "level": friction_drift_level, "linear": friction_drift_linear,
        "late": friction_drift_late, "back": friction_drift_back,
    }  # fmt: skip
    says = "friction grows or falls while the stage runs in or warms up"
    equation = (
        "F or yield <- (1 + change q) times it, q = 1 - exp(-t / T), s, s^3 or 4 s (1 - s), s = min(t / T, 1)"
    )
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30(7), run-in and temperature"
    signature = "residual force with the sign of motion whose size changes along the recording"
    experiment = "the same stroke at the beginning, in the middle and at the end of a long run"
    example = {"change": 0.4, "time_constant": 3.0}
    neutral = {"change": 0.0}
    linear = ("change",)
    order = 20


@register
class StictionAgeing(Effect):
    """Grows with the logarithm of time at rest.

    The age of the contacts grows with time and is lost over the sliding `distance` (the ageing law of rate
    and state friction); the yield level grows by `growth` for each e-fold of 1 + age / onset. Sliding at
    speed v keeps the age at distance / v, next to nothing but for the slowest motion. With `stiffening` 0
    what sticks holds more before it slides, with 1 the whole force grows, also at rest.
    """

    name = "stiction-ageing"
    place = Place.FRICTION
    parameters = (
        Parameter("growth", "1", 0.0, 10.0, "relative rise for each e-fold of time at rest"),
        Parameter("distance", "m", 0.0, 1e3, "sliding over which it fades to 1/e", open_low=True),
        Parameter("onset", "s", 0.0, 1e3, "time at rest from which on it grows", FRESH, open_low=True),
        *GROWTH,
    )
    kernel = stiction_ageing
    says = "friction at break-away grows with the logarithm of the time at rest, and fades as sliding begins"
    equation = "dage/dt = 1 - |v| age / distance,  yield <- yield (1 + growth ln(1 + age / onset))"
    source = "Dieterich (1979), J. Geophysical Research 84(B5); Ruina (1983), J. Geophysical Research 88(B12)"
    signature = "residual peaks at break-away that are higher the longer the rest before"
    experiment = "starts from rest after waiting times spaced logarithmically"
    example = {"growth": 0.1, "distance": 1e-5}
    neutral = {"growth": 0.0}
    linear = ("growth",)
    search_grid = {"onset": (FRESH,), "following": (0.0, 1.0)}
    order = 20
    states = 2


@register
class Creep(Effect):
    """Position goes on moving under constant force.

    The contacts carry a Kelvin-Voigt body in series: under a force F they yield, with the time constant, by a
    `fraction` of their elastic deflection F / k at the stiffness of everything sticking. In sliding the crept
    displacement stands still and the level is unchanged. It needs a friction model in the stage.
    """

    name = "creep"
    place = Place.FRICTION
    parameters = (
        Parameter("fraction", "1", 0.0, 10.0, "crept over elastic deflection in the end"),
        Parameter("time_constant", "s", 0.0, 1e7, "with which it comes", open_low=True),
    )
    kernel = creep
    says = "under constant force the contacts go on giving way, by a share of their deflection"
    equation = "T dc/dt = fraction F / k - c,  z = x - c"
    source = "Krejci, Kuhnen (2001), IEE Proc. Control Theory and Applications 148(3), creep operators"
    signature = "position at rest that moves on, or friction at rest that falls, after each stop"
    experiment = "small steps of force inside presliding, each held for several time constants"
    example = {"fraction": 0.4, "time_constant": 0.05}
    neutral = {"fraction": 0.0}
    linear = ("fraction",)
    whole_friction = True
    order = 30
    states = 1
