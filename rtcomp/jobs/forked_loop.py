"""A loop in a forked process, which finds everything loaded and compiled: to be killed, stopped, cut off.

It tells over a pipe when it runs, when a fault went in, and how it ended.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import time
from collections.abc import Sequence
from typing import Any, Self

from rtcomp_drivers.faults import Fault, FaultyDevice, FaultyLink

from rtcomp.control.references import Reference
from rtcomp.errors import RtcompError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import make_device, make_tick, run_loop
from rtcomp.loop.device import Armable

RUNNING_TICKS = 200
"""Exchanges after which a loop counts as running: it moves, learns and feeds forward."""


class ForkedLoop:
    """A loop along `reference` for `seconds`, learning and feeding forward, with `faults` in its device.

    It counts as running after `running` exchanges. A context manager; at its end the process is gone, however
    it stood.
    """

    def __init__(
        self,
        config: Configuration,
        reference: Reference,
        seconds: float,
        model: HysteresisModel | None = None,
        faults: Sequence[Fault] = (),
        running: int = RUNNING_TICKS,
    ) -> None:
        self.told: dict[str, Any] = {}
        """What it said: `running` and `fault` (s, monotonic), `ended` (s), `error` (its name), `says`."""
        self.status: int | None = None
        """Exit status (a negative signal), once it has ended."""
        self._rest = b""
        self._pipe, ours = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            status = 70
            try:
                os.close(self._pipe)
                status = _loop(config, reference, seconds, model, faults, running, ours)
            finally:
                os._exit(status)
        os.close(ours)

    def wait_for(self, what: str, patience: float) -> bool:
        """Wait until it has said `what`; False where it has ended, or `patience` (s) is over, without."""
        end = time.monotonic() + patience
        while what not in self.told:
            left = end - time.monotonic()
            if left <= 0.0 or not select.select([self._pipe], [], [], left)[0]:
                return False
            piece = os.read(self._pipe, 4096)
            if not piece:
                return False
            *lines, self._rest = (self._rest + piece).split(b"\n")
            for line in lines:
                self.told |= json.loads(line)
        return True

    def signal(self, number: int) -> float:
        """Send it a signal; return when (s, monotonic)."""
        # Before it: a process that ends at its own priority, 500 MB locked, keeps us waiting for 50 ms.
        sent = time.monotonic()
        os.kill(self.pid, number)
        return sent

    def join(self, patience: float) -> int | None:
        """Return its exit status, a negative signal where one has ended it, None where it has not ended."""
        end = time.monotonic() + patience
        self.wait_for("ended", patience)
        while self.status is None and time.monotonic() < end:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.status = os.waitstatus_to_exitcode(status)
            else:
                time.sleep(1e-3)
        return self.status

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.status is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)
            self.status = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        os.close(self._pipe)


def _loop(
    config: Configuration,
    reference: Reference,
    seconds: float,
    model: HysteresisModel | None,
    faults: Sequence[Fault],
    running: int,
    pipe: int,
) -> int:
    """The loop's process: run until the end, a fault or a signal; return the exit status."""

    def tell(**what: Any) -> None:
        os.write(pipe, json.dumps(what).encode() + b"\n")

    def at(number: int, name: str) -> Fault:
        return Fault("call", number, 1, call=lambda: tell(**{name: time.monotonic()}))

    first = [at(min(fault.at for fault in faults), "fault")] if faults else []
    inner = make_device(config)
    kind = FaultyLink if isinstance(inner, Armable) else FaultyDevice
    device = kind(inner, [at(running, "running"), *first, *faults])
    tick = make_tick(config, device.delay_ticks, model)
    ticks = round(seconds * config.stage.rate)
    plan = ReferencePlan(reference, config.stage, config.period, ticks, device.delay_ticks, ALWAYS, 0.0)
    try:
        run_loop(config, plan, device, tick)
    except RtcompError as error:
        tell(ended=time.monotonic(), error=type(error).__name__, says=str(error))
        return error.exit_status
    tell(ended=time.monotonic(), error="", says="")
    return 0
