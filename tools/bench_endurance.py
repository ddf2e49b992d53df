"""Endurance: an hour of virtual time at 10 kHz, and minutes of wall clock at 1 kHz over the serial link.

The loop identifies, compensates and records. Memory of loop and recorder is read from outside while it runs
and must not grow once both are warm; no counter may be off; the recording is read back whole.

    python tools/bench_endurance.py --hours 1 --wall 20 --json endurance.json
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import h5py
import numpy as np
from bench_kill import children, ring_of
from figures_table import Figure, show
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.cli.runs import load
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import RING_SECONDS, describe, make_device, make_tick
from rtcomp.loop.clock import VirtualClock, WallClock
from rtcomp.loop.realtime import in_force, realtime_process
from rtcomp.loop.ring import CLOSED, Ring
from rtcomp.loop.run import run
from rtcomp.loop.tick import COLUMNS
from rtcomp.recording.recorder import Recorder

WARM = 0.1
"""Part of a run after which memory must not grow."""
SAMPLES = 400
"""About how often memory is read in a run, at most five times a second."""
PIECE = 1 << 20
"""Rows of a recording that are read back at a time."""
STALLS = ("missed", "late", "lagging")
"""Counters that a machine with stalls of its own moves."""


@dataclass
class Held:
    """Memory (kB) that processes held, from the first row to the last."""

    kb: dict[str, list[float]] = field(default_factory=lambda: {"loop": [], "recorder": []})

    def read(self, who: str, pid: int) -> None:
        """Note what the process holds now; nothing where it has just ended."""
        with contextlib.suppress(OSError):
            for line in Path(f"/proc/{pid}/status").read_text().splitlines():
                if line.startswith("VmRSS:"):
                    self.kb[who].append(float(line.split()[1]))

    def growth_mb(self, who: str) -> float:
        """MB held more in the last twentieth of the run than in the one after warming up; medians, for
        what is taken and given back in between is no growth."""
        held = np.array(self.kb[who])
        few, warm = max(1, held.size // 20), int(WARM * held.size)
        return float(np.median(held[-few:]) - np.median(held[warm : warm + few])) / 1024.0


def endure(config: Configuration, folder: Path, seconds: float) -> dict[str, Any]:
    """The loop's process: run, record, return how it went. It reads nothing back: an hour is 4 GB."""
    device = make_device(config)
    tick = make_tick(config, device.delay_ticks)
    ticks = round(seconds * config.stage.rate)
    plan = ReferencePlan(
        config.reference(), config.stage, config.period, ticks, device.delay_ticks, ALWAYS, 0.0
    )
    ring = Ring.create(int(RING_SECONDS * config.stage.rate), tick.row_width)
    in_loop = in_force()
    recorder = Recorder.start(
        folder / "run.h5", ring, COLUMNS, describe(config, tick), weights_columns=tick.weights.size,
        later=tuple(in_loop),
    )  # fmt: skip
    with realtime_process() if config.wall_clock else contextlib.nullcontext(in_loop) as in_loop:
        recorder.fill(in_loop)
        clock = WallClock() if config.wall_clock else VirtualClock()
        outcome = run(
            device, tick, plan, clock, ring, recorder_alive=lambda: recorder.alive, spare_stand_ins=True
        )  # fmt: skip
    summary = recorder.finish(120.0)
    return {
        "late": outcome.late, "lost": outcome.lost, "rows_lost": summary.rows_lost, "ended": summary.ended,
        "counters": dict(getattr(device, "counters", {})), "seconds": outcome.seconds, "realtime": in_loop,
    }  # fmt: skip


