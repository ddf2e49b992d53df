"""Devices that are there and do not fit: one line, exit status 2, nothing armed, nothing lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command import listing, one_error_line, refused
from rtcomp_drivers import cansimple, protocol
from rtcomp_drivers.board import Board, BoardFacts
from rtcomp_drivers.cia402_axis import Cia402Axis
from rtcomp_drivers.cia402_memory import AxisFacts as DriveFacts
from rtcomp_drivers.cia402_objects import eds_text
from rtcomp_drivers.cia402_states import State
from rtcomp_drivers.odrive_axis import AxisFacts, OdriveAxis
from rtcomp_drivers.plant_links import DeviceSide
from rtcomp_drivers.slcan import Frame
from rtcomp_drivers.slcan_side import CanAxis, SlcanSide
from running import Running, configuration
from served_device import Served, Weight

DEVICES = {
    "serial": "{driver: serial, port: PORT, connect_timeout: 5.0, watchdog: 10.0, max_missed: 20000}",
    "odrive-can": (
        "{driver: odrive-can, interface: slcan, channel: PORT, lead: 1.0e-3, connect_timeout: 2.0, "
        "watchdog: 0.2}"
    ),
    "cia402": "{driver: cia402, interface: slcan, channel: PORT, node: 5, connect_timeout: 2.0}",
}
GIVEN = ["identify", "run.yaml", "--out", "results", "--force", "--json"]


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    """A folder with results of earlier runs, which must survive."""
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "recording.h5").write_bytes(b"of an earlier run")
    return tmp_path


def use(folder: Path, link: str, port: str, *changes: tuple[str, str]) -> None:
    text = configuration(DEVICES[link].replace("PORT", port))
    for change in changes:
        assert change[0] in text
        text = text.replace(*change)
    (folder / "run.yaml").write_text(text)


class OtherProtocol:
    """A board whose firmware speaks a later version of the protocol."""

    def __init__(self, plant: Weight) -> None:
        self.time, self.lagging, self._decoder = 0.0, False, protocol.Decoder()

    def receive(self, data: bytes, now: float) -> bytes:
        heard = self._decoder.feed(data)
        told = [protocol.OtherVersion(m.tag, 2) for m in heard if isinstance(m, protocol.Hello)]
        return b"".join(protocol.encode(message) for message in told)

    def run_until(self, now: float) -> bytes:
        return b""

    def shut_down(self, now: float) -> None:
        pass

    def summary(self) -> dict[str, Any]:
        return {}


class TwoMasters(SlcanSide):
    """A bus on which somebody else sends `frame` every 10 ms."""

    def __init__(self, axis: CanAxis, frame: Frame) -> None:
        super().__init__(axis)
        self._frame, self._next = frame, 0.0

    def run_until(self, now: float) -> bytes:
        lines = super().run_until(now)
        if now >= self._next:
            self._next = now + 0.01
            lines += self.adapter.send(self._frame)
        return lines


def board(plant: Weight, state: int = protocol.DISARMED, **facts: Any) -> Board:
    made = Board(plant, BoardFacts(**facts))
    made.state = state
    if state == protocol.ARMED:  # and fed by whoever has it
        made._watchdog = made._fed = 1e9
    return made


def odrive(plant: Weight, **facts: Any) -> OdriveAxis:
    return OdriveAxis(plant, AxisFacts(**{"watchdog": 0.2, **facts}))


def drive(plant: Weight, **facts: Any) -> Cia402Axis:
    return Cia402Axis(plant, DriveFacts(**{"force_constant": 4.0, **facts}))


def of_profile(number: int, plant: Weight) -> Cia402Axis:
    made = drive(plant)
    made.memory.fix(0x1000, 0, number)
    return made


def enabled(plant: Weight) -> Cia402Axis:
    made = drive(plant)
    made.state = State.ENABLED
    return made


TORQUE = Frame(cansimple.identifier(0, cansimple.Command.INPUT_TORQUE), bytes(8))
UNFIT: dict[str, tuple[str, Callable[[Weight], DeviceSide], list[str]]] = {
    "board of another protocol": ("serial", OtherProtocol, ["version 2", "update the older"]),
    "board of another axis": ("serial", lambda p: board(p, axis="rotary"), ["axis is rotary", "linear"]),
    "board of another rate": ("serial", lambda p: board(p, max_rate_hz=500), ["at most 500 Hz", "1000 Hz"]),
    "board without a unit": ("serial", lambda p: board(p, count_size=0.0), ["position count of 0"]),
    "board of another host": ("serial", lambda p: board(p, protocol.ARMED), ["armed by another host"]),
    "board in fault": ("serial", lambda p: board(p, protocol.FAULT), ["is in FAULT", "clear_fault"]),
    "odrive of later firmware": (
        "odrive-can", lambda p: SlcanSide(odrive(p, firmware=(0, 7, 1))), ["0.7.1", "0.6"],
    ),
    "odrive of earlier firmware": (
        "odrive-can", lambda p: SlcanSide(odrive(p, dialect="0.5.6", watchdog=None)), ["version", "0.5.6"],
    ),
    "odrive of another node": ("odrive-can", lambda p: SlcanSide(odrive(p, node=7)), ["node 0", "heard: 7"]),
    "odrive at another bit rate": (
        "odrive-can", lambda p: SlcanSide(odrive(p), 500_000), ["bit rate is 1000000 there too"],
    ),
    "odrive with two masters": ("odrive-can", lambda p: TwoMasters(odrive(p), TORQUE), ["only one master"]),
    "drive of another axis": ("cia402", lambda p: SlcanSide(drive(p, axis="rotary")), ["in rad", "linear"]),
    "drive of another profile": ("cia402", lambda p: SlcanSide(of_profile(401, p)), ["profile 401", "402"]),
    "drive of another node": ("cia402", lambda p: SlcanSide(drive(p, node=9)), ["nodes that do: 9"]),
    "drive at another bit rate": (
        "cia402", lambda p: SlcanSide(drive(p), 500_000), ["does not answer at 1000000 bit/s"],
    ),
    "drive with two masters": ("cia402", lambda p: TwoMasters(drive(p), Frame(0x80)), ["another master"]),
    "drive that another has": ("cia402", lambda p: SlcanSide(enabled(p)), ["enabled by another master"]),
}  # fmt: skip


@pytest.mark.parametrize("what", UNFIT)
def test_a_device_that_does_not_fit_is_one_line(folder: Path, what: str) -> None:
    link, made, says = UNFIT[what]
    weight = Weight()
    with Served(made(weight)) as device:
        use(folder, link, device.port)
        refused(*GIVEN, at=folder, says=says)
    assert weight.pushed == 0.0
    side = getattr(device.side, "axis", device.side)
    assert not getattr(side, "zeroings", [])  # what was never armed was never zeroed


def test_an_odrive_without_watchdog_is_refused_after_its_proof_at_zero_torque(folder: Path) -> None:
    weight = Weight()
    with Served(SlcanSide(odrive(weight, watchdog=None))) as device:
        use(folder, "odrive-can", device.port)
        refused(*GIVEN, at=folder, says=["stays on", "enable_watchdog"])
    assert weight.pushed == 0.0


UNITS = [
    ("node: 5", "node: 5, count_size: 1.0e-6", ["a count is 1e-06 here", "60A8h", "correct one of them"]),
    ("node: 5", "node: 5, rated_torque: 3.0", ["rated_torque is 3 N m", "says 4 (6076h"]),
    ("node: 5", "node: 5, counts_per_turn: 4096", ["counts_per_turn is for rotary axes", "count_size"]),
]


@pytest.mark.parametrize(("old", "new", "says"), UNITS)
def test_a_drive_whose_units_are_not_those_of_the_file(
    folder: Path, old: str, new: str, says: list[str]
) -> None:
    weight = Weight()
    with Served(SlcanSide(drive(weight))) as device:
        use(folder, "cia402", device.port, (old, new))
        refused(*GIVEN, at=folder, says=says)
    assert weight.pushed == 0.0


@pytest.mark.parametrize(
    ("section", "says"),
    [("6071", ["has no 6071h", "torque mode"]), ("6064", ["has no 6064h"]), ("1016sub1", ["no 1016h:1"])],
)
def test_an_eds_without_what_is_needed_opens_nothing(folder: Path, section: str, says: list[str]) -> None:
    """The port there is not: the file is refused before anybody looks for it."""
    head, _, rest = eds_text().partition(f"[{section}]\n")
    if len(section) == 4:
        head = "\n".join(line for line in head.split("\n") if not line.endswith(f"=0x{section}"))
    (folder / "axis.eds").write_text(head + rest.partition("\n\n")[2])
    use(folder, "cia402", "/dev/ttyNone", ("node: 5", "node: 5, eds: axis.eds"))
    refused(*GIVEN, at=folder, says=["run.yaml:", "device.eds: axis.eds", *says])


class Exchanged:
    """`first` until `over(first)`, then `second`: another device at the same port, or the same anew."""

    def __init__(self, first: Board, second: Board, hellos: int, commands: float) -> None:
        self._sides, self._hellos, self._commands = [first, second], hellos, commands
        self._decoder = protocol.Decoder()
        self.lagging = False

    @property
    def _now(self) -> Board:
        return self._sides[0]

    @property
    def time(self) -> float:
        return self._now.time

    def receive(self, data: bytes, now: float) -> bytes:
        heard = self._decoder.feed(data)
        self._hellos -= sum(isinstance(m, protocol.Hello) for m in heard)
        if len(self._sides) == 2 and (self._hellos <= 0 or self._now.counters["commands"] > self._commands):
            self._now.shut_down(now)
            del self._sides[0]
            self._now.time = now
        return self._now.receive(data, now)

    def run_until(self, now: float) -> bytes:
        return self._now.run_until(now)

    def shut_down(self, now: float) -> None:
        self._now.shut_down(now)

    def summary(self) -> dict[str, Any]:
        return self._now.summary()


def test_a_port_that_is_another_device_s_when_it_is_opened_again(folder: Path) -> None:
    """Looked at first, then opened to be driven: between the two it may have changed."""
    weight = Weight()
    side = Exchanged(board(weight), board(weight, axis="rotary"), hellos=2, commands=np.inf)
    with Served(side) as device:
        use(folder, "serial", device.port)
        before = listing(folder / "results")
        one_error_line(_run(folder), [device.port, "axis is rotary"])
    assert listing(folder / "results") == before
    assert weight.pushed == 0.0


def test_a_board_that_begins_anew_while_it_runs(folder: Path) -> None:
    first, second = Weight(), Weight()
    side = Exchanged(board(first), board(second), hellos=1000, commands=150)
    with Served(side) as device:
        use(folder, "serial", device.port)
        before = listing(folder / "results")
        says = [device.port, "not armed any more but DISARMED", "kept in results.failed"]
        one_error_line(_run(folder), says)
    assert listing(folder / "results") == before
    assert first.pushed > 0.0 == second.pushed  # it ran, and what came after it was never armed
    with h5py.File(folder / "results.failed" / "recording.h5", "r") as file:
        assert len(file["time"]) == len(file["position"]) == len(file["voltage"]) >= 100
        texts = [bytes(text).decode().rstrip("\0") for text in file["events/text"]]  # a late tick is one too
        assert any("not armed any more" in text for text in texts)


def _run(folder: Path) -> Any:
    with Running(*GIVEN, at=folder) as run:
        return run.end()
