"""Kill a run with SIGKILL at random moments and see what its recording has lost.

The run identifies on a wall clock at 1 kHz. Killed are, in turn, the loop alone, and the loop together with
the recorder. The last tick that happened is read from the ring in shared memory, which outlives both.

    python tools/bench_kill.py --kills 20 --json kill.json
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click
import h5py
import numpy as np
from figures_table import Figure, show

from rtcomp.jobs.demo import shipped
from rtcomp.loop.ring import Ring

SCRATCH = 2
"""Rows of the ring on which a loop warms up."""


def children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


def ring_of(pid: int) -> Ring | None:
    """Open the ring of a running loop through its process's descriptors."""
    for link in Path(f"/proc/{pid}/fd").iterdir():
        descriptor = -1
        try:
            if "rtcomp-ring" in str(link.readlink()):
                descriptor = os.open(link, os.O_RDWR)
                ring = Ring.attach(descriptor)
                if ring.written and ring.capacity > SCRATCH:
                    return ring
        except (OSError, ValueError):  # closed meanwhile, or not yet a ring
            pass
        if descriptor >= 0:
            os.close(descriptor)
    return None


def one(folder: Path, both: bool, seconds: float) -> tuple[bool, float]:
    """Run, kill after `seconds` of the loop; return whether the file opens, and the ms it has lost."""
    program = str(Path(sys.executable).parent / "rtcomp")
    command = [program, "identify", str(shipped("leuven.yaml")), "--clock", "wall", "--seconds", "60"]
    run = subprocess.Popen([*command, "--out", str(folder)], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    ring = None
    while ring is None:
        if run.poll() is not None:
            raise RuntimeError(run.stderr.read().decode() if run.stderr else "the run ended")
        time.sleep(0.01)
        ring = ring_of(run.pid)
    time.sleep(seconds)
    victims = [*(children(run.pid) if both else []), run.pid]
    for pid in victims:
        os.kill(pid, signal.SIGKILL)
    run.wait()
    time.sleep(0.5)  # a recorder that was left alive drains the ring and closes the file
    written = ring.written
    try:
        with h5py.File(folder / "recording.h5", "r") as file:
            times = file["time"][:]
            rows = min(file[name].shape[0] for name in ("time", "position", "voltage"))
    except OSError:
        return False, float("inf")
    even = bool(np.array_equal(np.round(times[:rows] * 1000), np.arange(rows)))
    return even, float(written - rows)


@click.command()
@click.option("--kills", default=20, show_default=True)
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(kills: int, seed: int, path: Path | None) -> None:
    draw = random.Random(seed)
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        for both in (False, True):
            done = [one(Path(folder, f"{both}-{k}"), both, draw.uniform(0.05, 3.0)) for k in range(kills)]
            who = "loop and recorder" if both else "loop"
            opened = sum(ok for ok, _ in done)
            figures.append(
                Figure(f"{who} killed: files that open", float(opened), f"of {kills}", f">= {kills}")
            )
            figures.append(Figure(f"{who} killed: most missing", max(ms for _, ms in done), "ms", "<= 100"))
    show(f"SIGKILL at {kills} random moments, twice", figures, path)


if __name__ == "__main__":
    main()
