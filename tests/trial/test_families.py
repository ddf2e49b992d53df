"""Families of axes: stable stages, readable files, beliefs that lack what is hidden."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from rtcomp.recording.reader import read
from rtcomp.stage.stage import Stage
from rtcomp.trial.draw import SHARES, Case, draw, plan
from rtcomp.trial.families import FAMILIES
from rtcomp.trial.families.heavy_screw import _trapezoid
from rtcomp.trial.files import drawn, write
from rtcomp.trial.oracle import Bare

NAMES = list(FAMILIES)
PLANS = "6b220ae66363f7e5"
GROWN = {"amplitude": 0.03815417703332373, "period": 0.0006608426162394, "phase": 2.7432743282924594}
"""Of a plant with coarser steps: what it is made from has not changed, and steps move it by 2e-4."""


@pytest.fixture(scope="module")
def cases() -> dict[str, Case]:
    return {name: drawn(name, 11) for name in NAMES}


def test_every_family_has_the_same_weight_and_every_kind() -> None:
    plans = plan(80, 5, None, NAMES)
    assert [p.name for p in plans] == [f"case{i:02d}" for i in range(80)]
    for name in NAMES:
        mine = [p for p in plans if p.family == name]
        assert len(mine) == 80 // len(NAMES)
        assert {p.kind for p in mine} == set(SHARES)
        for p in mine:
            assert not set(p.secrets) & FAMILIES[name].lacks


def test_the_micrometre_stage_is_drawn_as_before_there_were_families() -> None:
    """What `rtcomp trial --cases 300 --seed 15001` drew when README's table was made."""
    plans = plan(300, 15001)
    text = repr([(p.name, p.kind, p.secrets, p.tier, p.seed) for p in plans])
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == PLANS
    cogging = next(p for p in plans if p.secrets == ("cogging",))
    grown = draw(cogging).hidden[0]
    assert not grown.form and grown.parameters == pytest.approx(GROWN, rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_same_seed_same_case_and_it_comes_again_from_its_answer(name: str, cases: dict[str, Case]) -> None:
    case, again = cases[name], drawn(name, 11)
    assert again.answer() == case.answer()
    opened = Case.again(case.answer())
    assert np.array_equal(opened.run("unseen").position, case.run("unseen").position)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(2))
def test_stages_follow_within_their_limits(name: str, seed: int) -> None:
    case = drawn(name, seed, "clean")
    for which in ("train", "unseen"):
        run = case.run(which)
        assert np.mean(np.abs(run.voltage) > 0.999 * case.physics.voltage_limit) < 0.05
        assert np.max(np.abs(run.position)) > 30.0 * case.loop.resolution
        if case.loop.open:
            assert np.array_equal(run.voltage, run.reference)
        else:
            assert np.std(run.reference - run.truth) < 0.5 * np.std(run.reference)
            # Not swinging by itself: at rest in the end.
            assert np.ptp(run.truth[-20:]) < 0.2 * np.ptp(run.truth)


@pytest.mark.parametrize("name", NAMES)
def test_files_are_read_and_the_belief_lacks_what_is_hidden(
    name: str, cases: dict[str, Case], tmp_path: Path
) -> None:
    case = cases[name]
    write(case, tmp_path / "case")
    recording = read(tmp_path / "case" / "train.csv.gz")
    assert len(recording) == case.run("train").time.size
    assert ("reference" in recording.columns) == (not case.loop.open)
    stage = Stage.load(tmp_path / "case" / "stage.yaml")
    assert stage.rate == pytest.approx(case.loop.rate)
    listed = [entry["name"] for entry in case.believed["stage"].get("effects", [])]
    for grown in case.hidden:
        # A spring or a load that is believed may have other numbers hidden; nothing else is listed.
        assert grown.name not in set(listed) - {"parallel-spring", "gravity"}
        assert grown.changes.items() - case.bare._asdict().items()


@pytest.mark.parametrize("name", NAMES)
def test_without_what_is_hidden_the_balance_closes(name: str) -> None:
    case = drawn(name, 2, "clean")
    clean = case.run("train")
    bare = Bare.of(case.bare, case.loop, clean)
    assert bare.floor < 0.15 * bare.needed
    assert bare.beyond < 0.05 * bare.needed


def test_thin_beliefs_are_of_each_sort() -> None:
    thin = [drawn("thin-belief", seed, "clean").believed["stage"] for seed in range(8)]
    frictions = [len(stage.get("friction", [])) for stage in thin]
    assert 0 in frictions and 18 in frictions and any(0 < n < 5 for n in frictions)
    least = next(stage for stage in thin if "friction" not in stage)
    assert set(least) == {"mass", "force_constant", "voltage_limit"}


def test_a_joint_that_is_balanced_hides_the_moment_of_a_weight() -> None:
    case = next(c for s in range(9) if not (c := drawn("geared-joint", s, "one", ["gravity"])).bare.pendulum)
    assert case.believed["stage"]["axis"] == "rotary"
    assert "effects" not in case.believed["stage"]
    assert case.physics.pendulum == pytest.approx(case.hidden[0].parameters["amplitude"])


def test_a_trapezium_arrives_with_its_speed_and_acceleration() -> None:
    move = _trapezoid(0.1, -0.2, 0.2, 1.0, 1e-3)
    speed = np.diff(move, prepend=0.1) / 1e-3
    assert move[-1] == pytest.approx(-0.2)
    assert np.max(-speed) == pytest.approx(0.2, rel=1e-6) and np.max(np.abs(np.diff(speed))) < 1.01e-3


def test_a_stage_that_is_lost_is_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    import rtcomp.trial.draw as module

    chosen = plan(1, 4, "clean", ["heavy-screw"])[0]
    tries = []

    def lost(*arguments: object) -> object:
        tries.append(arguments)
        raise FloatingPointError("ran away")

    monkeypatch.setattr(module, "_drawn", lost)
    with pytest.raises(RuntimeError, match="no stage in 12 that stays controlled"):
        draw(chosen)
    assert len(tries) == 12


def test_strengths_are_those_that_were_drawn() -> None:
    """Of other families too: the effect is grown until it is near what was aimed at."""
    case = drawn("heavy-screw", 6, "one", ["cogging"])
    assert 0.01 < case.hidden[0].shows.beyond < 0.4
    assert not case.hidden[0].changes.keys() - case.bare._asdict().keys()
