"""The shape of presliding branches: differing by direction, or by the force at which they begin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.closing import ASYMMETRY, SOFTENING, ClosingBranches
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.softening import softened
from rtcomp.physics.wires import FRICTION, GRAIN, GRIP, GRIP_LEVEL, MOVED, REACH, SCALE, SOFTENS


@effect_kernel
def asymmetric_friction(p: Floats, s: Floats, w: Floats) -> None:
    """p: asymmetry (1), closing (1).

    s: place (m) within the sensor's grain, inside which motion has no direction.
    """
    if p[1] > 0.0:
        return
    inside = s[0] + w[MOVED]
    s[0] = min(max(inside, -w[GRAIN]), w[GRAIN])
    w[MOVED] += p[0] * abs(inside - s[0])


@effect_kernel
def non_congruent_friction(p: Floats, s: Floats, w: Floats) -> None:
    """p: softening (1)."""
    level = w[GRIP_LEVEL] * w[REACH] * w[SCALE]
    if level > 0.0:
        bent = softened(w[GRIP], level, p[0])
        w[FRICTION] += bent - w[GRIP]
        w[GRIP] = bent


@effect_kernel
def non_congruent_elements(p: Floats, s: Floats, w: Floats) -> None:
    """p: softening (1)."""
    w[SOFTENS] = p[0]


@effect_kernel
def non_congruent_branches(p: Floats, s: Floats, w: Floats) -> None:
    """p: softening (1), which the companion bends branches by."""


@register
class AsymmetricFriction(Effect):
    """Presliding that is stiffer forward than backward, up to the same level: of two kinds.

    With `closing` 0 stop elements are stiffer when loaded forward, at equal yield force: the friction model
    sees displacements (1 + asymmetry) times as long forward and (1 - asymmetry) times backward; so the
    levels of sliding are alike (a difference of those is `constant-force`, from which no motion that slides
    both ways can tell it), and every model takes part.

    An element's loop that yields on both sides, or on the stiffer one, closes and dissipates. One that yields
    on neither moves towards the stiffer side, by 2 k asymmetry for each unit of its travel there and back,
    until it yields there and its loop closes too. This ratcheting is bounded by the yield force, but while it
    lasts it is not passive. Reversals within GRAIN, the noise of a recorded position, have no direction, so
    that noise does not ratchet.

    With `closing` 1 the branches as such differ: how far one has come from its reversal to where it leads is
    bent, so that it begins 1 + asymmetry times as steep forward, 1 - asymmetry backward, and every loop
    closes (`ClosingBranches`). Loops that stay small are then next to symmetric. Loops that slide on
    neither side tell the two apart best.
    """

    name = "asymmetric-friction"
    place = Place.FRICTION
    parameters = (
        ASYMMETRY,
        Parameter(
            "closing",
            "1",
            0.0,
            1.0,
            "1: every loop closes, 0: small ones move to the stiffer side",
            0.0,
            choice=True,
        ),
    )
    kernel = asymmetric_friction
    says = "presliding is stiffer in one direction than in the other, up to the same level"
    equation = "dz = (1 + asymmetry sgn(dx)) dx"
    source = "Al Janaideh, Rakheja, Su (2011), IEEE/ASME Trans. Mechatronics 16(4), asymmetric hysteresis"
    signature = "residual force after reversals, alike in sign after both, gone once everything slides"
    experiment = "loops of several sizes inside presliding, each repeated"
    example = {"asymmetry": 0.1}
    neutral = {"asymmetry": 0.0}
    linear = ("asymmetry",)
    search_grid = {"closing": (0.0, 1.0)}
    order = 40
    states = 1

    def companions(self) -> list[Effect]:
        """Return what bends the branches, where they close."""
        if self.values["closing"] == 0.0:
            return []
        return [ClosingBranches(asymmetry=self.values["asymmetry"])]


MONOTONE = {"force": 1.0}
"""Largest softening by form with which the bend is monotone, where it must be."""


@register
class NonCongruentFriction(Effect):
    """Equal reversals at different force give loops of different shape.

    In the form `force` the friction model's force F is bent: steeper by 1 + softening at zero force, less
    steep by 1 - softening at its level, where it is unchanged. In the form `elements` so is the force of each
    element of a friction model by its deflection over its reach; a model without elements is one element. In
    the form `branches` a branch that begins at the force F_r is steeper by 1 + softening (1 - |F_r| / level)
    than the model's own, below 0 by 1 - softening |F_r| / level, and leads to where that does
    (`ClosingBranches`).

    A bent output keeps what a memory without drift needs: closed loops stay closed, wiping-out holds, and
    loops dissipate; only congruency is lost. For that the bend of the whole force must be monotone (softening
    at most 1), or small loops close to the level would give energy. An element is a spring that slips at its
    reach: bent in any way, it stores energy while it sticks and loses it while it slips. It needs a friction
    model in the stage; of damping nothing is bent.
    """

    name = "non-congruent-friction"
    place = Place.FRICTION
    parameters = (replace(SOFTENING, high_in=MONOTONE),)
    kernel = non_congruent_friction
    forms = {
        "force": non_congruent_friction,
        "elements": non_congruent_elements,
        "branches": non_congruent_branches,
    }
    says = "contacts are softer the more they carry: loops at high force are flatter than those around zero"
    equation = (
        "F <- F (1 + softening (1 - |F| / level)), or z_i <- z_i (1 + softening (1 - |z_i| / r_i)), "
        "or branches of exponent 1 + softening (1 - |F_r| / level), below 0 1 - softening |F_r| / level"
    )
    source = "Mayergoyz (1991), Mathematical Models of Hysteresis; Kuhnen (2003), European J. Control 9(4)"
    signature = "residual force odd in the friction force, largest at half of its level"
    experiment = "equal small reversals started from different forces"
    example = {"softening": 0.3}
    neutral = {"softening": 0.0}
    linear = ("softening",)
    whole_friction = True
    order = 80

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        if self.form == "elements":  # told to the model before it runs
            self.order, self.whole_friction = 15, False

    def companions(self) -> list[Effect]:
        """Return what bends the branches, in that form."""
        if self.form != "branches":
            return []
        return [ClosingBranches(softening=self.values["softening"])]
