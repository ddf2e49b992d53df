"""SIGKILL and SIGSTOP of the loop at random moments: the device's own watchdog zeroes the output in its time.

The loop identifies and compensates at 1 kHz over a serial link, against a board in Python and the firmware in
C. What the device did is read from the plant's side of the link. Afterwards a new host finds a latched fault
and goes no further; once that is cleared the board is DISARMED, and arming it moves nothing.

    python tools/bench_watchdog.py --moments 100 --json watchdog.json
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path

import click
import numpy as np
from bench_kill import children
from bench_roundtrip import firmware
from figures_table import Figure, show
from rtcomp_drivers import protocol
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.plant_process import PlantProcess
from rtcomp_drivers.registry import create
from rtcomp_drivers.serial_link import SerialLink

from rtcomp.cli.runs import load
from rtcomp.errors import DeviceError
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.forked_loop import ForkedLoop
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import make_device, make_tick, run_loop

WATCHDOG_S = 0.05
LONGEST_S = 0.8
"""The latest moment, from the first ticks on."""
LONGEST_RUN_S = 20.0
SETTLE_S = 0.2
LOOKS = 40
PATIENCE_S = 30.0
COUNT_M = 1e-12
"""The plant server's count."""


class StrandedError(Exception):
    """The last command, held until the watchdog bit, has carried the axis out of the travel it may have."""


@dataclass
class Seen:
    """What came of one link and one signal."""

    moments: int = 0
    since_command: list[float] = field(default_factory=list)
    """s from the last command that the device acted on to zero output, by the plant's clock."""
    after_signal: list[float] = field(default_factory=list)
    """s from the signal to zero output, by the machine's clock."""
    already: int = 0
    """Moments at which the watchdog had bitten before: the machine had kept the loop for longer than that."""
    refused: int = 0
    """New hosts that found the latched fault and went no further."""
    disarmed: int = 0
    """Boards that were DISARMED once cleared."""
    moved: list[float] = field(default_factory=list)
    """m, by arming and commands of zero volts."""
    output: list[float] = field(default_factory=list)
    """V, largest output told meanwhile."""
    went_on: int = 0
    """Stopped loops that were let go on, and ended by an error without a word more to the motor."""
    over: int = 0
    """Loops that a stall of the machine had ended before the moment; another moment was drawn for each."""


def one(config: Configuration, number: int, moment: float, seen: Seen) -> tuple[float, float] | None:
    """Signal a running loop at `moment` (s), look at the device afterwards; return when it began and when
    the signal was sent (s, monotonic), None where the loop had ended by then."""
    began = time.monotonic()
    with ForkedLoop(config, config.reference(), LONGEST_RUN_S, running=1) as loop:
        if not loop.wait_for("running", PATIENCE_S):
            if loop.told.get("error") == "LimitError":
                raise StrandedError
            raise RuntimeError(f"the loop did not begin within {PATIENCE_S:g} s: {loop.told}")
        if loop.wait_for("ended", moment):
            look_again(config, Seen())
            return None
        sent = loop.signal(number)
        seen.moments += 1
        time.sleep(WATCHDOG_S + SETTLE_S)
        if number == signal.SIGSTOP:
            loop.signal(signal.SIGCONT)
            seen.went_on += loop.join(PATIENCE_S) == 2
            time.sleep(SETTLE_S)
    look_again(config, seen)
    return began, sent


def look_again(config: Configuration, seen: Seen) -> None:
    """What a new host finds: by the driver, then word by word."""
    device = config.run.device
    host = SerialLink(device["port"], 1_000_000)
    try:
        state = host.hello(3.0).state
    finally:
        host.port.close()
    if state == protocol.FAULT:  # the loop had armed it, and now its watchdog has bitten
        with contextlib.suppress(DeviceError):
            create(device, Bench(stage=config.stage, period=config.period)).open()
            raise RuntimeError("a latched fault did not keep a new host from going on")
        seen.refused += 1
    host = SerialLink(device["port"], 1_000_000)
    try:
        host.hello(3.0)
        reply = host.ask(protocol.Clear(host.next_tag()))
        seen.disarmed += reply.state == protocol.DISARMED and state != protocol.ARMED
        before = samples(host, 1)
        host.ask(protocol.Arm(host.next_tag(), 1000, 10_000_000, 1000))
        after = samples(host, 1 + LOOKS)
        host.ask(protocol.Disarm(host.next_tag()))
    finally:
        host.port.close()
    assert after[-1].state == protocol.ARMED
    counts = float(np.mean([s.position for s in after]) - np.mean([s.position for s in before]))
    seen.moved.append(abs(counts) * COUNT_M)
    seen.output.append(max(1e-6 * abs(s.output_uv) for s in [*before, *after]))


def samples(host: SerialLink, first: int) -> list[protocol.Measured]:
    """Some samples, each asked for by a command of 0 V."""
    found: list[protocol.Measured] = []
    for sequence in range(first, first + LOOKS):
        host.port.write(protocol.encode_command(sequence, 0))
        end = time.monotonic() + 1.0
        while len(found) <= sequence - first and time.monotonic() < end:
            found += [m for m in host.take(0.1) or [] if isinstance(m, protocol.Measured)]
        time.sleep(1e-3)
    if len(found) != LOOKS:
        raise RuntimeError(f"{LOOKS} commands were answered by {len(found)} samples")
    return found


