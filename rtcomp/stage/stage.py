"""A stage: a chain of effects from command to measured position, with what it is built from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from rtcomp import physics
from rtcomp.physics import Effect
from rtcomp.stage.schema import (
    RUN_SECTIONS,
    Controller,
    Element,
    Mechanics,
    Sensor,
    StageFile,
    StageOfRun,
    friction_model,
)
from rtcomp.yamlfile import dump_yaml, load_yaml, validate

UNITS = {
    "mass": "kg",
    "force_constant": "N/V, applied force per volt of command",
    "voltage_limit": "V",
    "viscous": "N s/m",
    "micro_damping": "N s/m; force = micro_damping * exp(-(v / micro_damping_speed)^2) * v",
    "micro_damping_speed": "m/s",
    "friction": "elements: stiffness N/m, reach m, or a model by its name",
    "sensor": "m rms, m",
    "controller": "V/m, V/(m s), V s/m",
    "rate": "Hz",
}
"""Comments that a saved stage carries, by key."""


class Stage:
    """What a simulation believes of a positioning axis. Build it with `load` or `from_dict`."""

    def __init__(self, file: StageFile) -> None:
        self.file = file
        self.friction = _friction(file.stage)
        """The friction model, where there is one."""
        chain = _chain(file, self.friction)
        chain += [companion for effect in chain for companion in effect.companions()]
        self.chain: list[Effect] = sorted(chain, key=lambda e: (e.place, e.order))

    @classmethod
    def load(cls, path: str | Path) -> Stage:
        """Read a stage file (a run configuration will do); raise ConfigError naming file, line and key."""
        file = load_yaml(path)
        data = {key: value for key, value in file.data.items() if key not in RUN_SECTIONS}
        return cls(validate(StageOfRun, replace(file, data=data)))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Stage:
        """Build a stage from the content of a stage file."""
        return cls(StageFile.model_validate(dict(data)))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the stage file, defaults written out."""
        data = self.file.model_dump(exclude_none=True)
        if not data["stage"]["effects"]:
            del data["stage"]["effects"]
        return data

    def save(self, path: str | Path) -> None:
        """Write the stage as YAML, units as comments, whole or not at all."""
        dump_yaml(path, self.to_dict(), comments=UNITS)

    @property
    def mechanics(self) -> Mechanics:
        """The section ``stage``."""
        return self.file.stage

    @property
    def sensor(self) -> Sensor:
        """The section ``sensor``."""
        return self.file.sensor

    @property
    def controller(self) -> Controller | None:
        """The section ``controller``, where there is one."""
        return self.file.controller

    @property
    def rate(self) -> float:
        """Sampling rate of the stage's controller (Hz)."""
        return self.file.rate

    @property
    def axis(self) -> str:
        """``linear`` or ``rotary``."""
        return self.file.stage.axis

    @property
    def mass(self) -> float:
        """Moving mass (kg)."""
        return self.file.stage.mass

    @property
    def force_constant(self) -> float:
        """Force per volt (N/V)."""
        return self.file.stage.force_constant

    @property
    def voltage_limit(self) -> float:
        """Largest command that has an effect (V)."""
        return self.file.stage.voltage_limit

    def with_changes(self, **sections: Mapping[str, Any]) -> Stage:
        """Return a stage with keys of its sections replaced: ``stage.with_changes(stage={"mass": 2.1})``."""
        data = self.to_dict()
        for section, changes in sections.items():
            data[section] = {**data.get(section, {}), **changes}
        return Stage.from_dict(data)


def _friction(mechanics: Mechanics) -> Effect | None:
    friction = mechanics.friction
    if friction is None:
        return None
    if isinstance(friction, list):
        elements = [(e.stiffness, e.reach) for e in friction if isinstance(e, Element)]
        return physics.maxwell_slip.MaxwellSlip(elements)
    return friction_model(friction)


def _chain(file: StageFile, friction: Effect | None) -> list[Effect]:
    """Write the scalar keys of the stage as the effects they stand for, and add the others."""
    m = file.stage
    chain: list[Effect] = [
        physics.build({"name": "drive-saturation", "limit": m.voltage_limit}),
        physics.drive.DriveForce(),
    ]
    if m.viscous:
        chain.append(physics.build({"name": "viscous-friction", "coefficient": m.viscous}))
    if m.micro_damping:
        damping = {"coefficient": m.micro_damping, "speed": m.micro_damping_speed}
        chain.append(physics.build({"name": "micro-damping", **damping}))
    if friction is not None:
        chain.append(friction)
    chain += [physics.build(effect) for effect in m.effects]
    if file.sensor.noise:
        chain.append(physics.build({"name": "sensor-noise", "rms": file.sensor.noise}))
    if file.sensor.resolution:
        chain.append(physics.build({"name": "sensor-resolution", "resolution": file.sensor.resolution}))
    return chain
