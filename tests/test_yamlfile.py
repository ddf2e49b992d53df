"""YAML files: what is read, where it stands, what is refused and in which words, and what is written."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field, field_validator

from rtcomp.errors import ConfigError, RtcompError
from rtcomp.yamlfile import Section, dotted, dump_yaml, load_yaml, parse_yaml, validate, write_text

EXAMPLE = """\
stage:
  axis: linear                  # linear (default) or rotary
  mass: 2.0                     # kg
  friction:
    - {stiffness: 3.2e5, reach: 1.5e-6}
    - stiffness: 2.2e5
      reach: 1e-6
sensor: {noise: 15.0e-9, resolution: 10.0e-9}
rate: 1000.0
"""


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


def not_read(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_yaml(text, "run.yaml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


# Reading


def test_values_and_lines_of_the_contracts_example() -> None:
    file = parse_yaml(EXAMPLE, "run.yaml")
    assert file.data == {
        "stage": {
            "axis": "linear",
            "mass": 2.0,
            "friction": [{"stiffness": 3.2e5, "reach": 1.5e-6}, {"stiffness": 2.2e5, "reach": 1e-6}],
        },
        "sensor": {"noise": 15e-9, "resolution": 10e-9},
        "rate": 1000.0,
    }
    assert file.line(("stage", "friction", 1, "reach")) == 7
    assert file.line(("stage", "friction", 0)) == 5
    assert file.line(("rate",)) == 9
    assert file.line(("stage", "viscous")) == 1  # what is absent stands at its section
    assert file.get(("stage", "friction", 1, "reach")) == 1e-6
    assert file.get(("stage", "friction", 2, "reach")) is None


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("1e-6", 1e-6),
        ("1.e-6", 1e-6),
        ("+1e3", 1e3),
        ("1_000", 1000),
        ("1_000.5", 1000.5),
        (".5", 0.5),
        ("-.5E+2", -50.0),
        ("1E6", 1e6),
        ("5.", 5.0),
        ("010", 10),
        ("0x10", 16),
        ("0o10", 8),
        ("0b11", 3),
        ("-0", 0),
        ("1e999", math.inf),
    ],
)
def test_numbers_are_what_everybody_expects(text: str, number: float) -> None:
    value = parse_yaml(f"k: {text}").data["k"]
    assert type(value) in (int, float)
    assert value == number


@pytest.mark.parametrize(
    "text", ["1:30", "2026-11-20", "1e", "e5", "1 m", "1__0", "_1", "nan", "inf", "1.2.3", "'1'"]
)
def test_what_is_no_number_stays_text(text: str) -> None:
    assert parse_yaml(f"k: {text}").data["k"] == text.strip("'")


def test_words_and_quoting() -> None:
    file = parse_yaml("a: on\nb: 'on'\non: off\nc: ~\nd:\n")
    assert file.data == {"a": True, "b": "on", "on": False, "c": None, "d": None}


def test_anchors_are_followed() -> None:
    assert parse_yaml("a: &x {k: 1}\nb: *x\n").data == {"a": {"k": 1}, "b": {"k": 1}}


@settings(max_examples=200)
@given(
    st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(["{!r}", "{:e}", "{:.17g}", "{:+.17E}"])
)
def test_every_spelling_of_a_float_is_that_float(number: float, spelling: str) -> None:
    text = spelling.format(number)
    value = parse_yaml(f"k: {text}").data["k"]
    assert isinstance(value, int | float)
    assert value == float(text)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "run.yaml:1: is empty; it must hold keys, such as 'stage:'"),
        ("# nothing\n", "run.yaml:1: is empty"),
        ("---\n", "run.yaml:1: is empty"),
        ("- 1\n", "run.yaml:1: holds a list; it must hold keys"),
        ("time,position\n1,2\n", "run.yaml:1: holds only 'time,position 1,2'"),
        ("a: 1\nb: 2\na: 3\n", "run.yaml:3: a is given twice, in lines 1 and 3; remove one"),
        ("s:\n  f:\n    - {a: 1, b: 2, a: 3}\n", "run.yaml:3: s.f[0].a is given twice, in line 3"),
        ("stage:\n\tmass: 1\n", "run.yaml:2: is not YAML: a tab stands where YAML wants spaces"),
        ("stage:\n  mass: 1\n  - 3\n", "run.yaml:3: is not YAML: "),
        ("a: [1, 2\nb: 3\n", "run.yaml:2: is not YAML: "),
        ("a: 1\n---\nb: 2\n", "run.yaml:2: is not YAML: a second document"),
        ("a: *nowhere\n", "run.yaml:1: is not YAML: found undefined alias"),
        ("a: &a [*a]\n", "run.yaml:1: is nested too deeply"),
        ("a: " + "[" * 5000, "run.yaml:1: is nested too deeply"),
        ("a: !!python/object/apply:os.getcwd []\n", "run.yaml:1: tag "),
        ("a: &x {k: 1}\nb: {<<: *x}\n", "run.yaml:2: merge keys (<<) are not supported"),
        ("? [1, 2]\n: 3\n", "run.yaml:1: a key must be a plain word"),
        ("a: 1\nb: \x07\n", "run.yaml:2: character 0x7 is not allowed"),
    ],
)
def test_text_that_cannot_be_read_is_refused_with_its_line(text: str, says: str) -> None:
    assert not_read(text).startswith(says)


def test_aliases_that_multiply_are_stopped() -> None:
    laughs = "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n"
    for i in range(1, 10):
        laughs += f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n"
    assert "more than 1000000 values" in not_read(laughs)


@pytest.mark.parametrize(
    ("raw", "says"),
    [
        (b"\x89HDF\r\n\x1a\n\x00\x00", ":1: is an HDF5 file, a recording perhaps; a YAML file is UTF-8 text"),
        (b"\x1f\x8b\x08\x00", ":1: is a gzip file"),
        (b"a: 1\nb: \xff\xfe\n", ":2: is a binary file"),
        (b"a: 1\x00", ":1: is a binary file"),
    ],
)
def test_files_that_are_no_text(tmp_path: Path, raw: bytes, says: str) -> None:
    path = tmp_path / "stage.yaml"
    path.write_bytes(raw)
    with pytest.raises(ConfigError, match=re.escape(f"{path}{says}")):
        load_yaml(path)


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: no such file$"):
        load_yaml(tmp_path / "none.yaml")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_yaml(tmp_path)


def test_a_byte_order_mark_and_dos_line_ends_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "stage.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: two\r\n")
    file = load_yaml(path)
    assert file.data == {"a": 1, "b": "two"}
    assert file.line(("b",)) == 2


# Checking


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


# Writing

PLAIN = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=8)
)
TREES = st.recursive(
    PLAIN
    | st.sampled_from(
        ["on", "1e5", "1_0", "a: b", "- x", "n", "~", "0x1", "1:30", "#", " x ", "2026-11-20", "\u2028"]
    ),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=5),
    max_leaves=25,
)


@settings(max_examples=300, deadline=None)
@given(st.dictionaries(st.text(max_size=6), TREES, min_size=1, max_size=5))
def test_what_is_written_reads_back_alike_here_and_by_pyyaml(data: dict[str, Any]) -> None:
    text = dump_yaml(None, data, {"mass": "kg"})
    assert same(parse_yaml(text).data, data)
    assert same(yaml.safe_load(text), data)
    assert list(parse_yaml(text).data) == list(data)


def same(a: Any, b: Any) -> bool:
    """Compare with types, since 1 == True == 1.0 in Python."""
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and bool(a == b)


def test_layout_is_that_of_the_contract() -> None:
    data = parse_yaml(EXAMPLE).data
    text = dump_yaml(
        None, data, {"stage.mass": "kg", "friction": "stiffness N/m, reach m", "sensor": "m rms, m"}
    )
    assert text == (
        "stage:\n"
        "  axis: linear\n"
        "  mass: 2.0                     # kg\n"
        "  friction:                     # stiffness N/m, reach m\n"
        "    - {stiffness: 320000.0, reach: 1.5e-06}\n"
        "    - {stiffness: 220000.0, reach: 1.0e-06}\n"
        "sensor: {noise: 1.5e-08, resolution: 1.0e-08}  # m rms, m\n"
        "rate: 1000.0\n"
    )


def test_a_comment_on_an_inner_key_spreads_its_mapping_over_lines() -> None:
    text = dump_yaml(None, {"sensor": {"noise": 1.5e-8, "resolution": 0.0}}, {"noise": "m rms"})
    assert text == "sensor:\n  noise: 1.5e-08                # m rms\n  resolution: 0.0\n"


def test_long_lists_are_wrapped_and_numpy_is_written_as_numbers() -> None:
    weights = np.linspace(0.0, 1.0, 200)
    text = dump_yaml(
        None, {"weights": weights, "count": np.int64(3), "one": np.float32(0.5), "path": Path("a/b")}
    )
    assert max(map(len, text.splitlines())) <= 100
    back = parse_yaml(text).data
    assert back["weights"] == list(weights)
    assert (back["count"], back["one"], back["path"]) == (3, 0.5, "a/b")


@pytest.mark.parametrize("value", [math.nan, math.inf, np.array([1.0, math.nan]), object()])
def test_what_a_file_cannot_hold_is_refused_by_name(value: Any, tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    with pytest.raises(ConfigError, match=r"^model\.weights"):
        dump_yaml(path, {"model": {"weights": value}})
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_replaced_whole_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "stage.yaml"
    path.write_text("old: 1\n")
    dump_yaml(path, {"new": 2})
    assert path.read_text() == "new: 2\n"
    assert list(tmp_path.iterdir()) == [path]
    umask = os.umask(0)
    os.umask(umask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~umask


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    with pytest.raises(RtcompError, match="cannot be written"):
        write_text(tmp_path / "no" / "such" / "stage.yaml", "a: 1\n")
    target = tmp_path / "folder"
    (target / "inside").mkdir(parents=True)
    with pytest.raises(RtcompError, match="cannot be written"):
        write_text(target, "a: 1\n")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def test_dotted_names() -> None:
    assert dotted(("stage", "friction", 1, "reach")) == "stage.friction[1].reach"
    assert dotted(()) == ""
