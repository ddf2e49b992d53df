"""Shared by the tests of CiA 402: drives that end with their test, a driver on their bus."""

from __future__ import annotations

from pathlib import Path

import pytest
from drives_on_a_bus import AxisOnBus, LocalDrive
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create

E35 = Path(__file__).resolve().parents[4] / "shared" / "data" / "links" / "e35.eds"


@pytest.fixture
def e35():
    """The EDS of a drive that one can buy."""
    if not E35.is_file():
        pytest.skip("the measured drive's EDS (../shared/data/links/e35.eds) is not here")
    return E35


@pytest.fixture
def made():
    """Calls that build drives and drivers; all end with the test, drivers first."""
    everything = []

    class Made:
        @staticmethod
        def axis(**facts):
            everything.append(AxisOnBus(**facts))
            return everything[-1]

        @staticmethod
        def local(eds, **more):
            everything.append(LocalDrive(eds, **more))
            return everything[-1]

        @staticmethod
        def driver(drive, bench=None, **settings):
            settings = {
                "driver": "cia402", "interface": "virtual", "channel": drive.channel, "node": 5,
                "watchdog": 1.0, "reply_timeout": 0.3, **settings,
            }  # fmt: skip
            driver = create(settings, bench or Bench(period=1e-3))
            driver.end = driver.close
            everything.append(driver)
            return driver

    yield Made
    for thing in reversed(everything):
        thing.end()


@pytest.fixture
def drive(made):
    return made.axis()


@pytest.fixture
def driver(made, drive):
    return made.driver(drive)
