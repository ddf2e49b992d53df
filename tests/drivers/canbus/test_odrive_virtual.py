"""Identify and compensate through driver and ODrive axis in virtual time: no machine is too busy for that."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plugged_link import PluggedLink
from rtcomp_drivers import odrive_link
from rtcomp_drivers.cansimple import Command
from rtcomp_drivers.odrive_axis import odrive_side
from rtcomp_drivers.warm_stage import warm

from rtcomp.jobs.compensate import compensate
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import identify
from rtcomp.stage.stage import Stage

CONFIGS = Path(__file__).resolve().parents[3] / "configs"


def asks(message):
    return message.is_remote_frame and message.arbitration_id & 31 == Command.ENCODER_ESTIMATES


@pytest.fixture
def plugged(monkeypatch):
    """The Leuven stage on an axis; the ready configuration, in virtual time, runs on it."""
    stage = Stage.load(CONFIGS / "leuven.yaml")
    axis = odrive_side(warm(stage, 0), stage).axis
    monkeypatch.setattr(odrive_link, "CanLink", lambda settings: PluggedLink(axis, asks, waits=True))
    return axis, Configuration.load(CONFIGS / "odrive_can.yaml").changed(clock="virtual")


@pytest.mark.slow
def test_the_tracking_error_falls_twentyfold(plugged):
    axis, config = plugged
    identified = identify(config)
    done = compensate(config, identified.model)
    assert done.improvement > 20
    assert {z.cause for z in axis.zeroings} == {"watchdog", "disarmed"}  # proven at each opening, and closed
    assert axis.counters["clamped"] == axis.counters["refused"] == axis.counters["ignored"] == 0
    # The same stage without drive and bus, a command late by a tick as here: the same model.
    simulated = config.changed(device={"driver": "simulated", "delay_ticks": 1})
    direct = identify(replace(simulated, plant=Stage.load(CONFIGS / "leuven.yaml")))
    (x, ours), (same, theirs) = identified.model.virgin_curve(), direct.model.virgin_curve()
    assert np.array_equal(x, same)
    assert ours == pytest.approx(theirs, abs=0.02 * theirs.max())
