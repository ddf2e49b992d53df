"""The recordings as a diagnosis sees them: one rate, a bandwidth, blocks, and some of them put aside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import zero_phase
from rtcomp.stage.stage import Stage

MOST_ROWS = 30_000
"""Rows that a diagnosis works on; of longer recordings it takes windows, evenly spread."""
WINDOWS = 3
FASTEST_HZ = 2500.0
"""Faster recordings are averaged down: mechanics above a kilohertz is not in the catalogue."""
OVERSAMPLED = 12.0
"""Rate over bandwidth, at the most."""
BLOCKS = 12
UNSEEN = (4, 9)
"""Blocks that neither fitting nor selection sees."""


@dataclass(frozen=True)
class Strip:
    """One uninterrupted stretch of a recording at `rate`: time (s), position (m), voltage (V), reference."""

    time: Floats
    position: Floats
    voltage: Floats
    reference: Floats | None


@dataclass(frozen=True)
class Motion:
    """All stretches with the bandwidth (Hz) they are compared in."""

    strips: Sequence[Strip]
    rate: float
    cut: float

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

    def smooth(self, rows: Sequence[Floats]) -> Floats:
        """Smooth an array a strip, (n_i,) or (n_i, p), below the cut, thin it, and join the strips."""
        from scipy.signal import butter, sosfiltfilt

        sections = butter(2, self.cut, fs=self.rate, output="sos")
        edge, step = self.edge, self.thinning
        return np.concatenate([sosfiltfilt(sections, r, axis=0)[edge : -edge or None : step] for r in rows])

    @property
    def edge(self) -> int:
        """Rows left out at both ends of a strip, where smoothing has no neighbours."""
        return int(self.rate / self.cut) + 2

    def plain(self, rows: Sequence[Floats]) -> Floats:
        """Thin and join without smoothing."""
        return np.concatenate([r[self.edge : -self.edge or None : self.thinning] for r in rows])

    def block(self) -> np.ndarray:
        """Return the block number, 0 to BLOCKS - 1, of every kept row: equal stretches of motion."""
        count = sum(len(s.time[self.edge : -self.edge or None : self.thinning]) for s in self.strips)
        return np.arange(count) * BLOCKS // count


def prepare(stage: Stage, recordings: Sequence[Recording], cut: float | None = None) -> Motion:
    """Bring recordings of one rate to a workable size: windows of long ones, averages of fast ones."""
    rate = recordings[0].rate_hz
    strips = [s for r in recordings for s in _windows(r, MOST_ROWS // len(recordings), rate)]
    factor = max(1, int(rate // FASTEST_HZ))
    if factor > 1:
        strips = [_averaged(s, factor) for s in strips]
        rate /= factor
    cut = cut or _bandwidth(stage, strips, rate)
    if _coarse(stage, strips):
        # Every false reversal is a branch of the hysteresis: a coarse encoder is smoothed before it.
        strips = [
            replace(s, position=zero_phase(s.position, min(2.0 * cut, 0.4 * rate), rate)) for s in strips
        ]
    # Rows far finer than the bandwidth cost time and tell nothing: friction is exact over a displacement.
    factor = int(rate / (OVERSAMPLED * cut))
    if factor > 1:
        strips = [_averaged(s, factor) for s in strips]
        rate /= factor
    return Motion(strips, rate, cut)


def _windows(recording: Recording, most: int, rate: float) -> list[Strip]:
    most *= max(1, int(rate // FASTEST_HZ))
    good = recording.trusted
    position = np.interp(recording.time, recording.time[good], recording.position[good])
    time = recording.time - recording.time[0]
    whole = Strip(time, position, recording.voltage, recording.reference)
    if time.size <= most:
        return [whole]
    length = most // WINDOWS
    starts = np.linspace(0, time.size - length, WINDOWS).astype(int)
    return [_part(whole, slice(s, s + length)) for s in starts]


def _part(strip: Strip, rows: slice) -> Strip:
    reference = None if strip.reference is None else strip.reference[rows]
    return Strip(strip.time[rows], strip.position[rows], strip.voltage[rows], reference)


def _averaged(strip: Strip, factor: int) -> Strip:
    count = strip.time.size // factor

    def mean(a: Floats) -> Floats:
        return np.asarray(a[: count * factor].reshape(count, factor).mean(axis=1))

    # Position at the middle of the averaged rows; commands held over them average to the same middle,
    # half a short row later.
    return Strip(
        mean(strip.time),
        mean(strip.position),
        mean(strip.voltage),
        None if strip.reference is None else mean(strip.reference),
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
