"""The next experiment: among manoeuvres within stroke and force, the one that tells two stages apart."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtcomp.control.reference_settings import reference_settings
from rtcomp.control.references import build_reference, check
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.forces.replicate import followed
from rtcomp.diagnosis.mismatch.view import View
from rtcomp.diagnosis.result import Experiment
from rtcomp.errors import RtcompError
from rtcomp.stage.stage import Stage

SECONDS = 20.0


def manoeuvres(motion: View) -> dict[str, dict[str, Any]]:
    """Return reference sections that stay within the recorded stroke (m), by what they are."""
    low, high = motion.stroke
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    speeds = np.concatenate([np.abs(np.diff(s.position)) / motion.period for s in motion.strips])
    fast = float(np.quantile(speeds, 0.98)) or half
    common = {"offset": middle, "duration": SECONDS}
    return {
        "slow strokes over the whole stroke, both ways": {
            "kind": "triangle", "amplitude": half, "frequency": min(0.2, fast / (4 * half)), **common,
        },
        "the same stretch at higher speed": {
            "kind": "triangle", "amplitude": half, "frequency": fast / (4 * half), "corner": 0.3, **common,
        },
        "small fast motion up to five times the bandwidth": {
            "kind": "multisine", "amplitude": 0.05 * half,
            "band": {"low": 1.0, "high": 59.5, "count": 40}, **common,  # 1.5 Hz apart: repeats every 2 s
        },
        "reversals of decreasing size": {
            "kind": "nested-reversals", "amplitude": half, "ratio": 0.8, "count": 18, "stroke_time": 1.0,
            "offset": middle, "start": middle,
        },
        "a slow drift with small loops on it": {
            "kind": "multisine", "frequencies": [0.05, 1.3], "amplitudes": [0.8 * half, 0.1 * half], **common,
        },
    }  # fmt: skip


def next_experiment(one: Stage, other: Stage, names: tuple[str, str], motion: View) -> Experiment | None:
    """Return the manoeuvre in which two stages differ most in what would be measured; None if none runs.

    Both are simulated in closed loop; the difference counts in position against the sensor's noise and in
    voltage against what one count of the sensor commands.
    """
    if one.controller is None:
        return None
    noise = max(float(np.hypot(one.sensor.noise, one.sensor.resolution)), 1e-9)
    quiet = max(one.controller.kp * noise, 1e-6)

    def apart(section: dict[str, Any]) -> float:
        try:
            reference = build_reference(reference_settings(section))
            strongest = one.voltage_limit * one.force_constant / one.mass
            check(reference, stroke=motion.stroke, acceleration=0.5 * strongest)
            t = np.arange(round(reference.duration * motion.rate)) / motion.rate
            path = reference.evaluate(t)[0]
            (position, voltage), with_other = (followed(stage, path, motion.rate) for stage in (one, other))
        except RtcompError:
            return -np.inf
        far = float(np.sqrt(np.mean((position - with_other[0]) ** 2))) / noise
        far += float(np.sqrt(np.mean((voltage - with_other[1]) ** 2))) / quiet
        return far if np.isfinite(far) else -np.inf

    possible = manoeuvres(motion)
    distances = shared(apart, possible.values())
    says, section = list(possible.items())[int(np.argmax(distances))]
    if max(distances) == -np.inf:
        return None
    return Experiment(section, names, float(section.get("duration", SECONDS)), says)
