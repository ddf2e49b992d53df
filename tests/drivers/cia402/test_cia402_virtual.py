"""Identify and compensate through driver and drive, deterministically: a period passes with each SYNC."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest
from rtcomp_drivers import cia402
from rtcomp_drivers.cia402_axis import cia402_side
from rtcomp_drivers.slcan import Frame
from rtcomp_drivers.warm_stage import warm

from rtcomp.jobs.compensate import compensate
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import identify
from rtcomp.stage.stage import Stage

CONFIGS = Path(__file__).resolve().parents[3] / "configs"
PERIOD = 1e-3


class Plugged:
    """A link with the simulated drive at its other end. Nothing waits: time is what SYNC makes it."""

    who, damaged, latency_timer_ms = "CAN interface in virtual time", 0, None

    def __init__(self, drive):
        self._drive = drive
        self._received = deque()

    def send(self, message):
        if message.arbitration_id == 0x80:
            self._received += self._drive.run_until(self._drive.time + PERIOD)
        frame = Frame(message.arbitration_id, bytes(message.data), message.is_remote_frame)
        self._received += self._drive.receive([frame], self._drive.time)

    def receive(self, seconds):
        if not self._received:
            return None
        frame = self._received.popleft()
        return can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=False)

    def close(self):
        pass


@pytest.fixture
def plugged(monkeypatch):
    """The Leuven stage behind a simulated drive; the ready configuration, in virtual time, runs on it."""
    stage = Stage.load(CONFIGS / "leuven.yaml")
    drive = cia402_side(warm(stage, 0), stage).axis
    monkeypatch.setattr(cia402, "CanLink", lambda settings: Plugged(drive))
    config = Configuration.load(CONFIGS / "cia402.yaml")
    return drive, config.changed(clock="virtual", device={**config.run.device, "watchdog": 2.0})


@pytest.mark.slow
def test_the_tracking_error_falls_twentyfold(plugged):
    drive, config = plugged
    identified = identify(config)
    done = compensate(config, identified.model)
    assert done.improvement > 20
    assert drive.counters["watchdog_trips"] == drive.counters["emergencies"] == 0
    assert {zeroing.cause for zeroing in drive.zeroings} == {"disabled"}
    # The same stage without drive and bus, a command late by a tick as here: the same model.
    simulated = config.changed(device={"driver": "simulated", "delay_ticks": 1})
    direct = identify(replace(simulated, plant=Stage.load(CONFIGS / "leuven.yaml")))
    (x, ours), (same, theirs) = identified.model.virgin_curve(), direct.model.virgin_curve()
    assert np.array_equal(x, same)
    assert ours == pytest.approx(theirs, abs=0.02 * theirs.max())
