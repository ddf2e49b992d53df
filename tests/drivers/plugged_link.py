"""A CAN link with a simulated axis at its other end, in virtual time: no machine is too busy for that."""

from __future__ import annotations

from collections import deque

import can
from rtcomp_drivers.slcan import Frame

PERIOD = 1e-3


class PluggedLink:
    """Lets a period pass with each frame for which `ticks` is true; `waits` has time pass while one waits."""

    who, bitrate = "CAN interface in virtual time", 1_000_000
    damaged, error_frames, latency_timer_ms = 0, 0, None

    def __init__(self, axis, ticks, *, waits=False):
        self._axis, self._ticks, self._waits = axis, ticks, waits
        self._received = deque()

    def send(self, message):
        if self._ticks(message):
            self._let_pass()
        frame = Frame(message.arbitration_id, bytes(message.data), message.is_remote_frame)
        self._received += self._axis.receive([frame], self._axis.time)

    def receive(self, seconds):
        end = self._axis.time + seconds
        while self._waits and not self._received and self._axis.time + PERIOD < end:
            self._let_pass()
        if not self._received:
            return None
        frame = self._received.popleft()
        return can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False)

    def close(self):
        pass

    def _let_pass(self):
        self._received += self._axis.run_until(self._axis.time + PERIOD)
