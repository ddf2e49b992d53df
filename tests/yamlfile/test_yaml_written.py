"""YAML that is written: reads back alike, is laid out as the contract says, replaces whole files."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from example_file import EXAMPLE
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError, RtcompError
from rtcomp.yamlfile import dump_yaml, parse_yaml, write_text

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
