"""Start a plant server as a process of its own, learn its port, end it, read what it saw."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Self

from rtcomp.errors import DeviceError, DeviceTimeoutError


class PlantProcess:
    """A running plant server; a context manager that ends it. It also ends by itself when this process dies.

    `link` is what it speaks (rtcomp_drivers.plant_links), `watchdog` (s) that of a drive which has its own.
    With `firmware`, a program made by drivers/firmware, that is the board. Starting takes up to a minute the
    first time, when the simulation is compiled. Raises DeviceError where the server ends instead of serving,
    with what it said, and DeviceTimeoutError where it says nothing.
    """

    def __init__(
        self,
        config: str | Path,
        *,
        seed: int = 0,
        realtime: bool = True,
        patience: float = 120.0,
        firmware: str | Path | None = None,
        link: str = "serial",
        watchdog: float | None = None,
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="rtcomp-plant-")
        self._log = Path(self._folder.name, "summary.json")
        self._errors = Path(self._folder.name, "errors.txt")
        command = [sys.executable, "-m", "rtcomp_drivers.plant_server", "--config", str(config)]
        command += ["--link", link, "--until-eof", "--json", "--seed", str(seed), "--log", str(self._log)]
        if watchdog is not None:
            command += ["--watchdog", str(watchdog)]
        if firmware is not None:
            command += ["--firmware", str(firmware)]
        if not realtime:
            command.append("--no-realtime")
        with self._errors.open("wb") as errors:
            # A session of its own: Ctrl-C at the terminal is for the loop, which ends the plant afterwards.
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,  # never written to: it closes when this process dies, however it dies
                stdout=subprocess.PIPE,
                stderr=errors,
                start_new_session=True,
            )
        self.summary: dict[str, Any] | None = None
        """What the server saw; after `stop`."""
        try:
            ready: dict[str, Any] = json.loads(self._first_line(patience))
        except BaseException:
            self.kill()
            raise
        self.port: str = ready["port"]
        """The port to give to the link's driver."""
        self.scheduling: str = ready["scheduling"]

    @property
    def pid(self) -> int:
        """The server's process id."""
        return self.process.pid

    def stop(self, patience: float = 10.0) -> dict[str, Any]:
        """End the server in order and return its summary; again returns the same."""
        if self.summary is not None:
            return self.summary
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(patience)
            self.summary = json.loads(self._log.read_text())
        except (subprocess.TimeoutExpired, FileNotFoundError) as error:
            raise DeviceError(f"the plant server did not end in order; it said: {self._said()}") from error
        finally:
            self.kill()
        return self.summary

    def kill(self) -> None:
        """End the server at once, without a summary; does nothing where it has ended."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()
        self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None and self.summary is None:
            self.stop()
        else:
            self.kill()

    def _first_line(self, patience: float) -> bytes:
        assert self.process.stdout is not None
        descriptor = self.process.stdout.fileno()
        end, line = time.monotonic() + patience, b""
        while not line.endswith(b"\n"):
            left = end - time.monotonic()
            if left <= 0.0 or not select.select([descriptor], [], [], left)[0]:
                said = self._said()
                raise DeviceTimeoutError(
                    f"the plant server printed no port in {patience:g} s; it said: {said}"
                )
            piece = os.read(descriptor, 4096)
            if not piece:
                self.process.wait()
                raise DeviceError(f"the plant server ended without serving; it said: {self._said()}")
            line += piece
        return line

    def _said(self) -> str:
        try:
            text = self._errors.read_text(errors="replace")
        except OSError:
            return "nothing"
        lines = [line.removeprefix("error: ") for line in text.splitlines() if line.strip()]
        return lines[-1] if lines else "nothing"
