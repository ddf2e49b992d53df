"""`rtcomp` without its second of imports and of compiled kernels: a process that has them forks the commands.

Each child is what the installed script is: a process of its own with its own folder, files, signals, status.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

POLL_S = 2e-3


class Warm:
    """Starts the process with the first command and ends it with the tests."""

    def __init__(self) -> None:
        self._server: subprocess.Popen[str] | None = None

    def run(
        self, arguments: Sequence[str], at: Path, environment: dict[str, str], timeout: float
    ) -> subprocess.CompletedProcess[str]:
        """Run one command; as `subprocess.run` does, it raises TimeoutExpired."""
        server = self._start()
        assert server.stdin is not None and server.stdout is not None
        with tempfile.TemporaryDirectory() as folder:
            said, errors = Path(folder) / "out", Path(folder) / "err"
            request = {
                "arguments": list(arguments), "at": str(at), "environment": environment, "out": str(said),
                "err": str(errors), "timeout": timeout,
            }  # fmt: skip
            server.stdin.write(json.dumps(request) + "\n")
            server.stdin.flush()
            status = json.loads(server.stdout.readline())
            if status is None:
                raise subprocess.TimeoutExpired(list(arguments), timeout)
            return subprocess.CompletedProcess(list(arguments), status, said.read_text(), errors.read_text())

    def _start(self) -> subprocess.Popen[str]:
        if self._server is None:
            self._server = subprocess.Popen(
                [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
            atexit.register(self._end)
        return self._server

    def _end(self) -> None:
        assert self._server is not None
        self._server.communicate()


def serve() -> dict[str, Any] | None:
    """Fork for every request; return it in the child, None in the server when there are no more."""
    for line in sys.stdin:
        request = json.loads(line)
        pid = os.fork()
        if pid == 0:
            return request
        print(json.dumps(wait(pid, request["timeout"])), flush=True)
    return None


def wait(pid: int, timeout: float) -> int | None:
    """Return the exit status as `subprocess` has it, None for a child that had to be killed."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if (done := os.waitpid(pid, os.WNOHANG))[0]:
            return os.waitstatus_to_exitcode(done[1])
        time.sleep(POLL_S)
    os.kill(pid, 9)
    os.waitpid(pid, 0)
    return None


def become(request: dict[str, Any]) -> None:
    """Take on the folder, environment and files of a request."""
    for number, name, mode in ((0, os.devnull, "r"), (1, request["out"], "w"), (2, request["err"], "w")):
        with Path(name).open(mode) as file:
            os.dup2(file.fileno(), number)
    sys.stdin = os.fdopen(0, closefd=False)  # the server's has read ahead
    os.chdir(request["at"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv = ["rtcomp", *request["arguments"]]


def load_kernels() -> None:
    """Do the jobs once, in memory and in virtual time: what is compiled then, or read, no child need."""
    motion = {"reference": {"kind": "triangle", "amplitude": 6e-5, "frequency": 2.0, "duration": 2.0}}
    config = Configuration.load(shipped("leuven.yaml")).changed(**motion, judge=motion, compensate=motion)
    compensate(config, identify(config).model)
    assert threading.active_count() == 1, "a thread would not be there in a fork"


if __name__ == "__main__":
    sys.path.pop(0)  # this folder, which the script does not have
    import narwhals  # noqa: F401  # of plotly, which asks for it as late as a figure is made

    import rtcomp.diagnosis.pipeline
    import rtcomp.jobs.compensate
    import rtcomp.jobs.inspect
    import rtcomp.jobs.replay
    import rtcomp.jobs.simulate
    import rtcomp.recording.reader
    import rtcomp.recording.recorder
    import rtcomp.report.pages
    import rtcomp.report.watch  # noqa: F401
    from rtcomp.cli.main import main
    from rtcomp.jobs.compensate import compensate
    from rtcomp.jobs.configuration import Configuration
    from rtcomp.jobs.demo import shipped
    from rtcomp.jobs.identify import identify

    load_kernels()
    asked = serve()
    if asked is not None:
        become(asked)
        main()
