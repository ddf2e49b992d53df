"""Shared by the tests of CAN links."""

from __future__ import annotations

import pytest
from slcan_pty import Adapter, PtyAxis


class FreeMass:
    """1 kg m^2 (kg), 1 N m/V, no friction."""

    def __init__(self):
        self.position = self.velocity = 0.0

    def advance(self, volts, seconds):
        self.position += self.velocity * seconds + 0.5 * volts * seconds**2
        self.velocity += volts * seconds

    def measure(self):
        return self.position


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
