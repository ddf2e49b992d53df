"""Watching a run in the terminal: from inside in virtual time, from a process of its own on a wall clock.

A second thread, or drawing between two ticks, would hold up the loop; a process that looks at the ring in
shared memory does not.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from rtcomp.loop.ring import CLOSED, Ring
from rtcomp.report.terminal import Progress, si

LOOK_BACK = 2000
"""Rows that the figures are made from."""


class TerminalWatch:
    """Progress lines for the runs of a job; see `rtcomp.jobs.session.Watch`."""

    def __init__(self, titles: Sequence[str], *, quiet: bool = False, unit: str = "m") -> None:
        self._titles = list(titles)
        self._width = max((len(title) for title in titles), default=0)
        self._quiet = quiet
        self._unit = unit
        self._progress: Progress | None = None

    def update(self, done: int, ticks: int, ring: Ring, columns: tuple[str, ...]) -> None:
        """Show where the run is; a run that begins takes the next title."""
        if self._progress is None:
            self._progress = Progress(self._title(), quiet=self._quiet)
            self._progress.__enter__()
        if self._progress.due:
            self._progress.update(done / ticks, figures(ring, columns, self._unit))
        if done >= ticks:
            self.close()

    @contextlib.contextmanager
    def attach(self, ring: Ring, columns: tuple[str, ...], ticks: int) -> Iterator[None]:
        """Show the run from another process until the context ends."""
        title = self._title()
        if self._quiet or not sys.stderr.isatty():
            yield
            return
        job = {
            "ring": ring.descriptor,
            "columns": columns,
            "ticks": ticks,
            "title": title,
            "unit": self._unit,
        }
        process = subprocess.Popen(
            [sys.executable, "-m", "rtcomp.report.monitor", json.dumps(job)],
            pass_fds=(ring.descriptor,),
            stdin=subprocess.DEVNULL,
        )
        try:
            yield
        finally:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
            process.kill()
            process.wait()

    def close(self) -> None:
        """End the line of the run at hand."""
        if self._progress is not None:
            progress, self._progress = self._progress, None
            progress.__exit__(None, None, None)

    def _title(self) -> str:
        return (self._titles.pop(0) if self._titles else "run").ljust(self._width)


def figures(ring: Ring, columns: Sequence[str], unit: str = "m") -> dict[str, Any]:
    """Return what the newest rows of the ring say: tracking error, model error, late ticks."""
    written = ring.written
    count = min(written, LOOK_BACK, ring.capacity - 1)
    if count < 2:
        return {}
    rows = ring.rows[np.arange(written - count, written) % ring.capacity]
    column = {name: rows[:, j] for j, name in enumerate(columns)}
    error = column["reference"] - column["position"]
    peak = float(np.abs(column["force"]).max())
    shown = {"error": f"{si(float(np.sqrt(np.mean(error**2))), unit)} rms"}
    if peak > 0.0:
        residual = float(np.sqrt(np.mean((column["force"] - column["force_model"]) ** 2)))
        shown["model off"] = f"{100 * residual / peak:.1f} %"
    shown["late"] = f"{int(np.count_nonzero(column['overrun']))} of {count}"
    return shown


def closed(ring: Ring) -> bool:
    """Tell whether the loop has ended."""
    return bool(ring.header[CLOSED])