def watched(config: list[str], folder: Path, seconds: float) -> tuple[dict[str, Any], Held]:
    """Run `endure` in a process of its own and read what it and its recorder hold."""
    command = [sys.executable, __file__, "--child", json.dumps([*config, str(folder), seconds])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    held, ring = Held(), None
    pause = 0.05
    while process.poll() is None:
        with contextlib.suppress(OSError):
            ring = ring or ring_of(process.pid)
        if ring is not None and not ring.header[CLOSED]:
            held.read("loop", process.pid)
            for pid in children(process.pid):
                held.read("recorder", pid)
            rows = max(1, ring.written)
            pause = 0.2 if rows < 1000 else min(max(0.2, seconds / SAMPLES), 2.0)
        time.sleep(pause)
    assert process.stdout is not None
    said = process.stdout.read()
    if process.returncode:
        raise RuntimeError(f"the loop's process ended with status {process.returncode}")
    result: dict[str, Any] = json.loads(said)
    return result, held


def complete(file: Path, rate: float, ticks: int) -> float:
    """Return which part of the rows is in the recording, in place, every number of them finite."""
    good = 0
    with h5py.File(file, "r") as recording:
        names = [name for name, item in recording.items() if isinstance(item, h5py.Dataset)]
        rows = min(recording[name].shape[0] for name in names)
        for first in range(0, rows, PIECE):
            part = slice(first, min(first + PIECE, rows))
            fine = np.round(recording["time"][part] * rate) == np.arange(part.start, part.stop)
            for name in names:
                fine &= np.isfinite(recording[name][part])
            good += int(np.count_nonzero(fine))
        if not recording.attrs["complete"]:
            return 0.0
    return good / ticks


def figures_of(name: str, result: dict[str, Any], held: Held, whole: float, stalls: bool) -> list[Figure]:
    odd = {k: n for k, n in result["counters"].items() if n and k not in ("sent", "samples", *STALLS)}
    waits = {k: n for k, n in result["counters"].items() if n and k in STALLS}
    off = sum(odd.values()) + result["rows_lost"]
    never = "" if stalls else "<= 0"
    grown = [
        Figure(
            f"{name}: {who}'s memory grew by", held.growth_mb(who), "MB", "<= 1",
            f"of {held.kb[who][-1] / 1024:.4g} MB",
        )
        for who in held.kb
    ]  # fmt: skip
    return [
        *grown,
        Figure(f"{name}: rows in the file", 100.0 * whole, "%", ">= 100"),
        Figure(f"{name}: counters off", float(off), "", "<= 0", _listed(odd)),
        Figure(f"{name}: slots lost", float(result["lost"]), "", never, _listed(waits)),
        Figure(f"{name}: late ticks", float(result["late"]), "", never),
        Figure(f"{name}: took", result["seconds"], "s"),
    ]


def _listed(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


@click.command()
@click.option("--hours", default=1.0, show_default=True, help="Of virtual time at 10 kHz; 0 for none.")
@click.option("--wall", default=0.0, show_default=True, help="Minutes of wall clock over serial; 0 for none.")
@click.option("--json", "path", type=click.Path(path_type=Path))
@click.option("--child", hidden=True)
def main(hours: float, wall: float, path: Path | None, child: str | None) -> None:
    file = shipped("leuven.yaml")
    if child is not None:
        rate, port, folder, seconds = json.loads(child)
        config = load(file, port=port).changed(rate=rate)
        if port is not None:  # a machine that stalls for longer than a board would wait shall not end it
            config = config.changed(device={**config.run.device, "watchdog": 5.0})
        print(json.dumps(endure(config, Path(folder), seconds)))
        return
    figures: list[Figure] = []
    memory: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        if hours:
            result, held = watched([10_000.0, None], Path(name), 3600.0 * hours)
            whole = complete(Path(name, "run.h5"), 10_000.0, round(36e6 * hours))
            what = f"{hours:g} h virtual at 10 kHz"
            figures += figures_of(what, result, held, whole, stalls=False)
            memory[what] = held.kb
            Path(name, "run.h5").unlink()
        if wall:
            with PlantProcess(file) as plant:
                result, held = watched([1000.0, plant.port], Path(name), 60.0 * wall)
            whole = complete(Path(name, "run.h5"), 1000.0, round(6e4 * wall))
            what = f"{wall:g} min over serial at 1 kHz"
            figures += figures_of(what, result, held, whole, stalls=True)
            memory[what] = held.kb
    show("Endurance", figures, path, memory_kb=memory)


if __name__ == "__main__":
    main()
