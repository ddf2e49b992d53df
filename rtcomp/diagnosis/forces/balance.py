"""The force balance as a linear system: drive force on one side, what the motion needs on the other.

    drive(t) = m a + c v + micro(t) + sum_i k_i z_i(t) + forces of entries        (equation error)

z_i are unit stop elements on a grid of yield displacements, so that any virgin curve is within reach of the
fit. Entries that add a force are columns of free size; those that change friction, drive, sensor or mass are
at work while the other columns are made. Both sides go through the same filter, which weighs each frequency
by how far the motion stands above the sensor's noise (`noise.Whitening`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cache import KEPT_ONCE, Cache, Group, key_of
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.forces.bank import AS_IT_IS
from rtcomp.diagnosis.forces.blocks import cut
from rtcomp.diagnosis.forces.kinematics import acted
from rtcomp.diagnosis.forces.noise import Noise, Whitening
from rtcomp.diagnosis.forces.play import carried_by
from rtcomp.diagnosis.forces.reaches import MOST_OWN, joined
from rtcomp.diagnosis.forces.sides import exact
from rtcomp.diagnosis.forces.signals import BASE, Signals
from rtcomp.diagnosis.forces.sticking import RestWeights
from rtcomp.diagnosis.numerics.regression import System
from rtcomp.diagnosis.numerics.spectrum import filtered, spectrum
from rtcomp.diagnosis.recordings.data import Data, Segment
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place
from rtcomp.stage.balance import forces, parts_of_drive
from rtcomp.stage.stage import Stage

NOTHING = 1e-18
"""Part of the power of a signal that rounding makes of nothing."""


class ForceBalance(Signals):
    """The equation-error objective of one stage on one set of recordings."""

    def __init__(self, stage: Stage, data: Data, noise: Noise | None = None) -> None:
        super().__init__(stage, data, noise)
        self._whitening: Whitening | None = None
        self.blocks = 0
        self.noise_power = 0.0
        """N^2: mean square of what the sensor's noise makes of the residual below the motion's bandwidth."""
        self.block: np.ndarray = np.zeros(0, dtype=np.int64)
        self._reserved: np.ndarray = np.zeros(0, dtype=np.bool_)
        self._rest: RestWeights | None = None
        self.level = np.inf
        """N, of which friction may do any part unseen where the axis seems to rest; where unknown, any."""

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
        self._cache = Cache()
        own = float(np.sum(coefficients[self.model] * self.models))
        held = float(np.sum(coefficients[self.friction] * self.reaches)) + own
        believed = float(np.sum(self.weights * self.reaches)) + own
        self.level = max(held, believed) if self.stage.friction is not None or held > 0.0 else np.inf
        self.block, self._reserved = cut(self)
        self.blocks = self._reserved.size
        self._rest = None
        self._rest = RestWeights.of(self)

    def put(self, reaches: Floats, step: float) -> None:
        """Put the grid of yield displacements (m) to `reaches`, in steps of `step` (logarithm)."""
        own = self.believed_reaches if self.believed_reaches.size <= MOST_OWN else np.zeros(0)
        self.reaches, self.step = joined(own, np.unique(reaches), step), step
        self._cache = Cache()

    def on(self, data: Data, block: np.ndarray | None = None) -> ForceBalance:
        """Return the same objective, weights and grid on other data of equal length: a replicate.

        Or of another length, with the `block` of each compared row, (n,), of which none is reserved.
        """
        other = ForceBalance(self.stage, data, self.noise)
        other.reaches, other.coarse, other.step = self.reaches, self.coarse, self.step
        other._whitening, other.blocks, other.block = self._whitening, self.blocks, self.block
        other._reserved, other.let_go = self._reserved, self.let_go
        if block is not None:
            other.blocks, other.block = int(block[-1]) + 1, block
            other._reserved = np.zeros(other.blocks, dtype=np.bool_)
        other.believed_speed, other.speed_room = self.believed_speed, self.speed_room
        other.grain, other.level, other.exponent = self.grain, self.level, self.exponent
        other._cache = Cache(KEPT_ONCE)
        if self._whitening is not None:
            other._rest = RestWeights.of(other)
        return other

    @property
    def power(self) -> float:
        """Squared drive side of the blocks that are not reserved, as the belief has it."""
        return self.power_of(~self.reserved)

    def power_of(self, blocks: np.ndarray) -> float:
        """Return the squared drive side of some `blocks`, (B,) bool, as the belief has it."""
        return float(np.sum(self._plain_drive()[blocks[self.block]] ** 2))

    def _needed(self, segment: Segment, c: Floats) -> Floats:
        """Return the force (N, (K,)) that a segment's motion needs, of coefficients `c` of the belief."""
        path = self._path(segment, [], smooth=False)
        units = self._units(segment, path, self._start(segment, []), [], [], None)
        damped = c[1] * self._viscous(segment, path, []) + self._micro(segment, path) @ c[2 : len(BASE) + 1]
        force = path.measured * c[0] + damped + units @ c[self.model.start : self.friction.stop]
        made = [ent.build(one) for e in self.believed for one in ent.basis(e)]
        for effect, size in zip(made, c[self.size :], strict=True):
            force += size * self.force_of(effect, segment, path)
        return np.asarray(force)

    @property
    def whitening(self) -> Whitening:
        """The filter of both sides; raises RuntimeError before `whiten`."""
        if self._whitening is None:
            raise RuntimeError("whiten the balance first")
        return self._whitening

    @property
    def reserved(self) -> np.ndarray:
        """Blocks for the final judgement, (blocks,) bool: neither fitted nor selected on.

        One of every few, judged within what was fitted: a block in which the reading steps is unlike all
        others, and one that goes furthest shows what no other does.
        """
        return self._reserved

    def system(self, entries: Sequence[Entry] = (), weights: Floats | None = None) -> System:
        """Return the system with `entries`; `weights` (N/m) of the friction units where entries need them.

        Raises ConfigError where a parameter is out of its bounds.
        """
        drive, base, added, by_load = self._groups(entries, weights)
        y, spans = self._whitened(drive)[0], []
        rows = [self._whitened(g) for g in base]
        at = sum(r.shape[0] for r in rows)
        for groups in added:
            rows += [self._whitened(g) for g in groups]
            spans.append(slice(at, at + len(groups)))
            at += len(groups)
        columns = np.concatenate(rows)
        scale = self._scale(y, by_load)
        return System(scale * y, scale * columns if scale != 1.0 else columns, tuple(spans))

    def error(self, entries: Sequence[Entry], c: Floats, weights: Floats | None = None) -> Floats:
        """Return ``y - A c`` (n,) of `system` for given coefficients, filtered as one signal: far cheaper."""
        scale, left = self.left(entries, c, weights)
        return np.asarray(scale * left)

    def left(
        self,
        entries: Sequence[Entry],
        c: Floats,
        weights: Floats | None = None,
        larger: tuple[float, float] = AS_IT_IS,
    ) -> tuple[float, Floats]:
        """Return the scale of that error, and the error (n,) without it.

        Derivatives hold the scale: with it, a number that only makes the error smaller would explain all.
        Stiffness and level of the whole of friction are so many times `larger` than `weights` make them, for
        what asks for these.
        """
        drive, base, added, by_load = self._groups(entries, weights, larger)
        y = self._whitened(drive)[0]
        out = y.copy()
        pending: list[Floats] | None = None
        at = 0
        for group in [*base, *(g for groups in added for g in groups)]:
            sizes = c[at : at + group.width]
            at += group.width
            if not sizes.any():
                continue
            kept = self._cache.get(group.key)
            if kept is not None:
                out -= sizes @ kept[0]
                continue
            signals = group.summed(sizes)
            pending = signals if pending is None else [p + q for p, q in zip(pending, signals, strict=True)]
        if pending is not None:
            out -= self.compared(pending)[0]
        return self._scale(y, by_load), out

    def forces_of(self, entries: Sequence[Entry]) -> Floats:
        """Return the columns (p, n) of the last of `entries`, which adds a force; they are not kept."""
        drive, _, added, by_load = self._groups(entries, None)
        scale = self._scale(self._whitened(drive)[0], by_load)
        return np.asarray(scale * np.concatenate([self.compared(g.make()) for g in added[-1]]))

    def _scale(self, y: Floats, by_load: Group | None) -> float:
        """Return what makes up for a residual that depends less on the command than that of the belief.

        The density of a command is that of its residual times their derivative: a model whose drive side is
        smaller, or whose friction takes up whatever the drive gives (`by_load`), has explained nothing by it.
        Where no more than NOTHING of it is left, it is the worst there is.
        """
        told = y if by_load is None else y - self._whitened(by_load)[0]
        plain = self._plain_drive()
        if told is plain or self._whitening is None:
            return 1.0
        whole, left = self._swing(plain), self._swing(told)
        return float(np.sqrt(max(whole / max(left, NOTHING * whole), 1.0)))

    def _groups(
        self, entries: Sequence[Entry], weights: Floats | None, larger: tuple[float, float] = AS_IT_IS
    ) -> tuple[Group, list[Group], list[list[Group]], Group | None]:
        """Return the drive side, the columns of base and of each entry, the friction that loads make."""
        everything, adding, work = self.at_work(entries)
        drive = [e for e in work if e.place is Place.DRIVE]
        sensors = [e for e in work if e.place is Place.SENSOR]
        modifiers = [e for e in work if e.place is Place.FRICTION]
        bodies = [e for e in work if e.place in (Place.MECHANICS, Place.DISTURBANCE)]
        forces_added = [ent.build(e) for e, adds in zip(everything, adding, strict=True) if adds]
        side = self._side(drive, sensors)
        load = carried_by(bodies, forces_added, self.weights if weights is None else weights)
        base, by_load = self._base(drive, sensors, modifiers, bodies, forces_added, load, weights, larger)
        added = [
            [self._added(made, sensors, load) for made in ent.basis(e)] if adds else []
            for e, adds in zip(everything, adding, strict=True)
        ]
        return side, base, added, by_load

    def at_work(self, entries: Sequence[Entry]) -> tuple[list[Entry], list[bool], list[Effect]]:
        """Return all entries, which of them add a force, and the effects that are at work beside columns."""
        everything = [*self.believed, *entries]
        adding = [ent.adds_force(ent.kind_of(e)) for e in everything]
        built = [ent.build(e) for e, adds in zip(everything, adding, strict=True) if not adds]
        work = exact([*self._fixed, *built], self.data.held)
        # What effects other than friction's bring along is made with the columns.
        changing = [e for e in work if e.place is Place.FRICTION]
        return everything, adding, [*work, *(brought for e in changing for brought in e.companions())]

    def _side(self, drive: Sequence[Effect], sensors: Sequence[Effect]) -> Group:
        """Return the drive side; where nothing of it goes by the motion, that of the believed sensor."""
        own = [e for e in self.stage.chain if e.place is Place.DRIVE]
        fixed = all(e.command_only for e in [*own, *drive])
        at = [e for e in self._fixed if e.place is Place.SENSOR] if fixed else sensors
        return Group(("y", key_of(drive), key_of(at)), lambda: self._drive_side(drive, at))

    def _plain_drive(self) -> Floats:
        drive, sensors = ([e for e in self._fixed if e.place is p] for p in (Place.DRIVE, Place.SENSOR))
        return np.asarray(self._whitened(self._side(drive, sensors))[0])

    def _swing(self, y: Floats) -> float:
        """Return the power of what a constant does not change."""
        rows = ~self.reserved[self.block]
        swung, weight = y[rows], self.weighed(np.ones((1, y.size)))[0, rows]
        return float(np.mean((swung - (weight @ swung) / (weight @ weight) * weight) ** 2))

    # -- rows, whitened and joined over the segments ------------------------------------------------------

    def _whitened(self, group: Group) -> Floats:
        """Return a group's columns (p, n), filtered, thinned and joined."""
        return np.asarray(self._cache.of(group.key, lambda: [self.compared(group.make())])[0])

    def compared(self, made: list[Floats]) -> Floats:
        """Return signals (K, p) or (K,), one array a segment, filtered, thinned, weighed, joined: (p, n)."""
        parts = []
        for segment, signals in zip(self.data.segments, made, strict=True):
            table = np.ascontiguousarray(np.atleast_2d(signals.T))
            if self._whitening is None:
                parts.append(table[:, 3:-3])
                continue
            kept, rows = self._whitening.filtered(segment), self._whitening.rows(segment)
            wanted = slice(rows.start - kept.start, rows.stop - kept.start, rows.step)
            response = self._whitening.response
            parts.append(filtered(table[:, kept], self.data.rate, response, noisy=True, wanted=wanted))
        return self.weighed(np.concatenate(parts, axis=1))

    def weighed(self, rows: Floats, *, back: bool = False) -> Floats:
        """Weigh filtered `rows` (p, n) in place, or undo that (`back`), and return them."""
        if self._rest is not None:
            (self._rest.unweigh if back else self._rest.weigh)(rows)
        return rows

    @property
    def trust(self) -> Floats:
        """Weight of each compared row, (n,): below 1 where motion does not tell what friction does."""
        return np.ones(1) if self._rest is None else self._rest.trust

    def both_sides(self, stage: Stage) -> tuple[Floats, Floats]:
        """Return the force of the drive and the force that the motion needs (N, (n,)) by any `stage`.

        Both below the bandwidth in which the motion stands above the sensor's noise.
        """
        whole = exact(stage.chain, self.data.held)
        sensors, chain = ([e for e in whole if e.place is p] for p in (Place.SENSOR, Place.DRIVE))
        given, needed = [], []
        for s, p in zip(self.data.segments, self.paths(sensors), strict=True):
            held = self.given(s)
            parts = parts_of_drive(chain) if self.data.held else 1
            over = forces(stage, chain, s.time, p.x, p.v, p.a, held, parts=parts)
            f = forces(stage, whole, s.time, p.x, p.v, p.a, held, self.grain)
            given.append(acted(over, s, self.data, stage.force_constant))
            needed.append(f.mass * p.measured - f.others())
        return self.smooth(given), self.smooth(needed)

    @property
    def force_bandwidth(self) -> float:
        """Hz, up to which the drive's force stands above what the sensor's noise makes of the residual."""
        frequency, density, noise = self.force_densities()
        below = np.flatnonzero(density < noise)
        return float(frequency[max(below[0] - 1, 0) if below.size else -1])

    def force_densities(self) -> tuple[Floats, Floats, Floats]:
        """Return frequencies (Hz), the density of the drive's force and of noise (N^2/Hz), (F,) each."""

        def made() -> list[Floats]:
            frequency, density = spectrum(self._drive_side([], []), self.data.rate)
            return [frequency, density, 2.0 * self.whitening.coloured(frequency) ** 2 / self.data.rate]

        frequency, density, noise = self._cache.of(("densities",), made)
        return frequency, density, noise

    def drive_force(self) -> Floats:
        """Return the force of the believed drive (N, (n,)) below the motion's bandwidth."""
        return np.asarray(self._cache.of(("drive",), lambda: [self.both_sides(self.stage)[0]])[0])

    def smooth(self, signals: Sequence[Floats]) -> Floats:
        """Return signals (K,), one a segment, below the motion's bandwidth on the compared rows, (n,)."""
        parts = []
        for segment, s in zip(self.data.segments, signals, strict=True):
            kept, rows = self.whitening.filtered(segment), self.whitening.rows(segment)
            below = filtered(s[kept], self.data.rate, self.noise.wiener, noisy=True)
            parts.append(below[rows.start - kept.start : rows.stop - kept.start : rows.step])
        return np.concatenate(parts)

    def plain(self, signals: Sequence[Floats]) -> Floats:
        """Return one unfiltered number a compared row, (n,), of signals (K,), one a segment."""
        assert self._whitening is not None
        pairs = zip(self.data.segments, signals, strict=True)
        return np.concatenate([s[self._whitening.rows(segment)] for segment, s in pairs])


__all__ = ["BASE", "ForceBalance"]
