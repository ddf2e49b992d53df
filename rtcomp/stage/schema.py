"""The stage file: what a simulation believes of an axis, as it is written in YAML. SI units throughout."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, field_validator

from rtcomp import physics
from rtcomp.errors import ConfigError
from rtcomp.stage.identified import is_identified, stop_bank
from rtcomp.yamlfile import Section


class Element(Section):
    """One stop element of Maxwell-slip friction; a yielded element pushes stiffness * reach."""

    stiffness: float = Field(ge=-1e12, le=1e12, description="N/m")
    reach: float = Field(gt=0, le=1e3, description="m, travel at which it yields")


def _kind_of_friction(value: Any) -> str:
    return "elements" if isinstance(value, list) else "model"


Friction = Annotated[
    Annotated[Annotated[list[Element], Field(min_length=1)], Tag("elements")]
    | Annotated[dict[str, Any], Tag("model")],
    Discriminator(_kind_of_friction),
]
"""A bank of stop elements, or ``{model: NAME, parameter: value, ...}``: a friction model of the catalogue
or an identified hysteresis model."""


class Mechanics(Section):
    """The section ``stage``."""

    axis: Literal["linear", "rotary"] = "linear"
    mass: float = Field(gt=0, le=1e6, description="kg, moving mass")
    force_constant: float = Field(gt=0, le=1e9, description="N/V, applied force per volt of command")
    voltage_limit: float = Field(gt=0, le=1e6, description="V, the drive takes no more than this")
    viscous: float = Field(0.0, ge=0, le=1e6, description="N s/m")
    micro_damping: float = Field(0.0, ge=0, le=1e8, description="N s/m, damping of presliding at rest")
    micro_damping_speed: float = Field(5e-3, gt=0, le=1e3, description="m/s, where it has fallen to 1/e")
    friction: Friction | None = None
    effects: list[dict[str, Any]] = Field(default_factory=list, description="what else is known to be there")

    @field_validator("friction")
    @classmethod
    def _friction_exists(cls, value: Any) -> Any:
        if isinstance(value, dict):
            friction_model(value)
        return value

    @field_validator("effects")
    @classmethod
    def _effects_exist(cls, value: list[dict[str, Any]]) -> list[dict[str, Any]]:
        for effect in value:
            physics.build(effect)
        return value


class Sensor(Section):
    """The section ``sensor``."""

    noise: float = Field(0.0, ge=0, le=1.0, description="m rms")
    resolution: float = Field(0.0, ge=0, le=1.0, description="m, 0 for none")


class Controller(Section):
    """The section ``controller``: the stage's own position controller."""

    kp: float = Field(ge=0, le=1e12, description="V/m")
    ki: float = Field(0.0, ge=0, le=1e12, description="V/(m s)")
    kd: float = Field(0.0, ge=0, le=1e12, description="V s/m")


RUN_SECTIONS = (
    "reference", "clock", "device", "limits", "identify", "judge", "compensate", "recording", "seed",
)  # fmt: skip
"""What a run configuration holds beside its stage; reading it as a stage leaves these out."""


class StageFile(Section):
    """A whole stage file."""

    stage: Mechanics
    sensor: Sensor = Field(default_factory=lambda: Sensor.model_validate({}))
    controller: Controller | None = None
    rate: float = Field(1000.0, ge=1.0, le=1e6, description="Hz")


def friction_model(entry: dict[str, Any]) -> physics.Effect:
    """Build the friction effect from ``{model: NAME, ...}``; raise ConfigError where it cannot be."""
    rest = dict(entry)
    name = rest.pop("model", None)
    if is_identified(name):
        return stop_bank(entry)
    effect = physics.build({"name": name, **rest})
    if effect.place is not physics.Place.FRICTION:
        raise ConfigError(f"friction: {name!r} is not a friction model; it belongs under effects")
    return effect
