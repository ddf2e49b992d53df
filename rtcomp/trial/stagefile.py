"""What is believed of a drawn stage, as a stage file; and recordings as CSV."""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.trial.friction import ELEMENTS, stop_elements
from rtcomp.trial.plant import Loop, Physics, Run

MOVED = 0.11
"""A change by more than a belief is ever wrong without anything hidden (a tenth)."""


@dataclass(frozen=True)
class Believed:
    """The plant's parameters as believed, and factors on the elements' stiffness."""

    physics: Physics
    stiffness: tuple[float, ...]

    @classmethod
    def exact(cls, physics: Physics) -> Believed:
        """Return the belief that is right."""
        return cls(physics, (1.0,) * ELEMENTS)

    @classmethod
    def of(cls, physics: Physics, chance: np.random.Generator) -> Believed:
        """Draw a belief: exact in two of five, else mass, damping and stiffness off by up to a tenth."""
        if chance.random() < 0.4:
            return cls.exact(physics)
        off = 1.0 + 0.1 * chance.uniform(-1.0, 1.0, 3)
        common = 1.0 + 0.07 * chance.uniform(-1.0, 1.0)
        wrong = physics._replace(
            mass=physics.mass * off[0], viscous=physics.viscous * off[1],
            micro_damping=physics.micro_damping * off[2],
        )  # fmt: skip
        return cls(wrong, tuple(common + 0.03 * chance.uniform(-1.0, 1.0, ELEMENTS)))

    def off(self, truth: Physics, quantities: Sequence[str]) -> bool:
        """Tell whether one of `quantities` is, per volt, off by more than beliefs are; True without any."""
        p, factor = self.physics, sum(self.stiffness) / ELEMENTS
        believed = {"mass": p.mass, "viscous": p.viscous, "level": p.level * factor}
        true = {"mass": truth.mass, "viscous": truth.viscous + truth.back_emf, "level": truth.level}
        volts = p.force_constant / truth.force_constant
        return not quantities or any(abs(volts * true[q] / believed[q] - 1.0) > MOVED for q in quantities)


def stage_file(believed: Believed, loop: Loop, known: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the content of the stage file."""
    p = believed.physics
    elements = stop_elements(p.level, p.reach, p.shape, ELEMENTS)
    stage: dict[str, Any] = {
        "mass": _round(p.mass),
        "force_constant": _round(p.force_constant),
        "voltage_limit": _round(p.voltage_limit),
        "viscous": _round(p.viscous),
        "micro_damping": _round(p.micro_damping),
        "micro_damping_speed": _round(p.micro_speed),
        "friction": [
            {"stiffness": _round(k * factor), "reach": _round(reach)}
            for (k, reach), factor in zip(elements, believed.stiffness, strict=True)
        ],
    }
    if known:
        stage["effects"] = [{k: v if k == "name" else _round(v) for k, v in entry.items()} for entry in known]
    return {
        "stage": stage,
        "sensor": {"noise": _round(loop.noise), "resolution": _round(loop.resolution)},
        "controller": {"kp": _round(loop.kp), "ki": _round(loop.ki), "kd": _round(loop.kd)},
        "rate": _round(loop.rate),
    }


def exact_stage(bare: Physics, loop: Loop, believed: dict[str, Any]) -> dict[str, Any]:
    """Return the stage file of somebody who knows the plant without what is hidden."""
    known = believed["stage"].get("effects", [])
    return stage_file(Believed.exact(bare), loop, known)


def write_recording(path: Path, run: Run, resolution: float) -> None:
    """Write a run as gzipped CSV: time, reference, position, voltage."""
    decimals = 9 if resolution >= 1e-9 else 12
    rows = np.column_stack([run.time, run.reference, run.position, run.voltage])
    with gzip.open(path, "wt", compresslevel=4, encoding="ascii", newline="\n") as file:
        np.savetxt(
            file, rows, fmt=["%.6f", "%.6e", f"%.{decimals}f", "%.6f"], delimiter=",",
            header="time,reference,position,voltage", comments="",
        )  # fmt: skip


def _round(value: float) -> float:
    return float(f"{value:.7g}")
