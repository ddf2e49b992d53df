"""A stage in a process of its own, in real time, behind a pseudo-terminal: it stands in for hardware.

    python -m rtcomp_drivers.plant_server --config STAGE.yaml --link serial

prints the port to give to the driver of the same name and runs until SIGINT or SIGTERM. The stage moves by
the server's monotonic clock whether a host talks to it or not; the device in front of it (serial:
rtcomp_drivers.board; CAN: a drive behind an slcan adapter) has the states and the watchdog of a real one.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import select
import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from rtcomp.errors import ConfigError, RtcompError
from rtcomp.stage.stage import Stage
from rtcomp_drivers.firmware_server import FirmwareServer
from rtcomp_drivers.plant_links import LINKS, build
from rtcomp_drivers.pty_port import PtyPort
from rtcomp_drivers.warm_stage import warm

_SLICE_S = 1e-3
"""s, longest wait for a frame before the plant is moved on."""
_LAGGING_S = 5e-3
"""s behind real time from which samples say so."""
_BUDGET_S = 20e-3
"""s of processor time, at most, spent on catching up before anybody is listened to again."""
_BUSY = 0.9
"""Share of real time spent simulating from which the simulation cannot keep up."""
_PRIORITY = 60
_MOST = 4096


@dataclass
class Keeping:
    """How well the simulation keeps up with real time."""

    max_step_lag_s: float = 0.0
    """s, worst distance of the plant behind real time when a piece of simulation ended."""
    lost_s: float = 0.0
    """s of real time that were skipped rather than caught up."""
    seconds_too_slow: int = 0
    _begin: float = 0.0
    _busy: float = field(default=0.0, repr=False)

    def count(self, began: float, ended: float) -> bool:
        """Count one piece of simulation; return True once when it is first found too slow."""
        self._busy += ended - began
        if ended - self._begin < 1.0:
            return False
        too_slow = self._busy > _BUSY * (ended - self._begin)
        self._begin, self._busy = ended, 0.0
        self.seconds_too_slow += too_slow
        return too_slow and self.seconds_too_slow == 1


class PlantServer:
    """A device's side and its stage behind a pseudo-terminal. Build it, tell `port` to the host, `run` it.

    Raises ConfigError for a link that it does not speak, DeviceError where no port is to be had.
    """

    def __init__(
        self, stage: Stage, seed: int = 0, link: str = "serial", watchdog: float | None = None
    ) -> None:
        self.side = build(link, warm(stage, seed), stage, watchdog)
        self.keeping = Keeping()
        self.unsent = 0
        """Bytes that no host read."""
        self._stopped = False
        self._port = PtyPort()
        self.port = self._port.name
        """Path of the port for the host."""
        self.started = time.monotonic()

    def stop(self) -> None:
        """End `run` within a millisecond; may be called from a signal handler."""
        self._stopped = True

    def run(self, lifeline: int | None = None) -> None:
        """Serve until `stop`; then zero the output and let go of the port.

        `lifeline` is the descriptor of a pipe at whose end-of-file the server ends too: that comes when the
        process that holds its other end has ended, however it did.
        """
        side, keeping, master = self.side, self.keeping, self._port.master
        watched = [master] if lifeline is None else [master, lifeline]
        clock, wait, read = time.monotonic, select.select, os.read
        self.started = clock() - side.time
        keeping._begin = clock()
        try:
            while not self._stopped:
                ready = wait(watched, [], [], _SLICE_S)[0]
                arrived = clock()
                if lifeline in ready and not read(lifeline, _MOST):
                    break
                self._catch_up(arrived)
                data = read(master, _MOST) if master in ready else b""
                now = max(arrived - self.started, side.time)
                answer = side.receive(data, now) if data else side.run_until(now)
                if answer:
                    self._send(answer)
                ended = clock()
                lag = ended - self.started - side.time
                if lag > keeping.max_step_lag_s:
                    keeping.max_step_lag_s = lag
                side.lagging = lag > _LAGGING_S
                if keeping.count(arrived, ended):
                    self._say_too_slow()
        finally:
            side.shut_down(max(side.time, min(clock() - self.started, side.time + _SLICE_S)))
            self._port.close()

    def _send(self, answer: bytes) -> None:
        try:
            sent = os.write(self._port.master, answer)
        except BlockingIOError:
            sent = 0
        self.unsent += len(answer) - sent

    def _catch_up(self, arrived: float) -> None:
        """Run the plant in short pieces up to a slice before `arrived`, for as long as there is budget.

        What is then still missing is skipped, and counted: a simulation that is too slow, or a process
        that was stopped for an hour, must not make a server that hears nobody.
        """
        side = self.side
        behind = arrived - self.started - side.time
        if behind <= 2 * _SLICE_S:
            return
        while behind > _SLICE_S and time.monotonic() - arrived < _BUDGET_S:
            answer = side.run_until(side.time + _SLICE_S)
            if answer:
                self._send(answer)
            behind = arrived - self.started - side.time
        if behind > _SLICE_S:
            self.started += behind
            self.keeping.lost_s += behind

    def _say_too_slow(self) -> None:
        print(
            f"plant server: the simulation cannot keep up with real time (over {100 * _BUSY:.0f} % of a "
            "second went into it); soften the stage's stiffest element, or use a faster machine",
            file=sys.stderr,
            flush=True,
        )

    def summary(self) -> dict[str, Any]:
        """Return what happened, for the log; times in s on the board's clock."""
        side, keeping = self.side, self.keeping
        return {
            "port": self.port,
            "started_monotonic_s": self.started,
            "seconds": side.time,
            **side.summary(),
            "unsent_bytes": self.unsent,
            "max_step_lag_s": keeping.max_step_lag_s,
            "lost_s": keeping.lost_s,
            "seconds_too_slow": keeping.seconds_too_slow,
            "scheduling": _scheduling(),
        }


