"""The force balance as a linear system: drive force on one side, what the motion needs on the other.

    drive(t) = m a + c v + micro(t) + sum_i k_i z_i(t) + forces of entries        (equation error)

z_i are unit stop elements on a grid of yield displacements, so that any virgin curve is within reach of the
fit. Entries that add a force are columns of free size; those that change friction, drive, sensor or mass are
at work while the other columns are made. Both sides go through the same filter, which weighs each frequency
by how far the motion stands above the sensor's noise (`noise.Whitening`).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rtcomp.diagnosis.bank import units_along
from rtcomp.diagnosis.path import Load, behind_play
from rtcomp.diagnosis.second import entries as ent
from rtcomp.diagnosis.second.data import Data, Segment, reversals
from rtcomp.diagnosis.second.entries import Entry
from rtcomp.diagnosis.second.noise import Noise, Whitening
from rtcomp.diagnosis.second.settings import BLOCK_REVERSALS, BLOCK_SECONDS, RESERVED_EVERY
from rtcomp.diagnosis.second.spectrum import filtered
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place, catalogue
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.balance import around_rows, forces, parts_of_drive
from rtcomp.stage.sensed import true_position
from rtcomp.stage.stage import Stage

GRID = 22
"""Yield displacements of the coarse friction grid, from the sensor's grain to an eighth of the stroke."""
MOST_OWN = 10
"""Believed yield displacements up to which they are taken into the grid as they are."""
FEWEST, MOST = 10, 25
"""Blocks of a recording: at least, at most."""
BASE = ("mass", "viscous", "micro_damping")
"""Columns before those of the friction units."""
MORE = 1e-3
"""Relative change of the command to which that of friction is looked at."""
KEPT = 3 * 10**8
"""Bytes of columns that are kept for the next evaluation."""


@dataclass(frozen=True)
class Path:
    """The motion behind a segment, all (K,): true position smoothed (m), velocity, acceleration of both."""

    x: Floats
    v: Floats
    a: Floats
    measured: Floats
    """Acceleration (m/s^2) of the position as measured, as the balance compares it."""


@dataclass(frozen=True)
class System:
    """``y = A c`` in whitened units: y (n,), columns (p, n); numbers of entries' columns by entry."""

    y: Floats
    columns: Floats
    of_entry: tuple[slice, ...]


class Cache:
    """Arrays by key, the least recently used dropped beyond so many bytes; threads may share it."""

    def __init__(self, most: int) -> None:
        self._most, self._lock, self._size = most, threading.Lock(), 0
        self._found: dict[Hashable, list[Any]] = {}

    def get(self, key: Hashable) -> list[Any] | None:
        """Return what is kept for a key, None where nothing is."""
        with self._lock:
            if key in self._found:
                self._found[key] = value = self._found.pop(key)
                return value
        return None

    def of(self, key: Hashable, make: Callable[[], list[Any]]) -> list[Any]:
        """Return what `make` gave for `key` before, or gives now."""
        kept = self.get(key)
        if kept is not None:
            return kept
        value = make()
        with self._lock:
            if key not in self._found:
                self._found[key] = value
                self._size += _bytes(value)
            while self._size > self._most and len(self._found) > 1:
                self._size -= _bytes(self._found.pop(next(iter(self._found))))
        return value


def _bytes(value: list[Any]) -> int:
    arrays = [[v] if isinstance(v, np.ndarray) else [v.x, v.v, v.a, v.measured] for v in value]
    return sum(int(a.nbytes) for part in arrays for a in part)


@dataclass(frozen=True)
class _Group:
    """Columns that belong together: their key, and how they are made, (K, p) or (K,) for each segment."""

    key: Hashable
    make: Callable[[], list[Floats]]


