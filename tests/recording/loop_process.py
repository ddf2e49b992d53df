"""A loop in a process of its own, to be killed: counts rows into the ring at a fixed rate until told to end.

Arguments: ring descriptor, path of the recording, rate (Hz), rows (0: without end).
"""

from __future__ import annotations

import sys
import time

from rtcomp.loop.ring import WRITTEN, Ring
from rtcomp.recording.recorder import Recorder


def main() -> None:
    descriptor, path, rate, rows = int(sys.argv[1]), sys.argv[2], float(sys.argv[3]), int(sys.argv[4])
    ring = Ring.attach(descriptor)
    names = ["time", "position", "voltage", "row"]
    recorder = Recorder.start(path, ring, names, {"rate": rate}, weights_columns=ring.rows.shape[1] - 4)
    print(recorder.pid, flush=True)
    start = time.monotonic()
    row = 0
    while not rows or row < rows:
        place = ring.rows[row % len(ring.rows)]
        place[:4] = (row / rate, 1e-6 * row, -1.0, row)
        place[4:] = row
        ring.header[WRITTEN] += 1
        row += 1
        time.sleep(max(0.0, start + row / rate - time.monotonic()))
    ring.close()
    print(recorder.finish(), flush=True)


if __name__ == "__main__":
    main()
