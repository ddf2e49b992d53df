"""An emergency stop by file and by key, watched for in a process of its own."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from rtcomp.errors import RtcompError
from rtcomp.loop.ring import Ring

_PATIENCE_S = 20.0


@contextlib.contextmanager
def stop_watch(ring: Ring, path: Path | None = None, keys: bool = False) -> Iterator[None]:
    """Stop the loop on `ring`, latched, when the file `path` appears, or with space or Enter on the terminal.

    It watches from the moment the context is entered: a file that is there already stops the run before
    anything is armed. Raises RtcompError where the watching process does not come up.
    """
    if path is None and not keys:
        yield
        return
    terminal = _terminal() if keys else None
    job = {
        "ring": ring.descriptor,
        "file": None if path is None else str(path.absolute()),
        "keys": keys,
        "parent": os.getpid(),
    }
    package = str(Path(__file__).parents[2])
    paths = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "rtcomp.loop.stop_process", json.dumps(job)],
        pass_fds=(ring.descriptor,), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert process.stdout is not None
    try:
        ready = select.select([process.stdout], [], [], _PATIENCE_S)[0]
        if not ready or process.stdout.readline() != b"ready\n":
            raise RtcompError(
                "the process that watches for the emergency stop did not start; nothing was armed"
            )
        yield
    finally:
        process.terminate()
        try:
            process.wait(2.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()
        if terminal is not None:
            _put_back(*terminal)


def _terminal() -> tuple[int, list[object]] | None:
    """Return standard input and how it is set, to be put back even where the watcher was killed."""
    import termios

    with contextlib.suppress(OSError, termios.error, ValueError):
        descriptor = sys.stdin.fileno()
        return descriptor, termios.tcgetattr(descriptor)
    return None


def _put_back(descriptor: int, before: list[object]) -> None:
    import termios

    with contextlib.suppress(OSError, termios.error):
        termios.tcsetattr(descriptor, termios.TCSANOW, before)  # type: ignore[arg-type]
