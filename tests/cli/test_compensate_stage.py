"""`rtcomp compensate --stage`: a stage's whole chain fed forward; and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import CONFIG, refused, rtcomp

from rtcomp.stage.stage import Stage


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "config.yaml").write_text(CONFIG)
    Stage.load(tmp_path / "config.yaml").save(tmp_path / "stage.yaml")
    return tmp_path


def test_the_stage_that_is_there_is_followed(folder: Path) -> None:
    run = rtcomp("compensate", "config.yaml", "--stage", "stage.yaml", "--out", "out", "--json", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    assert json.loads(run.stdout)["improvement"] > 20
    left = {path.name for path in (folder / "out").iterdir()}
    assert {"without.h5", "with.h5", "stage.yaml", "summary.json", "report.html"} <= left
    assert "model.yaml" not in left
    assert Stage.load(folder / "out" / "stage.yaml").to_dict() == Stage.load(folder / "stage.yaml").to_dict()


def test_a_configuration_will_do_as_the_stage_and_identify_need_not_be_there(folder: Path) -> None:
    text = (folder / "config.yaml").read_text()
    begin, end = text.index("identify:"), text.index("judge:")
    (folder / "plain.yaml").write_text(text[:begin] + text[end:])
    run = rtcomp("compensate", "plain.yaml", "--stage", "config.yaml", "--out", "out", "--json", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    assert json.loads(run.stdout)["improvement"] > 20


def test_bad_combinations_are_refused(folder: Path) -> None:
    (folder / "rotary.yaml").write_text(CONFIG.replace("  mass:", "  axis: rotary\n  mass:"))
    (folder / "learning.yaml").write_text(CONFIG.replace("  settle: 0.5", "  settle: 0.5\n  learn: true"))
    refused("compensate", "config.yaml", "--stage", "rotary.yaml", at=folder, says=["rotary", "linear"])
    refused("compensate", "learning.yaml", "--stage", "stage.yaml", at=folder, says=["learn"])
    refused("compensate", "config.yaml", "--stage", "missing.yaml", at=folder, says=["missing.yaml"])
    refused(
        "compensate", "config.yaml", "--stage", "stage.yaml", "--model", "m.yaml", at=folder,
        says=["--model", "--stage"],
    )  # fmt: skip
