"""Diagnoses made up for the tests of what is shown of them: numbers like real ones, no engine behind."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.result import Candidate, Diagnosis, Experiment, Fit, Named, Place, Retuned, Sight, Value
from rtcomp.stage.stage import Stage

STAGE = {
    "stage": {
        "mass": 2.11,
        "force_constant": 4.0,
        "voltage_limit": 10.0,
        "viscous": 8.0,
        "friction": [{"stiffness": 3.2e5, "reach": 1.5e-6}, {"stiffness": 2.2e5, "reach": 3.5e-6}],
        "effects": [
            {"name": "cogging", "amplitude": 0.561, "period": 6.11e-4, "phase": 1.70},
            {"name": "drive-offset", "offset": -0.33},
        ],
    },
    "sensor": {"noise": 1.5e-8, "resolution": 1e-8},
    "controller": {"kp": 2e4, "ki": 2e5, "kd": 100.0},
    "rate": 1000.0,
}
REFERENCE = {
    "kind": "multisine", "amplitude": 3e-4, "band": {"low": 0.2, "high": 20.0, "count": 12}, "duration": 20.0,
}  # fmt: skip


def missing(rows: int = 30_000) -> Diagnosis:
    """Two effects named, one of them not to be told from two others; mass and friction retuned."""
    chance = np.random.default_rng(4)
    time = np.arange(rows) * 1e-3
    position = 7e-4 * np.sin(2 * np.pi * 0.31 * time) + 5e-5 * np.sin(2 * np.pi * 2.3 * time)
    cogging = 0.561 * np.sin(2 * np.pi * position / 6.11e-4 + 1.7)
    noise = 0.05 * chance.standard_normal(rows)
    unseen = ((time // 2.5).astype(int) % 4 == 3).astype(float)
    x = np.linspace(-7.5e-4, 7.5e-4, 60)
    curve = 0.561 * np.sin(2 * np.pi * x / 6.11e-4 + 1.7)
    spread = 0.02 + 0.03 * np.abs(x / 7.5e-4)
    data = curve + spread * chance.standard_normal(60)
    speed = np.geomspace(2e-5, 8e-3, 24)
    return Diagnosis(
        verdict="missing-physics",
        where=[
            Place("position", "m", (-7e-4, 7e-4), 0.83, 0.0004,
                  "position, period 0.611 mm, both directions, all speeds", x, data - 1.3,
                  after=0.4 * spread * chance.standard_normal(60), spread=spread),
            Place("direction", "1", (-1.0, 1.0), 0.12, 0.003, "the same push up and down, 1.3 N",
                  np.array([-1.0, 1.0]), np.array([-1.28, -1.35]), after=np.array([0.01, -0.02]),
                  spread=np.array([0.05, 0.06])),
            Place("speed", "m/s", (2e-5, 1e-3), 0.03, 0.04, "a little more at low speed", speed,
                  0.2 * np.exp(-speed / 1e-3), after=0.02 * np.cos(40 * speed), spread=np.full(24, 0.03)),
        ],
        retuned=[
            Retuned("mass", 2.0, Value(2.11, 2.09, 2.13, "kg")),
            Retuned("friction.level", 3.69, Value(3.521, 3.504, 3.539, "N")),
        ],
        effects=[
            Named(("cogging",), 0.998,
                  {"amplitude": Value(0.561, 0.548, 0.574, "N"),
                   "period": Value(6.111e-4, 6.108e-4, 6.114e-4, "m"),
                   "phase": Value(1.70, 1.66, 1.74, "rad")}, 0.83,
                  curve=("position", "m", x, data, curve, False)),
            Named(("drive-offset", "constant-force", "gravity"), 0.97,
                  {"offset": Value(-0.33, -0.34, -0.32, "V")}, 0.14,
                  separate_by="the same motion with the axis turned over"),
        ],
        fit=Fit(0.131, 0.128, 0.0093, 0.0081),
        not_observable=["frictional-lag", "creep", "end-stop"],
        stage=Stage.from_dict(STAGE),
        next_experiment=Experiment(REFERENCE, ("drive-offset", "constant-force"), 20.0,
                                   "the same stretch at speeds a hundred times apart"),
        sights=[
            Sight("cogging", "amplitude", "N", 0.012, 0.2, {"period": 2.5e-4}),
            Sight("inertia", "mass", "kg", 0.03, 2.0, {}),
            Sight("frictional-lag", "time_constant", "s", math.inf, 0.05, {}),
        ],
        candidates=[
            Candidate("cogging", 0.83, 41.0, True, 0.012),
            Candidate("torque-ripple", 0.41, 12.2, True, 0.04, "mostly what cogging explains"),
            Candidate("drive-offset", 0.14, 19.0, True, 0.005),
            Candidate("constant-force", 0.139, 18.8, True, 0.02),
            Candidate("position-dependent-friction", 0.031, 2.2, True, 0.03),
            Candidate("stribeck", 0.004, 0.9, True, 0.05),
            Candidate("back-emf", -0.001, -0.2, True, 0.9),
            Candidate("end-stop", 0.0, math.nan, False),
            Candidate("resonance", 0.0, math.nan, False, note="needs motion above 80 Hz"),
        ],
        notes=["log.csv: 3 rows of a time already seen (first: row 12): left out"],
        time=time,
        residual_before=cogging - 1.3 + noise,
        residual_after=noise,
        unseen=unseen,
    )  # fmt: skip


def consistent() -> Diagnosis:
    """Nothing missing."""
    whole = missing(2000)
    return replace(
        whole, verdict="consistent", where=[], retuned=[], effects=[], next_experiment=None,
        residual_before=whole.residual_after,
        candidates=[replace(k, gain=0.002 * k.gain, z=0.02 * k.z) for k in whole.candidates],
        fit=Fit(0.0082, 0.0082, 0.0082, 0.0081), notes=[],
        stage=Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": []}}),  # type: ignore[dict-item]
    )  # fmt: skip


def unexplained() -> Diagnosis:
    """Cogging named, and a part that no entry explains."""
    whole = missing(2000)
    x = np.linspace(-3e-4, 3e-4, 40)
    bump = np.exp(-((x / 6e-5) ** 2))
    rest = Named(("unexplained",), 1.0, {}, 0.2, curve=("position", "m", x, bump, bump, False))
    return replace(whole, effects=[whole.effects[0], rest])
