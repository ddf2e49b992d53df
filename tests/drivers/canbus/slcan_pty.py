"""An slcan adapter on a real pseudo-terminal, alone or with an ODrive's axis on its bus."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
import tty

from rtcomp_drivers.odrive_axis import AxisFacts, OdriveAxis
from rtcomp_drivers.slcan_adapter import SlcanAdapter


class Adapter:
    """An adapter on a real pty, in a thread, with a loopback: what the host sends, the bus sends back."""

    def __init__(self, bit_rate=1_000_000):
        self.adapter = SlcanAdapter(bit_rate)
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)  # what no host reads is lost, as on a bus
        self.port = os.ttyname(self._slave)
        self.heard = []
        self.reads = True
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ended:
            if not self.reads:
                time.sleep(0.01)
            elif select.select([self.master], [], [], 0.01)[0]:
                answer, frames = self.adapter.receive(os.read(self.master, 4096))
                self.heard += frames
                with contextlib.suppress(BlockingIOError):
                    os.write(self.master, answer + b"".join(map(self.adapter.send, frames)))

    def end(self):
        if not self._ended:
            self._ended = True
            self._thread.join()
            os.close(self.master)
            os.close(self._slave)


class PtyAxis:
    """An ODrive's axis behind an slcan adapter on a real pty, in a thread, with a bus that can be made bad.

    `to_axis` and `to_host` take the frames that cross the bus together and return those that arrive.
    """

    def __init__(self, plant, bit_rate=1_000_000, **facts):
        self.axis = OdriveAxis(plant, AxisFacts(**facts))
        self.adapter = SlcanAdapter(bit_rate)
        self.to_axis = self.to_host = lambda frames: frames
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)  # what no host reads is lost, as on a bus
        self.port = os.ttyname(self._slave)
        self._injected = []
        self._ended = False
        self._began = time.monotonic()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def inject(self, *frames):
        """Have somebody else on the bus send frames: to the axis and to the host."""
        self._injected.append(frames)

    def _run(self):
        while not self._ended:
            ready = select.select([self.master], [], [], 1e-3)[0]
            answers, frames = self.adapter.receive(os.read(self.master, 4096)) if ready else (b"", [])
            sent = []
            if self._injected:
                others = list(self._injected.pop(0))
                sent += others
                frames = others + frames
            sent += self.axis.receive(self.to_axis(frames), time.monotonic() - self._began)
            lines = answers + b"".join(map(self.adapter.send, self.to_host(sent)))
            if lines:
                with contextlib.suppress(BlockingIOError):
                    os.write(self.master, lines)

    def unplug(self):
        if not self._ended:
            self._ended = True
            self._thread.join()
            os.close(self.master)
            os.close(self._slave)
