"""The recorder as the loop's process sees it: start it, look whether it lives, wait for its end.

The recording is written by a process of its own (`recorder_process`), so that neither the disk nor the
HDF5 library can ever hold up the loop, and so that rows already in the ring survive the loop's death.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtcomp.errors import OutputExistsError, RecordingError
from rtcomp.loop.ring import CLOSED, FLUSHED, WRITTEN, Ring

LONGEST_FLUSH_S = 0.1
_RESERVED = ("complete", "rows_lost", "ended", "format", "event")


@dataclass(frozen=True)
class RecorderSummary:
    """How a recording ended."""

    path: Path
    rows: int
    """Rows in the file."""
    rows_lost: int
    """Rows that the loop wrote and the file has not."""
    complete: bool
    """The loop closed the ring as it should, and everything it wrote is in the file."""
    ended: str
    """``complete``, ``error`` (the loop ended by one), ``recorder told to end``, ``stopped: why``
    (the disk is full) or ``recorder died``."""
    problem: str = ""
    """What went wrong with the recorder, one line; empty where nothing did."""


class Recorder:
    """A running recorder process. Made by `Recorder.start`; never raises into the loop afterwards."""

    def __init__(
        self, path: Path, ring: Ring, process: subprocess.Popen[bytes], later: Sequence[str] = ()
    ) -> None:
        self.path = path
        self._later = frozenset(later)
        self._ring = ring
        self._process = process
        self._summary: RecorderSummary | None = None

    @classmethod
    def start(
        cls,
        path: str | os.PathLike[str],
        ring: Ring,
        columns: Sequence[str],
        metadata: Mapping[str, Any],
        weights_columns: int = 0,
        flush_s: float = 0.05,
        axis: str = "linear",
        overwrite: bool = False,
        later: Sequence[str] = (),
        timeout_s: float = 20.0,
    ) -> Recorder:
        """Start recording `ring` into the new HDF5 file `path`; return when the file is open.

        `columns` names the leading columns of each row (``time`` first); the trailing `weights_columns`
        are the identifier's weights. `metadata` becomes root attributes (dicts and lists as JSON text);
        `flush_s` (s, at most 0.1) bounds what a kill can cost. With `axis` ``rotary``, units read rad, N m.

        `later` names further root attributes, texts of at most 64 bytes, that `fill` sets once they are
        known (what is in force when the loop is armed); until then they read ``unknown``.

        Raises OutputExistsError where `path` exists and `overwrite` is false, RecordingError where the
        file cannot be made or the recorder does not come up within `timeout_s` seconds, ValueError where
        columns, metadata or `flush_s` do not fit.
        """
        target = Path(path).absolute()
        _check(ring, columns, [*metadata, *later], weights_columns, flush_s)
        if target.is_dir() or (os.path.lexists(target) and not overwrite):
            raise OutputExistsError(f"{path}: exists already; choose another name or use --force")
        job = {
            "path": str(target), "ring": ring.descriptor, "parent": os.getpid(), "columns": list(columns),
            "weights_columns": weights_columns, "metadata": dict(metadata), "flush_s": flush_s, "axis": axis,
            "overwrite": overwrite, "later": list(later),
        }  # fmt: skip
        line = (json.dumps(job, default=_plain) + "\n").encode()
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rtcomp.recording.recorder_process"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            pass_fds=(ring.descriptor,), start_new_session=True, env=_environment(),
        )  # fmt: skip
        recorder = cls(target, ring, process, later)
        try:
            assert process.stdin is not None
            with contextlib.suppress(BrokenPipeError):  # it died at once; its answer, or silence, says why
                process.stdin.write(line)
                process.stdin.flush()
            answer = recorder._answer(timeout_s)
        except BaseException:
            recorder._end(0.0)
            raise
        if answer.get("ready"):
            return recorder
        problem = answer.get("error") or recorder._last_words() or f"no answer within {timeout_s:g} s"
        recorder._end(0.0)
        raise RecordingError(f"{path}: the recording cannot be made: {_one_line(problem)}")

    @property
    def pid(self) -> int:
        """The recorder's process number."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the recorder runs; costs one system call, never raises."""
        return self._process.poll() is None

    @property
    def rows_flushed(self) -> int:
        """Rows that are safe in the file by now."""
        return int(self._ring.header[FLUSHED])

    def fill(self, values: Mapping[str, str]) -> None:
        """Set root attributes that `start` announced as `later`; does not wait, and asks no living recorder.

        Raises ValueError for a name that was not announced.
        """
        if unknown := [name for name in values if name not in self._later]:
            raise ValueError(f"attribute {unknown[0]!r} was not announced to Recorder.start as later")
        self._say(dict(values))

    def tell(self, time: float, state: int, text: str) -> None:
        """Have an event recorded: `time` (s from the start of the run), the loop's state, what happened.

        To be called before the ring is closed; does not wait, and asks no living recorder.
        """
        self._say({"event": [time, state, text]})

    def _say(self, what: Mapping[str, Any]) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):  # it has died or is finished; `finish` tells
            self._process.stdin.write((json.dumps(what) + "\n").encode())
            self._process.stdin.flush()

    def finish(self, timeout: float = 10.0) -> RecorderSummary:
        """Wait up to `timeout` s for the recorder to write what is left and end; return how it went.

        Call `ring.close()` before; a ring still open is closed here as ended by an error. A recorder that
        has died, or does not end in time, is reported in the summary's `problem`. Safe to call twice.
        """
        if self._summary is not None:
            return self._summary
        header = self._ring.header
        if not header[CLOSED]:
            self._ring.close(2)
        answer = self._answer(timeout)
        last_words = "" if answer else self._last_words()
        status = self._end(2.0 if answer else 0.0)
        rows = int(answer.get("rows", header[FLUSHED]))
        lost = int(header[WRITTEN]) - rows
        ended = answer.get("ended", "recorder died")
        problem = ""
        if "ended" not in answer:
            died = f"was ended by signal {-status}" if status < 0 else "gave up"
            why = answer.get("error") or last_words or "it gave no reason"
            problem = f"{self.path}: the recorder {died}: {_one_line(why)}"
        elif ended.startswith("stopped"):
            problem = f"{self.path}: the recorder {ended}"
        complete = ended == "complete" and lost == 0
        self._summary = RecorderSummary(self.path, rows, lost, complete, ended, problem)
        return self._summary

    def _answer(self, timeout_s: float) -> dict[str, Any]:
        """Read one line of JSON from the recorder; empty where it died or did not answer in time."""
        assert self._process.stdout is not None
        descriptor = self._process.stdout.fileno()
        deadline = time.monotonic() + timeout_s
        text = b""
        while not text.endswith(b"\n"):
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([descriptor], [], [], left)[0]:
                return {}
            piece = os.read(descriptor, 65536)
            if not piece:
                return {}
            text += piece
        answer: dict[str, Any] = json.loads(text)
        return answer

    def _last_words(self) -> str:
        """Return the last line that the recorder wrote to standard error, if it has ended."""
        assert self._process.stderr is not None
        if not select.select([self._process.stderr], [], [], 0)[0]:
            return ""
        lines = os.read(self._process.stderr.fileno(), 65536).decode(errors="replace").split("\n")
        return next((line for line in reversed(lines) if line.strip()), "")

    def _end(self, wait_s: float) -> int:
        """Wait for the process, end it where it does not by itself, close its pipes; return its status."""
        try:
            status = self._process.wait(wait_s) if wait_s else self._process.poll()
            if status is None:
                raise subprocess.TimeoutExpired(self._process.args, wait_s)
        except subprocess.TimeoutExpired:
            self._process.terminate()
            try:
                status = self._process.wait(2.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                status = self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):  # what a dead recorder was told last
                    pipe.close()
        return status


