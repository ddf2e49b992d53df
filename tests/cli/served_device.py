"""A device's side behind a real pseudo-terminal, in a thread, that a test has made unfit."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from typing import Self

from rtcomp_drivers.plant_links import DeviceSide
from rtcomp_drivers.pty_port import PtyPort


class Weight:
    """A mass of 1 kg that remembers the largest command that ever moved it."""

    def __init__(self) -> None:
        self.position = self.velocity = 0.0
        self.pushed = 0.0
        """V, largest so far."""

    def advance(self, volts: float, seconds: float) -> None:
        self.pushed = max(self.pushed, abs(volts))
        self.position += self.velocity * seconds + 0.5 * volts * seconds**2
        self.velocity += volts * seconds

    def measure(self) -> float:
        return self.position


class Served:
    """Serves `side` at `port` in real time until the context ends."""

    def __init__(self, side: DeviceSide) -> None:
        self.side = side
        self._pty = PtyPort()
        self.port = self._pty.name
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._pty.close()

    def _run(self) -> None:
        began, master = time.monotonic(), self._pty.master
        while not self._ended.is_set():
            ready = select.select([master], [], [], 1e-3)[0]
            data = os.read(master, 4096) if ready else b""
            now = max(time.monotonic() - began, self.side.time)
            answer = self.side.receive(data, now) if data else self.side.run_until(now)
            if answer:
                with contextlib.suppress(BlockingIOError):  # what no host reads is lost
                    os.write(master, answer)
