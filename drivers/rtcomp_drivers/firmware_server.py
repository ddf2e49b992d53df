"""The firmware in a process of its own behind a pseudo-terminal, and the stage that hangs on it here.

The program is what drivers/firmware makes for this machine: the C that a board runs. It owns the port and the
clock, and asks over a socket for the position and tells its output; the stage is run up to those times.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import select
import socket
import struct
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from rtcomp.errors import ConfigError, DeviceError
from rtcomp.stage.stage import Stage
from rtcomp_drivers.board import BoardFacts
from rtcomp_drivers.pty_port import PtyPort
from rtcomp_drivers.warm_stage import warm

_ASKED = struct.Struct("<BQi")
_MEASURED = struct.Struct("<Bq")
_MEASURE, _OUTPUT = b"MO"
_SLICE_S = 1e-3
"""s, longest wait for a request before the stage is moved on."""
_MARGIN_S = 2e-3
"""s that the stage stays behind the clock meanwhile: a request under way is never in its past."""
_PATIENCE_S = 2.0
_MOST = 4096


class FirmwareServer:
    """Build it, tell `port` to the host, `run` it; as `PlantServer`, with the board in C.

    Raises ConfigError where `program` cannot be run.
    """

    def __init__(self, stage: Stage, program: Path, seed: int = 0) -> None:
        self._plant = warm(stage, seed)
        self._facts = BoardFacts(axis=stage.axis, voltage_limit=stage.voltage_limit)
        self._time = self._output = 0.0
        self._last_asked = 0.0
        self._stopped = False
        self.zeroings: list[dict[str, float]] = []
        """Times (s) at which the output went to zero, as the stage got it, and s since it was last asked."""
        self._port = PtyPort()
        self.port = self._port.name
        """Path of the port for the host."""
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (read again in `summary`)
        self._socket, theirs = socket.socketpair()
        self.started = time.monotonic()
        try:
            self.process = subprocess.Popen(
                self._command(program, theirs.fileno()),
                pass_fds=(self._port.master, theirs.fileno()),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._errors,
                start_new_session=True,
            )
        except OSError as error:
            self._port.close()
            self._socket.close()
            raise ConfigError(
                f"firmware {program}: cannot be run ({error.strerror}); make it first"
            ) from error
        finally:
            theirs.close()

    def _command(self, program: Path, plant: int) -> list[str]:
        facts = self._facts
        return [
            os.fspath(program.absolute()), "--port", str(self._port.master), "--plant", str(plant),
            "--axis", facts.axis, "--limit-uv", str(round(1e6 * facts.voltage_limit)),
            "--rate", str(facts.max_rate_hz), "--count-size", repr(facts.count_size),
            "--began-us", str(int(1e6 * self.started)), "--text", "rtcomp firmware on the host",
        ]  # fmt: skip

    def stop(self) -> None:
        """End `run` within a millisecond; may be called from a signal handler."""
        self._stopped = True

    def run(self, lifeline: int | None = None) -> None:
        """Serve until `stop` or the end of the firmware; then end that, and let go of the port.

        `lifeline` is the descriptor of a pipe at whose end-of-file the server ends too.
        """
        watched: list[Any] = [self._socket] if lifeline is None else [self._socket, lifeline]
        try:
            while not self._stopped:
                able = select.select(watched, [], [], _SLICE_S)[0]
                if lifeline is not None and lifeline in able and not os.read(lifeline, _MOST):
                    break
                if self._socket in able:
                    if not self._answer():
                        break
                else:
                    self._pass_time(time.monotonic() - self.started - _MARGIN_S)
        finally:
            self._end()

    def _answer(self) -> bool:
        """Answer one request; False where the firmware has ended."""
        data = self._socket.recv(_ASKED.size, socket.MSG_WAITALL)
        if len(data) < _ASKED.size:
            return False
        what, time_us, output_uv = _ASKED.unpack(data)
        self._pass_time(1e-6 * time_us)
        if what == _MEASURE:
            self._last_asked = self._time
            with contextlib.suppress(OSError):  # it may have ended meanwhile
                self._socket.sendall(_MEASURED.pack(*self._measure()))
        elif what == _OUTPUT:
            output = 1e-6 * output_uv
            if output == 0.0 and self._output != 0.0:
                self.zeroings.append({"time": self._time, "since_asked": self._time - self._last_asked})
            self._output = output
        return True

    def _measure(self) -> tuple[bool, int]:
        counts = self._plant.measure() / self._facts.count_size
        good = math.isfinite(counts) and abs(counts) < 2.0**63
        return good, round(counts) if good else 0

    def _pass_time(self, until: float) -> None:
        if until > self._time:
            self._plant.advance(self._output, until - self._time)
            self._time = until

    def _end(self) -> None:
        """End the firmware in order: it zeroes its output, which is still heard."""
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()
        end = time.monotonic() + _PATIENCE_S
        while time.monotonic() < end and self.process.poll() is None:
            if select.select([self._socket], [], [], _SLICE_S)[0] and not self._answer():
                break
        while select.select([self._socket], [], [], 0.0)[0] and self._answer():
            pass
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(_PATIENCE_S)
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._socket.close()
        self._port.close()

    def summary(self) -> dict[str, Any]:
        """Return what happened, for the log; times in s on the board's clock."""
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        try:
            counters: dict[str, Any] = json.loads(said[-1])
        except (IndexError, ValueError) as error:
            status = self.process.returncode
            raise DeviceError(
                f"the firmware ended with status {status} and said: {said[-1] if said else 'nothing'}"
            ) from error
        return {
            "port": self.port,
            "started_monotonic_s": self.started,
            "seconds": self._time,
            **counters,
            "frames": counters["good"],
            "bad_frames": counters["bad"],
            "unknown_frames": counters["unknown"],
            "zeroings": self.zeroings,
            "output": self._output,
        }
