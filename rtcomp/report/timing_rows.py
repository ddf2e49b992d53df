"""How the ticks of runs went, as rows of a table."""

from __future__ import annotations

import numpy as np

from rtcomp.jobs.session import Run
from rtcomp.loop.states import State
from rtcomp.report.page import Row


def timing_rows(*runs: Run) -> list[Row]:
    """Return how the ticks went."""
    ticks = sum(r.outcome.ticks for r in runs)
    rows = [Row("Ticks", f"{ticks:,}", "", f"at {runs[0].rate_hz:g} Hz")]
    if any(r.columns["lateness_us"].any() for r in runs):
        late = np.concatenate([r.columns["lateness_us"] for r in runs])
        rows.append(
            Row(
                "Late ticks", f"{sum(r.outcome.late for r in runs):,}", "", "by more than a tenth of a period"
            )
        )
        rows.append(Row("Slots lost", f"{sum(r.outcome.lost for r in runs):,}"))
        stale = sum(int(np.count_nonzero(r.columns["status"])) for r in runs)
        rows.append(Row("Samples missing", f"{stale:,}", "", "no reply in time; an older one was used"))
        rows.append(Row("Lateness, median", float(np.median(late)) * 1e-6, "s"))
        rows.append(Row("Lateness, 99 %", float(np.percentile(late, 99)) * 1e-6, "s"))
        rows.append(Row("Scheduling", runs[-1].realtime.get("scheduling_class", "unknown")))
    if degraded := sum(r.outcome.degraded for r in runs):
        ticks_off = sum(int(np.count_nonzero(r.columns["state"] == State.DEGRADED)) for r in runs)
        note = f"{ticks_off:,} ticks by feedback alone: deadlines missed, or identifier put aside"
        rows.append(Row("Degraded", f"{degraded:,} times", "", note))
    if diverged := sum(r.outcome.diverged for r in runs):
        rows.append(Row("Identifier put aside", f"{diverged:,} times", "", "it had diverged"))
    if taken_back := sum(r.outcome.taken_back for r in runs):
        note = "what was kept foresaw the force better"
        rows.append(Row("Learning taken back", f"{taken_back:,} times", "", note))
    if repeated := sum(r.outcome.repeated for r in runs):
        rows.append(Row("Samples not new", f"{repeated:,}", "", "though the device said so; not used"))
    for run in runs:
        if run.recorder is not None and run.recorder.problem:
            rows.append(Row("Recording", run.recorder.problem))
    return rows
