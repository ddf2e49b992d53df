"""The values behind the simulated CiA 402 axis' object dictionary, and what may be written to them when."""

from __future__ import annotations

import math
from typing import NamedTuple

from rtcomp_drivers import sdo_server as sdo
from rtcomp_drivers.cia402_objects import ENTRIES, SIGNED, SIZES, TEXT
from rtcomp_drivers.sdo_server import SdoAbort

INVALID = 1 << 31
"""Bit of a PDO's COB-ID: the PDO does not exist."""
_MAPPINGS = {0x1600: 0x1400, 0x1A00: 0x1800}
"""Communication record by mapping record."""


class AxisFacts(NamedTuple):
    """What is behind the drive's objects."""

    node: int = 5
    axis: str = "linear"
    voltage_limit: float = 10.0
    """V of the plant; what the drive puts out at most."""
    force_constant: float = 1.0
    """N (N m) of the motor per V of the plant's."""
    peak: float = 10.0
    """Largest over rated torque; it is rated torque that 6071h counts in thousandths."""
    count_exponent: int = -9
    """6064h counts powers of ten of a m (rad); this one."""

    @property
    def count_size(self) -> float:
        """m (rad) per count."""
        return float(f"1e{self.count_exponent}")


def count_exponent(resolution: float) -> int:
    """Return the power of ten that a sensor of that resolution (m, rad; 0: ideal) is counted in."""
    return -9 if resolution <= 0.0 else min(-5, max(-12, math.floor(math.log10(resolution) + 1e-9)))


class Memory:
    """Values by index and sub-index, integers (and one text) as the wire has them."""

    def __init__(self, node: int) -> None:
        self.node = node
        self._entries = {(entry.number, entry.sub): entry for entry in ENTRIES}
        self._indices = {entry.number for entry in ENTRIES}
        self.values: dict[tuple[int, int], int] = {}
        self.texts: dict[tuple[int, int], str] = {}
        self.reset()

    def reset(self) -> None:
        """Go back to the defaults, those that were set with `fix` kept."""
        fixed = getattr(self, "_fixed", {})
        for key, entry in self._entries.items():
            if isinstance(entry.default, str):
                self.texts[key] = entry.default
            else:
                self.values[key] = entry.default + self.node * entry.of_node
        self._fixed: dict[tuple[int, int], int] = fixed
        self.values.update(fixed)

    def fix(self, index: int, sub: int, value: int) -> None:
        """Give a value another default."""
        self._fixed[index, sub] = self.values[index, sub] = value

    def __getitem__(self, index: int) -> int:
        return self.values[index, 0]

    def __setitem__(self, index: int, value: int) -> None:
        self.values[index, 0] = value

    def read(self, index: int, sub: int) -> bytes:
        """Return the value as bytes; raise SdoAbort where there is none."""
        entry = self._entries.get((index, sub))
        if entry is None:
            raise SdoAbort(sdo.NO_SUB_INDEX if index in self._indices else sdo.NO_OBJECT)
        if entry.type == TEXT:
            return self.texts[index, sub].encode()
        return self.values[index, sub].to_bytes(SIZES[entry.type], "little", signed=entry.type in SIGNED)

    def write(self, index: int, sub: int, data: bytes) -> int:
        """Take a value from bytes and return it; raise SdoAbort where it may not be written."""
        entry = self._entries.get((index, sub))
        if entry is None:
            raise SdoAbort(sdo.NO_SUB_INDEX if index in self._indices else sdo.NO_OBJECT)
        if entry.access != "rw":
            raise SdoAbort(sdo.READ_ONLY)
        if len(data) != SIZES[entry.type]:
            raise SdoAbort(sdo.WRONG_LENGTH)
        value = int.from_bytes(data, "little", signed=entry.type in SIGNED)
        if index in _MAPPINGS:
            self._check_mapping(index, sub, value)
        if index in _MAPPINGS.values() and sub == 1:
            self._check_cob_id(index, value)
        if index == 0x1003 and value:  # writing 0 clears the list; nothing else is allowed
            raise SdoAbort(sdo.BAD_VALUE)
        self.values[index, sub] = value
        return value

    def mapping(self, index: int) -> list[tuple[int, int, bool]]:
        """Return what a mapping record maps: object, bytes, whether signed."""
        found = []
        for sub in range(1, self.values[index, 0] + 1):
            entry = self._entries[self.values[index, sub] >> 16, self.values[index, sub] >> 8 & 0xFF]
            found.append((entry.number, SIZES[entry.type], entry.type in SIGNED))
        return found

    def cob_id(self, index: int) -> int | None:
        """Return the identifier of the PDO with the communication record `index`, None where it is off."""
        value = self.values[index, 1]
        return None if value & INVALID else value & 0x7FF

    def _check_cob_id(self, index: int, value: int) -> None:
        """An identifier can be changed only while the PDO is off, and must be an 11-bit one that is free."""
        if value & 0x3FFFF800:
            raise SdoAbort(sdo.BAD_VALUE)
        now = self.values[index, 1]
        if not now & INVALID and not value & INVALID and (value ^ now) & 0x7FF:
            raise SdoAbort(sdo.BAD_VALUE)
        if not value & 0x7FF:
            raise SdoAbort(sdo.BAD_VALUE)

    def _check_mapping(self, index: int, sub: int, value: int) -> None:
        """The order of CiA 301: PDO off, count to 0, entries, count."""
        if not self.values[_MAPPINGS[index], 1] & INVALID:
            raise SdoAbort(sdo.UNSUPPORTED)
        if sub:
            if self.values[index, 0]:
                raise SdoAbort(sdo.UNSUPPORTED)
            self._check_mapped(value)
            return
        if value > 4:
            raise SdoAbort(sdo.BAD_VALUE)
        bits = 0
        for k in range(1, value + 1):
            self._check_mapped(self.values[index, k])
            bits += self.values[index, k] & 0xFF
        if bits > 64:
            raise SdoAbort(sdo.PDO_TOO_LONG)

    def _check_mapped(self, value: int) -> None:
        entry = self._entries.get((value >> 16, value >> 8 & 0xFF))
        if entry is None or not entry.mappable or value & 0xFF != 8 * SIZES[entry.type]:
            raise SdoAbort(sdo.NOT_MAPPABLE)
