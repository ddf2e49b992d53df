"""A small trial of the program itself, in a file of its own: tests of one file run one after the other."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rtcomp.trial.seal import verify

RTCOMP = (sys.executable, "-m", "rtcomp.cli.main")


@pytest.mark.slow
def test_a_small_trial_over_all_families(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its seal holds, its scores are shown, and clean cases get no name.

    The budget is one that a busy machine does not use up: the answers do not depend on its load.
    """
    out = tmp_path / "trial"
    patient = f"{sys.executable} -m rtcomp diagnose --budget 200"
    more = ("--jobs", "2", "--cases", "8", "--seed", "11", "--diagnose", patient)
    command = [*RTCOMP, "trial", "--out", str(out), *more]
    run = subprocess.run(command, capture_output=True, text=True, timeout=3000.0)
    with capsys.disabled():
        print(f"\n{run.stdout}{run.stderr}")
    assert run.returncode == 0
    content = json.loads((out / "trial.json").read_text())
    assert len(verify(out / "answers.json", out / "commitments.json")) == len(content["rows"]) == 8
    figures = {f["name"]: f for f in content["figures"]}
    assert figures["right, all cases"]["count"] == 8
    assert figures["diagnosis failed"]["value"] == 0.0
    assert figures["made worse"]["count"] == 8 and figures["made worse"]["value"] <= 1 / 8
    assert figures["false alarm on clean"]["value"] == 0.0
    assert figures["right, all cases"]["value"] >= 0.85