def _check(
    ring: Ring, columns: Sequence[str], attributes: Sequence[str], weights_columns: int, flush_s: float
) -> None:
    width = ring.rows.shape[1]
    if len(columns) + weights_columns != width:
        raise ValueError(
            f"{len(columns)} columns and {weights_columns} weights do not make the ring's {width}"
        )
    if not columns or columns[0] != "time" or len(set(columns)) != len(columns) or "weights" in columns:
        raise ValueError("columns begin with time, are named once each, and none is named weights")
    if not 0.0 < flush_s <= LONGEST_FLUSH_S:
        raise ValueError(f"flush_s is {flush_s:g} s; allowed is (0, {LONGEST_FLUSH_S:g}]")
    if taken := [key for key in attributes if key in _RESERVED or attributes.count(key) > 1]:
        raise ValueError(
            f"metadata {taken[0]!r} is there twice, or is a name that the recorder writes itself"
        )


def _plain(value: Any) -> Any:
    """Return numpy numbers and arrays, and paths, as JSON takes them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return str(value)


def _environment() -> dict[str, str]:
    """Return the recorder's environment: it finds this package wherever it lies, and needs no threads."""
    package = str(Path(__file__).parents[2])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    return os.environ | threads | {"PYTHONPATH": os.pathsep.join(paths)}


def _one_line(text: str) -> str:
    return " ".join(str(text).split())
