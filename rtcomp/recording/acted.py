"""Our own recordings as an outsider would have made them: commands where they acted, doubtful rows marked.

Over a link a command takes effect a tick after the row that holds it, and some rows hold a position that was
measured at another time. The recording says both; who compares force with motion must not take them for
physics.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.recording.reader import Recording


def as_acted(recording: Recording) -> Recording:
    """Return the recording with each row's voltage the one that acted from that row on, until the next.

    Where the metadata of one of our own recordings name ``delay_ticks``, the voltage (V) is moved later by as
    many ticks of the loop that made it, before the first command zero; rows of a stale sample (``status``),
    of a late tick and of a lost one (``overrun``) are marked in the column ``gap``. Done once: what comes
    back has no delay. Any other recording comes back as it is.
    """
    if "rtcomp_version" not in recording.metadata:
        return recording
    columns = dict(recording.columns)
    notes = list(recording.notes)
    ticks = _number(recording.metadata.get("delay_ticks"))
    rows = ticks * recording.rate_hz / (_number(recording.metadata.get("rate_hz")) or recording.rate_hz)
    if rows > 0.0:
        columns["voltage"] = _later(recording.voltage, rows)
        notes.append(f"commands took effect {_count(ticks, 'tick')} after their row: moved there")
    doubtful = np.zeros(len(recording), dtype=np.bool_)
    for name in ("status", "overrun"):
        if name in columns:
            doubtful |= columns[name] != 0
    if doubtful.any():
        columns["gap"] = np.maximum(columns.get("gap", np.zeros(len(recording))), doubtful)
        notes.append(f"{_count(doubtful.sum(), 'row')} not measured at their time: bridged")
    return replace(recording, columns=columns, notes=notes, metadata={**recording.metadata, "delay_ticks": 0})


def _number(value: Any) -> float:
    """Return the number that metadata hold, as text perhaps; 0 where there is none."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return 0.0


def _later(voltage: Floats, rows: float) -> Floats:
    """Move a held voltage (K,) later by `rows`; the mean over each row where that is no whole number."""
    whole = int(rows)
    share = rows - whole
    before = np.concatenate([np.zeros(whole + 1), voltage])
    return np.asarray(
        (1.0 - share) * before[1 : voltage.size + 1] + share * before[: voltage.size], dtype=np.float64
    )


def _count(number: Any, what: str) -> str:
    return f"{int(number)} {what}{'' if number == 1 else 's'}"
