"""The object dictionary of the simulated CiA 402 axis, and its EDS, which is written from it.

    python -m rtcomp_drivers.cia402_objects > drivers/rtcomp_drivers/cia402_axis.eds

The driver ``cia402`` uses that EDS where it is given no other: it names the objects of a plain torque drive.
"""

from __future__ import annotations

import sys
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

EDS = Path(__file__).with_name("cia402_axis.eds")
"""The EDS beside this file."""

U8, U16, U32, I8, I16, I32, TEXT = 0x05, 0x06, 0x07, 0x02, 0x03, 0x04, 0x09
SIZES = {U8: 1, U16: 2, U32: 4, I8: 1, I16: 2, I32: 4}
"""Bytes by data type of CiA 301."""
SIGNED = (I8, I16, I32)


class Entry(NamedTuple):
    """One value of the dictionary."""

    number: int
    """The index, as CiA 301 calls it."""
    sub: int
    name: str
    type: int
    access: str
    """``ro``, ``rw`` or ``const``."""
    default: int | str = 0
    mappable: bool = False
    of_node: bool = False
    """Whether the node's number is added to the default."""
    group: str = ""
    """Name of the record or array; stands where sub 0 does."""


def _array(
    index: int, group: str, *entries: Entry, count: int | None = None, access: str = "const"
) -> list[Entry]:
    most = len(entries) if count is None else count
    return [Entry(index, 0, "Number of entries", U8, access, most, group=group), *entries]


STAND_IN = "rtcomp simulated"
"""How the name of a drive begins behind which nothing moves."""
ENTRIES: list[Entry] = [
    Entry(0x1000, 0, "Device type", U32, "ro", 0x00020192),
    Entry(0x1001, 0, "Error register", U8, "ro"),
    *_array(
        0x1003, "Predefined error field",
        *(Entry(0x1003, k, f"Error {k}", U32, "ro") for k in range(1, 5)), count=0, access="rw",
    ),
    Entry(0x1005, 0, "COB-ID SYNC", U32, "rw", 0x80),
    Entry(0x1008, 0, "Manufacturer device name", TEXT, "const", f"{STAND_IN} CiA 402 axis"),
    Entry(0x1014, 0, "COB-ID EMCY", U32, "ro", 0x80, of_node=True),
    *_array(0x1016, "Consumer heartbeat time", Entry(0x1016, 1, "Consumer heartbeat time 1", U32, "rw")),
    Entry(0x1017, 0, "Producer heartbeat time", U16, "rw"),
    *_array(
        0x1018, "Identity",
        *(Entry(0x1018, k, name, U32, "ro")
          for k, name in enumerate(("Vendor", "Product", "Revision", "Serial"), 1)),
    ),
    *_array(
        0x1400, "RPDO 1 communication",
        Entry(0x1400, 1, "COB-ID", U32, "rw", 0x200, of_node=True),
        Entry(0x1400, 2, "Transmission type", U8, "rw", 1),
    ),
    *_array(
        0x1600, "RPDO 1 mapping",
        *(Entry(0x1600, k + 1, f"Mapped object {k + 1}", U32, "rw", default)
          for k, default in enumerate((0x60400010, 0x60710010, 0, 0))), count=2, access="rw",
    ),
    *_array(
        0x1800, "TPDO 1 communication",
        Entry(0x1800, 1, "COB-ID", U32, "rw", 0x40000180, of_node=True),
        Entry(0x1800, 2, "Transmission type", U8, "rw", 1),
    ),
    *_array(
        0x1A00, "TPDO 1 mapping",
        *(Entry(0x1A00, k + 1, f"Mapped object {k + 1}", U32, "rw", default)
          for k, default in enumerate((0x60410010, 0x60640020, 0, 0))), count=2, access="rw",
    ),
    Entry(0x6007, 0, "Abort connection option code", I16, "rw", 1),
    Entry(0x603F, 0, "Error code", U16, "ro", 0, True),
    Entry(0x6040, 0, "Controlword", U16, "rw", 0, True),
    Entry(0x6041, 0, "Statusword", U16, "ro", 0, True),
    Entry(0x6060, 0, "Modes of operation", I8, "rw", 0, True),
    Entry(0x6061, 0, "Modes of operation display", I8, "ro", 0, True),
    Entry(0x6064, 0, "Position actual value", I32, "ro", 0, True),
    Entry(0x6071, 0, "Target torque", I16, "rw", 0, True),
    Entry(0x6072, 0, "Max torque", U16, "rw", 10_000, True),
    Entry(0x6076, 0, "Motor rated torque", U32, "ro", 1000),
    Entry(0x6077, 0, "Torque actual value", I16, "ro", 0, True),
    Entry(0x6087, 0, "Torque slope", U32, "rw", 0xFFFFFFFF),
    Entry(0x60A8, 0, "SI unit position", U32, "ro", 0xF8010000),
    *_array(
        0x60C2, "Interpolation time period",
        Entry(0x60C2, 1, "Interpolation time period value", U8, "rw", 1),
        Entry(0x60C2, 2, "Interpolation time index", I8, "rw", -3),
    ),
    Entry(0x6502, 0, "Supported drive modes", U32, "ro", 0x208),
]  # fmt: skip
"""Every value of the axis, in order of index and sub-index."""


