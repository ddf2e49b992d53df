"""What a person should know beside the answer: what was looked at, where it holds, what else it may be."""

from __future__ import annotations

from collections.abc import Sequence

from rtcomp.diagnosis.base import BELIEVED
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.result import Retuned
from rtcomp.diagnosis.scene import Entry
from rtcomp.recording.reader import Recording
from rtcomp.units import for_axis, prefixed

ALONG = ("parallel-spring", "position-force", "position-dependent-friction")
"""Entries whose force beyond the recorded motion is a guess; waves and stops are bounded there."""
SOFTER = "non-congruent-friction"
"""Entry that another reach does the work of."""


def looked_at(motion: Motion, recordings: Sequence[Recording]) -> list[str]:
    """Say in which band, and in how much of the recordings, forces are compared."""
    notes = [f"forces are compared below {motion.cut:.3g} Hz"]
    rows = sum(len(r) for r in recordings)
    if motion.seconds * motion.rate < 0.9 * rows * motion.rate / recordings[0].rate_hz:
        notes.append(f"of {rows} rows, windows of {motion.seconds:.3g} s in all were looked at")
    return notes


def known_here(named: list[Entry], motion: Motion, axis: str) -> list[str]:
    """Say of forces along the way where they are known: what leads beyond asks for what nobody has seen."""
    along = [str(e["name"]) for e in named if e["name"] in ALONG]
    if not along:
        return []
    (low, high), unit = prefixed(for_axis("m", axis), *motion.stroke)
    return [
        f"{' and '.join(along)}: known from {low} to {high} {unit}, where this motion went, and not beyond"
    ]


def or_else(retuned: Sequence[Retuned], named: list[Entry]) -> list[str]:
    """Say of a reach longer than beliefs are wrong by what else does the same.

    Where all branches begin in sliding, contacts that are softer the more they carry when they turn are
    contacts that reach further.
    """
    longer = [r for r in retuned if r.parameter == "friction.reach"]
    longer = [r for r in longer if r.after.value > (1.0 + BELIEVED) * r.before]
    if not longer or any(e["name"] == SOFTER for e in named):
        return []
    return [
        f"friction.reach, {longer[0].after.value / longer[0].before:.2f} times the believed one: {SOFTER} "
        "looks alike where motion slides before it turns; reversals inside presliding, at several forces, "
        "would tell"
    ]
