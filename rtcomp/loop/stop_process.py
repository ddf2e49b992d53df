"""The process that watches for an emergency stop: a file that appears, a key in the terminal.

Started by `stop_watch`, never by hand: ``python -m rtcomp.loop.stop_process JOB`` (JSON). It costs the loop
nothing: all that it does to it is one number in the ring's header, which the tick reads. It ends when the
ring is closed or the process that runs the loop has gone.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
import termios
import time
import tty

from rtcomp.loop.ring import CLOSED, STOPPED, Ring

LOOK_S = 0.002
"""How often it looks for the file, and how long a key may wait."""
BY_FILE, BY_KEY = 2, 3
KEYS = b" \r\n"


def main() -> int:
    """Watch until there is nothing left to watch; exit status 0."""
    job = json.loads(sys.argv[1])
    for number in (signal.SIGINT, signal.SIGTTIN, signal.SIGTTOU):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # the terminal is put back on the way out
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, -10)
    ring, path, parent = Ring.attach(job["ring"]), job["file"], job["parent"]
    with contextlib.ExitStack() as stack:
        terminal = stack.enter_context(keys()) if job["keys"] else -1
        _look(ring, path, terminal, 0.0)
        os.write(sys.stdout.fileno(), b"ready\n")
        while not ring.header[CLOSED] and os.getppid() == parent:
            _look(ring, path, terminal, LOOK_S)
    return 0


def _look(ring: Ring, path: str | None, terminal: int, wait_s: float) -> None:
    """Look once; a stop that is asked for stays asked for."""
    if path is not None and not ring.header[STOPPED] and os.path.lexists(path):
        ring.stop(BY_FILE)
    if terminal < 0:
        time.sleep(wait_s)
    elif select.select([terminal], [], [], wait_s)[0]:
        try:
            pressed = os.read(terminal, 64)
        except OSError:  # not in the foreground any more
            time.sleep(wait_s)
            return
        if any(key in KEYS for key in pressed) and not ring.header[STOPPED]:
            ring.stop(BY_KEY)


@contextlib.contextmanager
def keys():  # type: ignore[no-untyped-def]
    """Give the terminal, one key at a time and unseen; -1 where there is none. Ctrl-C stays what it is."""
    try:
        terminal = os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY)
    except OSError:
        yield -1
        return
    before = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal, termios.TCSANOW)
        yield terminal
    finally:
        termios.tcsetattr(terminal, termios.TCSANOW, before)
        os.close(terminal)


if __name__ == "__main__":
    sys.exit(main())
