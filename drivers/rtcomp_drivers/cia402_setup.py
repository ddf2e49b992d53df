"""What canopen does for the driver ``cia402``: EDS, SDO, NMT, PDO mapping; before the loop, without a thread.

canopen receives in a thread of python-can's Notifier, which has no place in a loop's process. Here whoever
waits for an answer reads the bus.
"""

from __future__ import annotations

import configparser
import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import canopen
from canopen.sdo import SdoAbortedError, SdoClient, SdoCommunicationError

from rtcomp.errors import ConfigError, DeviceTimeoutError, ProtocolError
from rtcomp_drivers.cia402_objects import EDS, SIGNED, SIZES

if TYPE_CHECKING:
    from rtcomp_drivers.can_link import CanLink

# What goes wrong is told by exceptions; canopen's own words about it would stand beside our one line.
logging.getLogger("canopen").addHandler(logging.NullHandler())

_INVALID = 1 << 31
_NEEDED = {  # object: data bytes, signed
    (0x1000, 0): (4, False), (0x1017, 0): (2, False), (0x6040, 0): (2, False), (0x6041, 0): (2, False),
    (0x6060, 0): (1, True), (0x6061, 0): (1, True), (0x6064, 0): (4, True), (0x6071, 0): (2, True),
    (0x1400, 1): (4, False), (0x1400, 2): (1, False), (0x1600, 0): (1, False), (0x1600, 1): (4, False),
    (0x1600, 2): (4, False), (0x1800, 1): (4, False), (0x1800, 2): (1, False), (0x1A00, 0): (1, False),
    (0x1A00, 1): (4, False), (0x1A00, 2): (4, False),
}  # fmt: skip
WATCHDOG, RATED_TORQUE = (0x1016, 1), (0x6076, 0)
"""Needed too, unless the settings say that they are not."""


def load_eds(path: str | None, node: int, further: dict[tuple[int, int], str]) -> Any:
    """Return the object dictionary of an EDS file (None: ours), as canopen has it, for a node.

    `further` names objects that are needed besides those that always are, each with what to do where it is
    missing. Raises ConfigError where there is no such file, it is no EDS, or objects are missing or of
    another size.
    """
    where = Path(path) if path is not None else EDS
    named = f"device: eds {where}"
    if not where.is_file():
        raise ConfigError(f"{named} does not exist; give the path of the drive's EDS file", key=("eds",))
    try:
        dictionary = canopen.import_od(str(where), node)
    except (configparser.Error, ValueError, KeyError, NotImplementedError, OSError, TypeError) as error:
        says = " ".join(str(error).split()) or type(error).__name__
        raise ConfigError(f"{named} is no EDS file ({says})", key=("eds",)) from error
    missing = [key for key in _NEEDED if dictionary.get_variable(*key) is None]
    if missing:
        raise ConfigError(
            f"{named} has no {', '.join(map(name_of, missing))}; a drive with torque mode, position and "
            "mappable PDOs has them: is this its EDS?",
            key=("eds",),
        )
    for key, remedy in further.items():
        if dictionary.get_variable(*key) is None:
            raise ConfigError(f"{named} has no {name_of(key)}; {remedy}", key=("eds",))
    for key, wanted in _NEEDED.items():
        kind = dictionary.get_variable(*key).data_type
        found = (SIZES.get(kind, 0), kind in SIGNED)
        if found != wanted and not (found[0] == wanted[0] == 1):
            raise ConfigError(
                f"{named}: {name_of(key)} has data type {kind:04X}h, not CiA 402's; is this its EDS?",
                key=("eds",),
            )
    return dictionary


def name_of(key: tuple[int, int]) -> str:
    """Return an object as the manuals write it, such as ``1016h:1``."""
    index, sub = key
    return f"{index:04X}h:{sub:X}" if sub else f"{index:04X}h"


class _Network(canopen.Network):  # type: ignore[misc]
    """canopen's network on a link, read by whoever waits."""

    def __init__(self, link: CanLink, heard: Callable[[can.Message], None]) -> None:
        super().__init__()
        self._link = link
        self._heard = heard

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._link.send(
            can.Message(arbitration_id=can_id, data=data, is_extended_id=False, is_remote_frame=remote)
        )

    def pump(self, seconds: float) -> bool:
        """Take one frame, waiting at most `seconds`; return whether one came."""
        message = self._link.receive(seconds)
        if message is None:
            return False
        self._heard(message)
        if not message.is_remote_frame and not message.is_extended_id:
            client = self.subscribers.get(message.arbitration_id)
            if client is not None and message.arbitration_id >> 7 == 0x580 >> 7 and len(message.data) == 8:
                self.notify(message.arbitration_id, message.data, message.timestamp)
        return True


