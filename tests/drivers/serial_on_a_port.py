"""The driver `serial` as the tests of it make it: on a port, patient with a busy machine."""

from __future__ import annotations

from refusals import in_one_line
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create

BENCH = Bench(period=1e-3)


def serial(port, bench=BENCH, **settings):
    settings = {"reply_timeout": 0.2, "connect_timeout": 2.0, **settings}
    return create({"driver": "serial", "port": str(port), **settings}, bench)


def refused(error_type, port, *words, bench=BENCH, **settings):
    """Opening fails with one line that holds port and words."""
    return in_one_line(error_type, (port, *words), serial(port, bench, **settings).open)
