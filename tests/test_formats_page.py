"""docs/formats.md names everything that the program reads and writes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pydantic
import pytest
import yaml

import rtcomp.physics as physics
from rtcomp.hysteresis.basis import bases
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import RunFile
from rtcomp.loop.tick import COLUMNS
from rtcomp.physics.effect import Effect
from rtcomp.stage.stage import Stage

PAGE = (Path(__file__).resolve().parent.parent / "docs" / "formats.md").read_text(encoding="utf-8")
CODE = set(re.findall(r"[\w-]+", " ".join(re.findall(r"`([^`\n]+)`", PAGE))))
"""Every word that stands in code on the page."""
EFFECTS = [effect for effect in physics.entries() if effect.__module__.startswith("rtcomp.")]


def keys(model: type[pydantic.BaseModel]) -> set[str]:
    """Return the names of all keys of `model`, with those inside."""
    found: set[str] = set()
    for name, field in model.model_fields.items():
        found.add(field.alias or name)
        waiting = [field.annotation]
        while waiting:
            annotation = waiting.pop()
            if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
                found |= keys(annotation)
            waiting += get_args(annotation)
    return found


def example(after: str) -> dict[str, object]:
    """Return the first YAML example after the heading `after`."""
    text = PAGE[PAGE.index(f"\n## {after}\n") :]
    block = re.search(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert block is not None
    data = yaml.safe_load(block[1])
    assert isinstance(data, dict)
    return data


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_every_effect_has_its_row_with_all_parameters_and_units(effect: type[Effect]) -> None:
    rows = [line for line in PAGE.splitlines() if f"| `{effect.name}` |" in line]
    assert len(rows) == 1
    assert rows[0].startswith(f"| {effect.place.name.lower()} |")
    for parameter in [*effect.parameters, *getattr(effect, "element", ())]:
        assert f"`{parameter.name}` ({parameter.unit})" in rows[0]


def test_no_row_names_an_effect_that_does_not_exist() -> None:
    table = PAGE[PAGE.index("\n### Effects\n") : PAGE.index("\n## Model files\n")]
    named = set(re.findall(r"^\| [a-z]+ \| `([a-z-]+)` \|", table, re.MULTILINE))
    assert named == {effect.name for effect in EFFECTS}


def test_every_key_of_a_run_configuration_is_there() -> None:
    assert keys(RunFile) - CODE == set()


def test_every_recorded_column_is_there() -> None:
    assert set(COLUMNS) - CODE == set()


def test_every_operator_is_there() -> None:
    assert set(bases()) - CODE == set()


def test_the_examples_are_what_they_say() -> None:
    stage = Stage.from_dict(example("Stage files"))
    assert stage.mass == 2.0
    model = HysteresisModel.from_dict(example("Model files"))
    assert model.weights.size == 3
