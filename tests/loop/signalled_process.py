"""A loop on the wall clock in a process of its own; says what was done to its device when it ends."""

from __future__ import annotations

import json
import os
import signal
import sys
import time

from loop_rig import device, go, plan, stage, tick

from rtcomp.interrupts import stop_on_signals
from rtcomp.loop.clock import WallClock


def main() -> None:
    again = len(sys.argv) > 1 and sys.argv[1] == "again"
    noting = device(stage())
    if again:
        # A second signal while the zero volts go out must not cut them short.
        def close():
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.05)
            noting.calls.append(("close", 0.0))
            noting.inner.close()

        noting.close = close
    opened = noting.open

    def say_and_open():
        opened()
        print("running", flush=True)

    noting.open = say_and_open
    with stop_on_signals() as stop:
        left = go(noting, tick(), plan(60_000), WallClock(), stop=stop)
    print(
        json.dumps(
            {
                "stopped_by": left.outcome.stopped_by,
                "ticks": left.outcome.ticks,
                "rows": len(left.rows),
                "last_volts": noting.commands[-1],
                "largest": max(abs(v) for v in noting.commands),
                "last_call": noting.calls[-1][0],
                "closed": int(left.ring.header[5]),
                "handler": str(signal.getsignal(signal.SIGTERM) == signal.SIG_DFL),
            }
        ),
        flush=True,
    )


if __name__ == "__main__":
    main()
