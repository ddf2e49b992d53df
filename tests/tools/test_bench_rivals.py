from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_rivals_are_compared_and_the_intervals_are_better_conditioned(tmp_path):
    target = tmp_path / "rivals.json"
    command = [
        sys.executable,
        "tools/bench_rivals.py",
        "--seeds",
        "1",
        "--seconds",
        "3",
        "--json",
        str(target),
    ]
    done = subprocess.run(command, cwd=TOP, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    figures = {f["name"]: f for f in json.loads(target.read_text())["rivals"]}
    assert set(figures) == {
        "interval + RLS", "interval + LMS", "stop + gradient", "stop + RLS", "extended stop + RLS",
        "Preisach + RLS",
    }  # fmt: skip
    assert figures["interval + RLS"]["held_out_percent"] < 1.0
    assert figures["stop + gradient"]["condition_number"] > 50 * figures["interval + RLS"]["condition_number"]
    assert figures["Preisach + RLS"]["weights"] == 210
    assert all(name in done.stdout for name in figures)
