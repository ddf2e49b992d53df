"""A host that talks to a simulated axis of CiA 402 in virtual time, frame by frame."""

from __future__ import annotations

import struct

from free_mass import FreeMass
from rtcomp_drivers.cia402_axis import Cia402Axis
from rtcomp_drivers.cia402_memory import AxisFacts
from rtcomp_drivers.cia402_states import State
from rtcomp_drivers.slcan import Frame

NODE, HOST = 5, 127
SYNC = Frame(0x80)
BEAT = Frame(0x700 + HOST, b"\x05")
START, STOP, PRE, RESET = (Frame(0, bytes([code, NODE])) for code in (1, 2, 0x80, 0x81))


class Abort(Exception):
    pass


class Host:
    """Talks to an axis in virtual time."""

    def __init__(self, plant=None, **facts):
        self.axis = Cia402Axis(plant or FreeMass(), AxisFacts(node=NODE, **facts))
        self.now = 0.0
        self.heard = list(self.axis.run_until(0.0))

    def send(self, *frames):
        answer = self.axis.receive(frames, self.now)
        self.heard += answer
        return answer

    def let(self, seconds):
        self.now += seconds
        answer = self.axis.run_until(self.now)
        self.heard += answer
        return answer

    def write(self, index, sub, value, size):
        data = value.to_bytes(size, "little", signed=value < 0)
        head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
        (answer,) = self.send(Frame(0x600 + NODE, (head + data).ljust(8, b"\0")))
        assert answer.identifier == 0x580 + NODE
        if answer.data[0] == 0x80:
            raise Abort(int.from_bytes(answer.data[4:], "little"))

    def read(self, index, sub=0):
        (answer,) = self.send(Frame(0x600 + NODE, struct.pack("<BHBI", 0x40, index, sub, 0)))
        if answer.data[0] == 0x80:
            raise Abort(int.from_bytes(answer.data[4:], "little"))
        if answer.data[0] & 2:
            return bytes(answer.data[4 : 8 - (answer.data[0] >> 2 & 3)])
        data, toggle = b"", 0
        while True:
            (answer,) = self.send(Frame(0x600 + NODE, bytes([0x60 | toggle]) + bytes(7)))
            assert answer.data[0] & 0x10 == toggle
            data += answer.data[1 : 8 - (answer.data[0] >> 1 & 7)]
            if answer.data[0] & 1:
                return data
            toggle ^= 0x10

    def command(self, controlword, torque=0):
        """RPDO and SYNC; returns statusword and position of the TPDO."""
        answer = self.send(Frame(0x200 + NODE, struct.pack("<Hh", controlword, torque)), SYNC)
        (tpdo,) = [frame for frame in answer if frame.identifier == 0x180 + NODE]
        return struct.unpack("<Hi", tpdo.data)

    def enable(self, watchdog_ms=100):
        self.write(0x6060, 0, 10, 1)
        if watchdog_ms:
            self.write(0x1016, 1, HOST << 16 | watchdog_ms, 4)
        self.send(START, BEAT)
        for controlword in (0x06, 0x07, 0x0F):
            self.command(controlword)
        assert self.axis.state is State.ENABLED
