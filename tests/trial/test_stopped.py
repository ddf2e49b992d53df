"""What is taken over from a trial that was stopped."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from rtcomp.errors import RtcompError
from rtcomp.trial.run import Outcome
from rtcomp.trial.stopped import Stopped


@pytest.mark.parametrize("lost", ["answer", "log", ""])
def test_an_answer_that_was_lost_is_asked_for_again_and_not_scored_as_failed(
    lost: str, tmp_path: Path
) -> None:
    kept, out = tmp_path / "kept", tmp_path / "out"
    for name in ("case0", "case1"):
        (kept / "diagnoses" / name).mkdir(parents=True)
        (kept / "diagnoses" / f"{name}.log").touch()
    out.mkdir()
    (kept / "commitments.json").write_text("{}")
    if lost == "answer":
        shutil.rmtree(kept / "diagnoses" / "case1")
    elif lost == "log":
        (kept / "diagnoses" / "case1.log").unlink()
    ended = {"diagnoses": {name: Outcome(name, 0, 1.0, False, "") for name in ("case0", "case1")}}
    so_far = Stopped(2, 7, ended=ended)
    so_far.bring(kept, out)
    brought = ["case0"] if lost else ["case0", "case1"]
    assert list(so_far.ended["diagnoses"]) == brought
    assert sorted(p.name for p in (out / "diagnoses").iterdir() if p.is_dir()) == brought


@pytest.mark.parametrize(
    "published",
    [None, "{", '{"commitments": {"case0": "ab"}}', '{"commitments": {"case0": "ab", "case2": "cd"}}'],
)
def test_what_was_sealed_must_be_there_whole(published: str | None, tmp_path: Path) -> None:
    salts = {"case0": "01", "case1": "02"}
    Stopped(2, 7, salts=salts).write(tmp_path)
    (tmp_path / "commitments.json").write_text(json.dumps({"commitments": dict.fromkeys(salts, "ab")}))
    assert Stopped.read(tmp_path).salts == salts
    if published is None:
        (tmp_path / "commitments.json").unlink()
    else:
        (tmp_path / "commitments.json").write_text(published)
    with pytest.raises(RtcompError, match=r"stopped\.json or commitments\.json is missing or damaged"):
        Stopped.read(tmp_path)


def test_a_trial_with_cases_that_could_not_be_drawn_goes_on(tmp_path: Path) -> None:
    stopped = Stopped(
        2, 7, salts={"case0": "01"}, families=["flexure"], forms=0.5, not_drawn={"case1": "ran away"}
    )
    stopped.write(tmp_path)
    (tmp_path / "commitments.json").write_text(json.dumps({"commitments": {"case0": "ab"}}))
    assert Stopped.read(tmp_path) == stopped


def test_a_trial_that_was_stopped_before_there_were_families_was_of_micrometre_stages(tmp_path: Path) -> None:
    (tmp_path / "stopped.json").write_text(
        json.dumps({"cases": 1, "seed": 7, "salts": {"case0": "01"}, "ended": {}})
    )
    (tmp_path / "commitments.json").write_text(json.dumps({"commitments": {"case0": "ab"}}))
    assert Stopped.read(tmp_path).families == ["micrometre"]
