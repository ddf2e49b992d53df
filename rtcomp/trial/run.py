"""Run commands in processes of their own, a few at a time, each within its time; none outlives the trial."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from rtcomp.interrupts import Stop

LOOK_S = 0.1
"""How often it is looked whether a signal came, while tasks run."""


@dataclass(frozen=True)
class Task:
    """A command, what it is called, and where its output goes."""

    name: str
    command: tuple[str, ...]
    log: Path
    timeout_s: float


@dataclass(frozen=True)
class Outcome:
    """How a task ended: exit status (negative: by that signal), seconds, its last words."""

    name: str
    status: int
    seconds: float
    timed_out: bool
    words: str

    @property
    def well(self) -> bool:
        """Whether it ended by itself with status 0."""
        return self.status == 0 and not self.timed_out


class Processes:
    """Runs tasks with `jobs` workers; leaving the ``with`` block ends everything that still runs.

    A signal that ends the run is handed on by `stop`, between tasks or within LOOK_S.
    """

    def __init__(self, jobs: int, stop: Stop) -> None:
        self.jobs = jobs
        self._stop = stop
        self._live: set[subprocess.Popen[bytes]] = set()
        self._lock = threading.Lock()
        self._closed = False

    def __enter__(self) -> Processes:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._closed = True
            left = list(self._live)
        for process in left:
            _end(process)

    @property
    def running(self) -> int:
        """Processes that have not ended."""
        with self._lock:
            return len(self._live)

    def run(self, tasks: Sequence[Task], each: Callable[[Outcome], None] | None = None) -> list[Outcome]:
        """Run all tasks and return their outcomes in the order given; `each` sees every one as it ends."""
        pool = ThreadPoolExecutor(self.jobs)
        try:
            futures = {pool.submit(self._one, task): task for task in tasks}
            left = set(futures)
            while left:
                ended, left = wait(left, LOOK_S, FIRST_COMPLETED)
                for future in ended:
                    if each is not None:
                        each(future.result())
                self._stop.hand_on()
            outcomes = {future.result().name: future.result() for future in futures}
        finally:
            with self._lock:
                waiting = list(self._live)
            for process in waiting:  # only after an error or a signal is anything left here
                _end(process)
            pool.shutdown(wait=True, cancel_futures=True)
        return [outcomes[task.name] for task in tasks]

    def _one(self, task: Task) -> Outcome:
        threads = str(max(1, (os.cpu_count() or 1) // self.jobs))
        environment = {
            **os.environ,
            **{f"{name}_NUM_THREADS": threads for name in ("OMP", "OPENBLAS", "NUMBA")},
        }
        environment["PYTHONUNBUFFERED"] = "1"  # else an error's line comes before what was printed earlier
        task.log.parent.mkdir(parents=True, exist_ok=True)
        started = time.perf_counter()
        timed_out = False
        with task.log.open("wb") as log:
            with self._lock:
                if self._closed:
                    return Outcome(task.name, -signal.SIGTERM, 0.0, False, "not started: the trial was ended")
                try:
                    process = subprocess.Popen(
                        task.command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                        env=environment, start_new_session=True,
                    )  # fmt: skip
                except OSError as error:
                    return Outcome(task.name, 127, 0.0, False, f"{task.command[0]}: {error.strerror}")
                self._live.add(process)
            try:
                process.wait(task.timeout_s)
            except subprocess.TimeoutExpired:
                timed_out = True
            finally:
                # The whole group: a worker that a crashed diagnosis left behind is ended with it.
                _end(process)
                with self._lock:
                    self._live.discard(process)
        seconds = time.perf_counter() - started
        return Outcome(task.name, process.returncode, seconds, timed_out, _last_words(task.log))


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and all that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _last_words(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").split("\n")
    said = [line.strip() for line in lines if line.strip()]
    return said[-1][:300] if said else ""
