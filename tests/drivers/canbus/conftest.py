"""Shared by the tests of CAN links."""

from __future__ import annotations

import pytest
from free_mass import FreeMass
from odrive_on_a_port import WATCHDOG
from slcan_pty import Adapter, PtyAxis


@pytest.fixture
def adapter():
    made = Adapter()
    yield made
    made.end()


@pytest.fixture
def pty_axis():
    axes = []

    def make(**facts):
        axes.append(PtyAxis(FreeMass(), **facts))
        return axes[-1]

    yield make
    for axis in axes:
        axis.unplug()


@pytest.fixture
def axis(pty_axis):
    return pty_axis(watchdog=WATCHDOG)
