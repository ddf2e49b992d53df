"""An entry under the name of another that acts alike: the same delay, force or wave."""

from __future__ import annotations

from rtcomp.diagnosis.scene import Entry
from rtcomp.stage.stage import Stage

LATE_BY = {"drive-delay": "delay", "sensor-delay": "delay", "drive-lag": "time_constant"}
"""Entries that make something late, and the parameter (s) that says by how much."""
PUSHES_WITH = {"constant-force": "force", "gravity": "force"}
"""Entries that push on the load, and the parameter (N) that says how much; `drive-offset`: in volts."""
RIPPLE = 0.1
"""Part of the drive's force that a ripple is given in the place of a wave along the way."""


def renamed(entry: Entry, name: str, stage: Stage) -> Entry | None:
    """Return `entry` as the effect `name`; None where there is no rule for the two."""
    was = str(entry["name"])
    if was in LATE_BY and name in LATE_BY:
        return {"name": name, LATE_BY[name]: entry[LATE_BY[was]]}
    if was == "drive-offset" and name in PUSHES_WITH:
        return {"name": name, PUSHES_WITH[name]: float(entry["offset"]) * stage.force_constant}  # type: ignore[arg-type]
    if was in PUSHES_WITH and name == "drive-offset":
        return {"name": name, "offset": float(entry[PUSHES_WITH[was]]) / stage.force_constant}  # type: ignore[arg-type]
    if name == "torque-ripple" and {"period", "phase"} <= set(entry):
        return {"name": name, "amplitude": RIPPLE, "period": entry["period"], "phase": entry["phase"]}
    return None


def other_side(entry: Entry, stage: Stage) -> Entry:
    """Return an offset of the drive as the force that it makes, and such a force as an offset."""
    other = {"drive-offset": "constant-force", "constant-force": "drive-offset"}.get(str(entry["name"]))
    return entry if other is None else renamed(entry, other, stage) or entry
