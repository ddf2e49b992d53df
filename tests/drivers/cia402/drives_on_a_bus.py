"""Drives on python-can's virtual bus, each in a thread: our simulated axis, canopen's LocalNode; or none."""

from __future__ import annotations

import itertools
import struct
import threading
import time

import can
import canopen
from canopen.profiles.p402 import State402
from free_mass import FreeMass
from rtcomp_drivers.cia402_axis import Cia402Axis
from rtcomp_drivers.cia402_memory import AxisFacts
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create
from rtcomp_drivers.slcan import Frame

_NUMBER = itertools.count()


def channel():
    """The name of a bus that nobody else has."""
    return f"cia402-{next(_NUMBER)}"


def in_vain(period=1e-3, **settings):
    """A call that builds a driver whose settings are to be refused before any bus is touched."""
    settings = {"driver": "cia402", "interface": "virtual", "channel": "nobody", "node": 5, **settings}
    return lambda: create(settings, Bench(period=period))


class AxisOnBus:
    """Our axis in real time. `to_host` takes the frames of one answer and returns those that arrive."""

    def __init__(self, position=0.0, **facts):
        self.channel = channel()
        self.bus = can.Bus(interface="virtual", channel=self.channel)
        self.axis = Cia402Axis(FreeMass(position), AxisFacts(**facts))
        self.to_host = lambda frames: frames
        self._lock = threading.Lock()
        self._began = time.monotonic()
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ended:
            message = self.bus.recv(2e-3)
            with self._lock:
                now = time.monotonic() - self._began
                if message is None:
                    answer = self.axis.run_until(now)
                else:
                    remote = message.is_remote_frame
                    frame = Frame(message.arbitration_id, bytes(message.data), remote, message.is_extended_id)
                    answer = self.axis.receive([frame], now)
                self._send(answer)

    def _send(self, frames):
        for frame in self.to_host(frames):
            self.put(frame.identifier, frame.data)

    def put(self, identifier, data=b""):
        """Send a frame as if somebody on this bus did."""
        self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def fail(self, code):
        with self._lock:
            self._send(self.axis.fail(code, time.monotonic() - self._began))

    def end(self):
        if not self._ended:
            self._ended = True
            self._thread.join()
            self.bus.shutdown()


class LocalDrive:
    """canopen's LocalNode that behaves as a CiA 402 drive: its objects, NMT, SDO and PDOs are canopen's.

    So is the table of transitions; none of it is this project's.
    """

    def __init__(self, eds, node=5, count=1000, values=()):
        self.channel = channel()
        self.network = canopen.Network()
        self.network.connect(interface="virtual", channel=self.channel)
        self.node = self.network.create_node(node, str(eds))
        self.state = "SWITCH ON DISABLED"
        self.controlword = 0
        self.mode = 0
        self.position = 0
        self.step = count
        """Counts by which each SYNC at positive torque moves it."""
        self.torques = []
        self.node.add_read_callback(self._read)
        self.node.add_write_callback(self._write)
        for index, sub, value in values:
            var = self.node.object_dictionary.get_variable(index, sub)
            self.node.data_store.setdefault(index, {})[sub] = var.encode_raw(value)
        self._pending = None
        self.network.subscribe(0x80, self._sync)
        self.network.subscribe(0x200 + node, self._rpdo)
        self.node.nmt.send_command(0)  # boot-up
        self.node.nmt.state = "PRE-OPERATIONAL"

    def _statusword(self):
        return State402.SW_MASK[self.state][1] | 0x0200

    def _read(self, index, subindex, od):
        return {
            0x6041: self._statusword(),
            0x6061: self.mode,
            0x6064: (self.position + (1 << 31)) % (1 << 32) - (1 << 31),
            0x603F: 0x2310 if self.state == "FAULT" else 0,
        }.get(index)

    def _write(self, index, subindex, od, data):
        if index == 0x6040:
            self._obey(int.from_bytes(data, "little"))
        elif index == 0x6060:
            self.mode = int.from_bytes(data, "little", signed=True)

    def _obey(self, controlword):
        for (start, end), word in State402.TRANSITIONTABLE.items():
            automatic = start in ("START", "NOT READY TO SWITCH ON", "FAULT REACTION ACTIVE")
            edge = start != "FAULT" or not self.controlword & 0x80
            if start == self.state and word == controlword and edge and not automatic:
                self.state = end
                break
        self.controlword = controlword

    def _rpdo(self, _identifier, data, _timestamp):
        mapped = [self.node.sdo[0x1600][k].raw for k in range(1, self.node.sdo[0x1600][0].raw + 1)]
        assert mapped == [0x60400010, 0x60710010]
        self._pending = struct.unpack("<Hh", data)

    def _sync(self, _identifier, _data, _timestamp):
        if self.node.nmt.state != "OPERATIONAL":
            return
        mapped = [self.node.sdo[0x1A00][k].raw for k in range(1, self.node.sdo[0x1A00][0].raw + 1)]
        assert mapped == [0x60410010, 0x60640020]
        cob_id = self.node.sdo[0x1800][1].raw
        if not cob_id >> 31 and self.node.sdo[0x1800][2].raw == 1:
            data = struct.pack("<Hi", self._statusword(), self._read(0x6064, 0, None))
            self.network.send_message(cob_id & 0x7FF, data)
        if self._pending is not None:
            controlword, torque = self._pending
            self._pending = None
            self._obey(controlword)
            if self.state == "OPERATION ENABLED":
                self.torques.append(torque)
                self.position += self.step * (torque > 0)

    def fail(self, code):
        """Go into fault and say so."""
        self.state = "FAULT"
        self.node.emcy.send(code, 0x03)

    def end(self):
        self.node.nmt.stop_heartbeat()
        self.network.disconnect()
