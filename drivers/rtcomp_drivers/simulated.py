"""The stage simulated in the loop's own process, one period an exchange, by whatever clock the loop runs."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from rtcomp.errors import ConfigError
from rtcomp.loop.device import Sample
from rtcomp.stage.simulate import Simulator
from rtcomp_drivers.driver import Bench, Driver, DriverSettings, check_volts


class SimulatedSettings(DriverSettings):
    """Settings of the driver ``simulated``."""

    delay_ticks: Literal[0, 1] = Field(
        0, description="ticks that each command is held back; 1 behaves as a real link does"
    )


class SimulatedDriver(Driver):
    """The stage simulated in process; runs as fast as it is asked."""

    name = "simulated"
    hardware = False
    Settings = SimulatedSettings

    def __init__(self, settings: SimulatedSettings, bench: Bench) -> None:
        super().__init__(settings, bench)
        if bench.stage is None:
            raise ConfigError("device: driver 'simulated' needs a stage to simulate; add the section stage")
        self.delay_ticks = settings.delay_ticks
        self._limit = bench.stage.voltage_limit
        self._simulator: Simulator | None = None
        self._sequence = 0
        self._held = 0.0

    @property
    def simulator(self) -> Simulator:
        """The simulation of the run, to see what no sensor shows; DeviceError where it is not open."""
        if self._simulator is None:
            raise self.not_open()
        return self._simulator

    def open(self) -> None:
        """Put the stage at rest at position 0, friction relaxed, time 0; the same noise each time."""
        if self._simulator is None:
            assert self.bench.stage is not None
            self._simulator = Simulator(
                self.bench.stage, seed=self.bench.seed, substeps=self.bench.substeps, start=self.bench.start
            )
            self._sequence = 0
            self._held = 0.0

    def exchange(self, volts: float) -> Sample:
        """Advance by one period with the command (the first exchange: by none), then measure."""
        simulator = self._simulator
        if simulator is None:
            raise self.not_open()
        limit = self._limit
        if not -limit <= volts <= limit:
            check_volts(self.name, volts)
            volts = limit if volts > 0.0 else -limit
        if self.delay_ticks:
            volts, self._held = self._held, volts
        if self._sequence:
            simulator.advance(volts, self.bench.period)
        self._sequence += 1
        return Sample(simulator.measure(), simulator.time, self._sequence)

    def close(self) -> None:
        """Let a period pass with zero volts and end the simulation."""
        if self._simulator is not None:
            simulator, self._simulator = self._simulator, None
            simulator.advance(0.0, self.bench.period)
