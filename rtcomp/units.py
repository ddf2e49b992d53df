"""Units of everything that is recorded or configured, SI throughout.

On a rotary axis read rad for m, N m for N and kg m^2 for kg.
"""

from __future__ import annotations

COLUMN_UNITS: dict[str, str] = {
    "time": "s",
    "reference": "m",
    "position": "m",
    "voltage": "V",
    "velocity": "m/s",
    "force": "N",
    "force_model": "N",
    "feedforward": "V",
    "feedback": "V",
    "device_time": "s",
    "sequence": "1",
    "status": "1",
    "lateness_us": "us",
    "execution_us": "us",
    "overrun": "1",
    "learning": "1",
    "outlier": "1",
    "force_drive": "N",
    "force_motion": "N",
    "position_simulated": "m",
    "voltage_simulated": "V",
}
"""Unit of each column that the program writes; columns not listed have unit ``"1"``."""

_ROTARY = {
    "m": "rad",
    "N": "N m",
    "kg": "kg m^2",
    "m/s": "rad/s",
    "N/m": "N m/rad",
    "N s/m": "N m s/rad",
    "N/V": "N m/V",
}


def for_axis(unit: str, axis: str) -> str:
    """Return `unit` as it reads on `axis` (``"linear"`` or ``"rotary"``)."""
    return _ROTARY.get(unit, unit) if axis == "rotary" else unit