def link(config: Configuration, program: Path | None, number: int, moments: int, draw: random.Random) -> Seen:
    """Every moment; where a strike has carried the axis away, it is put back: another plant is served."""
    seen = Seen()
    while seen.moments < moments:
        one_plant(config, program, number, moments, draw, seen)
    return seen


def one_plant(
    config: Configuration, program: Path | None, number: int, moments: int, draw: random.Random, seen: Seen
) -> None:
    """Strike loops against one plant until the moments are up or the axis is stranded; read its account."""
    with PlantProcess(shipped("leuven.yaml"), firmware=program) as plant:
        config = config.changed(
            device={"driver": "serial", "port": plant.port, "watchdog": WATCHDOG_S, "max_missed": 10_000}
        )
        if program is not None:
            on_time(plant.pid)
        times: list[tuple[float, float]] = []
        with contextlib.suppress(StrandedError):
            while seen.moments < moments:
                struck = one(config, number, draw.uniform(0.0, LONGEST_S), seen)
                seen.over += struck is None
                times += [] if struck is None else [struck]
        account = plant.stop()
    began = account["started_monotonic_s"]
    zeroings = [
        (began + z["time"] + z.get("noticed_after", 0.0), z.get("since_command", z.get("since_asked")))
        for z in account["zeroings"]
        if z.get("cause", "watchdog") == "watchdog"
    ]
    tell(seen, times, zeroings)


def tell(seen: Seen, times: list[tuple[float, float]], zeroings: list[tuple[float, float]]) -> None:
    """Find for each run, (began, signalled), how its output went to zero, of (when, s since last command)."""
    for number, (began, sent) in enumerate(times):
        end = times[number + 1][0] if number + 1 < len(times) else float("inf")
        mine = [(at, silent) for at, silent in zeroings if began <= at < end]
        if mine:
            at, silent = mine[-1]
            seen.since_command.append(silent)
            seen.after_signal.append(max(0.0, at - sent))
            seen.already += at < sent


def on_time(pid: int) -> None:
    """Have the firmware run like the board that it is, which nothing keeps from its timer: in real time."""
    for child in children(pid):
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(child, os.SCHED_FIFO, os.sched_param(70))


def figures_of(seen: Seen, who: str) -> list[Figure]:
    ms, every = 1e3 * WATCHDOG_S, f">= {seen.moments}"
    of = f"of {seen.moments}"
    worst = 1e3 * max(seen.since_command, default=float("inf"))
    sent = 1e3 * max(seen.after_signal, default=float("inf"))
    return [
        Figure(
            f"{who}: zeroed by the watchdog", float(len(seen.since_command)), of, every,
            f"{seen.already} before the signal, {seen.over} more loops had ended: the machine had stalled"
            if seen.already or seen.over
            else "",
        ),
        Figure(f"{who}: zero after the last command, worst", worst, "ms", f"<= {ms + 1:g}"),
        Figure(f"{who}: zero after the signal, worst", sent, "ms", "", "as processes were run"),
        Figure(f"{who}: a new host is refused", float(seen.refused), of, every),
        Figure(f"{who}: DISARMED once cleared", float(seen.disarmed), of, every),
        Figure(f"{who}: output when armed again, most", max(seen.output), "V", "<= 0"),
        Figure(f"{who}: moved by arming again, most", 1e9 * max(seen.moved), "nm", "<= 100", "noise: 15 nm"),
    ]  # fmt: skip


@click.command()
@click.option("--moments", default=100, show_default=True, help="For each signal on each link.")
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(moments: int, seed: int, path: Path | None) -> None:
    draw = random.Random(seed)
    config = load(shipped("leuven.yaml"))
    boards: dict[str, Path | None] = {"board in Python": None}
    if (program := firmware()) is not None:
        boards["firmware in C"] = program
    warm(config)
    figures = []
    for board, program in boards.items():
        for number in (signal.SIGKILL, signal.SIGSTOP):
            seen = link(config, program, number, moments, draw)
            figures += figures_of(seen, f"{board}, {number.name}")
            if number == signal.SIGSTOP:
                name = f"{board}, SIGSTOP: ended by an error when let go on"
                figures.append(Figure(name, float(seen.went_on), f"of {moments}", f">= {moments}"))
    show(f"The loop stopped at {moments} random moments, watchdog {1e3 * WATCHDOG_S:g} ms", figures, path)


def warm(config: Configuration) -> None:
    """Have everything loaded and compiled, which the forked loops inherit."""
    quick = config.changed(clock="virtual", device={"driver": "simulated"})
    device = make_device(quick)
    plan = ReferencePlan(quick.reference(), quick.stage, quick.period, 100, 0, ALWAYS, 0.0)
    run_loop(quick, plan, device, make_tick(quick, 0))


if __name__ == "__main__":
    main()
