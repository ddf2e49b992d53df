"""YAML checked by a model: what is refused, with line, key, value and what is allowed."""

from __future__ import annotations

import re
from typing import Annotated, Literal

import pytest
from example_file import EXAMPLE
from pydantic import Field, field_validator

from rtcomp.errors import ConfigError
from rtcomp.yamlfile import Section, dotted, parse_yaml, validate


class Element(Section):
    stiffness: float
    reach: float = Field(gt=0, le=1, description="m")


class LuGre(Section):
    model: Literal["lugre"]
    sigma_0: float


class Gms(Section):
    model: Literal["gms"]
    level: float


class Stage(Section):
    axis: Literal["linear", "rotary"] = "linear"
    mass: float = Field(gt=0, description="kg")
    viscous: float = Field(0.0, ge=0, le=1e6, json_schema_extra={"unit": "N s/m"})
    friction: (
        Annotated[list[Element], Field(min_length=1)]
        | Annotated[LuGre | Gms, Field(discriminator="model")]
        | None
    ) = None


class Sensor(Section):
    noise: float = 0.0
    resolution: float = 0.0


class Run(Section):
    stage: Stage
    sensor: Sensor = Sensor()
    rate: float = Field(1000.0, gt=0)
    cycles: int = 3
    window: tuple[float, float] | None = None
    label: str = ""
    quiet: bool = False

    @field_validator("label")
    @classmethod
    def _no_slash(cls, value: str) -> str:
        if "/" in value:
            raise ValueError("a label holds\nno slash")
        return value


def refused(text: str, model: type[Section] = Run, section: tuple[str | int, ...] = ()) -> str:
    """Return the message with which `text` is refused, which is always one line."""
    with pytest.raises(ConfigError) as caught:
        validate(model, parse_yaml(text, "run.yaml"), section)
    message = str(caught.value)
    assert "\n" not in message
    assert re.match(r"run\.yaml:\d+: ", message)
    return message


def test_a_good_file_becomes_its_model() -> None:
    run = validate(Run, parse_yaml(EXAMPLE + "cycles: 1e1\nwindow: [0, 1e-3]\n"))
    assert run.stage.mass == 2.0
    assert run.cycles == 10 and isinstance(run.cycles, int)
    assert run.window == (0.0, 1e-3)
    assert isinstance(run.stage.friction, list) and run.stage.friction[1].reach == 1e-6


