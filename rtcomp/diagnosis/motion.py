"""The recordings as a diagnosis sees them: one rate, a bandwidth, blocks, and some of them put aside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtcomp.diagnosis.jumps import jumps
from rtcomp.diagnosis.stretches import LEAST_ROWS, stretches
from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.recording.pieces import bridged
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import zero_phase
from rtcomp.stage.stage import Stage

MOST_ROWS = 120_000
"""Rows that a diagnosis works on as they are; of longer recordings it takes windows, evenly spread."""
WINDOW_ROWS = 12_000
WINDOWS = 5
SAMPLE = 6_000
"""Rows of each window from which the bandwidth is judged."""
OVERSAMPLED = 6.5
"""Rate over bandwidth, at the most: friction is exact over a displacement, finer rows only cost time."""
WASHED = 2.2
"""Travel within a strip, in longest reaches, after which friction has forgotten what was before it."""
LEAD = 0.25
"""Part of a recording that may go by until then; else what was before it has to be taken as nothing."""
FAINT = 0.02
"""Part of all that friction holds, that may be of reaches too long to be waited for."""
BLOCKS = 24
UNSEEN = (3, 9, 14, 20)
"""Blocks that are left out of the fit; explanations that do not hold on them are rejected."""


@dataclass(frozen=True)
class Strip:
    """One uninterrupted stretch of a recording at `rate`: time (s), position (m), voltage (V), reference.

    Its first `lead` rows only tell friction where it comes from; they are not compared.
    """

    time: Floats
    position: Floats
    voltage: Floats
    reference: Floats | None
    lead: int = 0


@dataclass(frozen=True)
class Motion:
    """All stretches with the bandwidth (Hz) they are compared in."""

    strips: Sequence[Strip]
    rate: float
    cut: float
    smoothed: float = 0.0
    """Hz from which on positions were smoothed, lest each count of an encoder be a reversal; 0: were not."""
    averaged: int = 1
    """Rows of the recording to one of the strips."""
    jumps: tuple[tuple[float, float], ...] = ()
    """Times (s) and sizes (m) of jumps that the sensor may have made."""

    @property
    def period(self) -> float:
        """Time between rows (s)."""
        return 1.0 / self.rate

    @property
    def thinning(self) -> int:
        """Every how manieth row is kept after smoothing."""
        return max(1, int(self.rate / (2.5 * self.cut)))

    @property
    def stroke(self) -> tuple[float, float]:
        """Lowest and highest position (m)."""
        return min(float(s.position.min()) for s in self.strips), max(
            float(s.position.max()) for s in self.strips
        )

    @property
    def seconds(self) -> float:
        """Length of all stretches together (s)."""
        return float(sum(s.time.size for s in self.strips)) / self.rate

    def kept(self, strip: Strip) -> slice:
        """Return the rows of a strip that are compared: after its lead, where smoothing has neighbours."""
        return slice(strip.lead + self.edge, -self.edge or None, self.thinning)

    def smooth(self, rows: Sequence[Floats]) -> Floats:
        """Smooth an array a strip, (n_i,) or (n_i, p), below the cut; join what is compared of the strips."""
        parts = zip(self.strips, rows, strict=True)
        smoothed = [zero_phase(r, self.cut, self.rate)[self.kept(s)] for s, r in parts]
        return np.ascontiguousarray(smoothed[0]) if len(smoothed) == 1 else np.concatenate(smoothed)

    @property
    def edge(self) -> int:
        """Rows left out at both ends of a strip, where smoothing has no neighbours."""
        return int(self.rate / self.cut) + 2

    def plain(self, rows: Sequence[Floats]) -> Floats:
        """Keep what is compared of an array a strip, and join the strips, without smoothing."""
        return np.concatenate([r[self.kept(s)] for s, r in zip(self.strips, rows, strict=True)])

    def block(self) -> np.ndarray:
        """Return the block number, 0 to BLOCKS - 1, of every kept row: equal stretches of motion."""
        count = sum(len(s.time[self.kept(s)]) for s in self.strips)
        return np.arange(count) * BLOCKS // count

    @property
    def jumped(self) -> set[int]:
        """Blocks in which the sensor may have jumped."""
        times, block = self.plain([s.time for s in self.strips]), self.block()
        return {int(block[np.argmin(np.abs(times - at))]) for at, _ in self.jumps}

    @property
    def unseen(self) -> tuple[int, ...]:
        """Return the blocks that are put aside: UNSEEN, but none in which the sensor may have jumped.

        What happens once can be learned only where it happens.
        """
        full = self.jumped
        chosen: list[int] = []
        for k in UNSEEN:
            free = [b for b in ((k + j) % BLOCKS for j in range(BLOCKS)) if b not in full and b not in chosen]
            chosen += free[:1]
        return tuple(chosen)


def prepare(stage: Stage, recordings: Sequence[Recording], cut: float | None = None) -> Motion:
    """Bring recordings of one rate to a workable size: windows of long ones, averages of fast ones."""
    rate = recordings[0].rate_hz
    reach = longest_reach(stage.friction)
    wholes = [s for r in recordings for s in _stretches(r, reach)]
    if cut is None:
        cut = _bandwidth(stage, [s for w in wholes for s in _windows(w, SAMPLE, 0.0)], rate)
    factor = max(1, int(rate / (OVERSAMPLED * cut)))
    if sum(s.time.size for s in wholes) <= factor * MOST_ROWS:
        strips = wholes
    else:
        strips = [s for w in wholes for s in _windows(w, factor * WINDOW_ROWS // len(wholes), reach)]
    jumped = tuple(j for s in strips for j in jumps(s.time, s.position))
    smoothed = min(2.0 * cut, 0.4 * rate) if _coarse(stage, strips) else 0.0
    if smoothed:
        strips = [replace(s, position=unstepped(s.position, smoothed, rate)) for s in strips]
    if factor > 1:
        strips = [averaged(s, factor) for s in strips]
        rate /= factor
    return Motion(strips, rate, cut, smoothed, factor, jumped)


def unstepped(position: Floats, smoothed: float, rate: float) -> Floats:
    """Smooth the counts of a coarse encoder (m, (K,)) from `smoothed` (Hz) on, as far as `rate` lets it."""
    return zero_phase(position, min(smoothed, 0.4 * rate), rate)


def longest_reach(friction: Effect | None) -> float:
    """Return the travel (m) at which all but a FAINT part of the believed friction has yielded.

    0 where that is not known. Identified friction has a reach for every place of its grid, the longest of
    them often with next to no force.
    """
    if not isinstance(friction, MaxwellSlip):
        return 0.0
    stiffness, reach = np.array(sorted(friction.elements, key=lambda e: e[1])).T
    held = np.cumsum(stiffness * reach)
    return float(reach[np.argmax(held >= (1.0 - FAINT) * held[-1])])


def _stretches(recording: Recording, reach: float) -> list[Strip]:
    """Return what is between a recording's long gaps, each with the lead that wipes out what was before."""
    position = bridged(recording.position, recording.trusted)
    whole = Strip(recording.time - recording.time[0], position, recording.voltage, recording.reference)
    found = []
    for rows in stretches(recording.trusted):
        strip = whole if rows.stop - rows.start == position.size else _part(whole, rows)
        share = LEAD if rows.start == 0 else 1.0
        begin = strip.position[: int(share * strip.position.size) + 1]
        washed = np.maximum.accumulate(begin) - np.minimum.accumulate(begin) >= WASHED * reach
        first = int(np.argmax(washed))
        if washed[first]:
            found.append(replace(strip, lead=first))
        elif rows.start == 0:
            found.append(strip)
    longest = max((s.time.size - s.lead for s in found), default=0)
    return [s for s in found if s.time.size - s.lead >= min(LEAST_ROWS // 2, longest)] or [whole]


def _windows(whole: Strip, rows: int, reach: float) -> list[Strip]:
    """Return windows of so many rows, each with the lead that wipes out what friction remembers."""
    if whole.time.size <= WINDOWS * rows:
        return [whole]
    found = []
    for start in np.linspace(0, whole.time.size - rows, WINDOWS).astype(int):
        first = max(start - rows, 0)
        before = whole.position[first : start + 1][::-1]
        washed = np.maximum.accumulate(before) - np.minimum.accumulate(before) >= WASHED * reach
        lead = int(np.argmax(washed)) if washed.any() else start - first
        lead = max(lead, whole.lead if start == 0 else 0)
        first = max(start - lead, 0)
        found.append(replace(_part(whole, slice(first, first + lead + rows)), lead=lead))
    return found


def _part(strip: Strip, rows: slice) -> Strip:
    reference = None if strip.reference is None else strip.reference[rows]
    return Strip(strip.time[rows], strip.position[rows], strip.voltage[rows], reference)


def averaged(strip: Strip, factor: int) -> Strip:
    """Return the means of so many rows each; a command is held from its mean row to the next."""
    count = strip.time.size // factor

    def mean(a: Floats) -> Floats:
        return np.asarray(a[: count * factor].reshape(count, factor).mean(axis=1))

    time = mean(strip.time)
    # A command is held from its row to the next one: from the middle of the averaged rows on, too.
    given = np.concatenate([[0.0], np.cumsum(strip.voltage)])
    edges = np.arange(count + 1) * factor + 0.5 * (factor - 1)
    held = np.diff(np.interp(edges, np.arange(given.size), given)) / factor
    return Strip(
        time,
        mean(strip.position),
        held,
        None if strip.reference is None else mean(strip.reference),
        -(-strip.lead // factor),
    )


def _coarse(stage: Stage, strips: Sequence[Strip]) -> bool:
    """Tell whether position noise is no small part of the shortest travel at which friction yields."""
    friction = stage.friction
    if not isinstance(friction, MaxwellSlip):
        return False
    noise = max(float(np.hypot(stage.sensor.noise, stage.sensor.resolution / np.sqrt(12.0))), heard(strips))
    return noise > 0.05 * min(r for _, r in friction.elements)


def heard(strips: Sequence[Strip]) -> float:
    """Return the noise of position (m rms) that the recording itself shows, in the fastest third of its band.

    The fourth difference leaves of a slow motion next to nothing and of white noise sqrt(70) times it; the
    median over the rows forgets the stretches where the motion is fast.
    """
    fourth = np.concatenate([np.diff(s.position, 4) for s in strips])
    return float(np.median(np.abs(fourth)) / 0.6745 / np.sqrt(70.0))


def _bandwidth(stage: Stage, strips: Sequence[Strip], rate: float) -> float:
    """Return the bandwidth (Hz) up to which the noise of the acceleration stays small beside the force."""
    noise = max(float(np.hypot(stage.sensor.noise, stage.sensor.resolution / np.sqrt(12.0))), heard(strips))
    force = stage.force_constant * float(np.sqrt(np.mean(np.concatenate([s.voltage for s in strips]) ** 2)))
    most = min(0.15 * rate, 150.0)
    if noise == 0.0 or force == 0.0:
        return most
    # rms of m a up to B under white position noise at this rate: m (2 pi B)^2 noise sqrt(B / (2.5 rate))
    cuts = np.geomspace(min(2.0, most), most, 80)
    disturbed = stage.mass * (2 * np.pi * cuts) ** 2 * noise * np.sqrt(cuts / (2.5 * rate))
    friction = stage.friction
    stiffness = friction.stiffness() if friction is not None else 0.0
    # Presliding turns position noise into force as a spring would; it only has to stay a small part of it.
    sprung = stiffness * noise * np.sqrt(2.0 * cuts / rate)
    quiet = cuts[(disturbed < 0.004 * force) & (sprung < 0.03 * force)]
    return float(quiet[-1]) if quiet.size else float(cuts[0])
