"""The benchmark of the closed circle runs and meets its target, in virtual time."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_circle_closes_for_all_four(tmp_path):
    target = tmp_path / "circle.json"
    command = [sys.executable, "tools/bench_circle.py", "--virtual", "--json", str(target)]
    done = subprocess.run(command, cwd=TOP, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    result = json.loads(target.read_text())
    assert len(result["circles"]) == 4
    assert [f["name"] for f in result["figures"] if f["met"] is False] == []
    for circle in result["circles"]:
        assert circle["hidden"]["name"] in {name for names in circle["named"] for name in names}