def serve(
    stage: Stage,
    *,
    link: str = "serial",
    seed: int = 0,
    as_json: bool = False,
    log: Path | None = None,
    realtime: bool = True,
    until_eof: bool = False,
    firmware: Path | None = None,
    watchdog: float | None = None,
) -> dict[str, Any]:
    """Run `stage` behind a port until SIGINT or SIGTERM; return the summary that is also written.

    `watchdog` (s) is that of a drive on which it is set beforehand (CAN).
    With `firmware`, the program that drivers/firmware makes for this machine, the board is that program in a
    process of its own, and this one is only what hangs on it.

    Prints one line with the port on stdout (`as_json`: an object), at exit a JSON summary on stderr, or to
    the file `log`. With `realtime` the process runs under SCHED_FIFO where that is allowed; what is in
    force stands in the line and in the summary. With `until_eof` it ends at the end of standard input too.
    Raises ConfigError for a link that it does not speak and DeviceError where the port cannot be had. Call
    it from the main thread: it sets signal handlers.
    """
    server: PlantServer | FirmwareServer
    if firmware is None:
        server = PlantServer(stage, seed=seed, link=link, watchdog=watchdog)
    elif watchdog is not None:
        raise ConfigError("plant server: the host sets a board's watchdog; leave --watchdog out")
    elif link == "serial":
        server = FirmwareServer(stage, firmware, seed=seed)
    else:
        raise ConfigError(f"plant server: --firmware is a board on the link 'serial', not on {link!r}")

    def end(_signal: int, _frame: FrameType | None) -> None:
        server.stop()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    scheduling = _begin_realtime() if realtime else None
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        if as_json:
            line = json.dumps(
                {"port": server.port, "link": link, "pid": os.getpid(), "scheduling": _scheduling()}
            )
        else:
            line = f"port: {server.port}"
        print(line, flush=True)
        server.run(sys.stdin.fileno() if until_eof else None)
    finally:
        gc.enable()
        gc.unfreeze()
        if scheduling is not None:
            summary = server.summary()  # before the scheduling goes back
            os.sched_setscheduler(0, scheduling[0], scheduling[1])
        else:
            summary = server.summary()
        for number, handler in before.items():
            signal.signal(number, handler)
        _write(summary, log)
    return summary


def _write(summary: dict[str, Any], log: Path | None) -> None:
    text = json.dumps(summary, allow_nan=False)
    if log is None:
        print(text, file=sys.stderr, flush=True)
    else:
        log.write_text(text + "\n")


def _begin_realtime() -> tuple[int, os.sched_param] | None:
    """Ask for SCHED_FIFO; return what was in force before, or None where it is not allowed or not there."""
    try:
        before = (os.sched_getscheduler(0), os.sched_getparam(0))
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(_PRIORITY))
    except (OSError, AttributeError):  # no right to it, or not Linux; said in the ready line and the summary
        return None
    return before


def _scheduling() -> str:
    """Return the scheduling class that is really in force."""
    try:
        policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
        priority = os.sched_getparam(0).sched_priority
    except (OSError, AttributeError):
        return "unknown"
    return f"SCHED_FIFO {priority}" if policy == os.SCHED_FIFO else "SCHED_OTHER"


def main(arguments: list[str] | None = None) -> int:
    """Run the plant server from the command line; return the exit status."""
    says = (__doc__ or "").split("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m rtcomp_drivers.plant_server", description=says)
    parser.add_argument("--config", type=Path, required=True, help="stage file or run configuration")
    parser.add_argument("--link", choices=sorted(LINKS), default="serial", help="what it speaks")
    parser.add_argument(
        "--serial", dest="link", action="store_const", const="serial", help="the same as --link serial"
    )
    parser.add_argument("--json", action="store_true", help="print the port as a JSON object")
    parser.add_argument("--log", type=Path, help="write the summary to this file instead of stderr")
    parser.add_argument("--seed", type=int, default=0, help="of the sensor's noise")
    parser.add_argument("--firmware", type=Path, help="the board: a program made by drivers/firmware")
    parser.add_argument("--no-realtime", action="store_true", help="do not ask for SCHED_FIFO")
    parser.add_argument(
        "--until-eof", action="store_true", help="end at the end of standard input too: with who started it"
    )
    parser.add_argument(
        "--watchdog", type=float, help="s, of a drive that has its own (CAN); on serial the host sets it"
    )
    options = parser.parse_args(arguments)
    try:
        serve(
            Stage.load(options.config),
            link=options.link,
            seed=options.seed,
            as_json=options.json,
            log=options.log,
            realtime=not options.no_realtime,
            until_eof=options.until_eof,
            firmware=options.firmware,
            watchdog=options.watchdog,
        )
    except RtcompError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_status
    return 0


if __name__ == "__main__":
    sys.exit(main())
