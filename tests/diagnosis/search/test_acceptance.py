"""What is no finding, however well it fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded import STAGE, run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.acceptance import accepted, doubts, impossible

STRIBECK = {"name": "stribeck", "rise": 0.4, "velocity": 1e-3}
BY_LOAD = {"name": "load-dependent-friction", "form": "linear", "stiffening": 1.0}


@pytest.mark.parametrize(("share", "coefficient"), [(0.5, 1.05), (0.7, 0.95)])
def test_a_drive_that_gives_nothing_and_friction_that_holds_the_rest_explain_nothing(
    share: float, coefficient: float
) -> None:
    """A wide dead zone and friction as strong as its load leave an axis without mass nothing to explain."""
    recording = run(stage(effects=[STRIBECK]), there_and_back(16.0))
    balance = ForceBalance(stage(), load_data([recording]))
    base = baseline(balance)
    fitter = Fitter(balance)
    width = share * float(np.abs(recording.voltage).max())
    holds = Term.of({**BY_LOAD, "coefficient": coefficient})
    model = fitter.fit([holds, Term.of({"name": "drive-deadband", "width": width})], base)
    assert model.sse < 1e-3 * base.sse
    assert model.weightless
    null = Null(np.linspace(0.0, 0.01, 19), np.tile(model.errors, (19, 1)))
    assert not accepted(fitter, model, base, null, float(base.errors.sum()))
    assert all("mass" in doubt.why for doubt in doubts(fitter, model, null))
    assert not base.weightless
    true = fitter.fit([Term.of({**STRIBECK, "rise": 0.2})], base)
    assert true.sse < 0.05 * base.sse
    assert accepted(fitter, true, base, null, float(base.errors.sum()))


@pytest.mark.parametrize(("times", "found"), [(1.0, True), (2.5, False)])
def test_what_takes_the_place_of_believed_friction_is_no_finding(times: float, found: bool) -> None:
    """A dead zone beside which friction holds less than half of what is believed, and of that without it."""
    dead = {"name": "drive-deadband", "width": 0.6}
    recording = run(stage(effects=[dead]), there_and_back(16.0))
    friction = [{**e, "stiffness": times * e["stiffness"]} for e in STAGE["stage"]["friction"]]
    balance = ForceBalance(stage(friction=friction), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term.of(dead)], base)
    assert model.sse < 1e-3 * base.sse
    null = Null(np.linspace(0.0, 0.01, 19), np.tile(model.errors, (19, 1)))
    assert accepted(fitter, model, base, null, float(base.errors.sum())) is found


def found_in(fitter: Fitter, model: Fitted, null: Null) -> list[str]:
    """What is left of a model's effects where those in doubt are left out, the most doubtful first."""
    while model.terms:
        doubted = doubts(fitter, model, null)
        at = max(range(len(doubted)), key=lambda i: (bool(doubted[i].why), doubted[i].left))
        if not doubted[at].why:
            break
        gone = doubted[at].together or (at,)
        model = fitter.fit([t for i, t in enumerate(model.terms) if i not in gone], model)
    return [str(entry["name"]) for entry in model.entries]


def test_effects_that_are_a_bump_only_together_are_no_finding() -> None:
    """A wave, a stop and a spring, each of which the others need; not so where each is there."""
    axis, reference = stage(), there_and_back(20.0)
    terms = [
        {"name": "cogging", "amplitude": 1.0, "period": 3e-4, "phase": 0.3},
        {"name": "end-stop", "stiffness": 1e4, "position": 1e-4},
        {"name": "parallel-spring", "stiffness": 1e4, "cubic": -1e11},
    ]
    recording = run(axis, reference)
    bump = np.exp(-(((recording.position - 0.8e-4) / 4e-5) ** 2))
    pushed = {**recording.columns, "voltage": recording.voltage + bump / axis.force_constant}
    made = []
    for one in (replace(recording, columns=pushed), run(stage(effects=terms), reference)):
        balance = ForceBalance(axis, load_data([one]))
        base, fitter = baseline(balance), Fitter(balance)
        model = fitter.fit([Term.of(entry) for entry in terms], base)
        null = Null(np.linspace(0.0, 0.01, 19), np.tile(0.1 * model.errors, (19, 1)))
        made.append(found_in(fitter, model, null))
    assert made[0] == []
    assert made[1] == [entry["name"] for entry in terms]


def test_what_a_poor_form_of_one_effect_leaves_is_no_room_for_another() -> None:
    """A wave with an overtone, told as one without: an end stop makes up for some of that."""
    axis = stage()
    recording = run(axis, there_and_back(20.0))
    x, span = recording.position, float(np.ptp(recording.position))
    at = 2.0 * np.pi * x / (0.3 * span)
    pushed = {**recording.columns, "voltage": recording.voltage + 0.2 * np.sin(at) + 0.1 * np.sin(2.0 * at)}
    balance = ForceBalance(axis, load_data([replace(recording, columns=pushed)]))
    base, fitter = baseline(balance), Fitter(balance)
    wave = Term.of({"name": "cogging", "amplitude": 0.8, "period": 0.3 * span, "phase": 0.0})
    stop = Term.of({"name": "end-stop", "stiffness": 1e4, "position": float(np.quantile(x, 0.9))})
    model = fitter.fit([wave, stop], base)
    null = Null(np.linspace(0.0, 0.01, 19), np.tile(1e-3 * model.errors, (19, 1)))
    of_wave, of_stop = doubts(fitter, model, null)
    assert not of_wave.why and "is left, more than noise" in of_stop.why


def test_a_hysteresis_bent_to_a_function_of_the_position_is_none() -> None:
    """A spring that softens as an exponential: Bouc-Wen's equation without a loop has that very law."""
    axis = stage()
    recording = run(axis, there_and_back(20.0))
    length = float(np.abs(recording.position).max())
    x = recording.position / length
    noise = 0.05 * np.random.default_rng(1).standard_normal(x.size)
    force = 0.5 * np.sign(x) * -np.expm1(-3.0 * np.abs(x)) + noise
    pushed = {**recording.columns, "voltage": recording.voltage + force}
    balance = ForceBalance(axis, load_data([replace(recording, columns=pushed)]))
    base, fitter = baseline(balance), Fitter(balance)
    bent = {"name": "bouc-wen", "alpha": 6.0 / length, "beta": 30.0 / length, "gamma": 0.0, "delta": 0.1}
    model = fitter.fit([Term(bent, frozenset({"alpha", "beta"}))], base)
    assert not model.at_bound and impossible(fitter, model, base)
    spring = Term.of({"name": "parallel-spring", "stiffness": 1.0 / length, "cubic": 1e3})
    beside = fitter.fit([*model.terms, spring], model)
    assert impossible(fitter, beside, model)
    alone = fitter.fit([spring], base)
    assert not impossible(fitter, alone, base)


def test_a_hysteresis_with_a_loop_is_one() -> None:
    loop = {"name": "bouc-wen", "alpha": 6e3, "beta": 1e4, "gamma": 0.5, "delta": -0.5}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[loop]), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term(loop, frozenset({"alpha"}))], base)
    assert not impossible(fitter, model, base)
