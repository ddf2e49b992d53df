"""A command run on a terminal of its own: what it showed and when, how long it took, how much memory."""

from __future__ import annotations

import fcntl
import os
import pty
import struct
import termios
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Shown:
    """What a command showed, and what it took."""

    text: str
    when: dict[str, float]
    """Seconds from the start of its process until each of the words asked for stood on the terminal."""
    seconds: float
    peak_bytes: int
    """Largest resident memory of the process."""


def on_terminal(
    command: list[str],
    *words: str,
    at: Path | None = None,
    environment: Mapping[str, str] | None = None,
    columns: int = 110,
) -> Shown:
    """Run a command in the folder `at` on a terminal of 40 lines; raise RuntimeError where it fails."""
    began = time.perf_counter()
    pid, terminal = pty.fork()
    if pid == 0:
        if at is not None:
            os.chdir(at)
        os.execve(command[0], command, os.environ if environment is None else environment)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    shown, when = b"", {}
    while True:
        try:
            more = os.read(terminal, 65536)
        except OSError:  # the other side is closed
            break
        if not more:
            break
        shown += more
        for word in words:
            if word not in when and word.encode() in shown:
                when[word] = time.perf_counter() - began
    _, status, used = os.wait4(pid, 0)
    seconds = time.perf_counter() - began
    text = shown.decode(errors="replace")
    if os.waitstatus_to_exitcode(status) != 0:
        raise RuntimeError(
            f"{' '.join(command)} ended with {os.waitstatus_to_exitcode(status)}: {text[-300:]}"
        )
    return Shown(text, when, seconds, used.ru_maxrss * 1024)
