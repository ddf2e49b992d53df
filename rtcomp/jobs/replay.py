"""The job `replay`: a recording beside what a stage makes of it, row by row."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.errors import RecordingError
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import bridged
from rtcomp.jobs.simulate import on_reference
from rtcomp.kernels import Floats
from rtcomp.recording.acted import as_acted
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import force_balance
from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import YamlFile


@dataclass(frozen=True)
class Replayed:
    """The table of a replay by column, and its figures."""

    columns: dict[str, Floats]
    relative_force_error: float
    bandwidth_hz: float
    position_error_rms: float | None
    """m, simulated against recorded, where the stage could be simulated on the recording's reference."""
    notes: list[str]

    def summary(self) -> dict[str, Any]:
        """Return the figures, for `--json`."""
        return {
            "rows": int(self.columns["time"].size),
            "relative_force_error": self.relative_force_error,
            "bandwidth_hz": self.bandwidth_hz,
            "position_error_rms_m": self.position_error_rms,
            "notes": self.notes,
        }


def replay(stage: Stage, recording: Recording, bandwidth_hz: float | None = None) -> Replayed:
    """Return both sides of the force balance along `recording`; where possible, simulate the closed loop.

    Both sides are compared below `bandwidth_hz` (default a tenth of the rate, at most 100 Hz).
    """
    commanded = recording.voltage
    recording = as_acted(recording)
    if len(recording) < 64:
        raise RecordingError(f"{recording.path}: {len(recording)} rows; a force balance needs at least 64")
    position = bridged(recording)
    balance = force_balance(stage, recording.time, position, recording.voltage, bandwidth_hz)
    columns = {
        "time": recording.time,
        "voltage": commanded,
        "position": recording.position,
        "force_drive": balance.force_drive,
        "force_motion": balance.force_motion,
    }
    off = None
    notes = list(recording.notes)
    if recording.reference is not None and stage.controller is not None:
        config = Configuration.of(YamlFile({**stage.to_dict(), "rate": recording.rate_hz}, Path("stage")))
        run = on_reference(config, recording.reference, float(position[0]))
        columns["position_simulated"] = run.columns["position"]
        columns["voltage_simulated"] = run.columns["voltage"]
        off = float(np.sqrt(np.mean((run.columns["position"] - position) ** 2)))
    return Replayed(columns, balance.relative_error, balance.bandwidth_hz, off, notes)
