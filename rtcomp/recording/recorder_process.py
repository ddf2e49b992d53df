"""The recorder's own process: takes rows from the ring, appends them to the recording, outlives the loop.

Started by `rtcomp.recording.recorder`, never by hand. The job comes as one line of JSON on standard input,
answers go as lines of JSON to standard output: one when the file is open (or why it cannot be), one at the
end. It ends when the ring is closed and drained, or when the process that runs the loop has gone.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import sys
import time
from pathlib import Path
from typing import Any, NoReturn

from rtcomp.loop.ring import CLOSED, FLUSHED, LOST, Ring
from rtcomp.recording.events import Event
from rtcomp.recording.file import CHUNK_ROWS, RecordingFile

EVENT = "event"
"""Key of a line that tells of an event, in place of the name of a text to fill in."""
DRAIN_S = 0.02
"""How often waiting rows are taken from the ring."""


class _Parent:
    """The process that runs the loop: whether it lives, by its pidfd where there is one and always by its
    number; and what it has to say, lines of JSON on standard input.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._descriptor = -1
        self._input = sys.stdin.fileno()
        self._text = b""
        if hasattr(os, "pidfd_open"):
            with contextlib.suppress(OSError):  # it has gone already; `gone` sees that by its number
                self._descriptor = os.pidfd_open(pid)

    def gone(self, wait_s: float) -> bool:
        """Return whether the parent has ended; wait for that, or for words of it, up to `wait_s` seconds."""
        watched = [d for d in (self._descriptor, self._input) if d >= 0]
        ready = select.select(watched, [], [], wait_s)[0]
        return self._descriptor in ready or os.getppid() != self._pid

    def words(self) -> tuple[dict[str, str], list[Event]]:
        """Return what it has said since the last call, without waiting: texts to fill in, and events."""
        while self._input >= 0 and select.select([self._input], [], [], 0.0)[0]:
            piece = os.read(self._input, 65536)
            self._text += piece
            if not piece:
                self._input = -1
        *lines, self._text = self._text.split(b"\n")
        texts: dict[str, str] = {}
        events = []
        for line in lines:
            for name, said in json.loads(line).items():
                if name == EVENT:
                    events.append(Event(*said))
                else:
                    texts[name] = said
        return texts, events


def _answer(**what: Any) -> None:
    """Send one line to the parent, if it is still there to read it."""
    with contextlib.suppress(BrokenPipeError):
        os.write(sys.stdout.fileno(), (json.dumps(what) + "\n").encode())


def _give_up(error: OSError | RuntimeError) -> NoReturn:
    """Say why the file cannot be written, and end."""
    number = getattr(error, "errno", None)
    inside = re.search(r"errno = (\d+)", str(error))  # the library's own, where Python's is missing
    number = number or (int(inside[1]) if inside else 0)
    _answer(error=os.strerror(number) if number else str(error))
    # The library would write once more on its way out; what has been flushed stays valid as it is.
    os._exit(1)


def _prepare() -> list[int]:
    """Take the process out of the loop's fate and way; return the list that gathers signals to end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    asked: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _frame: asked.append(number))
    if hasattr(os, "sched_setscheduler"):
        # A loop pinned to one core in a real-time class must not have its recorder there beside it.
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, range(os.cpu_count() or 1))
    with contextlib.suppress(OSError):  # only the privileged may; a busy machine then delays flushes more
        os.setpriority(os.PRIO_PROCESS, 0, -10)
    return asked


def _record(ring: Ring, file: RecordingFile, parent: _Parent, flush_s: float, asked: list[int]) -> str:
    """Run until there is nothing more to come; return how it ended, everything taken being flushed."""
    header = ring.header
    pause = min(DRAIN_S, flush_s)
    flushed_at = time.monotonic()
    ended = ""
    while not ended:
        hurry = ring.waiting > ring.rows.shape[0] // 4
        # Each sign of the end is read before the last rows are taken: none can come after it.
        if parent.gone(0.0 if hurry else pause):
            ended = "loop died"
        if header[CLOSED]:
            ended = "complete" if header[CLOSED] == 1 else "error"
        elif asked:
            ended = ended or "recorder told to end"
        texts, events = parent.words()
        file.fill(texts)
        for event in events:
            file.add(event)
        waiting = ring.waiting
        more = True
        while more:
            file.append(ring.take(min(waiting, CHUNK_ROWS)))
            waiting -= CHUNK_ROWS
            more = waiting > 0
            if file.full or time.monotonic() - flushed_at >= flush_s:
                if problem := _flush(ring, file):
                    return problem
                flushed_at = time.monotonic()
    return _flush(ring, file) or ended


def _flush(ring: Ring, file: RecordingFile) -> str:
    """Make what was taken safe from a kill; return why no more can be recorded, empty where it can."""
    file.flush()
    ring.header[FLUSHED] = file.rows
    try:
        file.reserve()
    except OSError as error:
        return f"stopped: {error.strerror}"
    return ""


def main() -> int:
    """Do the job on standard input; exit status 0 when the recording was closed as it should be."""
    asked = _prepare()
    line = sys.stdin.readline()
    if not line:
        print("error: the recorder is started by a run, not by hand", file=sys.stderr)
        return 2
    job = json.loads(line)
    parent = _Parent(job["parent"])
    try:
        ring = Ring.attach(job["ring"])
        file = RecordingFile(
            Path(job["path"]),
            job["columns"],
            job["metadata"],
            job["weights_columns"],
            job["axis"],
            job["overwrite"],
            job["later"],
        )
    except (OSError, RuntimeError) as error:  # the library raises either
        _give_up(error)
    _answer(ready=True)
    try:
        ended = _record(ring, file, parent, job["flush_s"], asked)
        file.mark(ended == "complete", int(ring.header[LOST]), ended)
        file.close()
    except (OSError, RuntimeError) as error:
        file.abandon()
        _give_up(error)
    _answer(rows=file.rows, ended=ended)
    return 0


if __name__ == "__main__":
    sys.exit(main())
