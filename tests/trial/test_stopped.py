"""What is taken over from a trial that was stopped."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

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
