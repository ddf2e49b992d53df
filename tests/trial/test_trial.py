"""The command `rtcomp trial` from end to end, with real processes."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from rtcomp.trial.draw import SHARES, Case, Plan, draw, plan
from rtcomp.trial.families import FAMILIES
from rtcomp.trial.hidden import EFFECTS
from rtcomp.trial.seal import verify

RTCOMP = (sys.executable, "-m", "rtcomp.cli.main")
STAND_IN = Path(__file__).with_name("stand_in.py")


def trial(
    out: Path, *more: object, how: str = "", timeout: float = 500.0
) -> subprocess.CompletedProcess[str]:
    stand_in = ("--diagnose", f"{sys.executable} {STAND_IN} {how}") if how else ()
    command = [*RTCOMP, "trial", "--out", out, "--jobs", 2, *stand_in, *more]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=timeout)


def checked(out: Path, cases: int) -> dict[str, object]:
    """What every trial must leave, whatever the diagnoses were worth."""
    answers = verify(out / "answers.json", out / "commitments.json")
    content = json.loads((out / "trial.json").read_text())
    rows = list(csv.DictReader((out / "rows.csv").open()))
    assert len(answers) == len(rows) == len(content["rows"]) == cases
    for row in rows:
        answer = answers[row["case"]]
        assert row["hidden"] == "+".join(e["name"] for e in answer["effects"])
    assert Counter(r["kind"] for r in rows).keys() == set(SHARES) or cases < len(SHARES)
    return content


@pytest.mark.slow
def test_a_case_of_each_family_is_sealed_run_opened_and_scored(tmp_path: Path) -> None:
    out, count = tmp_path / "trial", len(FAMILIES)
    run = trial(out, "--cases", count, "--seed", 3, "--keep", "--rivals", "none", how="cogging")
    assert run.returncode == 0, run.stderr
    content = checked(out, count)
    assert set(content["families"]) == set(FAMILIES) and not content["not_drawn"]  # type: ignore[call-overload]
    figures = {f["name"]: f for f in content["figures"]}  # type: ignore[attr-defined]
    assert figures["false alarm on clean"]["value"] == 1.0
    assert figures["diagnosis failed"]["value"] == 0.0
    # Replays of all are scored: with a thin belief, in open loop, on a rotary axis.
    assert figures["made worse"]["count"] == count and figures["made worse"]["value"] == 0.0
    for row in content["rows"]:  # type: ignore[attr-defined]
        # The stand-in hands the believed stage back; the oracle knows better, or as well where nothing is.
        assert row["before"] == row["after"] and row["oracle"] < 1.1 * row["before"]
    stated = {s["stated"]: s["count"] for s in content["calibration"]}  # type: ignore[attr-defined]
    assert stated["0.9 to 0.95"] == 0 and stated["0.8 to 0.9"] == count
    assert f"{count} sealed cases" in run.stdout and "NOT met" in run.stdout
    assert "By family" in run.stdout and all(name in run.stdout for name in FAMILIES)
    # A change of one answer afterwards is noticed.
    text = (out / "answers.json").read_text()
    (out / "answers.json").write_text(text.replace('"tier": "full"', '"tier": "weak"', 1))
    with pytest.raises(Exception, match="does not match its commitment"):
        verify(out / "answers.json", out / "commitments.json")


@pytest.mark.parametrize(("how", "says"), [("crash", "ends badly"), ("garbage", "not a diagnosis")])
def test_a_diagnosis_that_fails_is_scored_as_failed(how: str, says: str, tmp_path: Path) -> None:
    out = tmp_path / "trial"
    run = trial(out, "--cases", 1, "--rivals", "none", "--json", how=how)
    assert run.returncode == 0, run.stderr
    content = json.loads(run.stdout)
    assert says in content["rows"][0]["fault"] or "Expecting value" in content["rows"][0]["fault"]
    assert {f["name"]: f["value"] for f in content["figures"]}["diagnosis failed"] == 1.0
    checked(out, 1)
    assert not (out / "cases").exists()


def test_a_trial_of_clean_cases_only_scores_false_alarms_and_nothing_else(tmp_path: Path) -> None:
    run = trial(
        tmp_path / "trial", "--cases", 2, "--only", "clean", "--rivals", "none", "--json", how="cogging"
    )
    assert run.returncode == 0, run.stderr
    content = json.loads(run.stdout)
    assert content["only"] == "clean"
    assert [row["kind"] for row in content["rows"]] == ["clean", "clean"]
    figures = {f["name"]: f for f in content["figures"]}
    assert (figures["false alarm on clean"]["value"], figures["false alarm on clean"]["count"]) == (1.0, 2)
    assert figures["named first, one effect"]["count"] == figures["outside misnamed"]["count"] == 0


def test_a_kind_that_there_is_not_is_refused(tmp_path: Path) -> None:
    run = trial(tmp_path / "trial", "--only", "dirty", how="cogging")
    assert run.returncode == 2 and all(kind in run.stderr for kind in SHARES)
    assert not (tmp_path / "trial").exists()


def test_a_family_that_there_is_not_is_refused(tmp_path: Path) -> None:
    run = trial(tmp_path / "trial", "--family", "heavy-screws", how="cogging")
    assert run.returncode == 2 and "did you mean 'heavy-screw'?" in run.stderr
    assert len(run.stderr.splitlines()) == 1 and not (tmp_path / "trial").exists()


def test_a_case_that_cannot_be_drawn_costs_that_case_only(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    import rtcomp.trial.trial as module

    def brittle(chosen: Plan) -> Case:
        if chosen.name == "case1":
            raise FloatingPointError("ran away")
        return draw(chosen)

    monkeypatch.setattr(module, "draw", brittle)
    stand_in = (sys.executable, str(STAND_IN), "cogging")
    settings = module.Settings(3, 5, 2, stand_in, (*RTCOMP, "replay"), 60.0, (), "clean")
    done = module.trial(settings, tmp_path, lambda step, n, of: None)
    assert [row.case.plan.name for row in done.rows] == ["case0", "case2"]
    assert done.not_drawn == {"case1": "FloatingPointError: ran away"}
    assert any("case1: not drawn" in note for note in done.notes)
    assert done.to_json(settings)["not_drawn"] and not (tmp_path / "cases").exists()


def test_a_diagnosis_that_never_ends_is_ended(tmp_path: Path) -> None:
    out = tmp_path / "trial"
    run = trial(out, "--cases", 1, "--rivals", "none", "--timeout", 2, "--keep", how="sleep")
    assert run.returncode == 0, run.stderr
    assert "without an answer" in run.stdout
    for pid in (next(out.glob("cases/*/pids"))).read_text().split():
        stat = Path(f"/proc/{pid}/stat")
        assert not stat.exists() or stat.read_text().rsplit(")", 1)[1].split()[0] == "Z"


def ended(run: subprocess.Popen[str], number: int) -> str:
    """Send a signal; return what was said on standard error until the end that it is to bring."""
    run.send_signal(number)
    try:
        _, said = run.communicate(timeout=60.0)
    except subprocess.TimeoutExpired:
        run.kill()
        raise
    assert run.returncode == 128 + number, said
    return said


def stopped(out: Path, number: int = signal.SIGTERM) -> Path:
    """Stop a trial of three cases when the first is answered; return where it was kept."""
    stand_in = f"{sys.executable} {STAND_IN} once"
    command = [*RTCOMP, "trial", "--out", str(out), "--jobs", "1", "--cases", "3", "--seed", "5"]
    command += ["--only", "clean"]
    command += ["--rivals", "none", "--diagnose", stand_in]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as run:
        until = time.monotonic() + 200.0
        while not (out / "waits").exists() and time.monotonic() < until and run.poll() is None:
            time.sleep(0.05)
        said = ended(run, number)
    kept = out.with_name(f"{out.name}.failed")
    assert str(kept) in said
    return kept


@pytest.fixture(scope="module")
def stopped_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stopped(tmp_path_factory.mktemp("stopped") / "trial")


@pytest.mark.slow
def test_a_trial_that_was_stopped_goes_on(tmp_path: Path) -> None:
    kept = stopped(tmp_path / "trial")
    published = (kept / "commitments.json").read_text()
    assert not (kept / "answers.json").exists()
    done = list((kept / "diagnoses").glob("*/diagnosis.json"))
    assert len(done) == 1
    answer = json.loads(done[0].read_text()) | {"verdict": "unexplained"}  # what tells it from a new one
    done[0].write_text(json.dumps(answer))
    out = tmp_path / "again"
    run = trial(out, "--resume", kept, "--rivals", "none", how="cogging")
    assert run.returncode == 0, run.stderr
    content = checked(out, 3)
    assert (content["seed"], content["cases"], content["only"]) == (5, 3, "clean")
    assert {row["kind"] for row in content["rows"]} == {"clean"}  # type: ignore[attr-defined]
    assert (out / "commitments.json").read_text() == published
    verdicts = {row["case"]: row["verdict"] for row in content["rows"]}  # type: ignore[attr-defined]
    assert verdicts.pop(done[0].parent.name) == "unexplained"
    assert set(verdicts.values()) == {"missing-physics"}
    assert "gone on with" in run.stdout
    # A commitment that is another one means other answers: nothing is diagnosed against those.
    (kept / "commitments.json").write_text(published.replace(published.split('"')[-2], "0" * 64))
    run = trial(tmp_path / "other", "--resume", kept, "--rivals", "none", how="cogging")
    assert run.returncode == 2 and "does not come out as it was committed to" in run.stderr


@pytest.mark.parametrize("after", [0.0, 0.01, 0.03, 0.1, 0.3])
def test_a_trial_that_is_stopped_again_loses_nothing(
    after: float, stopped_once: Path, tmp_path: Path
) -> None:
    """From when all answers are taken over: drawing starts then, and takes about half a second."""
    kept, out = stopped_once, tmp_path / "again"
    answered = [p.parent.name for p in (kept / "diagnoses").glob("*/diagnosis.json")]
    command = [*RTCOMP, "trial", "--out", str(out), "--resume", str(kept), "--rivals", "none"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as run:
        until = time.monotonic() + 60.0
        # Fast machines stop with two of them.
        taken = [out / "diagnoses" / f"{name}.log" for name in answered]
        while not all(log.exists() for log in taken) and time.monotonic() < until:
            time.sleep(0.001)
        time.sleep(after)
        said = ended(run, signal.SIGTERM)
    again = out.with_name("again.failed")
    assert said == f"interrupted; what was written until then is kept in {again}\n"
    found = [p.parent.name for p in (again / "diagnoses").glob("*/diagnosis.json")]
    assert sorted(found) == sorted(answered)
    assert json.loads((again / "stopped.json").read_text())["salts"]


@pytest.mark.parametrize("content", [None, "{", '{"cases": 3}', '{"cases": 3, "seed": 1, "ended": 7}', "[]"])
def test_only_a_stopped_trial_goes_on(content: str | None, tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    folder.mkdir()
    if content is not None:
        (folder / "stopped.json").write_text(content)
    run = trial(tmp_path / "trial", "--resume", folder, how="cogging")
    assert run.returncode == 2 and "no trial was stopped there" in run.stderr
    assert len(run.stderr.splitlines()) == 1 and not (tmp_path / "trial").exists()


def test_same_seed_same_cases_and_a_case_comes_again_from_its_answer() -> None:
    first, second = plan(12, 7), plan(12, 7)
    assert first == second != plan(12, 8)
    case = draw(first[0])
    again = Case.again(json.loads(json.dumps(case.answer())))
    assert again == draw(first[0]) == case
    run, same = case.run("unseen"), again.run("unseen")
    assert (run.position == same.position).all() and (run.voltage == same.voltage).all()
    train = case.run("train")
    assert train.reference.size != run.reference.size or (train.reference != run.reference).any()


def test_a_large_trial_hides_every_effect_in_the_parts_promised() -> None:
    plans = plan(300, 1)
    kinds = Counter(p.kind for p in plans)
    assert all(abs(kinds[kind] / 300 - share) < 0.01 for kind, share in SHARES.items())
    assert {s for p in plans if p.kind == "one" for s in p.secrets} == {e.name for e in EFFECTS}
    assert 0.1 < sum(p.tier == "weak" for p in plans) / 300 < 0.35
    assert len({p.name for p in plans}) == 300
    for kind in SHARES:
        assert {p.kind for p in plan(20, 1, kind)} == {kind}
    assert len({p.seed for p in plan(20, 1, "clean")}) == 20


@pytest.mark.slow
@pytest.mark.parametrize("rival", ["frols", "sindy"])
def test_rivals_name_a_strong_plain_effect(rival: str, tmp_path: Path) -> None:
    pytest.importorskip({"frols": "sysidentpy", "sindy": "pysindy"}[rival])
    from rtcomp.trial.draw import Plan
    from rtcomp.trial.rival import name
    from rtcomp.trial.stagefile import write_recording
    from rtcomp.yamlfile import dump_yaml

    case = draw(Plan("case", "one", ("drive-offset",), "full", 4))
    dump_yaml(tmp_path / "stage.yaml", case.believed)
    write_recording(tmp_path / "train.csv.gz", case.run("train"), case.loop)
    names = [e["names"][0] for e in name(rival, tmp_path)["effects"]]  # type: ignore[attr-defined]
    assert "constant-force" in names
