"""The stage file: what a simulation believes of an axis, as it is written in YAML. SI units throughout."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, create_model, field_validator

from rtcomp import physics
from rtcomp.errors import ConfigError, nearest
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


def _effect_exists(entry: dict[str, Any]) -> dict[str, Any]:
    physics.build(entry)
    return entry


EffectEntry = Annotated[dict[str, Any], AfterValidator(_effect_exists)]
"""One item of ``effects``: ``{name: ..., parameter: value, ...}``."""


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
    effects: list[EffectEntry] = Field(default_factory=list, description="what else is known to be there")

    @field_validator("friction", mode="before")
    @classmethod
    def _empty_is_none(cls, value: Any) -> Any:
        return None if value == [] else value

    @field_validator("friction")
    @classmethod
    def _friction_exists(cls, value: Any) -> Any:
        if isinstance(value, dict):
            friction_model(value)
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
    "reference", "clock", "device", "limits", "loop", "identify", "judge", "relax", "compensate", "recording",
    "seed",
)  # fmt: skip
"""What a run configuration holds beside its stage; reading it as a stage leaves these out."""


class StageFile(Section):
    """A whole stage file."""

    stage: Mechanics
    sensor: Sensor = Field(default_factory=lambda: Sensor.model_validate({}))
    controller: Controller | None = None
    rate: float = Field(1000.0, ge=1.0, le=1e6, description="Hz")


StageOfRun: type[StageFile] = create_model(  # type: ignore[call-overload]
    "StageOfRun", __base__=StageFile, **dict.fromkeys(RUN_SECTIONS, (Any, None))
)
"""A stage file that knows what a run configuration's sections are called: the nearest of a misspelt one."""


def friction_model(entry: dict[str, Any]) -> physics.Effect:
    """Build the friction effect from ``{model: NAME, ...}``; raise ConfigError where it cannot be."""
    name = entry.get("model")
    if is_identified(name):
        return stop_bank(entry)
    models = [e.name for e in physics.entries() if e.place is physics.Place.FRICTION] + ["interval"]
    if name is None:
        hint = f"known are {', '.join(models)}; or give a list of stop elements"
        raise ConfigError(f"friction: model is missing; {hint}", key=("model",))
    if name not in models:
        if any(name == e.name for e in physics.entries()):
            says = f"friction: {name!r} is not a friction model; it belongs under effects"
        else:
            says = f"friction: no model is named {name!r}; {nearest(name, models)}"
        raise ConfigError(says, key=("model",))
    return physics.build({"name": name, **{k: v for k, v in entry.items() if k != "model"}})
