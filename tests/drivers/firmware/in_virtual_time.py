"""The firmware in virtual time: bytes and a position in, bytes, output and state out."""

from __future__ import annotations

import json
import struct
import subprocess
from pathlib import Path
from typing import Any, NamedTuple, Self

_STEP = struct.Struct("<QqBI")
_OUTCOME = struct.Struct("<iBBI")


class Outcome(NamedTuple):
    """What the board did in a step."""

    output_uv: int
    state: int
    fault: int
    sent: bytes


class VirtualBoard:
    """A running `rtcomp-board --virtual`; a context manager."""

    def __init__(self, program: Path, *options: str) -> None:
        self._process = subprocess.Popen(
            [program, "--virtual", *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def step(self, now_us: int, data: bytes = b"", position: int | None = 0) -> Outcome:
        """Let time pass to `now_us` and hand over `data`; None is a position that cannot be read."""
        assert self._process.stdin is not None and self._process.stdout is not None
        step = _STEP.pack(now_us, position or 0, position is not None, len(data))
        self._process.stdin.write(step + data)
        self._process.stdin.flush()
        output, state, fault, size = _OUTCOME.unpack(self._process.stdout.read(_OUTCOME.size))
        return Outcome(output, state, fault, self._process.stdout.read(size))

    def end(self) -> dict[str, Any]:
        """End it and return its counters; whatever a sanitizer said fails here."""
        _, errors = self._process.communicate(timeout=60.0)
        assert self._process.returncode == 0, errors.decode()
        counters: dict[str, Any] = json.loads(errors)
        return counters

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.communicate()
