"""The driver `odrive-can` as the tests of it make it: on a port, patient with a busy machine."""

from __future__ import annotations

from refusals import in_one_line
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create
from rtcomp_drivers.slcan import Frame

from rtcomp.errors import DeviceError

BENCH = Bench(period=1e-3)
WATCHDOG = 1.0
"""s, on both sides in most tests: this machine may be busy."""


def odrive(port, bench=BENCH, **settings):
    settings = {
        "reply_timeout": 0.2,
        "watchdog": WATCHDOG,
        "check_watchdog": False,
        "connect_timeout": 2.0,
        "heartbeat_timeout": 2.0,
        **settings,
    }
    return create({"driver": "odrive-can", "interface": "slcan", "channel": str(port), **settings}, bench)


def refused(error_type, port, *words, bench=BENCH, **settings):
    """Opening fails with one line that holds port and words; afterwards the port is free."""
    device = odrive(port, bench, **settings)
    said = in_one_line(error_type, (port, *words), device.open)
    in_one_line(DeviceError, ["open()"], lambda: device.exchange(0.0))
    return said


def command(what, data=b"", node=0):
    return Frame(c.identifier(node, what), data)
