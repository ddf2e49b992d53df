"""The ledger: drive force on one side, what the motion needed on the other, as a linear system.

    drive(t) = m a + c v + micro(t) + sum_i k_i z_i(t) + extra columns

`z_i` are unit stop elements on a grid of reaches around the believed ones, so that any virgin curve is in
reach of the fit and a mistuned friction is not taken for missing physics. Effects are run by the kernels
of the catalogue along the recorded motion: what changes friction changes the columns z_i, what adds a
force adds a column, what changes the drive changes the left side, what changes the sensor changes the motion.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rtcomp.diagnosis.bank import units_along
from rtcomp.diagnosis.blocks import Blocks
from rtcomp.diagnosis.motion import BLOCKS, Motion, Strip
from rtcomp.diagnosis.path import Load, behind_play, derivatives, kinematics
from rtcomp.diagnosis.remembered import Memory
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place
from rtcomp.physics.closing import ClosingBranches
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.balance import around_rows, forces, parts_of_drive
from rtcomp.stage.stage import Stage

MASS, VISCOUS, MICRO, BIAS = "mass", "viscous", "micro_damping", "bias"
BIASES = ("constant-force", "gravity", "drive-offset")
GRID = 20
"""Reaches of the grid where the believed friction is not a short list of elements."""


WHOLE = ("load-dependent-friction", "creep", "non-congruent-friction", ClosingBranches.name)
"""Modifiers that ask for the whole of friction, so that its weights change what its units do."""
HUNG = ("inertia", "resonance")
"""What the moving mass is, and what of it hangs on a spring."""


@dataclass(frozen=True)
class System:
    """``y = A c`` on the kept rows, with the names of the columns."""

    y: Floats
    columns: Floats
    names: tuple[str, ...]
    blocks: Blocks


@dataclass(frozen=True)
class Play:
    """A play at work, and how much heavier than the refitted base all is that moves, where that is named."""

    effect: Effect
    heavier: float

    @classmethod
    def of(cls, effects: Sequence[Effect], mass: float) -> Play | None:
        """Return the play among `effects` (not what is believed of the base, `mass`), None where none is."""
        play = next((e for e in effects if e.name == "backlash" and e.values["gap"] > 0.0), None)
        named = next((e.values["mass"] for e in effects if e.name == "inertia"), mass)
        return None if play is None else cls(play, named / mass)

    @property
    def share(self) -> float:
        """Mass behind the play over that of the refitted base."""
        return self.effect.values["share"] * self.heavier

    @property
    def key(self) -> Hashable:
        """What it is remembered by."""
        return (_key([self.effect]), self.heavier)


@dataclass
class Ledger:
    """Builds systems for one stage and motion; remembers what does not change."""

    stage: Stage
    motion: Motion
    reaches: Floats
    known: list[Effect] = field(default_factory=list)
    """Effects of the believed stage beside its base."""
    memory: Memory = field(default_factory=Memory)
    """What ledgers of this stage and motion share."""
    carried: Floats | None = None
    """Mass (kg), viscous and micro-damping (N s/m) found, as the weights were, with a play at work: then its
    load carries these, else what is believed."""

    def __post_init__(self) -> None:
        self.block = self.motion.block()
        sensor = self.stage.sensor
        self.grain = 1.5 * sensor.noise + 0.5 * sensor.resolution
        self.seen = np.ones(BLOCKS, dtype=np.bool_)
        self.seen[list(self.motion.unseen)] = False
        self.weights = believed_weights(self.stage, self.reaches)
        self._plain: System | None = None

    def weigh(self, weights: Floats) -> None:
        """Take `weights` (N/m) of the stop elements for the friction at hand, where effects ask for it."""
        self.weights = np.ascontiguousarray(weights)

    @property
    def biased(self) -> bool:
        """Whether the believed stage has a constant force or offset."""
        return any(e.get("name") in BIASES for e in self.stage.mechanics.effects)

    def system(self, effects: Sequence[Effect] = (), adders: Sequence[Effect] = ()) -> System:
        """Return the system with `effects` at work, and one more column for each of `adders` (unit size)."""
        effects = [*self.known, *effects]
        if effects or self._plain is None:
            made = self._make(effects)
            if not effects:
                self._plain = made
        else:
            made = self._plain
        if not adders:
            return made
        more = np.column_stack([self.added(a, effects) for a in adders])
        columns = np.column_stack([made.columns, more])
        names = (*made.names, *(a.name for a in adders))
        return System(made.y, columns, names, Blocks.of(columns, made.y, self.block, BLOCKS))

    def extended(self, made: System, names: Sequence[str], more: Floats) -> System:
        """Return `made` with further columns `more` (n, q)."""
        blocks = made.blocks.extended(made.columns, more, made.y, self.block)
        columns = np.column_stack([made.columns, more])
        return System(made.y, columns, (*made.names, *names), blocks)

    def added(self, effect: Effect, sensors: Sequence[Effect] = ()) -> Floats:
        """Return the force (N, kept rows) that the motion needs for `effect` alone: a column."""
        rows = []
        for strip in self.motion.strips:
            x, v, a = kinematics(strip, self.motion, sensors)
            held = np.append(strip.voltage[:1], strip.voltage[:-1])
            # Drag that depends on speed follows it as late as all friction does.
            chain = [*(e for e in sensors if e.name == "frictional-lag"), effect]
            f = forces(self.stage, chain, strip.time, x, v, a, strip.voltage)
            g = forces(self.stage, chain, strip.time, x, v, a, held) if effect.place is Place.DRIVE else f
            rows.append(f.friction - f.push - 0.5 * (f.drive + g.drive))
        return self.motion.smooth(rows)

    def _make(self, effects: Sequence[Effect]) -> System:
        drive = [e for e in effects if e.place is Place.DRIVE]
        modifiers = [e for e in effects if e.place is Place.FRICTION]
        modifiers += [companion for e in modifiers for companion in e.companions()]
        sensors = [e for e in effects if e.place is Place.SENSOR]
        others = [e for e in effects if e.place in (Place.MECHANICS, Place.DISTURBANCE)]
        play = Play.of(others, self.stage.mass)
        hung = sorted((e for e in others if e.name in HUNG), key=lambda e: e.order)
        if not any(e.name == "resonance" for e in hung):
            hung = []
        others = [e for e in others if e.name not in ("backlash", "resonance")]
        before: list[Effect] = []
        if any(e.name == "load-dependent-friction" for e in modifiers):
            before = [*self._drive(), *drive]
            if any(e.values.get("external") for e in modifiers):
                before += others
        paths = self._kinematics(sensors)
        sides, masses = [], []
        given = self._driven(drive, sensors)
        for i, (strip, (x, v, a)) in enumerate(zip(self.motion.strips, paths, strict=True)):
            side, moved = given[i], a
            if modifiers or others:
                f = forces(self.stage, [*modifiers, *others], strip.time, x, v, a, strip.voltage)
                side, moved = side + around_rows(f.push - f.friction), a * f.mass / self.stage.mass
            if hung:
                # Part of the mass, whatever it is refitted to: what hangs on it pushes in proportion.
                f = forces(self.stage, hung, strip.time, x, v, a, strip.voltage)
                moved = (a * f.mass - around_rows(f.push)) / self.stage.mass
            if play is not None:
                rest = derivatives(self._behind(sensors, play)[i], self.motion.period)[1]
                moved = moved + play.share * (rest - a)
            sides.append(side)
            masses.append(moved)
        columns = [self.motion.smooth(masses), self._friction(before, modifiers, sensors, play)]
        names = (MASS, VISCOUS, MICRO, *(f"reach {r:.3g}" for r in self.reaches))
        y = self.motion.smooth(sides)
        if self.biased:
            # A believed bias is a number like the others: it is refitted with them.
            names = (*names, BIAS)
            columns.append(-np.ones_like(y))
        table = np.column_stack(columns)
        return System(y, table, names, Blocks.of(table, y, self.block, BLOCKS))

    def _kinematics(self, sensors: Sequence[Effect]) -> list[tuple[Floats, Floats, Floats]]:
        """Return true position, velocity and acceleration of each strip."""
        return self.memory.paths.of(
            _key(sensors), lambda: [kinematics(strip, self.motion, sensors) for strip in self.motion.strips]
        )

    def _behind(self, sensors: Sequence[Effect], play: Play) -> list[Floats]:
        """Return the position (m) of the load behind a play along each strip."""
        found = () if self.carried is None else (self.carried.tobytes(),)
        own = self._believes_load() is None and (self.weights.tobytes(), self.reaches.tobytes(), *found)
        return self.memory.loads.of(
            (_key(sensors), play.key, own),
            lambda: [self._drawn(x, play) for x, _, _ in self._kinematics(sensors)],
        )

    def _believes_load(self) -> tuple[Floats, Floats] | None:
        """Return the believed stiffnesses and reaches where they hold for the load, else None: those at hand.

        As believed: a play that is not yet in the balance is taken for longer reaches.
        """
        friction = self.stage.friction
        if not isinstance(friction, MaxwellSlip) or self.carried is not None:
            return None
        stiffnesses, reaches = zip(*friction.elements, strict=True)
        return np.array(stiffnesses), np.array(reaches)

    def _drawn(self, x: Floats, play: Play) -> Floats:
        m = self.stage.mechanics
        weights, reaches = self._believes_load() or (self.weights, self.reaches)
        numbers = (m.mass, m.viscous, m.micro_damping) if self.carried is None else self.carried
        mass, viscous, micro = map(float, numbers)
        load = Load(play.share * mass, viscous, micro, m.micro_damping_speed, weights, reaches)
        values = play.effect.values
        return behind_play(x, self.motion.period, values["gap"], values["contact"], load)

    def _friction(
        self,
        before: Sequence[Effect],
        modifiers: Sequence[Effect],
        sensors: Sequence[Effect],
        play: Play | None,
    ) -> Floats:
        """Return the units of friction on the kept rows."""

        def found() -> Floats:
            rows = []
            for i, (strip, path) in enumerate(
                zip(self.motion.strips, self._kinematics(sensors), strict=True)
            ):
                x, v, a = path
                if play is not None:
                    x = self._behind(sensors, play)[i]
                    v, a = derivatives(x, self.motion.period)
                held = np.append(strip.voltage[:1], strip.voltage[:-1])
                motion = np.column_stack([strip.time, x, v, a, held])
                rows.append(
                    units_along(self.stage, before, modifiers, self.reaches, self.weights, motion, self.grain)
                )
            return self.motion.smooth(rows)

        weighs = play is not None or any(e.name in WHOLE for e in modifiers)
        behind = play is not None and (play.key, self.carried is not None and self.carried.tobytes())
        own = self.reaches.tobytes(), weighs and self.weights.tobytes()
        return self.memory.frictions.of((_key(before), _key(modifiers), _key(sensors), behind, own), found)

    def _driven(self, drive: Sequence[Effect], sensors: Sequence[Effect]) -> list[Floats]:
        """Return the force of the drive (N) around the rows of each strip."""

        def found() -> list[Floats]:
            paths = zip(self.motion.strips, self._kinematics(sensors), strict=True)
            return [self._given(strip, drive, *path) for strip, path in paths]

        return self.memory.drives.of((_key(drive), _key(sensors)), found)

    def _given(self, strip: Strip, drive: Sequence[Effect], x: Floats, v: Floats, a: Floats) -> Floats:
        chain = sorted([*self._drive(), *drive], key=lambda e: e.order)
        held = np.append(strip.voltage[:1], strip.voltage[:-1])
        # What remembers, or depends on position, changes within a row; the mean over the row is what moved.
        f = forces(self.stage, chain, strip.time, x, v, a, held, parts=parts_of_drive(chain))
        return 0.5 * (f.drive + np.append(f.drive[1:], f.drive[-1:])) + around_rows(f.push)

    def _drive(self) -> list[Effect]:
        chain = [e for e in self.stage.chain if e.place is Place.DRIVE]
        return [e for e in chain if not any(e is k for k in self.known)]


def _key(effects: Sequence[Effect]) -> Hashable:
    return tuple(repr(e.to_dict()) for e in effects)


def believed_weights(stage: Stage, reaches: Floats) -> Floats:
    """Return the believed friction as stiffnesses (N/m) of stop elements of these reaches (m)."""
    friction = stage.friction
    weights = np.zeros(reaches.size)
    if isinstance(friction, MaxwellSlip):
        for k, r in friction.elements:
            at = int(np.argmin(np.abs(np.log(reaches / r))))
            weights[at] += k * r / reaches[at]
    else:
        weights[:] = 1.0 / reaches.size
    return weights


def grid_of(stage: Stage, scale: float = 1.0) -> Floats:
    """Return reaches (m) for the base: the believed ones, between and around them, times `scale`."""
    friction = stage.friction
    if isinstance(friction, MaxwellSlip) and len(friction.elements) <= 10:
        own = np.unique([r for _, r in friction.elements])
        between = np.sqrt(own[1:] * own[:-1])
        return np.sort(np.concatenate([[0.6 * own[0]], own, between, [1.4 * own[-1]]])) * scale
    if isinstance(friction, MaxwellSlip):
        reach = [r for _, r in friction.elements]
        return np.geomspace(0.7 * min(reach), 1.4 * max(reach), GRID) * scale
    return np.geomspace(1e-7, 1e-4, GRID) * scale
