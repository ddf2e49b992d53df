"""A recording plays the stage: its positions come back row by row, whatever is commanded."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.loop.device import INVALID, OK, EndOfRun, Sample
from rtcomp_drivers.driver import Bench, Driver, DriverSettings, check_volts


class ReplaySettings(DriverSettings):
    """Settings of the driver ``replay``; the recording itself is part of the run."""


class ReplayDriver(Driver):
    """A recording played back as the stage; the identifier learns from what was recorded."""

    name = "replay"
    hardware = False
    Settings = ReplaySettings

    def __init__(self, settings: ReplaySettings, bench: Bench) -> None:
        super().__init__(settings, bench)
        if bench.recording is None:
            raise ConfigError("device: driver 'replay' needs a recording to play; name one")
        columns = bench.recording.columns
        missing = [name for name in ("time", "position", "voltage") if name not in columns]
        if missing:
            raise ConfigError(
                f"device: driver 'replay' needs the columns {', '.join(missing)}; "
                f"the recording has {', '.join(columns)}"
            )
        # Lists of floats: reading one costs a tenth of indexing an array.
        self._times: list[float] = columns["time"].tolist()
        self._positions: list[float] = columns["position"].tolist()
        self._voltages: list[float] = columns["voltage"].tolist()
        has_reference = "reference" in columns
        self._references: list[float] | None = columns["reference"].tolist() if has_reference else None
        doubtful = [columns[name] for name in ("outlier", "gap") if name in columns]
        for rows in doubtful:
            for k in np.flatnonzero(rows):
                self._positions[k] = math.nan
        self._row = -1
        self._open = False

    def __len__(self) -> int:
        """Rows in the recording."""
        return len(self._times)

    @property
    def voltage(self) -> float:
        """V, recorded in the row returned last: the command held from there to the next row."""
        return self._voltages[self._row] if self._row >= 0 else 0.0

    @property
    def reference(self) -> float:
        """m (rad), recorded in the row returned last; NaN where the recording has no reference."""
        return self._references[self._row] if self._references is not None and self._row >= 0 else math.nan

    def open(self) -> None:
        """Start at the first row."""
        if not self._open:
            self._open = True
            self._row = -1

    def exchange(self, volts: float) -> Sample:
        """Return the next row's position and time; raise EndOfRun behind the last row.

        The command is checked as on any device and then ignored. A row whose position is not finite,
        or marked as an outlier or a gap, comes with status INVALID and the last valid position.
        """
        if not self._open:
            raise self.not_open()
        check_volts(self.name, volts)
        row = self._row + 1
        if row >= len(self._times):
            raise EndOfRun(f"the recording ends after {len(self._times)} rows")
        self._row = row
        position = self._positions[row]
        if math.isfinite(position):
            return Sample(position, self._times[row], row + 1, OK)
        earlier = (p for p in reversed(self._positions[:row]) if math.isfinite(p))
        return Sample(next(earlier, 0.0), self._times[row], row + 1, INVALID)

    def close(self) -> None:
        """End the playback; there is no output to zero."""
        self._open = False
