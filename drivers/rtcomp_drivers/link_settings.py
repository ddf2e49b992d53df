"""What every driver of a device behind a link is told: how long to wait, and when to give it up."""

from __future__ import annotations

import math

from pydantic import Field

from rtcomp.errors import ConfigError
from rtcomp_drivers.driver import DriverSettings

WAITED = 0.7
"""Share of the period that a sample is waited for, unless told."""


class LinkSettings(DriverSettings):
    """The settings that every link has; a driver whose device means another silence says so."""

    watchdog: float = Field(
        0.1, ge=0.002, le=10.0, description="s without a command until the device zeroes its output"
    )
    reply_timeout: float | None = Field(
        None, gt=0.0, le=1.0, description="s to wait for a sample; without it 0.7 of the period"
    )
    max_missed: int | None = Field(
        None,
        ge=0,
        le=100_000,
        description="samples that may be missing in a row; without it as many as the watchdog's time holds",
    )
    connect_timeout: float = Field(
        3.0, ge=0.3, le=60.0, description="s to wait for the device to answer, and to do as it is told"
    )
    clear_fault: bool = Field(False, description="clear, when opening, a fault that the device has latched")

    def wait(self, period: float) -> float:
        """Return how long (s) an exchange waits for its sample."""
        return WAITED * period if self.reply_timeout is None else self.reply_timeout

    def most_missed(self, period: float) -> int:
        """Return how many samples may be missing in a row.

        Unless told, the host gives up when the device would: nothing heard for the watchdog's time.
        """
        if self.max_missed is not None:
            return self.max_missed
        return math.ceil(self.watchdog / max(period, self.wait(period)) - 1e-9)

    def check_watchdog_holds(self, period: float, periods: int = 2) -> None:
        """Raise ConfigError where the watchdog's time does not hold so many periods (s)."""
        if self.watchdog < periods * period:
            count = {2: "two", 3: "three"}.get(periods, str(periods))
            raise ConfigError(
                f"device: watchdog is {self.watchdog:g} s; it must be at least {count} periods "
                f"({periods * period:g} s)",
                key=("watchdog",),
            )
