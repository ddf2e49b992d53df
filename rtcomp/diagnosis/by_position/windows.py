"""Recordings as short simulated windows, and a stage fitted to where it ends up in them.

Where friction is stiffer than the encoder sees, the balance of forces says little: while the axis sticks,
friction is whatever the drive gives, and no recorded motion tells. A simulation sticks by itself. So the
stage is let go from points all along the recording, driven by what was commanded, and judged by how far its
position is off (multiple shooting: Bock 1981; van Domselaar, Hemker 1975).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtcomp.diagnosis.motion import BLOCKS, UNSEEN
from rtcomp.kernels import Floats
from rtcomp.physics import Place
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import zero_phase
from rtcomp.stage.sensed import true_position
from rtcomp.stage.shoot import shoot
from rtcomp.stage.stage import Stage

PERIODS = 4.0
"""Length of a window in periods of the bandwidth: time to break away or not, too short to drift off."""
COARSE = 3.0
"""Length of integration steps, in those of a simulation: windows are short, and run thousands of times."""
STRETCH = 3
"""Windows' length that a stretch of one block has."""
FASTEST_HZ = 1000.0
"""Rows a second at the most; the command between them is averaged."""
MOST_WINDOWS = 96
"""Of longer recordings, windows are taken evenly spread."""


@dataclass(frozen=True)
class Track:
    """One recording, ready to follow: time (s), reading (m), the same smoothed, voltage (V), (K,) each."""

    time: Floats
    reading: Floats
    position: Floats
    voltage: Floats


@dataclass(frozen=True)
class Windows:
    """Where a stage is let go in each track, for how many rows, and the block of every window."""

    tracks: Sequence[Track]
    starts: Sequence[np.ndarray]
    rows: int
    block: np.ndarray
    stretch: int
    """Rows of a stretch; stretches of all tracks, one after the other, go to the blocks in turn."""

    @property
    def recording(self) -> np.ndarray:
        """Number of the track that each window is of, (W,)."""
        return np.repeat(np.arange(len(self.starts)), [s.size for s in self.starts])

    @property
    def seconds(self) -> float:
        """Length of a window (s)."""
        return self.rows * float(self.tracks[0].time[1] - self.tracks[0].time[0])

    def unseen_rows(self) -> list[np.ndarray]:
        """Return which rows (K,) bool of each track are left out of the fit."""
        found, before = [], 0
        for track in self.tracks:
            rows = before + np.arange(track.time.size)
            found.append(np.isin(rows // self.stretch % BLOCKS, UNSEEN))
            before += track.time.size
        return found

    def as_if(self, stage: Stage, cut: float, seed: int) -> Windows:
        """Return the windows of the same commands if `stage` were the whole truth, read by its sensor."""
        random = np.random.default_rng(seed)
        count, noise = stage.sensor.resolution, stage.sensor.noise
        tracks = []
        for track in self.tracks:
            whole = np.array([0])
            velocity = np.zeros_like(track.time)
            went = shoot(stage, track.time, track.position, velocity, track.voltage, whole, track.time.size)[
                0
            ]
            went = np.nan_to_num(went) + noise * random.standard_normal(went.size)
            reading = count * np.round(went / count) if count > 0.0 else went
            rate = 1.0 / float(track.time[1] - track.time[0])
            smooth = zero_phase(reading, min(2.0 * cut, 0.4 * rate), rate)
            tracks.append(Track(track.time, reading, smooth, track.voltage))
        return replace(self, tracks=tracks)

    @property
    def seen(self) -> np.ndarray:
        """Windows that the fit uses, (W,) bool."""
        return ~np.isin(self.block, UNSEEN)

    def off(self, stage: Stage, which: np.ndarray | None = None) -> Floats:
        """Return how far the simulated position is off, m, (windows of `which`, rows); not finite is far."""
        use = np.ones(self.block.size, dtype=np.bool_) if which is None else which
        sensors = any(e.place is Place.SENSOR and "resolution" not in e.name for e in stage.chain)
        found, at = [], 0
        for track, starts in zip(self.tracks, self.starts, strict=True):
            mine = starts[use[at : at + starts.size]]
            at += starts.size
            if not mine.size:
                continue
            position = true_position(stage.chain, track.time, track.position) if sensors else track.position
            reading = true_position(stage.chain, track.time, track.reading) if sensors else track.reading
            velocity = np.gradient(position, track.time)
            went = shoot(stage, track.time, position, velocity, track.voltage, mine, self.rows, COARSE)
            found.append(went - reading[mine[:, None] + np.arange(self.rows)])
        off = np.concatenate(found)
        far = float(np.ptp(np.concatenate([t.reading for t in self.tracks])))
        return np.asarray(np.clip(np.nan_to_num(off, nan=far, posinf=far, neginf=-far), -far, far))


def windows_of(recordings: Sequence[Recording], cut: float) -> Windows:
    """Cut recordings of one rate into windows for a bandwidth of `cut` (Hz).

    Stretches of STRETCH windows go to the BLOCKS in turn, so that every block has a bit of every motion.
    """
    tracks = [_track(r, cut) for r in recordings]
    period = float(tracks[0].time[1] - tracks[0].time[0])
    total = sum(t.time.size for t in tracks)
    rows = min(max(8, round(PERIODS / cut / period)), max(8, total // (2 * BLOCKS)))
    stretch = max(rows, min(STRETCH * rows, total // BLOCKS))
    starts, blocks, before = [], [], 0
    for track in tracks:
        mine = np.arange(0, track.time.size - rows + 1, max(1, rows // 2))
        first, last = (before + mine) // stretch, (before + mine + rows - 1) // stretch
        whole = first == last  # a window lies in one stretch, so that none is half seen
        starts.append(mine[whole])
        blocks.append(first[whole] % BLOCKS)
        before += track.time.size
    thin = max(1, -(-sum(s.size for s in starts) // MOST_WINDOWS))
    starts, blocks = [s[::thin] for s in starts], [b[::thin] for b in blocks]
    return Windows(tracks, starts, rows, np.concatenate(blocks), stretch)


def _track(recording: Recording, cut: float) -> Track:
    good = recording.trusted
    time = recording.time - recording.time[0]
    reading = np.interp(time, time[good], recording.position[good])
    rate = recording.rate_hz
    smooth = zero_phase(reading, min(2.0 * cut, 0.4 * rate), rate)
    factor = max(1, int(rate // FASTEST_HZ))
    if factor == 1:
        return Track(time, reading, smooth, recording.voltage)
    count = time.size // factor
    voltage = recording.voltage[: count * factor].reshape(count, factor).mean(axis=1)
    rows = slice(0, count * factor, factor)
    return Track(time[rows], reading[rows], smooth[rows], voltage)
