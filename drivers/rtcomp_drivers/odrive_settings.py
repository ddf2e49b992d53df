"""Settings of the driver ``odrive-can``, and the scales that follow from them and the stage."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from rtcomp.errors import ConfigError
from rtcomp_drivers.can_link import CanSettings
from rtcomp_drivers.cansimple import MOST_NODE
from rtcomp_drivers.driver import Bench

MOST_TORQUE = 1e6
"""Nm (V), beyond which nothing is sent."""


class OdriveSettings(CanSettings):
    """Settings of the driver ``odrive-can``."""

    node_id: int = Field(0, ge=0, le=MOST_NODE, description="the axis' number on the bus")
    firmware: Literal["0.6", "0.5.6"] = Field("0.6", description="0.6 (Pro, S1, Micro) or 0.5.6 (3.x)")
    lead: float | None = Field(
        None, gt=0.0, le=1e3, description="m (rad) the axis moves in a turn of the motor; 2 pi if rotary"
    )
    torque_per_volt: float | None = Field(
        None, gt=0.0, le=1e6, description="Nm for each volt of command; without it what gives force_constant"
    )
    torque_limit: float | None = Field(
        None, gt=0.0, le=MOST_TORQUE, description="Nm, clamped here; without it the stage's voltage_limit"
    )
    velocity_limit: float | None = Field(
        None, gt=0.0, le=1e4, description="turns/s, set on the ODrive; needs current_limit"
    )
    current_limit: float | None = Field(
        None, gt=0.0, le=1e3, description="A, set on the ODrive; needs velocity_limit"
    )
    watchdog: float = Field(
        0.1, ge=0.005, le=10.0, description="s without a frame until the ODrive goes idle, as set there"
    )
    check_watchdog: bool = Field(
        True, description="prove the watchdog when opening: loop closed at zero torque, then silence"
    )
    heartbeat_timeout: float = Field(
        0.5, ge=0.02, le=10.0, description="s without a heartbeat until the run ends"
    )


def scales(settings: OdriveSettings, bench: Bench) -> tuple[float, float]:
    """Return what the axis moves in a turn (m, rad) and the torque for a volt (Nm), or raise ConfigError."""
    stage = bench.stage
    turn = settings.lead
    if turn is None:
        if stage is not None and stage.axis == "linear":
            raise ConfigError(
                "device: lead is missing; on a linear axis say how far (m) it moves in a turn of the motor",
                key=("lead",),
            )
        turn = 2.0 * math.pi
    if settings.torque_per_volt is not None:
        return turn, settings.torque_per_volt
    return turn, 1.0 if stage is None else abs(stage.force_constant) * turn / (2.0 * math.pi)


def torque_limit(settings: OdriveSettings, bench: Bench, torque_per_volt: float) -> float:
    """Return the largest torque (Nm) that is sent."""
    if settings.torque_limit is not None:
        return settings.torque_limit
    return MOST_TORQUE if bench.stage is None else bench.stage.voltage_limit * torque_per_volt
