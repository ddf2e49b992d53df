"""YAML that is read, where its keys stand, and what cannot be read."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from example_file import EXAMPLE
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.yamlfile import load_yaml, parse_yaml


def not_read(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_yaml(text, "run.yaml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


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
