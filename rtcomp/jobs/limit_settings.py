"""The sections ``limits`` and ``loop``: what a run may do, and when it gives up."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import Section

Positive = Annotated[float, Field(gt=0)]
Window = Annotated[list[float], Field(min_length=2, max_length=2)]

STUCK_S = 0.25
"""s that a real axis may stand still while fully driven, unless the file says otherwise."""
NOISE_COUNTS = 6.0
"""Times the sensor's rms noise that a resting position may flicker."""


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


Wrong = tuple[tuple[str, ...], str]
"""Key of the configuration and what is wrong with it."""


def flicker(stage: Stage) -> float:
    """Return how far (m) the measured position of a resting axis moves: a count and the sensor's noise."""
    return stage.sensor.resolution + NOISE_COUNTS * stage.sensor.noise


def beyond_stage(limits: Limits, stage: Stage) -> Iterator[Wrong]:
    """Yield the voltages that are never reached, whatever is done with the configuration."""
    most, whose = stage.voltage_limit, "the stage's voltage_limit"
    if limits.voltage is not None and limits.voltage > most:
        yield ("limits", "voltage"), f"is {limits.voltage:g} V; {whose} allows at most {most:g} V"
    if limits.voltage is not None:
        most, whose = limits.voltage, "limits.voltage"
    if limits.moves_at is not None and limits.moves_at > most:
        says = f"{limits.moves_at:g} V is more than {whose} ({most:g} V) ever lets out; lower it"
        yield ("limits", "moves_at"), says


def contradictions(limits: Limits, stage: Stage, device: Mapping[str, Any]) -> Iterator[Wrong]:
    """Yield the limits that a closed loop could not keep, or that another one leaves without effect."""
    tick = 1.0 / stage.rate
    for key in ("age", "stuck"):
        given = getattr(limits, key) if key in limits.model_fields_set else None
        if given is not None and given < tick:
            says = f"{given:g} s is less than a tick ({tick:g} s at {stage.rate:g} Hz); give some ticks"
            yield ("limits", key), says
    if limits.invalid > limits.age:
        says = (
            f"{limits.invalid:g} s is more than limits.age ({limits.age:g} s), after which the loop stops "
            "whatever the reason; lower it, or raise that"
        )
        yield ("limits", "invalid"), says
    least = flicker(stage)
    if limits.jump is not None and limits.jump < least:
        says = (
            f"{limits.jump:g} m is less than a resting position flickers by ({least:g} m, sensor.resolution "
            "and six times sensor.noise); give more than that"
        )
        yield ("limits", "jump"), says
    most = limits.voltage or stage.voltage_limit
    its_own = device.get("voltage_limit")
    if isinstance(its_own, int | float) and its_own < most * (1.0 - 1e-9):
        whose = "limits.voltage" if limits.voltage is not None else "the stage's voltage_limit"
        says = (
            f"{its_own:g} V is less than {whose} ({most:g} V): what the device cuts off would be taken for "
            f"force; set limits.voltage to {its_own:g} V, or raise this one"
        )
        yield ("device", "voltage_limit"), says
