"""What happens in another thread or process is waited for, not slept for: at most so long."""

from __future__ import annotations

import time
from collections.abc import Callable

from rtcomp.loop.device import Device


def wait(condition: Callable[[], object], seconds: float = 5.0) -> None:
    """Return as soon as `condition` holds; it is an error if it does not in so many seconds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"still not so after {seconds:g} s"
        time.sleep(2e-3)


def keep_on(driver: Device, volts: float = 0.0, seconds: float = 5.0) -> Callable[[], None]:
    """A call that exchanges about every millisecond until that raises."""

    def run() -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            driver.exchange(volts)
            time.sleep(1e-3)

    return run
