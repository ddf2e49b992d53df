"""Recordings and runs that say too little, as a user meets them: exit status 0, and a note that says what."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import CONFIG, one_error_line, refused, rtcomp, write

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel

TRUTH = HysteresisModel(IntervalBasis(np.array([8e-6, 2e-5, 3.2e-5])), np.array([1e5, 5e4, 2e4]))
EVERYTHING = "shape: {parts: [reversible, position, output], places: 25, groups: 6}"


def recording(kind: str, rows: int = 4000) -> dict[str, np.ndarray]:
    """A recording of friction that is known, of a motion to and fro, coarsely seen, or one way only."""
    time = np.arange(rows) / 1000.0
    position = 5e-5 * np.sin(2 * np.pi * 2.0 * time)
    if kind == "one way":
        position = 1e-4 * time
    elif kind == "coarse":
        position = np.round(position / 2e-5) * 2e-5
    voltage = (TRUTH.response(position) + 8.0 * np.gradient(position, 1e-3)) / 4.0
    return {"time": time, "position": position, "voltage": voltage}


def learned(folder: Path, kind: str, rows: int = 4000, **section: str) -> dict[str, Any]:
    """Identify such a recording with lines of the section `identify` changed; return the summary."""
    text = CONFIG.replace("  map: {position: qm}\n", "")
    for new in section.values():
        key = new.split(":")[0]
        old = next((line for line in text.splitlines() if line.startswith(f"  {key}:")), None)
        text = (
            text.replace(f"{old}\n", f"  {new}\n")
            if old
            else text.replace("identify:", f"identify:\n  {new}")
        )
    (folder / "run.yaml").write_text(text)
    write(folder / "log.csv", recording(kind, rows))
    run = rtcomp("identify", "run.yaml", "log.csv", "--out", "out", "--json", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    summary = json.loads(run.stdout)
    model = HysteresisModel.load(folder / "out" / "model.yaml")
    assert (
        np.isfinite(model.weights).all()
        and np.isfinite(model.response(recording("to and fro")["position"])).all()
    )
    assert isinstance(summary, dict)
    return summary


def noted(summary: dict[str, Any], *words: str) -> None:
    assert any(all(word in note for word in words) for note in summary["notes"]), summary["notes"]


def test_an_ordinary_recording_needs_no_note(tmp_path: Path) -> None:
    assert learned(tmp_path, "to and fro")["notes"] == []


@pytest.mark.parametrize(
    "asked",
    [
        {"model": "model: auto", "beyond": "beyond: continue"},
        {"model": "model: shaped-interval", "shape": EVERYTHING, "beyond": "beyond: continue"},
    ],
    ids=["auto", "shaped-interval"],
)
def test_everything_at_once_on_too_little_data(tmp_path: Path, asked: dict[str, str]) -> None:
    drifting = "learner: {learner: rls, forgetting: 0.9995, drift: 1.0e-3}"
    summary = learned(tmp_path, "to and fro", 150, learner=drifting, **asked)
    noted(summary, "left off for want of data", "reversible", "position (", "output (", "record longer")
    model = (tmp_path / "out" / "model.yaml").read_text()
    assert "position" not in model


@pytest.mark.parametrize("model", ["interval", "self-placing", "stop", "auto"])
def test_more_intervals_than_places_at_which_it_was_seen(tmp_path: Path, model: str) -> None:
    summary = learned(tmp_path, "coarse", model=f"model: {model}", intervals="intervals: 60")
    noted(summary, "60 elements, but only 5 distinct positions", "at most 2")


@pytest.mark.parametrize("model", ["interval", "self-placing"])
def test_a_range_a_thousand_times_the_motion(tmp_path: Path, model: str) -> None:
    summary = learned(tmp_path, "to and fro", model=f"model: {model}", range="range: 0.1")
    noted(summary, "never reached", "make identify.range smaller")


@pytest.mark.parametrize("model", ["interval", "self-placing"])
def test_a_range_a_thousand_times_smaller_than_the_motion(tmp_path: Path, model: str) -> None:
    summary = learned(tmp_path, "to and fro", model=f"model: {model}", range="range: 1.0e-7")
    noted(summary, "the motion spans 0.0001, 1e+03 times identify.range", "make identify.range larger")


@pytest.mark.parametrize("model", ["interval", "self-placing", "auto"])
def test_a_recording_of_one_direction_only(tmp_path: Path, model: str) -> None:
    noted(learned(tmp_path, "one way", model=f"model: {model}"), "one way only", "move to and fro")


def test_a_recording_of_one_direction_only_has_no_loops(tmp_path: Path) -> None:
    write(tmp_path / "log.csv", recording("one way"))
    refused("inspect", "log.csv", "--out", "out", at=tmp_path, says=["the position only rises"])
    own = [word for name in ("time", "position", "voltage") for word in ("--map", f"{name}={name}")]
    one_error_line(rtcomp("paper", "log.csv", *own, "--out", "out", at=tmp_path), ["log.csv"])
    assert not (tmp_path / "out").exists()
