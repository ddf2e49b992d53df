"""Round trips over a serial link: through the driver, beside raw reads and writes on the same port.

One exchange is the driver's, the next is made by hand, so that what else the machine does, and what the
board is busy with, meets both alike.
"""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.protocol import encode_command
from rtcomp_drivers.serial_board import SerialDriver, SerialSettings

from rtcomp.bench.spread import Spread, ratio
from rtcomp.errors import DeviceTimeoutError
from rtcomp.loop.clock import WallClock
from rtcomp.loop.realtime import PRIORITY, realtime_process

LEFT_OUT = 20
"""First exchanges that do not count: they arm the board, and meet cold caches."""
_MOST = 4096
_PATIENCE_S = 1.0


@dataclass(frozen=True)
class RoundTrips:
    """Times of round trips, the driver's and raw ones."""

    rate_hz: float
    driver: Spread
    raw: Spread
    counters: Mapping[str, int]
    """What the driver counted."""
    realtime: Mapping[str, str]

    def ratios(self) -> dict[str, float | None]:
        """Return the driver's percentiles and longest over the raw ones."""
        ours, theirs = self.driver.figures(), self.raw.figures()
        return {name.removesuffix("_us"): ratio(ours[name], theirs[name]) for name in ours}

    def to_json(self) -> dict[str, Any]:
        """Return all figures."""
        return {
            "rate_hz": self.rate_hz,
            "driver": {"round_trips": self.driver.total, **self.driver.figures()},
            "raw": {"round_trips": self.raw.total, **self.raw.figures()},
            "ratios": self.ratios(),
            "counters": dict(self.counters),
            "realtime": dict(self.realtime),
        }


class _Both(SerialDriver):
    """The driver, with a second way through its port."""

    def by_hand(self, count: int) -> Callable[[], None]:
        """Return the plain exchange: the bytes of every second one of the next `count` commands, made before,
        are written, and what comes is looked at for nothing but the end of a frame.
        """
        link = self._link
        if link is None:
            raise self.not_open()
        descriptor, who = link.port.descriptor, link.who
        write, read, wait = os.write, os.read, select.select
        first = self._sequence + 2
        frames = iter([encode_command(number, 0) for number in range(first, first + count, 2)])

        def exchange() -> None:
            write(descriptor, next(frames))
            data = b""
            while not data.endswith(b"\0"):
                if not wait([descriptor], [], [], _PATIENCE_S)[0]:
                    raise DeviceTimeoutError(f"{who}: no sample in {_PATIENCE_S:g} s")
                data = read(descriptor, _MOST)

        return exchange

    def count_one(self) -> None:
        """Take note that an exchange went by hand."""
        self._sequence += 1
        self._answered = self._sequence


def measure(
    port: str,
    rate_hz: float,
    seconds: float,
    *,
    baudrate: int = 1_000_000,
    priority: int = PRIORITY,
    progress: Callable[[float], None] | None = None,
) -> RoundTrips:
    """Exchange commands of 0 V for samples on `port` for `seconds`, by turns through the driver and raw.

    Each way is paced at `rate_hz`, by the loop's clock. `progress(done 0 to 1)` is called once a second.
    Raises DeviceError where the board cannot be had or is lost.
    """
    pairs = LEFT_OUT + max(1, round(rate_hz * seconds))
    settings = SerialSettings.model_validate(
        {
            "driver": "serial", "port": port, "baudrate": baudrate, "watchdog": 10.0,
            "reply_timeout": _PATIENCE_S,
        }
    )  # fmt: skip
    bench = Bench(period=0.5 / rate_hz)
    with realtime_process(priority) as realtime, _Both(settings, bench) as device:
        device.arm()
        by_hand = device.by_hand(2 * pairs)
        driver, raw = by_turns(
            lambda: device.exchange(0.0), by_hand, rate_hz, pairs, after=device.count_one, progress=progress
        )
    return RoundTrips(rate_hz, driver, raw, dict(device.counters), realtime)


def by_turns(
    ours: Callable[[], object],
    theirs: Callable[[], object],
    rate_hz: float,
    pairs: int,
    *,
    after: Callable[[], None] = lambda: None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Spread, Spread]:
    """Call `ours`, then `theirs`, `pairs` times, each at `rate_hz`; return how long (us) they took.

    For every kind of link: two ways to make one exchange. `after` is called, untimed, after each of `theirs`;
    the first `LEFT_OUT` pairs do not count.
    """
    period = 0.5 / rate_hz
    taken = np.zeros((pairs, 2), np.int64)
    clock, now = WallClock(), time.perf_counter_ns
    due = 0
    clock.start(period)
    for pair in range(pairs):
        if progress is not None and not pair % max(1, round(rate_hz)):
            progress(pair / pairs)
        late = clock.wait(due)
        began = now()
        ours()
        taken[pair, 0] = now() - began
        due += 1 + int(late / period)  # a slot that has passed is not caught up
        late = clock.wait(due)
        began = now()
        theirs()
        taken[pair, 1] = now() - began
        after()
        due += 1 + int(late / period)
    times = 1e-3 * taken[LEFT_OUT:]
    return Spread.of(times[:, 0]), Spread.of(times[:, 1])