class _Client(SdoClient):  # type: ignore[misc]
    """An SDO client that reads the bus itself while it waits."""

    MAX_RETRIES = 2

    def read_response(self) -> bytes:
        end = time.monotonic() + self.RESPONSE_TIMEOUT
        while self.responses.empty():
            left = end - time.monotonic()
            if left <= 0.0:
                raise SdoCommunicationError("No SDO response received")
            self.network.pump(left)
        response: bytes = super().read_response()
        return response


class _Node(canopen.RemoteNode):  # type: ignore[misc]
    """A remote node whose SDO channel needs no thread."""

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> _Client:
        client = _Client(rx_cobid, tx_cobid, self.object_dictionary)
        self.sdo_channels.append(client)
        return client


class Drive:
    """A node on a link: its objects by SDO, its NMT state, its PDOs. `who` is how messages call it.

    `heard` is called with every frame that comes while somebody waits here.
    """

    def __init__(
        self, link: CanLink, node: int, dictionary: Any, heard: Callable[[can.Message], None]
    ) -> None:
        self.node = node
        self.who = f"drive {node} on {link.who}"
        self._dictionary = dictionary
        self._network = _Network(link, heard)
        self._remote = _Node(node, dictionary)
        self._network.add_node(self._remote)

    def has(self, index: int, sub: int = 0) -> bool:
        """Return whether the EDS has an object."""
        return self._dictionary.get_variable(index, sub) is not None

    def read(self, index: int, sub: int = 0) -> int:
        """Return an object's value; raise DeviceTimeoutError, or ProtocolError where the drive refuses."""
        data = self._ask(index, sub, lambda: self._remote.sdo.upload(index, sub))
        return int.from_bytes(data, "little", signed=self._kind(index, sub) in SIGNED)

    def text(self, index: int) -> str:
        """Return an object that is a text, printable."""
        data: bytes = self._ask(index, 0, lambda: self._remote.sdo.upload(index, 0))
        said = data.split(b"\0")[0].decode("ascii", "replace")
        return "".join(c for c in said if c.isprintable()).strip()[:64]

    def write(self, index: int, sub: int, value: int) -> None:
        """Set an object's value; raises as `read` does."""
        kind = self._kind(index, sub)
        data = value.to_bytes(SIZES[kind], "little", signed=kind in SIGNED)
        self._ask(index, sub, lambda: self._remote.sdo.download(index, sub, data))

    def command(self, code: int) -> None:
        """Send this node an NMT command: 1 start, 2 stop, 128 pre-operational."""
        self._network.send_message(0, bytes([code, self.node]))

    def listen(self, seconds: float) -> None:
        """Hear what is on the bus for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._network.pump(left)

    def others(self, seconds: float = 0.2) -> list[int]:
        """Return the nodes that answer a question for their device type: for when this one does not."""
        heard: list[int] = []
        before, self._network._heard = self._network._heard, lambda m: heard.append(m.arbitration_id)
        try:
            self._network.scanner.search()
            self.listen(seconds)
        finally:
            self._network._heard = before
        return sorted({i & 0x7F for i in heard if i >> 7 in (0x580 >> 7, 0x700 >> 7)} - {self.node})

    def map_pdos(self, tpdo: list[int], rpdo: list[int]) -> int:
        """Map the first PDO of each kind, both with SYNC; turn the others off. Return how many these were.

        Raises as `read` does.
        """
        turned_off = 0
        for maps, first, objects in (
            (self._remote.tpdo, 0x180 + self.node, tpdo),
            (self._remote.rpdo, 0x200 + self.node, rpdo),
        ):
            record = 0x1800 if objects is tpdo else 0x1400
            for number in list(maps)[1:]:
                value = self.read(record + number - 1, 1)
                if not value & _INVALID:
                    self.write(record + number - 1, 1, value | _INVALID)
                    turned_off += 1
            pdo = maps[1]
            pdo.cob_id, pdo.trans_type, pdo.enabled = first, 1, True
            pdo.rtr_allowed = objects is not tpdo  # the bit means nothing on an RPDO
            pdo.inhibit_time = 0 if objects is tpdo and self.has(record, 3) else None
            pdo.event_timer = 0 if objects is tpdo and self.has(record, 5) else None
            pdo.clear()
            for index in objects:
                pdo.add_variable(index)
            self._ask(record, 1, pdo.save)
        return turned_off

    def _kind(self, index: int, sub: int) -> int:
        kind: int = self._dictionary.get_variable(index, sub).data_type
        return kind

    def _ask(self, index: int, sub: int, transfer: Callable[[], Any]) -> Any:
        try:
            return transfer()
        except SdoAbortedError as error:
            says = SdoAbortedError.CODES.get(error.code, f"code {error.code:08X}h").lower()
            raise ProtocolError(f"{self.who}: refuses access to {name_of((index, sub))} ({says})") from error
        except SdoCommunicationError as error:
            raise DeviceTimeoutError(
                f"{self.who}: no answer to an SDO request for {name_of((index, sub))}; is it still powered "
                "and connected?"
            ) from error
