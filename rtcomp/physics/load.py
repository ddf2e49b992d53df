"""Friction that depends on the load that the drive transmits."""

from __future__ import annotations

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.growing import GROWTH, grow
from rtcomp.physics.wires import DRIVE, GRIP_LEVEL, PUSH


@effect_kernel
def load_dependent_friction(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (1), external (1), stiffening (1), following (1)."""
    if w[GRIP_LEVEL] > 0.0:
        factor = 1.0 + abs(p[0] * w[DRIVE] - p[1] * w[PUSH]) / w[GRIP_LEVEL]
        grow(w, factor, factor, p[2], p[3])


@effect_kernel
def load_quadratic(p: Floats, s: Floats, w: Floats) -> None:
    """As `load_dependent_friction`, with the square of the load over the level."""
    if w[GRIP_LEVEL] > 0.0:
        load = p[0] * w[DRIVE] * abs(w[DRIVE]) - p[1] * w[PUSH] * abs(w[PUSH])
        factor = 1.0 + abs(load) / w[GRIP_LEVEL] ** 2
        grow(w, factor, factor, p[2], p[3])


@register
class LoadDependentFriction(Effect):
    """Friction grows with the transmitted load.

    The load is the size of the drive's force, which carries weight and inertia as well. The sliding level
    grows by `coefficient` times it, in the form `quadratic` times its square over the level; with
    `stiffening` 0 at equal stiffness: while all sticks a changing load changes no force, and elements beyond
    a falling level slip back to it. With 1 the whole force grows. A gear is loaded from its other side too:
    weight and springs, which hold against the drive, add `external` times theirs. It needs a friction model
    in the stage; the level, where it falls with speed, is that of the step before.
    """

    name = "load-dependent-friction"
    place = Place.FRICTION
    parameters = (
        Parameter("coefficient", "1", 0.0, 10.0, "friction force over the force of the drive"),
        Parameter("external", "1", 0.0, 10.0, "the same over weight, springs and other forces", 0.0),
        *GROWTH,
    )
    kernel = load_dependent_friction
    forms = {"linear": load_dependent_friction, "quadratic": load_quadratic}
    says = "friction grows with the force that the drive transmits, as in gears and screws"
    equation = "level <- level + |c F_drive - e F_push|, or of signed squares of both, over the level"
    source = "Duclusaud, Passault, Padois, Ly (2024), arXiv 2410.08650, load-dependent friction"
    signature = "residual force with the sign of motion whose size is in proportion to the command's"
    experiment = "the same stroke at several loads, or accelerating and coasting"
    example = {"coefficient": 0.05}
    neutral = {"coefficient": 0.0, "external": 0.0}
    linear = ("coefficient",)
    search_grid = {"stiffening": (0.0, 1.0)}
    whole_friction = True
    order = 20

    def least_parts(self) -> int:
        """Return 4: the level jumps with the command, and the mean over a row is half a part late."""
        return 4
