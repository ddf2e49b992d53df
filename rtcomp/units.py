"""Units of everything that is recorded or configured, SI throughout.

On a rotary axis read rad for m, N m for N and kg m^2 for kg.
"""

from __future__ import annotations

import math

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
    "state": "1",
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
    "1/m": "1/rad",
    "N/m^3": "N m/rad^3",
    "N s^2/m^2": "N m s^2/rad^2",
}


def for_axis(unit: str, axis: str) -> str:
    """Return `unit` as it reads on `axis` (``"linear"`` or ``"rotary"``)."""
    return _ROTARY.get(unit, unit) if axis == "rotary" else unit


def power_of(base: str, unit: str) -> int:
    """Return the power of `base` (``"m"``, ``"N"`` or ``"s"``) in a unit such as ``"N s/m"``.

    A kilogram is a N s^2/m, and a moment (N m) a rotary axis's N.
    """
    unit = "N" if unit == _ROTARY["N"] else unit
    above, _, below = unit.replace("kg", "N s^2/m").partition("/")
    found = 0
    for part, sign in ((above, 1), (below, -1)):
        for factor in part.split():
            name, _, power = factor.partition("^")
            found += sign * int(power or 1) * (name == base)
    return found


_PREFIXES = {-9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M"}


def prefixed(unit: str, *values: float) -> tuple[list[str], str]:
    """Return `values` (SI) with three digits in one unit that suits the largest: ``(["-236", "241"], "um")``.

    Of a unit with kilograms or without a name (``"1"``) the numbers come as they are.
    """
    largest = max(abs(v) for v in values)
    takes_one = unit not in ("", "1") and not unit.startswith("kg") and 0.0 < largest < 1e9
    power = 3 * min(max(math.floor(math.log10(largest) / 3 + 1e-9), -3), 2) if takes_one else 0
    texts = [f"{v / 10.0**power:.3g}" for v in values]
    return texts, _PREFIXES[power] + unit if unit != "1" else ""
