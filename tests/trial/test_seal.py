"""Sealed answers: nothing about them can be read from what is published, nothing in them changed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from rtcomp.trial.seal import Sealed, SealError, verify

ANSWERS = {"case0": {"effects": [{"name": "cogging", "amplitude": 0.1}]}, "case1": {"effects": []}}


def opened(folder: Path) -> tuple[Path, Path]:
    sealed = Sealed(ANSWERS)
    answers, published = folder / "answers.json", folder / "commitments.json"
    sealed.publish(published)
    assert sealed.open(answers, published) == ANSWERS
    return answers, published


def test_answers_come_back_as_they_were_sealed(tmp_path: Path) -> None:
    answers, published = opened(tmp_path)
    assert verify(answers, published) == ANSWERS


def test_anybody_can_check_a_commitment_by_its_description(tmp_path: Path) -> None:
    answers, published = opened(tmp_path)
    entry = json.loads(answers.read_text())["case0"]
    text = json.dumps(entry["answer"], sort_keys=True, separators=(",", ":"))
    digest = hashlib.sha256(bytes.fromhex(entry["salt"]) + text.encode()).hexdigest()
    assert digest == json.loads(published.read_text())["commitments"]["case0"]


@pytest.mark.parametrize("change", ["answer", "salt", "commitment", "missing", "added"])
def test_whatever_is_changed_is_noticed(change: str, tmp_path: Path) -> None:
    answers, published = opened(tmp_path)
    content, commitments = json.loads(answers.read_text()), json.loads(published.read_text())
    if change == "answer":
        content["case0"]["answer"]["effects"][0]["amplitude"] = 0.1000001
    elif change == "salt":
        content["case0"]["salt"] = "00" * 32
    elif change == "commitment":
        commitments["commitments"]["case0"] = commitments["commitments"]["case1"]
    elif change == "missing":
        del content["case1"]
    else:
        content["case2"] = content["case1"]
    answers.write_text(json.dumps(content))
    published.write_text(json.dumps(commitments))
    with pytest.raises(SealError, match="case"):
        verify(answers, published)


def test_an_answer_changed_after_sealing_does_not_change_what_is_sealed(tmp_path: Path) -> None:
    mine = {"case0": {"effects": ["cogging"]}}
    sealed = Sealed(mine)
    mine["case0"]["effects"][0] = "stribeck"
    sealed.publish(tmp_path / "c.json")
    assert sealed.open(tmp_path / "a.json", tmp_path / "c.json") == {"case0": {"effects": ["cogging"]}}


def test_equal_answers_have_different_commitments() -> None:
    same = Sealed({"a": {"effects": []}, "b": {"effects": []}}).commitments()
    assert same["a"] != same["b"]
