"""An slcan adapter on a real pseudo-terminal."""

from __future__ import annotations

import os
import select
import threading
import tty

from rtcomp_drivers.slcan_adapter import SlcanAdapter


class Adapter:
    """An adapter on a real pty, in a thread, with a loopback: what the host sends, the bus sends back."""

    def __init__(self, bit_rate=1_000_000):
        self.adapter = SlcanAdapter(bit_rate)
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self.heard = []
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ended:
            if select.select([self.master], [], [], 0.01)[0]:
                answer, frames = self.adapter.receive(os.read(self.master, 4096))
                self.heard += frames
                os.write(self.master, answer + b"".join(map(self.adapter.send, frames)))

    def end(self):
        if not self._ended:
            self._ended = True
            self._thread.join()
            os.close(self.master)
            os.close(self._slave)
