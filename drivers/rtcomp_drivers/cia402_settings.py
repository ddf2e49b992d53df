"""The settings of the driver ``cia402``, and what they make of the bus."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from rtcomp.errors import ConfigError
from rtcomp_drivers.bus_budget import Traffic, check_budget
from rtcomp_drivers.can_link import CanSettings

RPDO_BYTES, TPDO_BYTES = 4, 6
"""Controlword and torque; statusword and position."""


class Cia402Settings(CanSettings):
    """Settings of the driver ``cia402``."""

    node: int = Field(ge=1, le=127, description="the drive's node number")
    eds: str | None = Field(None, description="path of the drive's EDS; without it a plain torque drive's")
    watchdog: float = Field(
        0.1, ge=0.005, le=10.0, description="s without a heartbeat of the loop until the drive itself stops"
    )
    drive_watchdog: bool = Field(
        True, description="false: take a drive without heartbeat consumer (1016h); if we die, torque stays on"
    )
    host_node: int = Field(127, ge=1, le=127, description="node number under which the loop's heartbeat goes")
    mode: Literal["cyclic", "profile"] | None = Field(
        None, description="cyclic synchronous or profile torque; without it cyclic, where the drive has it"
    )
    torque_per_volt: float | None = Field(
        None, gt=0.0, le=1e6, description="N m (N) per V of command; without it the stage's force_constant"
    )
    rated_torque: float | None = Field(
        None, gt=0.0, le=1e6, description="N m (N), 1000 of 6071h; without it the drive's 6076h"
    )
    count_size: float | None = Field(
        None, gt=0.0, le=1.0, description="m (rad) per count of 6064h; without it the drive's 60A8h"
    )
    counts_per_turn: float | None = Field(None, gt=0.0, le=1e12, description="instead, on a rotary axis")
    voltage_limit: float | None = Field(
        None, gt=0.0, le=1e6, description="V, clamped by the drive as torque; without it the stage's"
    )
    connect_timeout: float = Field(3.0, gt=0.0, le=60.0, description="s for the drive to become enabled")

    def beat_every(self, period: float) -> int:
        """Return after how many ticks of `period` s a heartbeat goes: ten times in the watchdog's time."""
        return max(1, int(self.watchdog / (10.0 * period) + 1e-9))

    @property
    def heartbeat_ms(self) -> int:
        """ms between two heartbeats of the drive, 1017h."""
        return max(10, round(500.0 * self.watchdog))

    def check(self, period: float) -> float:
        """Return the worst share of the bus that a loop of `period` s takes; raise ConfigError at misfits."""
        self.check_watchdog_holds(period, periods=3)
        if self.host_node == self.node:
            raise ConfigError(
                f"device: host_node is {self.node}, the drive's own node; take another", key=("host_node",)
            )
        rate = 1.0 / period
        traffic = [
            Traffic("RPDO", rate, RPDO_BYTES), Traffic("SYNC", rate, 0), Traffic("TPDO", rate, TPDO_BYTES),
            Traffic("heartbeat of the host", rate / self.beat_every(period), 1),
            Traffic("heartbeat of the drive", 1e3 / self.heartbeat_ms, 1),
        ]  # fmt: skip
        return check_budget(traffic, self.bitrate, rate)
