"""Signals along the recordings: drive side, and what the motion needs of mass, friction and each effect.

Unfiltered, one array a segment. Entries that add a force are columns of free size; those that change
friction, drive, sensor or mass are at work while the other columns are made.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cache import Cache, Group, key_of
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.forces.bank import AS_IT_IS, deflections, units_along
from rtcomp.diagnosis.forces.kinematics import Path, acted, second_difference
from rtcomp.diagnosis.forces.led import led_there, way_there
from rtcomp.diagnosis.forces.models import levels
from rtcomp.diagnosis.forces.noise import Noise
from rtcomp.diagnosis.forces.play import Carried, Load, behind_play
from rtcomp.diagnosis.forces.reaches import elements_of, grid, on_grid
from rtcomp.diagnosis.forces.sides import exact
from rtcomp.diagnosis.numerics.spectrum import filtered
from rtcomp.diagnosis.recordings.data import Data, Segment, behind_reading
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place, catalogue
from rtcomp.physics.speed import MicroDamping, ViscousFriction
from rtcomp.stage.balance import around_rows, forces, parts_of_drive
from rtcomp.stage.stage import Stage

BASE = ("mass", "viscous", "micro_damping")
"""Numbers whose columns come first. After them that of the speed of micro-damping, to first order, then
those of a believed model of friction, of the friction units, and a constant force."""
FURTHEST = 0.3
"""Largest change of its logarithm that is taken from one fit."""
SPEED_STEP = 0.02
"""Relative change of the speed of micro-damping to which its damping is looked at."""
GRAINS = 1.5
"""Motion there and back that is noise, in times the noise (rms) that smoothing leaves."""
MORE = 1e-3
"""Relative change of the command to which that of friction is looked at."""


class Signals:
    """What one stage makes of one set of recordings, row by row."""

    def __init__(self, stage: Stage, data: Data, noise: Noise | None = None) -> None:
        self.stage, self.data = stage, data
        self.noise = noise or Noise.of(stage, data)
        share = min(1.0, self.noise.bandwidth / (0.5 * data.rate))
        self.grain = GRAINS * self.noise.rms * float(np.sqrt(share))
        self.coarse = grid(stage, data, self.grain)
        """Yield displacements (m) over all that the recording could show."""
        self.reaches = self.coarse
        self.step = float(np.log(self.reaches[1] / self.reaches[0]))
        """Between yield displacements (logarithm)."""
        believed = [dict(e) for e in stage.mechanics.effects]
        self.believed = [e for e in believed if ent.adds_force(ent.kind_of(e))]
        """Entries of the belief that add a force: their sizes are refitted with the base."""
        self._fixed = exact((ent.build(e) for e in believed if not ent.adds_force(ent.kind_of(e))), data.held)
        self._elements, self.exponent = elements_of(stage)
        self.models = levels(stage)
        self.let_go = np.zeros(0)  # factors of the precisions of believed numbers, see fitting/baseline
        self._cache = Cache()
        m = stage.mechanics
        self.believed_speed = m.micro_damping_speed if m.micro_damping > 0.0 else None
        """Speed (m/s) below which micro-damping is believed to act, None where there is no such belief."""
        self.speed_room = 0.0  # N s/m, up to which its column goes where none is believed: first order ends

    @property
    def believed_reaches(self) -> Floats:
        """Yield displacements (m) that the belief states."""
        return np.unique([r for _, r in self._elements])

    @property
    def size(self) -> int:
        """Columns of the base: mass, damping and its speed, friction, and last a constant force."""
        return int(self.friction.stop) + 1

    @property
    def model(self) -> slice:
        """Column of a believed model of friction, as a factor of it; empty where there is none."""
        return slice(len(BASE) + 1, len(BASE) + 1 + self.models.size)

    @property
    def friction(self) -> slice:
        """Columns of the friction units, in the order of `reaches`."""
        return slice(self.model.stop, self.model.stop + self.reaches.size)

    @property
    def faster(self) -> int:
        """Column of the speed of micro-damping: its coefficient is damping times the change of log speed."""
        return len(BASE)

    def speed_of(self, c: Floats) -> float:
        """Return the speed (m/s) of micro-damping that coefficients `c` of the base tell."""
        now, damping = self.stage.mechanics.micro_damping_speed, float(c[self.faster - 1])
        if damping <= 0.0:
            return now
        change = float(np.clip(c[self.faster] / damping, -FURTHEST, FURTHEST))
        return now * float(np.exp(change))

    def without(self, number: str) -> bool:
        """Tell whether the belief denies a number of the base: it has friction, but none of this kind.

        Then an effect that stands for it may be missing; a belief without friction leaves it open.
        """
        stated = float(getattr(self.stage.mechanics, number))
        named = any(k.stands_for == number and k.searchable for k in catalogue.entries())
        return stated == 0.0 and self.stage.friction is not None and named

    def smooth_for(self, part: float) -> None:
        """Smooth the position as if only `part` of its noise (power) were there."""
        before, self.noise = self.noise.smoother, self.noise.smoothing_for(part)
        shares = self.noise.smoother(np.linspace(0.0, 0.5 * self.data.rate, 1000))
        grain, self.grain = self.grain, GRAINS * self.noise.rms * float(np.sqrt(np.mean(shares**2)))
        if (before, grain) != (self.noise.smoother, self.grain):
            self._cache = Cache()

    def read_noise(self, stage: Stage) -> float:
        """Return the noise (m rms) of a recorded reading, of which rows may be means."""
        return self.noise.rms if self.data.averaged == 1 else Noise.of(stage, self.data.as_recorded()).rms

    def act_early(self, rows: float) -> None:
        """Take a held command to act so many `rows` before its own."""
        self.data = replace(self.data, early=rows)
        self._cache = Cache()

    def damp_below(self, speed: float) -> None:
        """Take `speed` (m/s) as that below which micro-damping acts."""
        self.stage = self.stage.with_changes(stage={"micro_damping_speed": speed})

    def force_of(self, effect: Effect, segment: Segment, path: Path, before: Sequence[Effect] = ()) -> Floats:
        """Return the force (N, (K,)) that the motion needs for an effect that adds one, some `before` it."""
        chain, given = [*before, effect], self.given(segment)
        f = forces(self.stage, chain, segment.time, path.x, path.v, path.a, given, self.grain)
        return np.asarray(-f.others() - around_rows(f.drive))

    def _viscous(self, segment: Segment, path: Path, modifiers: Sequence[Effect]) -> Floats:
        """Return the force (N, (K,)) of viscous friction of size 1, `modifiers` at work on its speed."""
        return self.force_of(ViscousFriction(coefficient=1.0), segment, path, modifiers)

    def _micro(self, segment: Segment, path: Path) -> Floats:
        """Return the force (N, (K, 2)) of micro-damping of size 1, and its derivative by its log speed."""
        speed = self.stage.mechanics.micro_damping_speed
        here, faster = (
            self.force_of(MicroDamping(coefficient=1.0, speed=each), segment, path)
            for each in (speed, (1.0 + SPEED_STEP) * speed)
        )
        return np.column_stack([here, (faster - here) / np.log1p(SPEED_STEP)])

    def paths(self, sensors: Sequence[Effect] = ()) -> list[Path]:
        """Return the motion of every segment, what `sensors` did to the reading undone."""
        return self._cache.of(
            ("paths", key_of(sensors)), lambda: [self._path(s, sensors) for s in self.data.segments]
        )

    def _path(self, segment: Segment, sensors: Sequence[Effect], *, smooth: bool = True) -> Path:
        rate = self.data.rate
        x = behind_reading(segment, sensors)
        slow = filtered(x, rate, self.noise.smoother) if smooth else x
        if self.data.held:
            measured = second_difference(x, rate)
            v = filtered(x, rate, self.noise.smoother, derivative=True)
        else:
            v = filtered(x, rate, _all, derivative=True)
            measured = around_rows(filtered(v, rate, _all, derivative=True))
            v = filtered(v, rate, self.noise.smoother)
        return Path(slow, v, second_difference(slow, rate), measured)

    def given(self, segment: Segment) -> Floats:
        """Return the command (V, (K,)) that acts up to each row."""
        u = segment.voltage
        return np.append(u[:1], u[:-1]) if self.data.held else u

    def _drive_side(self, drive: Sequence[Effect], sensors: Sequence[Effect]) -> list[Floats]:
        own = [e for e in self.stage.chain if e.place is Place.DRIVE and e.name not in {b["name"] for b in
               self.stage.mechanics.effects}]  # fmt: skip
        chain = sorted([*own, *drive], key=lambda e: e.order)
        found = []
        for s, p in zip(self.data.segments, self.paths(sensors), strict=True):
            parts = parts_of_drive(chain) if self.data.held else 1
            f = forces(self.stage, chain, s.time, p.x, p.v, p.a, self.given(s), parts=parts)
            found.append(acted(f, s, self.data, self.stage.force_constant) + around_rows(f.push))
        return found

    def _base(
        self,
        drive: Sequence[Effect],
        sensors: Sequence[Effect],
        modifiers: Sequence[Effect],
        bodies: Sequence[Effect],
        adding: Sequence[Effect],
        carried: Carried | None,
        weights: Floats | None,
        larger: tuple[float, float],
    ) -> tuple[list[Group], Group | None]:
        """Return the base's columns (mass; damping; units of friction; a constant force), the load's.

        The last is how much the friction at hand changes with the command, relative to it.
        """
        whole = any(e.whole_friction for e in modifiers)
        others = sorted((e for e in bodies if not e.behind), key=lambda e: (e.place, e.order))
        second_masses = [e for e in others if e.moving_mass]
        on_load = [e for e in others if not e.moving_mass]
        own = (weights.tobytes(), larger) if weights is not None and whole else ()
        before: list[Effect] = []
        if any(e.values.get("external") is not None for e in modifiers):
            chain = [e for e in exact(self.stage.chain, self.data.held) if e.place is Place.DRIVE]
            before = [*chain, *(e for e in drive if e not in chain)]
            if any(e.values.get("external") for e in modifiers):
                before += [e for e in adding if e.place in (Place.MECHANICS, Place.DISTURBANCE)]
        behind = carried.key if carried is not None else ()

        def driven() -> list[Path]:
            return self.driven(sensors, carried)

        def mass() -> list[Floats]:
            found = []
            for s, p, load in zip(self.data.segments, self.paths(sensors), driven(), strict=True):
                a = p.measured
                for some, path in ((second_masses, p), (on_load, load)):
                    if some:
                        moving, push = led_there(self.stage, some, s, path, sensors)
                        a = (a * moving - push) / self.stage.mass
                if carried is not None:
                    a = a + carried.play.values["share"] * (load.a - p.a)
                found.append(a)
            return found

        def along(made: Callable[[Segment, Path], Floats]) -> list[Floats]:
            return [made(s, path) for s, path in zip(self.data.segments, driven(), strict=True)]

        def units(
            more: float = 0.0, some: np.ndarray | None = None, times: Floats | None = None
        ) -> list[Floats]:
            def one(s: Segment, path: Path) -> Floats:
                pushed = replace(s, voltage=(1.0 + more) * s.voltage) if more else s
                start, at_hand = self._start(s, sensors), weights if whole else None
                return self._units(pushed, path, start, before, modifiers, at_hand, some, times, larger)

            return along(one)

        def of_sizes(sizes: Floats) -> list[Floats]:
            some = sizes[stops:] != 0.0
            if whole:
                some |= held != 0.0
            whole_of_it = np.append(sizes[:stops], 1.0)
            return [table @ whole_of_it for table in units(some=some, times=sizes[stops:])]

        def by_load() -> list[Floats]:
            some = held != 0.0
            pairs = zip(units(MORE, some, held), units(0.0, some, held), strict=True)
            return [(more - plain).sum(axis=1) / MORE for more, plain in pairs]

        stops = self.models.size
        held = self.weights if weights is None else weights
        at, speed = (key_of(sensors), behind), self.stage.mechanics.micro_damping_speed
        key = (key_of(before), key_of(modifiers), *at, own)
        turned = sorted((e for e in modifiers if ent.changes_speed(type(e))), key=lambda e: e.order)
        columns = [
            Group(("mass", key_of(others), *at), mass),
            Group(("viscous", key_of(turned), *at), lambda: along(lambda s, p: self._viscous(s, p, turned))),
            Group(("micro", speed, *at), lambda: along(self._micro), width=2),
            Group(("units", *key), units, of_sizes, stops + self.reaches.size),
            Group(("offset",), lambda: [np.ones(s.time.size) for s in self.data.segments]),
        ]
        return columns, Group(("by load", held.tobytes(), *key), by_load) if before else None

    def driven(self, sensors: Sequence[Effect], carried: Carried | None) -> list[Path]:
        """Return the motion of the load behind a play along each segment; without one, that of the axis."""
        if carried is None:
            return self.paths(sensors)
        m, play, pushes = self.stage.mechanics, carried.play.values, carried.pushes
        load = Load(
            play["share"] * m.mass, m.viscous, m.micro_damping, m.micro_damping_speed, carried.weights,
            self.reaches, self.exponent,
        )  # fmt: skip

        def path(s: Segment, p: Path) -> Path:
            start = float(s.time[0])
            y = behind_play(p.x, self.data.period, play["gap"], play["contact"], load, pushes, start)
            return Path(y, np.gradient(y, self.data.period), second_difference(y, self.data.rate), p.measured)

        pairs = list(zip(self.data.segments, self.paths(sensors), strict=True))
        return self._cache.of(
            ("driven", key_of(sensors), carried.key), lambda: [path(s, p) for s, p in pairs]
        )

    @property
    def weights(self) -> Floats:
        """Believed friction as stiffnesses (N/m) of the units."""
        return on_grid(self._elements, self.reaches)

    def _units(
        self,
        segment: Segment,
        path: Path,
        start: Floats,
        before: Sequence[Effect],
        modifiers: Sequence[Effect],
        weights: Floats | None,
        some: np.ndarray | None = None,
        times: Floats | None = None,
        larger: tuple[float, float] = AS_IT_IS,
    ) -> Floats:
        """Return the force (N, (K, p)) around rows of friction units, all or `some`, or their sum by `times`.

        `start` (m) are deflections of all units before the motion.
        """
        motion = np.column_stack([segment.time, path.x, path.v, path.a, self.given(segment)])
        held, reaches = self.weights if weights is None else weights, self.reaches
        if some is not None:
            held, reaches, start = held[some], reaches[some], start[some]
            times = times[some] if times is not None else None
        return units_along(
            self.stage, list(before), list(modifiers), reaches, held, np.ascontiguousarray(motion),
            self.grain, start, times, larger, self.exponent,
        )  # fmt: skip

    def _start(self, segment: Segment, sensors: Sequence[Effect]) -> Floats:
        """Return the deflections (m) of the friction units at the first row of a segment."""

        def made() -> list[Floats]:
            way = way_there(segment, sensors)
            return [
                np.zeros(self.reaches.size)
                if way is None
                else deflections(way[1], self.reaches, self.exponent, self.grain)
            ]

        key = ("start", float(segment.time[0]), segment.time.size, key_of(sensors))
        return np.asarray(self._cache.of(key, made)[0])

    def _added(self, entry: Entry, sensors: Sequence[Effect], carried: Carried | None) -> Group:
        """Return the force that the motion needs for an entry that adds one: behind a play, on the load."""
        effect = ent.build(entry)
        load = carried if effect.place is not Place.DRIVE else None

        def made() -> list[Floats]:
            pairs = zip(self.data.segments, self.driven(sensors, load), strict=True)
            return [self.force_of(effect, s, p) for s, p in pairs]

        return Group(("added", key_of([effect]), key_of(sensors), load.key if load is not None else ()), made)


def _all(frequency: Floats) -> Floats:
    return np.ones_like(frequency)
