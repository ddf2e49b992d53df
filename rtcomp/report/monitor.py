"""The process that watches a run on a wall clock: ``python -m rtcomp.report.monitor JOB`` (JSON)."""

from __future__ import annotations

import json
import os
import signal
import sys
import time

from rtcomp.loop.ring import Ring
from rtcomp.report.terminal import Progress
from rtcomp.report.watch import closed, figures


def main() -> None:
    """Draw the progress of the ring's run until it is closed or its process has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the loop ends the run, and with it this process
    job = json.loads(sys.argv[1])
    ring = Ring.attach(job["ring"])
    parent = os.getppid()
    with Progress(job["title"]) as progress:
        while not closed(ring) and os.getppid() == parent:
            progress.update(ring.written / job["ticks"], figures(ring, job["columns"], job["unit"]))
            time.sleep(0.125)
        progress.update(ring.written / job["ticks"])


if __name__ == "__main__":
    main()
