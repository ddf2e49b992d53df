"""The sections ``limits`` and ``loop``: what a run may do, and when it gives up."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from rtcomp.errors import ConfigError
from rtcomp.yamlfile import Section

Positive = Annotated[float, Field(gt=0)]
Window = Annotated[list[float], Field(min_length=2, max_length=2)]

STUCK_S = 0.25
"""s that a real axis may stand still while fully driven, unless the file says otherwise."""


class Limits(Section):
    """The section ``limits``: beyond any of these the loop stops at zero volts, or does not start."""

    travel: Window | None = Field(None, description="m, lowest and highest position")
    speed: Positive | None = Field(None, description="m/s")
    acceleration: Positive | None = Field(None, description="m/s^2, of references")
    voltage: Positive | None = Field(None, description="V; at most the stage's voltage_limit")
    slew: Positive | None = Field(None, description="V/s")
    jump: Positive | None = Field(None, description="m, second difference of three samples; else none")
    age: Positive = Field(0.1, description="s that the newest sample may be old")
    invalid: float = Field(0.0, ge=0, description="s with positions that the device says must not be used")
    stuck: Positive | None = Field(
        None, description="s without motion while driven; 0.25 on real devices, off in simulation"
    )
    moves_at: Positive | None = Field(
        None, description="V at which the axis must move, and that way; without it 0.98 of the voltage limit"
    )

    stop_file: str | None = Field(None, min_length=1, description="path; while it exists nothing runs")

    @field_validator("travel")
    @classmethod
    def _ordered(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and not value[0] < value[1]:
            raise ValueError(f"is [{value[0]:g}, {value[1]:g}]; the lowest must come first")
        return value

    @model_validator(mode="after")
    def _reachable(self) -> Limits:
        if self.voltage is not None and self.moves_at is not None and self.moves_at > self.voltage:
            says = f"{self.moves_at:g} V is more than limits.voltage ({self.voltage:g} V) ever lets out"
            raise ConfigError(says, key=("moves_at",))
        return self


class Loop(Section):
    """The section ``loop``: what missed deadlines do."""

    overrun: Literal["host-paced", "device-paced"] = Field(
        "host-paced", description="whose clock decides what is late: the host's, or the device's"
    )
    late: float = Field(0.5, gt=0, le=1, description="share of the period from which a tick counts as late")
    slots_lost: int | None = Field(
        None, ge=1, le=1_000_000_000,
        description="slots lost after which the loop stops; without it 20 on hardware, none elsewhere",
    )  # fmt: skip
