"""A host in a process of its own that pushes an axis at about 1 kHz, to be killed or stopped at a moment."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create

from rtcomp.stage.stage import Stage

RUNNING = b"running\n"
SETTLED_TICKS = 20
MOMENTS = int(os.environ.get("RTCOMP_TEST_MOMENTS", "15"))
"""At which a host is killed or stopped in each proof."""


@contextlib.contextmanager
def pushing(
    stage: Path | None = None, volts: float = 1.0, **settings: Any
) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a host that pushes with `volts`; one that a busy machine starves is started again."""
    asked = json.dumps({"stage": None if stage is None else str(stage), "volts": volts, "settings": settings})
    for _ in range(10):
        host = subprocess.Popen(
            [sys.executable, __file__, asked], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        assert host.stdout is not None
        try:
            if host.stdout.readline() == RUNNING:
                yield host
                return
        finally:
            host.kill()
            _, said = host.communicate()
        assert b"DeviceError" in said or b"DeviceTimeoutError" in said, said.decode()
    raise AssertionError(said.decode())


def push(asked: dict[str, Any]) -> None:
    stage = None if asked["stage"] is None else Stage.load(Path(asked["stage"]))
    device = create(asked["settings"], Bench(stage=stage, period=1e-3))
    device.open()
    try:
        for k in range(1_000_000):
            device.exchange(asked["volts"])
            if k == SETTLED_TICKS:
                print("running", flush=True)
            time.sleep(1e-3)
    finally:
        device.close()


if __name__ == "__main__":
    push(json.loads(sys.argv[1]))