def test_a_section_alone_is_checked_under_its_full_name() -> None:
    file = parse_yaml(EXAMPLE.replace("mass: 2.0 ", "mass: -2.0"), "run.yaml")
    assert validate(Sensor, file, ("sensor",)).noise == 15e-9
    assert validate(Element, file, ("stage", "friction", 1)).reach == 1e-6
    with pytest.raises(ConfigError, match=r"^run.yaml:3: stage.mass is -2; allowed is more than 0 \(kg\)$"):
        validate(Stage, file, ("stage",))
    with pytest.raises(ConfigError, match=r"^run.yaml:1: controller: is missing$"):
        validate(Sensor, file, ("controller",))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("stage: {mas: 1}", "run.yaml:1: unknown key stage.mas; did you mean stage.mass?"),
        ("stage: {mass: 1}\nmass: 2", "run.yaml:2: unknown key mass; did you mean stage.mass?"),
        ("stage:\n  mass: 1\n  rate: 2", "run.yaml:3: unknown key stage.rate; did you mean rate?"),
        ("stage: {Mass: 1}", "run.yaml:1: unknown key stage.Mass; did you mean stage.mass?"),
        (
            "stage:\n  mass: 1\nsensor:\n  noize: 2",
            "run.yaml:4: unknown key sensor.noize; did you mean sensor.noise?",
        ),
        (
            "stage: {mass: 1}\nsensor: {foo: 2}",
            "run.yaml:2: unknown key sensor.foo; known here are noise, resolution",
        ),
        (
            "stage: {mass: 1, friction: [{stiffness: 1, rech: 1}]}",
            "run.yaml:1: unknown key stage.friction[0].rech; did you",
        ),
        ("rate: 1\nstage:\n  axis: linear", "run.yaml:2: stage.mass is missing (kg)"),
        ("rate: 1", "run.yaml:1: stage is missing"),
        ("stage: {mass: heavy}", "run.yaml:1: stage.mass is 'heavy'; it must be a number (kg)"),
        ("stage: {mass: '1.0'}", "run.yaml:1: stage.mass is '1.0'; it must be a number (kg)"),
        ("stage: {mass: yes}", "run.yaml:1: stage.mass is true; it must be a number (kg)"),
        ("stage: {mass: }", "run.yaml:1: stage.mass is empty; it must be a number (kg)"),
        ("stage: {mass: [1]}", "run.yaml:1: stage.mass is a list of 1; it must be a number (kg)"),
        ("stage: {mass: .nan}", "run.yaml:1: stage.mass is nan; it must be a finite number"),
        ("stage: {mass: -.inf}", "run.yaml:1: stage.mass is -inf; it must be a finite number"),
        ("stage: {mass: 1e999}", "run.yaml:1: stage.mass is inf; it must be a finite number"),
        ("stage: {mass: nan}", "run.yaml:1: stage.mass is 'nan'; it must be a number (kg)"),
        ("stage: {mass: 0}", "run.yaml:1: stage.mass is 0; allowed is more than 0 (kg)"),
        (
            "stage: {mass: 1, viscous: 1e7}",
            "run.yaml:1: stage.viscous is 1e+07; allowed is [0, 1e+06] (N s/m)",
        ),
        (
            "stage: {mass: 1, friction: []}",
            "run.yaml:1: stage.friction has 0 entries; it must have at least 1",
        ),
        (
            "stage: {mass: 1, friction: [{stiffness: 1, reach: -1e-6}]}",
            "run.yaml:1: stage.friction[0].reach is -1e-06; allowed is (0, 1] (m)",
        ),
        (
            "stage: {mass: 1, friction: {model: lugr, sigma_0: 1}}",
            "run.yaml:1: stage.friction.model is 'lugr'; allowed is 'lugre', 'gms'",
        ),
        ("stage: {mass: 1, friction: {model: gms}}", "run.yaml:1: stage.friction.level is missing"),
        ("stage: {mass: 1, friction: {level: 3}}", "run.yaml:1: stage.friction.model is missing"),
        (
            "stage: {mass: 1, friction: 3}",
            "run.yaml:1: stage.friction is 3; it must be a list or a mapping of keys",
        ),
        (
            "stage: {mass: 1, axis: angular}",
            "run.yaml:1: stage.axis is 'angular'; allowed is 'linear' or 'rotary'",
        ),
        ("stage: 3", "run.yaml:1: stage is 3; it must be a mapping of keys"),
        ("stage: {mass: 1}\ncycles: 2.5", "run.yaml:2: cycles is 2.5; it must be a whole number"),
        ("stage: {mass: 1}\nquiet: 1", "run.yaml:2: quiet is 1; it must be true or false"),
        ("stage: {mass: 1}\nlabel: 1", "run.yaml:2: label is 1; it must be text"),
        ("stage: {mass: 1}\nlabel: a/b", "run.yaml:2: label: a label holds no slash"),
    ],
)
def test_what_is_wrong_is_said_with_line_key_value_and_what_is_allowed(text: str, says: str) -> None:
    assert refused(text).startswith(says)


def test_an_unknown_key_that_explains_a_missing_one_is_one_problem() -> None:
    assert "more" not in refused("stage: {mas: 1}")


def test_several_problems_are_one_line_in_the_files_order() -> None:
    message = refused("stage:\n  mass: -1\n  axis: skew\nrate: fast\nsensor: {noise: .inf}\nfoo: 1\n")
    assert message == (
        "run.yaml:2: stage.mass is -1; allowed is more than 0 (kg) (and 4 more: "
        "line 3 stage.axis is 'skew'; line 4 rate is 'fast'; line 5 sensor.noise is inf; ...)"
    )


def test_long_values_are_shortened() -> None:
    assert len(refused(f"stage: {{mass: {'x' * 5000}}}")) < 200


def test_dotted_names() -> None:
    assert dotted(("stage", "friction", 1, "reach")) == "stage.friction[1].reach"
    assert dotted(()) == ""
