"""What is believed of a drawn stage, as a stage file; and recordings as CSV."""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.friction import ELEMENTS, stop_elements
from rtcomp.trial.plant import Run
from rtcomp.yamlfile import dump_yaml

MOVED = 0.11
"""A change by more than a belief is ever wrong without anything hidden (a tenth)."""


@dataclass(frozen=True)
class Believed:
    """The plant's parameters as believed, factors on the elements' stiffness; () for no friction."""

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
        p, factor = self.physics, sum(self.stiffness) / len(self.stiffness) if self.stiffness else 1.0
        believed = {"mass": p.mass, "viscous": p.viscous, "level": p.level * factor}
        true = {"mass": truth.mass, "viscous": truth.viscous + truth.back_emf, "level": truth.level}
        volts = p.force_constant / truth.force_constant
        return not quantities or any(
            not believed[q] or abs(volts * true[q] / believed[q] - 1.0) > MOVED for q in quantities
        )


def stage_file(
    believed: Believed, loop: Loop, known: list[dict[str, Any]], *, rotary: bool = False
) -> dict[str, Any]:
    """Return the content of the stage file; what is zero of a thin belief is left out of it."""
    p = believed.physics
    elements = stop_elements(p.level, p.reach, p.shape, max(1, len(believed.stiffness)))
    stage: dict[str, Any] = {"axis": "rotary"} if rotary else {}
    stage |= {
        "mass": _round(p.mass),
        "force_constant": _round(p.force_constant),
        "voltage_limit": _round(p.voltage_limit),
    }
    if p.viscous:
        stage["viscous"] = _round(p.viscous)
    if p.micro_damping:
        stage |= {"micro_damping": _round(p.micro_damping), "micro_damping_speed": _round(p.micro_speed)}
    if believed.stiffness:
        stage["friction"] = [
            {"stiffness": _round(k * factor), "reach": _round(reach)}
            for (k, reach), factor in zip(elements, believed.stiffness, strict=True)
        ]
    effects = [*_springs(p), *known]
    if effects:
        stage["effects"] = [
            {k: v if k == "name" else _round(v) for k, v in entry.items()} for entry in effects
        ]
    controller = {"kp": _round(loop.kp), "ki": _round(loop.ki), "kd": _round(loop.kd)}
    return {
        "stage": stage,
        "sensor": {"noise": _round(loop.noise), "resolution": _round(loop.resolution)},
        **({} if loop.open else {"controller": controller}),
        "rate": _round(loop.rate),
    }


def _springs(p: Physics) -> list[dict[str, Any]]:
    """Return the entries of a spring and a pendulum, where there are."""
    spring = {"name": "parallel-spring", "stiffness": p.spring}
    pendulum = {"name": "gravity", "amplitude": p.pendulum, "phase": p.pendulum_phase}
    return [*([spring] if p.spring else []), *([pendulum] if p.pendulum else [])]


def exact_stage(bare: Physics, loop: Loop, believed: dict[str, Any]) -> dict[str, Any]:
    """Return the stage file of somebody who knows the plant without what is hidden."""
    own = {entry["name"] for entry in _springs(bare)}
    known = [entry for entry in believed["stage"].get("effects", []) if entry["name"] not in own]
    rotary = believed["stage"].get("axis") == "rotary"
    return stage_file(Believed.exact(bare), loop, known, rotary=rotary)


def write_recording(path: Path, run: Run, loop: Loop) -> None:
    """Write a run as gzipped CSV: time, reference, position, voltage; in open loop without reference."""
    decimals = 9 if loop.resolution >= 1e-9 else 12
    columns = {
        "time": (run.time, "%.6f"), "reference": (run.reference, "%.6e"),
        "position": (run.position, f"%.{decimals}f"), "voltage": (run.voltage, "%.6f"),
    }  # fmt: skip
    if loop.open:
        del columns["reference"]
    with gzip.open(path, "wt", compresslevel=4, encoding="ascii", newline="\n") as file:
        np.savetxt(
            file, np.column_stack([values for values, _ in columns.values()]),
            fmt=[form for _, form in columns.values()], delimiter=",", header=",".join(columns), comments="",
        )  # fmt: skip


def write_case(folder: Path, stage: dict[str, Any], run: Run, loop: Loop) -> None:
    """Write what a diagnosis gets, ``stage.yaml`` and ``train.csv.gz``, into a new folder."""
    folder.mkdir(parents=True)
    dump_yaml(folder / "stage.yaml", stage)
    write_recording(folder / "train.csv.gz", run, loop)


def _round(value: float) -> float:
    return float(f"{value:.7g}")
