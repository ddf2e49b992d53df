"""Round trips over a CAN link: through the driver, beside bare python-can on the same slcan port."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from typing import Any

from rtcomp_drivers import cansimple as c
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.odrive_can import OdriveDriver
from rtcomp_drivers.odrive_settings import OdriveSettings

from rtcomp.bench.link import LEFT_OUT, RoundTrips, by_turns
from rtcomp.errors import DeviceTimeoutError
from rtcomp.loop.realtime import PRIORITY, realtime_process

WATCHDOG_S = 10.0
"""That the axis' watchdog must have: half of the exchanges do not feed it through the driver."""
_PATIENCE_S = 1.0


class _Both(OdriveDriver):
    """The driver, with a second way through its port."""

    def by_hand(self) -> Callable[[], None]:
        """Return the plain exchange: python-can's own slcan bus sends the same frames and receives."""
        from can.interfaces.slcan import slcanBus

        if self._link is None:
            raise self.not_open()
        link, node = self._link, self.settings.node_id
        bare: Any = copy.copy(link.can.bus)
        bare.__class__ = slcanBus  # the same port; python-can's own sending and receiving
        bare._is_shutdown = True  # the driver closes the port
        request = link.message(c.Command.ENCODER_ESTIMATES, None)
        torque = link.message(c.Command.INPUT_TORQUE, c.encode_torque(0.0))
        wanted = c.identifier(node, c.Command.ENCODER_ESTIMATES)
        send, receive, clock = bare.send, bare.recv, time.monotonic

        def exchange() -> None:
            send(request)
            send(torque)
            end = clock() + _PATIENCE_S
            while (message := receive(_PATIENCE_S)) is None or message.arbitration_id != wanted:
                if message is not None:  # a heartbeat, which the driver would miss
                    link.take(message)
                if clock() > end:
                    raise DeviceTimeoutError(f"{link.who}: no position in {_PATIENCE_S:g} s")

        return exchange


def measure(
    port: str,
    rate_hz: float,
    seconds: float,
    *,
    priority: int = PRIORITY,
    progress: Callable[[float], None] | None = None,
) -> RoundTrips:
    """Ask an ODrive axis for positions and send it torques of zero for `seconds`, by turns through the driver
    and by bare python-can.

    `port` is an slcan adapter's, or that of a plant server with a watchdog of `WATCHDOG_S`. Each way is paced
    at `rate_hz`, by the loop's clock. Raises DeviceError where the axis cannot be had or is lost.
    """
    settings = OdriveSettings.model_validate(
        {
            "driver": "odrive-can", "interface": "slcan", "channel": port, "lead": 1e-3,
            "watchdog": WATCHDOG_S, "check_watchdog": False, "reply_timeout": _PATIENCE_S,
            "heartbeat_timeout": 10.0,
        }
    )  # fmt: skip
    pairs = LEFT_OUT + max(1, round(rate_hz * seconds))
    with realtime_process(priority) as realtime, _Both(settings, Bench(period=1.0 / rate_hz)) as device:
        device.arm()
        by_hand = device.by_hand()
        driver, raw = by_turns(lambda: device.exchange(0.0), by_hand, rate_hz, pairs, progress=progress)
    return RoundTrips(rate_hz, driver, raw, dict(device.counters), realtime)
