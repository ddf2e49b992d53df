"""Stands in for a diagnosis program: `stand_in.py HOW RECORDING --stage STAGE --out DIR`."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

how, recording, _, stage, _, out = sys.argv[1:7]
case = Path(recording).parent

ANSWER = {"verdict": "consistent", "where": [], "retuned": [], "effects": [], "not_observable": []}
COGGING = {
    "names": ["cogging"],
    "probability": 0.9,
    "parameters": {"period": {"value": 1e-4, "low": 0.9e-4, "high": 1.1e-4, "unit": "m"}},
    "share": 0.8,
}

if how == "crash":
    sys.exit("error: the stand-in ends badly")
if how == "sleep":
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    (case / "pids").write_text(f"{os.getpid()} {child.pid}")
    time.sleep(600)

# All that a diagnosis may see is its recording and its stage; no answer is anywhere below the trial.
seen = sorted(p.name for p in case.iterdir())
assert seen == ["stage.yaml", "train.csv.gz"], seen
trial = case.parent.parent
assert (trial / "commitments.json").is_file() and not (trial / "answers.json").exists()

assert not any(trial.rglob("stopped.json"))

if how == "once":  # answers the first case that it is given, and never any other
    before = (trial / "diagnoses").glob("*/diagnosis.json")
    if any(before):
        time.sleep(0.3)  # until the trial has surely taken the first one down
        (trial / "waits").touch()
        time.sleep(600)

Path(out).mkdir(parents=True)
if how == "cogging":
    ANSWER |= {"verdict": "missing-physics", "effects": [COGGING]}
text = "not a diagnosis" if how == "garbage" else json.dumps(ANSWER)
(Path(out) / "diagnosis.json").write_text(text)
shutil.copy(stage, Path(out) / "stage.yaml")
