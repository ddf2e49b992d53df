"""What devices hang on: serial ports, CAN interfaces, drivers. Paths are looked up below `root`."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path

from rtcomp.doctor.files import number, text
from rtcomp.doctor.finding import BAD, GOOD, WEAK, Finding

_ARPHRD_CAN = "280"


def links(root: Path) -> Iterator[Finding]:
    """Look at every port and interface there is, and at the drivers installed."""
    yield from _serial_ports(root)
    yield from _can(root)
    yield from _drivers()


def _serial_ports(root: Path) -> Iterator[Finding]:
    names = sorted(
        p.name
        for p in (root / "sys/class/tty").glob("tty*")
        if p.name.startswith(("ttyUSB", "ttyACM", "ttyAMA"))
    )
    if not names:
        yield Finding("serial ports", GOOD, "none found")
    users = _users(root) if names else {}
    for name in names:
        device = root / "dev" / name
        about, path = f"serial port /dev/{name}", f"/dev/{name}"
        if not os.access(device, os.R_OK | os.W_OK):
            yield Finding(
                about,
                BAD,
                "no right to it",
                "it cannot be opened",
                "sudo usermod -aG dialout $USER   # then log in again",
            )
        elif path in users:
            pid, command = users[path]
            yield Finding(
                about,
                BAD,
                f"in use by {command} (process {pid})",
                "a second master is refused",
                f"kill {pid}",
            )
        else:
            yield _latency(root, name, about)


def _latency(root: Path, name: str, about: str) -> Finding:
    ms = number(root / f"sys/class/tty/{name}/device/latency_timer")
    if ms is None:
        return Finding(about, GOOD, "free")
    if ms <= 1:
        return Finding(about, GOOD, f"free; latency timer {ms} ms")
    return Finding(
        about,
        WEAK,
        f"free; latency timer {ms} ms",
        f"the adapter keeps short answers back for {ms} ms: no loop faster than {1000 / (ms + 1):.0f} Hz",
        f"echo 1 | sudo tee /sys/class/tty/{name}/device/latency_timer",
    )


def _users(root: Path) -> dict[str, tuple[int, str]]:
    """Return the process, with its command, that has each device open, as far as this user may see."""
    found: dict[str, tuple[int, str]] = {}
    for folder in (root / "proc").glob("[0-9]*"):
        try:
            for descriptor in (folder / "fd").iterdir():
                target = str(descriptor.readlink())
                if target.startswith("/dev/tty"):
                    command = (folder / "comm").read_text().strip()
                    found.setdefault(target, (int(folder.name), command))
        except OSError:
            continue
    return found


def _can(root: Path) -> Iterator[Finding]:
    names = [p.parent.name for p in sorted((root / "sys/class/net").glob("*/type")) if text(p) == _ARPHRD_CAN]
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        yield Finding(
            "CAN",
            WEAK,
            "this kernel has no CAN sockets",
            "socketcan cannot be used; adapters that speak slcan can",
            "sudo modprobe can can_raw",
        )
    else:
        if not names:
            yield Finding("CAN interfaces", GOOD, "none found")
    for name in names:
        about = f"CAN interface {name}"
        if text(root / f"sys/class/net/{name}/operstate") in ("up", "unknown"):
            yield Finding(about, GOOD, "up")
        else:
            mend = f"sudo ip link set {name} up type can bitrate 1000000"
            yield Finding(about, BAD, "down", "nothing is heard on it", mend)


def _drivers() -> Iterator[Finding]:
    from rtcomp_drivers.registry import describe

    found = describe()
    able = [d.name for d in found if d.available]
    yield Finding(
        "drivers", GOOD if able else BAD, ", ".join(able) or "none", "" if able else "no device can be used"
    )
    for description in found:
        if not description.available:
            yield Finding(
                f"driver {description.name}",
                BAD,
                description.says,
                "it cannot be used",
                "install what it needs",
            )
