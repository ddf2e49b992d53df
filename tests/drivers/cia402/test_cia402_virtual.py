"""Identify and compensate through driver and drive, deterministically: a period passes with each SYNC."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plugged_link import PluggedLink
from rtcomp_drivers import cia402
from rtcomp_drivers.cia402_axis import cia402_side
from rtcomp_drivers.warm_stage import warm

from rtcomp.jobs.compensate import compensate
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import identify
from rtcomp.stage.stage import Stage

CONFIGS = Path(__file__).resolve().parents[3] / "configs"


def is_sync(message):
    return message.arbitration_id == 0x80


@pytest.fixture
def plugged(monkeypatch):
    """The Leuven stage behind a simulated drive; the ready configuration, in virtual time, runs on it."""
    stage = Stage.load(CONFIGS / "leuven.yaml")
    drive = cia402_side(warm(stage, 0), stage).axis
    monkeypatch.setattr(cia402, "CanLink", lambda settings: PluggedLink(drive, is_sync))
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
