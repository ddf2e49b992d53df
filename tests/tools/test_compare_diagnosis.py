"""Two ways to diagnose, paired case by case."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from compare_diagnosis import compared, paired

from rtcomp.errors import RtcompError

TOP = Path(__file__).resolve().parents[2]


def row(case: str, right: int, **more: Any) -> dict[str, Any]:
    return {
        "case": case, "kind": "one", "tier": "full", "hidden": "cogging", "share": "0.1", "family": "flexure",
        "form": "", "detectable": 1, "right": right, "wrong": 0, "before": 0.1, "after": 0.05, "fault": "",
        "seconds": 1.0, **more,
    }  # fmt: skip


def test_the_exact_test_is_on_the_disagreements_only() -> None:
    """McNemar's, by hand: of 9 cases on which they differ 8 go to the new one, p = 2 (1 + 9) / 2^9."""
    old = [row(f"case{i}", int(i == 0 or i > 8)) for i in range(20)]
    new = [row(f"case{i}", int(i != 0)) for i in range(20)]
    found = paired("right", "all", list(zip(old, new, strict=True)))
    assert (found.both, found.only_old, found.only_new, found.neither) == (11, 1, 8, 0)
    assert found.p_value == pytest.approx(20 / 512)
    assert paired("right", "all", [(old[0], old[0])]).p_value == 1.0


def test_groups_are_of_kind_family_strength_and_form() -> None:
    old = [
        row("case0", 1), row("case1", 0, tier="weak"), row("case2", 1, kind="clean", hidden="", share=""),
        row("case3", 1, form="power", family="other-forms"), row("case4", 0, fault="crashed"),
    ]  # fmt: skip
    found = {(p.asked, p.group): p for p in compared(old, old[1:])}
    assert found["right", "all"].cases == 4
    assert found["right", "kind: weak"].neither == 1 and found["right", "kind: clean"].both == 1
    assert found["right", "family: other-forms"].cases == found["right", "in another form"].cases == 1
    assert found["answered", "all"].neither == 1 == found["no false name", "all"].neither


def test_trials_of_other_cases_are_not_paired() -> None:
    with pytest.raises(RtcompError, match="one seed"):
        compared([row("case0", 1)], [row("case0", 1, hidden="stribeck")])
    with pytest.raises(RtcompError, match="no case in common"):
        compared([row("case0", 1)], [row("case1", 1)])


def test_trials_that_ended_are_paired_from_their_folders(tmp_path: Path) -> None:
    for name, right in (("old", 0), ("new", 1)):
        (tmp_path / name).mkdir()
        content = {"rows": [row(f"case{i}", right) for i in range(6)]}
        (tmp_path / name / "trial.json").write_text(json.dumps(content))
    target = tmp_path / "compare.json"
    tool = [sys.executable, "tools/compare_diagnosis.py", "--json", str(target), "--trials"]
    run = subprocess.run(
        [*tool, str(tmp_path / "old"), str(tmp_path / "new")], cwd=TOP, capture_output=True, text=True,
        timeout=100, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    first = json.loads(target.read_text())["paired"][0]
    assert (first["asked"], first["group"], first["only_new"]) == ("right", "all", 6)
    assert first["p_value"] == pytest.approx(2 / 64) and "family: flexure" in run.stdout
    run = subprocess.run(
        [*tool, str(tmp_path), str(tmp_path / "new")], cwd=TOP, capture_output=True, text=True, timeout=100,
        check=False,
    )  # fmt: skip
    assert run.returncode != 0 and run.stderr.count("\n") == 1 and "trial.json" in run.stderr
