"""The job `inspect`: is a recorded hysteresis symmetric, congruent, closed, the same at every speed?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rtcomp.errors import ConfigError, RecordingError
from rtcomp.inspection.branches import Branch, branches
from rtcomp.inspection.closure import Closure, closure
from rtcomp.inspection.congruency import Congruency, congruency
from rtcomp.inspection.grain import Sight, sight_of
from rtcomp.inspection.kinds import NEAR, Kind, MajorLoop, kinds_of, major_loop
from rtcomp.inspection.rates import Rates, rates
from rtcomp.inspection.symmetry import Symmetry, symmetry
from rtcomp.inspection.words import closure_figures, congruency_figures, rate_figures, symmetry_figures
from rtcomp.jobs.identify import bridged
from rtcomp.kernels import Floats
from rtcomp.recording.acted import as_acted
from rtcomp.recording.driven import ENABLED
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import bandwidth, known_force, zero_phase
from rtcomp.stage.stage import Stage

LEAST_ROWS = 64
ENOUGH = 8
"""With so many branches the first loop is left out: it still holds how the run began."""
LARGE = 0.5
"""Branches longer than this part of the stroke are looked at with the minor loops in them left out."""
DOUBTFUL = 0.1
"""A branch of which a larger part was not measured is left out."""


@dataclass(frozen=True)
class Inspected:
    """What a recording says of its hysteresis. Arrays (K,), smoothed alike, positions m, forces N."""

    name: str
    time: Floats
    position: Floats
    force: Floats
    sight: Sight
    branches: Sequence[Branch]
    left_out: Sequence[Branch]
    kinds: Sequence[Kind]
    loop: MajorLoop | None
    symmetry: Symmetry | None
    congruency: Congruency | None
    closure: Closure
    rates: Rates
    notes: list[str]

    @property
    def force_range(self) -> tuple[float, float]:
        """Lowest and highest force of the branches looked at, N."""
        return _range([b.forces() for b in self.branches])

    def summary(self) -> dict[str, Any]:
        """Return the figures, for `--json` and the result file."""
        low, high = _range([np.array([b.position, b.end]) for b in self.branches])
        least, most = self.force_range
        rising = sum(b.rising for b in self.branches)
        return {
            "recording": self.name,
            "rows": int(self.time.size),
            "seconds": float(self.time[-1] - self.time[0]),
            "smoothing_hz": self.sight.smoothing_hz,
            "noise_m": self.sight.grain.noise,
            "count_m": self.sight.grain.count,
            "reversal_m": self.sight.reversal,
            "lowest_m": low,
            "highest_m": high,
            "force_lowest_n": least,
            "force_highest_n": most,
            "branches_rising": rising,
            "branches_falling": len(self.branches) - rising,
            "branches_left_out": len(self.left_out),
            "symmetry": symmetry_figures(self.symmetry),
            "congruency": congruency_figures(self.congruency),
            "closure": closure_figures(self.closure),
            "rate_dependence": rate_figures(self.rates),
            "notes": self.notes,
        }


def inspect(
    recording: Recording,
    stage: Stage | None = None,
    *,
    delay_ticks: int = 0,
    smoothing_hz: float | None = None,
    reversal: float | None = None,
    settle: float | None = None,
) -> Inspected:
    """Cut a recording into branches and test its hysteresis.

    The force is that of friction, where a `stage` says what else the drive's force was needed for; without
    one it is the column ``voltage`` as it is. Position and force go through one low-pass at `smoothing_hz`
    (0 for none; by default what the sensor and the motion ask for, at most a tenth of the rate and 100 Hz).
    A motion back by more than `reversal` (m) is a reversal; branches that begin in the first `settle` seconds
    are left out (by default the first loop, where there are enough). Raises RecordingError where there is no
    rising and no falling branch, too few rows or no force; ConfigError for an option out of range.
    """
    recording = as_acted(recording)
    path = recording.path
    if len(recording) < LEAST_ROWS:
        raise RecordingError(f"{path}: {len(recording)} rows; an inspection needs at least {LEAST_ROWS}")
    time = recording.time - recording.time[0]
    _check_options(recording, smoothing_hz, settle, float(time[-1]))
    good = recording.trusted & (recording.columns.get(ENABLED, np.ones(len(recording))) != 0)
    position = bridged(recording)
    rate = recording.rate_hz
    sight = sight_of(position, rate, bandwidth(rate), smoothing_hz, reversal)
    force = _force(recording, stage, time, position, delay_ticks)
    if sight.smoothing_hz > 0.0:
        position, force = (zero_phase(signal, sight.smoothing_hz, rate) for signal in (position, force))
    least = sight.reversal
    found = branches(time, position, force, least, sight.rest)
    began = found[2].time if len(found) >= ENOUGH else 0.0
    settled = began if settle is None else settle
    kept, out = _parted(found, settled, good)
    _check_branches(recording, position, found, kept, least, reversal, settle)
    notes = [*recording.notes, *_said(sight, stage, out, found)]
    span = _range([np.array([b.position, b.end]) for b in kept])
    span_force = _range([b.forces() for b in kept])
    size, size_force = span[1] - span[0], span_force[1] - span_force[0]
    if not size_force > 0.0:
        raise RecordingError(
            f"{path}: the force is {span_force[0]:g} all along; map another column: --map voltage=COLUMN"
        )
    near = max(NEAR * size, least)
    # Over minor loops a branch goes on as if they had not been (wiping-out): the large ones are whole so.
    large = branches(time, position, force, max(least, LARGE * size), sight.rest)
    whole = {b.rows[0]: b for b in _parted(large, settled, good)[0]}
    kinds = kinds_of([whole.get(b.rows[0], b) for b in kept], near, size_force)
    loop = major_loop(kinds, near)
    centre = (0.5 * sum(span), 0.5 * sum(span_force))
    return Inspected(
        path.name, time, position, force, sight, kept, out, kinds, loop,
        symmetry(loop) if loop is not None else None,
        congruency(kinds, size_force, centre, size) if kinds else None,
        closure(kept, size_force), rates(kinds, 0.5 * size_force), notes,
    )  # fmt: skip


def _check_options(
    recording: Recording, smoothing: float | None, settle: float | None, seconds: float
) -> None:
    half = 0.5 * recording.rate_hz
    if smoothing is not None and not smoothing < half:
        raise ConfigError(
            f"--smoothing is {smoothing:g} Hz; allowed is [0, {half:g}), below half of the recording's rate"
        )
    if settle is not None and not settle < seconds:
        raise ConfigError(f"--settle is {settle:g} s; the recording lasts {seconds:.4g} s")


def _force(
    recording: Recording, stage: Stage | None, time: Floats, position: Floats, delay_ticks: int
) -> Floats:
    """Return the force (N) around each row, not yet smoothed: what the drive gave less what else it moved."""
    acts = recording.voltage
    if delay_ticks:
        acts = np.concatenate([np.full(delay_ticks, acts[0]), acts[:-delay_ticks]])
    if stage is None and "rtcomp_version" not in recording.metadata:
        return acts
    # A command is held until the next row: around a row acts the mean of two.
    force = 0.5 * (acts + np.append(acts[:1], acts[:-1]))
    if stage is None:
        return force
    rate = recording.rate_hz
    slow = zero_phase(position, bandwidth(rate), rate)
    acceleration = np.zeros_like(position)
    acceleration[1:-1] = (position[2:] - 2.0 * position[1:-1] + position[:-2]) * rate**2
    known = known_force(stage, time, slow, np.gradient(slow, 1.0 / rate))
    return np.asarray(stage.force_constant * force - stage.mass * acceleration - known)


def _parted(
    found: list[Branch], settled: float, good: npt.NDArray[np.bool_]
) -> tuple[list[Branch], list[Branch]]:
    """Return the branches to look at and those left out: the beginning, and what was not measured."""
    kept: list[Branch] = []
    out: list[Branch] = []
    for one in found:
        rows = slice(one.rows[0], one.rows[1] + 1)
        measured = float(np.mean(good[rows])) >= 1.0 - DOUBTFUL
        (kept if measured and one.time >= settled else out).append(one)
    return kept, out


def _check_branches(
    recording: Recording,
    position: Floats,
    found: list[Branch],
    kept: list[Branch],
    least: float,
    reversal: float | None,
    settle: float | None,
) -> None:
    if any(b.rising for b in kept) and any(not b.rising for b in kept):
        return
    path = recording.path
    stroke = float(np.ptp(position))
    if least >= 0.5 * stroke:
        seen = "--reversal" if reversal is not None else "what is no noise of the sensor (--reversal sets it)"
        raise RecordingError(
            f"{path}: {seen} is {least:.3g}, the whole stroke only {stroke:.3g}; there is no loop to look at"
        )
    if len(found) >= 2 and settle is not None:
        raise RecordingError(
            f"{path}: after --settle {settle:g} s there is no rising and falling branch left; give less"
        )
    if len(found) >= 2:
        raise RecordingError(
            f"{path}: too few branches were measured without gaps and outliers for a loop; record it anew"
        )
    way = "rises" if position[-1] > position[0] else "falls"
    turned = (
        f"turns back once by more than {least:.3g}"
        if found
        else f"only {way}, and nowhere turns back by more than {least:.3g}"
    )
    raise RecordingError(
        f"{path}: the position {turned}; an inspection needs two reversals or more: record "
        "motion to both sides, or give a smaller --reversal"
    )


def _said(sight: Sight, stage: Stage | None, out: Sequence[Branch], found: Sequence[Branch]) -> list[str]:
    notes = []
    if stage is None:
        notes.append(
            "no stage was given: the column voltage is taken as the force, as it is; inertia and "
            "what goes with speed are in it"
        )
    if sight.floored:
        notes.append(
            f"the sensor is coarse for this motion: the low-pass of {sight.smoothing_hz:.3g} Hz that it asks "
            "for rounds the corners of the loops, of small ones most"
        )
    if out:
        notes.append(
            f"{len(out)} of {len(found)} branches left out: the beginning, and what was not measured"
        )
    return notes


def _range(some: Sequence[Floats]) -> tuple[float, float]:
    return min(float(one.min()) for one in some), max(float(one.max()) for one in some)