class ForceBalance:
    """The equation-error objective of one stage on one set of recordings."""

    def __init__(self, stage: Stage, data: Data, noise: Noise | None = None) -> None:
        self.stage, self.data = stage, data
        self.noise = noise or Noise.of(stage, data)
        share = min(1.0, self.noise.bandwidth / (0.5 * data.rate))
        self.grain = 1.5 * self.noise.rms * float(np.sqrt(share))
        self.coarse = _grid(stage, data, self.grain)
        """Yield displacements (m) over all that the recording could show."""
        self.reaches = self.coarse
        self.step = float(np.log(self.reaches[1] / self.reaches[0]))
        """Between yield displacements (logarithm)."""
        believed = [dict(e) for e in stage.mechanics.effects]
        self.believed = [e for e in believed if _refitted(e)]
        """Entries of the belief that add a force: their sizes are refitted with the base."""
        self._fixed = [ent.build(e) for e in believed if not _refitted(e)]
        self._cache = Cache(KEPT)
        self._whitening: Whitening | None = None
        self.blocks = 0
        self.noise_power = 0.0
        """N^2: mean square of what the sensor's noise makes of the residual below the motion's bandwidth."""
        self.block: np.ndarray = np.zeros(0, dtype=np.int64)

    @property
    def believed_reaches(self) -> Floats:
        """Yield displacements (m) that the belief states."""
        friction = self.stage.friction
        return np.unique([r for _, r in friction.elements] if isinstance(friction, MaxwellSlip) else [])

    @property
    def size(self) -> int:
        """Columns of the base: mass, damping, friction units, and last a constant force."""
        return len(BASE) + self.reaches.size + 1

    @property
    def friction(self) -> slice:
        """Columns of the friction units, in the order of `reaches`."""
        return slice(len(BASE), len(BASE) + self.reaches.size)

    @property
    def biased(self) -> bool:
        """Tell whether the belief has a constant force, which is refitted."""
        return any(ent.kind_of(e).bias for e in self.believed)

    def without(self, number: str) -> bool:
        """Tell whether the belief denies a number of the base: it has friction, but none of this kind.

        Then an effect that stands for it may be missing; a belief without friction leaves it open.
        """
        stated = float(getattr(self.stage.mechanics, number))
        named = any(k.stands_for == number and k.searchable for k in catalogue.entries())
        return stated == 0.0 and self.stage.friction is not None and named

    def whiten(self, coefficients: Floats) -> None:
        """Weigh frequencies by what the sensor's noise does to the residual of a fit (base columns)."""
        random = np.random.default_rng(7)
        shaken = []
        for s in self.data.segments:
            read = replace(s, position=s.position + self.noise.rms * random.standard_normal(s.position.size))
            change = self._needed(s, coefficients) - self._needed(read, coefficients)
            edge = min(50, change.size // 4)
            shaken.append(change[edge:-edge])
        self._whitening = Whitening.of(self.noise, self.data, shaken)
        below = [filtered(s, self.data.rate, self.noise.wiener) for s in shaken]
        self.noise_power = float(np.mean(np.concatenate(below) ** 2))
        self._cache = Cache(KEPT)
        self._cut_blocks()

    def put(self, reaches: Floats, step: float) -> None:
        """Put the grid of yield displacements (m) to `reaches`, in steps of `step` (logarithm)."""
        own = self.believed_reaches if self.believed_reaches.size <= MOST_OWN else np.zeros(0)
        self.reaches = _joined(own[own <= self.coarse[-1]], np.unique(reaches), step)
        self.step = step
        self._cache = Cache(KEPT)

    def on(self, data: Data) -> ForceBalance:
        """Return the same objective, weights and grid on other data of equal length: a replicate."""
        other = ForceBalance(self.stage, data, self.noise)
        other.reaches, other.step, other.grain = self.reaches, self.step, self.grain
        other._whitening, other.blocks, other.block = self._whitening, self.blocks, self.block
        return other

    @property
    def power(self) -> float:
        """Squared drive side of the blocks that are not reserved, as the belief has it."""
        return self._power(self._plain_drive())

    def _needed(self, segment: Segment, c: Floats) -> Floats:
        """Return the force (N, (K,)) that a segment's motion needs, of coefficients `c` of the belief."""
        path = self._path(segment, [], smooth=False)
        units = self._units(segment, path, [], [], None)
        force = path.measured * c[0] + units @ c[1 : self.size - 1]
        made = [ent.build(one) for e in self.believed for one in ent.basis(e)]
        for effect, size in zip(made, c[self.size :], strict=True):
            force += size * self._force_of(effect, segment, path)
        return np.asarray(force)

    def _force_of(self, effect: Effect, segment: Segment, path: Path) -> Floats:
        """Return the force (N, (K,)) that the motion needs for an effect that adds one."""
        given = self._given(segment)
        f = forces(self.stage, [effect], segment.time, path.x, path.v, path.a, given, self.grain)
        return np.asarray(-f.others() - around_rows(f.drive))

    def _cut_blocks(self) -> None:
        assert self._whitening is not None
        kept = [s.time[self._whitening.rows(s.time.size)].size for s in self.data.segments]
        turns = sum(reversals(s.position) for s in self.data.segments)
        count = min(self.data.seconds / BLOCK_SECONDS, turns / BLOCK_REVERSALS if turns else np.inf)
        self.blocks = int(np.clip(count, FEWEST, MOST))
        self.block = np.arange(sum(kept)) * self.blocks // sum(kept)

    @property
    def whitening(self) -> Whitening:
        """The filter of both sides; raises RuntimeError before `whiten`."""
        if self._whitening is None:
            raise RuntimeError("whiten the balance first")
        return self._whitening

    @property
    def reserved(self) -> np.ndarray:
        """Blocks for the final judgement, (blocks,) bool: neither fitted nor selected on."""
        return np.asarray(np.arange(self.blocks) % RESERVED_EVERY == RESERVED_EVERY // 2)

    def system(self, entries: Sequence[Entry] = (), weights: Floats | None = None) -> System:
        """Return the system with `entries`; `weights` (N/m) of the friction units where entries need them.

        Raises ConfigError where a parameter is out of its bounds.
        """
        drive, base, added, by_load = self._groups(entries, weights)
        y = self._whitened(drive)[0]
        rows, spans = [self._whitened(g) for g in base], []
        at = sum(r.shape[0] for r in rows)
        for groups in added:
            found = [self._whitened(g) for g in groups]
            rows += found
            spans.append(slice(at, at + len(found)))
            at += len(found)
        columns = np.concatenate(rows)
        scale = self._scale(y, by_load)
        return System(scale * y, scale * columns if scale != 1.0 else columns, tuple(spans))

    def error(self, entries: Sequence[Entry], c: Floats, weights: Floats | None = None) -> Floats:
        """Return ``y - A c`` (n,) of `system` for given coefficients, filtered as one signal: far cheaper."""
        drive, base, added, by_load = self._groups(entries, weights)
        y = self._whitened(drive)[0]
        out = y.copy()
        pending: list[Floats] | None = None
        at = 0
        for group in [*base, *(g for groups in added for g in groups)]:
            kept = self._cache.get(group.key)
            if kept is not None:
                out -= c[at : at + kept[0].shape[0]] @ kept[0]
                at += kept[0].shape[0]
                continue
            made = group.make()
            width = 1 if made[0].ndim == 1 else made[0].shape[1]
            sizes = c[at : at + width]
            at += width
            signals = [m * sizes[0] if m.ndim == 1 else m @ sizes for m in made]
            pending = signals if pending is None else [p + q for p, q in zip(pending, signals, strict=True)]
        if pending is not None:
            out -= self._filtered(pending)[0]
        return np.asarray(self._scale(y, by_load) * out)

    def forces_of(self, entries: Sequence[Entry]) -> Floats:
        """Return the columns (p, n) of the last of `entries`, which adds a force; they are not kept."""
        drive, _, added, by_load = self._groups(entries, None)
        rows = np.concatenate([self._filtered(g.make()) for g in added[-1]])
        return np.asarray(self._scale(self._whitened(drive)[0], by_load) * rows)

    def _scale(self, y: Floats, by_load: _Group | None) -> float:
        """Return what makes up for a residual that depends less on the command than that of the belief.

        The density of a command is that of its residual times their derivative: a model whose drive side is
        smaller, or whose friction takes up whatever the drive gives (`by_load`), has explained nothing by it.
        """
        told = y if by_load is None else y - self._whitened(by_load)[0]
        plain = self._plain_drive()
        if told is plain or self._whitening is None:
            return 1.0
        return float(np.sqrt(max(self._swing(plain) / max(self._swing(told), 1e-300), 1.0)))

    def _groups(
        self, entries: Sequence[Entry], weights: Floats | None
    ) -> tuple[_Group, list[_Group], list[list[_Group]], _Group | None]:
        """Return the drive side, the columns of base and of each entry, the friction that loads make."""
        everything = [*self.believed, *entries]
        adding = [ent.adds_force(ent.kind_of(e)) for e in everything]
        work = [*self._fixed, *(ent.build(e) for e, adds in zip(everything, adding, strict=True) if not adds)]
        drive = [e for e in work if e.place is Place.DRIVE]
        sensors = [e for e in work if e.place is Place.SENSOR]
        modifiers = [e for e in work if e.place is Place.FRICTION]
        modifiers += [companion for e in modifiers for companion in e.companions()]
        bodies = [e for e in work if e.place in (Place.MECHANICS, Place.DISTURBANCE)]
        forces_added = [ent.build(e) for e, adds in zip(everything, adding, strict=True) if adds]
        side = _Group(("y", _key(drive), _key(sensors)), lambda: self._drive_side(drive, sensors))
        base, by_load = self._base(drive, sensors, modifiers, bodies, forces_added, weights)
        added = [
            [self._added(made, sensors) for made in ent.basis(e)] if adds else []
            for e, adds in zip(everything, adding, strict=True)
        ]
        return side, base, added, by_load

    def _plain_drive(self) -> Floats:
        fixed = [e for e in self._fixed if e.place is Place.DRIVE]
        sensors = [e for e in self._fixed if e.place is Place.SENSOR]
        key = ("y", _key(fixed), _key(sensors))
        found: Floats = self._whitened(_Group(key, lambda: self._drive_side(fixed, sensors)))[0]
        return found

    def _power(self, y: Floats) -> float:
        return float(np.sum(y[~self.reserved[self.block]] ** 2))

    def _swing(self, y: Floats) -> float:
        """Return the power of what a constant does not change."""
        return float(np.var(y[~self.reserved[self.block]]))

    # -- rows, whitened and joined over the segments ------------------------------------------------------

    def _whitened(self, group: _Group) -> Floats:
        """Return a group's columns (p, n), filtered, thinned and joined."""
        found: Floats = self._cache.of(group.key, lambda: [self._filtered(group.make())])[0]
        return found

    def _filtered(self, made: list[Floats]) -> Floats:
        """Return signals (K, p) or (K,), one array a segment, filtered, thinned and joined: (p, n)."""
        parts = []
        for signals in made:
            table = np.ascontiguousarray(np.atleast_2d(signals.T))
            if self._whitening is None:
                parts.append(table[:, 3:-3])
                continue
            # What the ends have wrong would be drawn out over all that a filter remembers.
            lead, rows = self._whitening.lead, self._whitening.rows(table.shape[1])
            white = filtered(table[:, lead:-lead], self.data.rate, self._whitening.response, noisy=True)
            parts.append(white[:, rows.start - lead : rows.stop - lead : rows.step])
        return np.concatenate(parts, axis=1)

    def both_sides(self, stage: Stage) -> tuple[Floats, Floats]:
        """Return the force of the drive and the force that the motion needs (N, (n,)) by any `stage`.

        Both below the bandwidth in which the motion stands above the sensor's noise.
        """
        sensors = [e for e in stage.chain if e.place is Place.SENSOR]
        chain = [e for e in stage.chain if e.place is Place.DRIVE]
        given, needed = [], []
        for s, p in zip(self.data.segments, self.paths(sensors), strict=True):
            held = self._given(s)
            parts = parts_of_drive(chain) if self.data.held else 1
            over = forces(stage, chain, s.time, p.x, p.v, p.a, held, parts=parts).drive
            f = forces(stage, stage.chain, s.time, p.x, p.v, p.a, held, self.grain)
            mean = 0.5 * (over + np.append(over[1:], over[-1:])) if self.data.held else around_rows(over)
            given.append(mean)
            needed.append(f.mass * p.measured - f.others())
        return self.smooth(given), self.smooth(needed)

    def drive_force(self) -> Floats:
        """Return the force of the believed drive (N, (n,)) below the motion's bandwidth."""
        found: Floats = self._cache.of(("drive",), lambda: [self.both_sides(self.stage)[0]])[0]
        return found

    def smooth(self, signals: Sequence[Floats]) -> Floats:
        """Return signals (K,), one a segment, below the motion's bandwidth on the compared rows, (n,)."""
        parts = []
        for s in signals:
            lead, rows = self.whitening.lead, self.whitening.rows(s.size)
            below = filtered(s[lead:-lead], self.data.rate, self.noise.wiener, noisy=True)
            parts.append(below[rows.start - lead : rows.stop - lead : rows.step])
        return np.concatenate(parts)

    def plain(self, signals: Sequence[Floats]) -> Floats:
        """Return one unfiltered number a compared row, (n,), of signals (K,), one a segment."""
        assert self._whitening is not None
        rows = [s[self._whitening.rows(s.size)] for s in signals]
        return np.concatenate(rows)

    def paths(self, sensors: Sequence[Effect] = ()) -> list[Path]:
        """Return the motion of every segment, what `sensors` did to the reading undone."""
        return self._cache.of(
            ("paths", _key(sensors)), lambda: [self._path(s, sensors) for s in self.data.segments]
        )

    def _path(self, segment: Segment, sensors: Sequence[Effect], *, smooth: bool = True) -> Path:
        rate = self.data.rate
        x = true_position(sensors, segment.time, segment.position)
        slow = filtered(x, rate, self.noise.wiener) if smooth else x
        if self.data.held:
            measured = _second_difference(x, rate)
            v = filtered(x, rate, self.noise.wiener, derivative=True)
        else:
            v = filtered(x, rate, _all, derivative=True)
            measured = around_rows(filtered(v, rate, _all, derivative=True))
            v = filtered(v, rate, self.noise.wiener)
        return Path(slow, v, _second_difference(slow, rate), measured)

    def _given(self, segment: Segment) -> Floats:
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
            f = forces(self.stage, chain, s.time, p.x, p.v, p.a, self._given(s), parts=parts)
            mean = 0.5 * (f.drive + np.append(f.drive[1:], f.drive[-1:]))
            found.append((mean if self.data.held else around_rows(f.drive)) + around_rows(f.push))
        return found

    def _base(
        self,
        drive: Sequence[Effect],
        sensors: Sequence[Effect],
        modifiers: Sequence[Effect],
        bodies: Sequence[Effect],
        adding: Sequence[Effect],
        weights: Floats | None,
    ) -> tuple[list[_Group], _Group | None]:
        """Return the base's columns (mass; damping and friction units; a constant force), and the load's.

        The latter is how much the friction at hand changes with the command, relative to it.
        """
        whole = any(e.whole_friction for e in modifiers)
        play = next((e for e in bodies if e.behind and _active(e)), None)
        hung = [e for e in bodies if not e.behind]
        own = weights.tobytes() if weights is not None and (whole or play is not None) else b""
        before: list[Effect] = []
        if any(e.values.get("external") is not None for e in modifiers):
            chain = [e for e in self.stage.chain if e.place is Place.DRIVE]
            before = [*chain, *[e for e in drive if e not in chain]]
            if any(e.values.get("external") for e in modifiers):
                before += [e for e in adding if e.place in (Place.MECHANICS, Place.DISTURBANCE)]
        behind = ("load", _key([play] if play else []), own if play is not None else b"")

        def mass() -> list[Floats]:
            found = []
            for k, (s, p) in enumerate(zip(self.data.segments, self.paths(sensors), strict=True)):
                a = p.measured
                if hung:
                    f = forces(
                        self.stage, sorted(hung, key=lambda e: e.order), s.time, p.x, p.v, p.a, s.voltage
                    )
                    a = (a * f.mass - around_rows(f.push)) / self.stage.mass
                if play is not None:
                    rest = _second_difference(self._load(sensors, play, weights)[k], self.data.rate)
                    a = a + play.values["share"] * (rest - p.a)
                found.append(a)
            return found

        def units(more: float = 0.0) -> list[Floats]:
            found = []
            for k, (s, p) in enumerate(zip(self.data.segments, self.paths(sensors), strict=True)):
                path = p
                if play is not None:
                    y = self._load(sensors, play, weights)[k]
                    v = np.gradient(y, self.data.period)
                    path = Path(y, v, _second_difference(y, self.data.rate), p.measured)
                pushed = replace(s, voltage=(1.0 + more) * s.voltage) if more else s
                found.append(self._units(pushed, path, before, modifiers, weights if whole else None))
            return found

        def by_load() -> list[Floats]:
            held = self.weights if weights is None else weights
            first = len(BASE) - 1
            pairs = zip(units(MORE), units(), strict=True)
            return [(more[:, first:] - plain[:, first:]) @ held / MORE for more, plain in pairs]

        key = (_key(before), _key(modifiers), _key(sensors), behind, own)
        columns = [
            _Group(("mass", _key(hung), _key(sensors), behind), mass),
            _Group(("units", *key), units),
            _Group(("offset",), lambda: [np.ones(s.time.size) for s in self.data.segments]),
        ]
        held = (weights if weights is not None else self.weights).tobytes()
        return columns, _Group(("by load", held, *key), by_load) if before else None

    def _load(self, sensors: Sequence[Effect], play: Effect, weights: Floats | None) -> list[Floats]:
        """Return the position (m) of the load behind a play along each segment."""
        held = self.weights if weights is None else weights
        m = self.stage.mechanics
        share, gap, contact = (play.values[k] for k in ("share", "gap", "contact"))
        load = Load(share * m.mass, m.viscous, m.micro_damping, m.micro_damping_speed, held, self.reaches)
        key = ("behind", _key(sensors), _key([play]), held.tobytes())
        return self._cache.of(
            key, lambda: [behind_play(p.x, self.data.period, gap, contact, load) for p in self.paths(sensors)]
        )

    @property
    def weights(self) -> Floats:
        """Believed friction as stiffnesses (N/m) of the units."""
        found = np.zeros(self.reaches.size)
        if isinstance(self.stage.friction, MaxwellSlip):
            for k, r in self.stage.friction.elements:
                at = int(np.argmin(np.abs(np.log(self.reaches / r))))
                found[at] += k * r / self.reaches[at]
        return found

    def _units(
        self,
        segment: Segment,
        path: Path,
        before: Sequence[Effect],
        modifiers: Sequence[Effect],
        weights: Floats | None,
    ) -> Floats:
        """Return the force (N, (K, p)) of each unit of damping and friction around the rows."""
        motion = np.column_stack([segment.time, path.x, path.v, path.a, self._given(segment)])
        held = self.weights if weights is None else weights
        return units_along(
            self.stage,
            list(before),
            list(modifiers),
            self.reaches,
            held,
            np.ascontiguousarray(motion),
            self.grain,
        )

    def _added(self, entry: Entry, sensors: Sequence[Effect]) -> _Group:
        """Return the force that the motion needs for an entry that adds one."""
        effect = ent.build(entry)

        def made() -> list[Floats]:
            pairs = zip(self.data.segments, self.paths(sensors), strict=True)
            return [self._force_of(effect, s, p) for s, p in pairs]

        return _Group(("added", _key([effect]), _key(sensors)), made)


def _active(effect: Effect) -> bool:
    """Tell whether an effect is away from the values at which it changes nothing."""
    neutral = effect.neutral or {}
    return not neutral or any(effect.values[name] != value for name, value in neutral.items())


def _refitted(entry: Entry) -> bool:
    kind = ent.kind_of(entry)
    return ent.adds_force(kind) and bool(kind.linear)


def _grid(stage: Stage, data: Data, grain: float) -> Floats:
    """Return yield displacements (m) from the grain to an eighth of the stroke, the believed ones in it."""
    low, high = data.stroke
    longest = 0.125 * (high - low)
    shortest = max(2.0 * grain, 1e-5 * longest)
    friction = stage.friction
    if isinstance(friction, MaxwellSlip):
        first = min(r for _, r in friction.elements)
        shortest = min(max(0.3 * first, shortest), first)
    return np.geomspace(min(shortest, 0.5 * longest), longest, GRID)


def _joined(own: Floats, grid: Floats, step: float) -> Floats:
    """Return believed yield displacements (m) and those of a grid that are not close to one of them."""
    if not own.size:
        return np.sort(grid)
    apart = np.min(np.abs(np.log(grid[:, None] / own[None, :])), axis=1)
    return np.sort(np.concatenate([own, grid[apart > 0.3 * step]]))


def _second_difference(x: Floats, rate: float) -> Floats:
    a = np.zeros_like(x)
    a[1:-1] = (x[2:] - 2.0 * x[1:-1] + x[:-2]) * rate**2
    return a


def _all(frequency: Floats) -> Floats:
    return np.ones_like(frequency)


def _key(effects: Sequence[Effect]) -> Hashable:
    return tuple(sorted(repr(e.to_dict()) for e in effects))