def eds_text() -> str:
    """Return the EDS (CiA 306) of the axis."""
    lines = [
        "; Objects of a plain CiA 402 torque drive; written by rtcomp_drivers.cia402_objects.",
        "[FileInfo]", "FileName=cia402_axis.eds", "FileVersion=1", "FileRevision=1", "EDSVersion=4.0",
        "Description=Plain CiA 402 torque drive", "CreatedBy=rtcomp", "",
        "[DeviceInfo]", "VendorName=rtcomp", "ProductName=simulated CiA 402 axis", "Granularity=8",
        "NrOfRXPDO=1", "NrOfTXPDO=1", "SimpleBootUpSlave=1",
        *(f"BaudRate_{rate}=1" for rate in (10, 20, 50, 125, 250, 500, 800, 1000)), "",
    ]  # fmt: skip
    indices = list(dict.fromkeys(entry.number for entry in ENTRIES))
    mandatory = [0x1000, 0x1001, 0x1018]
    optional = [index for index in indices if index not in mandatory]
    for title, kept in (("MandatoryObjects", mandatory), ("OptionalObjects", optional)):
        lines += [f"[{title}]", f"SupportedObjects={len(kept)}"]
        lines += [f"{k}=0x{index:04X}" for k, index in enumerate(kept, 1)] + [""]
    for index, group in groupby(ENTRIES, key=lambda entry: entry.number):
        entries = list(group)
        if not entries[0].group:
            lines += [f"[{index:04X}]", *_value(entries[0])]
            continue
        kind = 0x8 if index in (0x1003, 0x1016) else 0x9
        lines += [f"[{index:04X}]", f"ParameterName={entries[0].group}", f"ObjectType=0x{kind:X}"]
        lines += [f"SubNumber=0x{len(entries):X}", ""]
        for entry in entries:
            lines += [f"[{index:04X}sub{entry.sub:X}]", *_value(entry)]
    return "\n".join(lines)


def _value(entry: Entry) -> list[str]:
    default = entry.default
    if isinstance(default, int) and entry.type not in SIGNED:
        default = f"$NODEID+0x{default:X}" if entry.of_node else f"0x{default:X}"
    return [
        f"ParameterName={entry.name}", "ObjectType=0x7", f"DataType=0x{entry.type:04X}",
        f"AccessType={entry.access}", f"DefaultValue={default}", f"PDOMapping={int(entry.mappable)}", "",
    ]  # fmt: skip


if __name__ == "__main__":
    sys.stdout.write(eds_text())
