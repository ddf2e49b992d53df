"""The stretches of a recording in which the drive was switched on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtcomp.errors import RecordingError
from rtcomp.recording.reader import Recording

ENABLED = "enabled"
"""Column that is 0 where the drive was switched off."""
LEAST_ROWS = 64
"""Shorter stretches are left out: a force balance needs as many."""


def driven(recording: Recording) -> list[Recording]:
    """Return the stretches of `recording` in which its column ``enabled`` is not 0, each a recording.

    A drive that is switched off neither pushes nor brakes, whatever command stands in those rows. Where there
    is no such column, or it is never 0, the recording comes back as it is. Raises RecordingError where the
    drive was never on for LEAST_ROWS rows.
    """
    column = recording.columns.get(ENABLED)
    if column is None or np.all(column != 0):
        return [recording]
    on = np.concatenate([[0], column != 0, [0]])
    first, last = np.flatnonzero(np.diff(on) > 0), np.flatnonzero(np.diff(on) < 0)
    kept = [slice(a, b) for a, b in zip(first, last, strict=True) if b - a >= LEAST_ROWS]
    off = int(np.count_nonzero(column == 0))
    if not kept:
        raise RecordingError(
            f"{recording.path}: the drive is switched off in {off} of {len(recording)} rows "
            f"({ENABLED} is 0), and never on for {LEAST_ROWS} rows; a diagnosis needs motion "
            "that the drive makes"
        )
    left = sum(part.stop - part.start for part in kept)
    note = f"the drive is switched off in {off} rows: {left} of {len(recording)} rows are looked at"
    found = []
    for i, rows in enumerate(kept):
        columns = {name: values[rows] for name, values in recording.columns.items()}
        notes = [*recording.notes, note] if i == 0 else []
        part = replace(recording, columns=columns, notes=notes, weights=None, weights_time=None)
        found.append(part)
    return found
