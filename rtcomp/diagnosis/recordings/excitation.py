"""What a recording's motion can show at all: motion, reversals, clipping, repeated and bridged rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.recordings.data import reversals
from rtcomp.errors import RecordingError
from rtcomp.kernels import Floats
from rtcomp.recording.pieces import pieces, steps
from rtcomp.recording.reader import Recording

CLIPPED = 0.5
"""Share of rows at the very largest or smallest value above which a column is clipped throughout."""
_SOME = 0.02
_TRUSTED = 0.5
FEW_REVERSALS = 6


def moved(recording: Recording, noise: float, unit: str) -> None:
    """Raise RecordingError where nothing was commanded, or nothing moved beyond the sensor's `noise` (rms).

    Positions are told in `unit`. With `noise` 0 only the recording itself tells: readings that do not hang
    together from row to row.
    """
    path, position, voltage = recording.path, recording.position, recording.voltage
    good = recording.trusted
    if np.count_nonzero(good) < _TRUSTED * len(recording):
        raise RecordingError(
            f"{path}: {100 * (1 - good.mean()):.0f} % of its rows are outliers or bridged gaps; "
            "record it again"
        )
    span = float(np.ptp(voltage))
    if span <= 1e-12 * _largest(voltage):
        raise RecordingError(
            f"{path}: voltage is {voltage[0]:g} V in every row; a diagnosis needs a command that changes"
        )
    travel = float(np.ptp(position[good]))
    if noise > 0.0:
        floor = 8.0 * noise
        if travel <= floor:
            raise RecordingError(
                f"{path}: nothing moved: position stays within {travel:.3g} {unit}, which the sensor's noise "
                f"and resolution alone make ({floor:.3g} {unit}); command more than friction holds"
            )
        return
    parts = [position[max(p.start - 2, 0) : p.stop] for p in pieces(len(position))]
    white = float(np.sqrt(np.mean([np.var(np.diff(part, 2)) for part in parts if part.size > 2]) / 6.0))
    if float(np.std(position)) < 1.5 * white:
        raise RecordingError(
            f"{path}: nothing moved: position stays within {travel:.3g} {unit} and is noise from row to "
            "row; command more than friction holds"
        )


def clipping(recording: Recording, voltage_limit: float, unit: str) -> list[str]:
    """Return notes on columns that sit at their extremes; raise RecordingError where that is most rows.

    Positions are told in `unit`.
    """
    notes = []
    voltage, position = recording.voltage, recording.position
    largest = _largest(voltage)
    share = _at_extremes(voltage)
    if share > CLIPPED:
        raise RecordingError(
            f"{recording.path}: voltage is saturated or clipped in {100 * share:.0f} % of its rows (at "
            f"{voltage.min():g} or {voltage.max():g} V); record a motion that the drive can follow"
        )
    if share > _SOME:
        notes.append(
            f"voltage is at its largest ({largest:.3g} V) in {100 * share:.0f} % of the rows: saturated there"
        )
    if largest > 1.02 * voltage_limit:
        notes.append(f"voltage reaches {largest:.4g} V, the stage's voltage_limit is {voltage_limit:g} V")
    share = _at_extremes(position)
    if share > CLIPPED and _arrives_at_speed(position):
        raise RecordingError(
            f"{recording.path}: position is clipped: {100 * share:.0f} % of its rows are exactly "
            f"{position.min():.6g} or {position.max():.6g} {unit}, reached at full speed; check the sensor's "
            "range"
        )
    if share > 10 * _SOME:
        notes.append(
            f"position is exactly at its highest or lowest value in {100 * share:.0f} % of the rows: resting "
            "there, or clipped"
        )
    both = zip(steps(position), steps(voltage), strict=True)
    again = sum(np.count_nonzero((x == 0) & (u == 0)) for (_, x), (_, u) in both) / (len(position) - 1)
    if again > 0.3:
        notes.append(
            f"{100 * again:.0f} % of the rows repeat the one before: recorded faster than measured? "
            "--rate takes fewer"
        )
    bridged = 1.0 - float(recording.trusted.mean())
    if bridged > _SOME:
        notes.append(f"{100 * bridged:.0f} % of the rows are outliers or bridged gaps and are left out")
    return notes


def check(recordings: Sequence[Recording], unit: str) -> list[str]:
    """Return notes on the reversals of all `recordings`; raise RecordingError where there is none.

    Positions are told in `unit`.
    """
    counts = [reversals(r.position[r.trusted]) for r in recordings]
    total = sum(counts)
    if total == 0:
        first = recordings[0]
        ways = {bool(r.position[-1] > r.position[0]) for r in recordings}
        if len(ways) == 1:
            which = "up" if ways.pop() else "down"
            what = f"{first.path}: moves" if len(recordings) == 1 else "the recordings move"
            raise RecordingError(
                f"{what} in one direction only ({which}, from {first.position[0]:.4g} to "
                f"{first.position[-1]:.4g} {unit}), without a reversal; friction and all that differs by "
                "direction needs motion both ways"
            )
        return ["no recording has a reversal in it: what happens at reversals cannot be seen"]
    if total < FEW_REVERSALS:
        many = "one reversal" if total == 1 else f"{total} reversals"
        return [f"only {many}: what happens at reversals is hardly seen; ten or more are good"]
    return []


def _largest(column: Floats) -> float:
    """Return the largest magnitude."""
    return max(abs(float(column.max())), abs(float(column.min())))


def _at_extremes(column: Floats) -> float:
    """Return the share of rows at exactly the smallest or largest value, beyond the two that have to be."""
    edges = np.count_nonzero(column == column.max()) + np.count_nonzero(column == column.min())
    return max(0.0, (int(edges) - 2) / column.size)


def _arrives_at_speed(position: Floats) -> bool:
    """Return whether `position` reaches its extremes without slowing down, as nothing that moves can."""
    reach = 8
    edge = (position == position.max()) | (position == position.min())
    steps = np.abs(position[reach:] - position[:-reach])
    inside = ~edge[reach:] & ~edge[:-reach] & (steps > 0)
    arriving = np.flatnonzero(edge[reach + 1 :] & ~edge[reach:-1] & ~edge[: -reach - 1])
    if not inside.any() or not arriving.size:
        return False
    return bool(np.median(steps[arriving]) > 0.5 * np.median(steps[inside]))
