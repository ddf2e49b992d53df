"""The law by which friction yields is that of the recording, whichever is believed, also beside an effect."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import RATE, STAGE, run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.law import SOLID, STOP, law_of
from rtcomp.diagnosis.fitting.retuned import level_and_reach
from rtcomp.diagnosis.fitting.stage_of import bank
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.stage import Stage

ELEMENTS = [(e["stiffness"], e["reach"]) for e in STAGE["stage"]["friction"]]


@pytest.mark.parametrize(("believed", "true"), [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.0, 2.0)])
def test_it_is_that_of_the_recording(believed: float, true: float) -> None:
    recording = run(stage(friction=bank(ELEMENTS, true)), there_and_back(8.0))
    balance = ForceBalance(stage(friction=bank(ELEMENTS, believed)), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    assert balance.exponent == pytest.approx(true, abs=0.05)
    assert fitter.relative(base, seen=True) < 0.01
    written = fitter.stage(base).friction
    assert isinstance(written, MaxwellSlip) and written.exponent == balance.exponent
    assert written.level == pytest.approx(sum(k * r for k, r in ELEMENTS), rel=0.05)


@pytest.mark.parametrize("true", [STOP, SOLID])
def test_within_a_few_counts_it_is_told_by_what_friction_forgets_unseen(true: float) -> None:
    """Both laws leave the same of the recording, but only a solid leaves as much of its own replicates."""
    solid, level, reach = bank([(1.25e7, 5.7e-6)], SOLID), 71.5, 5.7e-6
    reaches = reach * np.geomspace(0.15, 4.0, 7)
    slopes = np.diff(level * -np.expm1(-np.append(0.0, reaches) / reach)) / np.diff(np.append(0.0, reaches))
    stops = bank(list(zip((-np.diff(np.append(slopes, 0.0))).tolist(), reaches.tolist(), strict=True)), STOP)

    def screw(exponent: float) -> Stage:
        own = {"mass": 66.0, "force_constant": 115.0, "viscous": 1900.0, "voltage_limit": 10.0}
        return Stage.from_dict(
            {
                "stage": {**own, "friction": solid if exponent == SOLID else stops},
                "sensor": {"noise": 3e-8, "resolution": 1e-6},
                "controller": {"kp": 4e3, "ki": 5.5e4, "kd": 67.0},
                "rate": RATE,
            }
        )

    random, x = np.random.default_rng(1), 0.0
    moves = []
    while sum(m.size for m in moves) < 30_000:
        there, s = random.uniform(-2.5e-2, 2.5e-2), np.linspace(0.0, 1.0, int(random.uniform(600, 2500)))
        moves += [
            x + (there - x) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
            np.full(random.integers(1, 800), there),
        ]
        x = there
    balance = ForceBalance(screw(STOP), load_data([run(screw(true), np.concatenate(moves))]))
    baseline(balance)
    assert balance.exponent == true


def test_an_axis_without_friction_has_no_law_that_all_begins_anew_for() -> None:
    """On an air bearing the grid's units fit noise: each law leaves more than the other beside the drag."""
    air = {
        "stage": {"mass": 6.0, "force_constant": 50.0, "voltage_limit": 10.0, "viscous": 5.4},
        "sensor": {"noise": 3e-9, "resolution": 5e-9},
        "controller": {"kp": 1.1e4, "ki": 2e5, "kd": 48.0},
        "rate": RATE,
    }
    drag = {**air["stage"], "effects": [{"name": "quadratic-drag", "coefficient": 20.0}]}
    recording = run(Stage.from_dict({**air, "stage": drag}), 100.0 * there_and_back(12.0))
    belief = Stage.from_dict(air)
    for exponent in (STOP, SOLID):
        balance = ForceBalance(belief, load_data([recording]))
        baseline(balance)
        balance.exponent = exponent
        assert law_of(Fitter(balance), [Term.of({"name": "quadratic-drag", "coefficient": 1.0})]) == exponent
    found = diagnose(belief, [recording])
    assert [e.names for e in found.effects] == [("quadratic-drag",)]


def test_numbers_and_form_of_an_effect_that_suit_one_law_do_not_hide_another() -> None:
    """Beside stops the fall of friction with speed is one that what sticks follows, and as good."""
    fall = {"name": "stribeck", "rise": 0.5, "velocity": 4e-4}
    recording = run(stage(friction=bank(ELEMENTS, 1.0), effects=[fall]), there_and_back(12.0))
    balance = ForceBalance(stage(), load_data([recording]))
    baseline(balance)
    fitter = Fitter(balance)
    balance.exponent = 0.0
    bent = fitter.fit([Term.of({**fall, "velocity": 1e-3, "form": "exponential", "following": 1.0})])
    assert law_of(fitter, bent.terms) == 1.0


@pytest.mark.slow
def test_a_fall_of_friction_with_speed_is_named_beside_any_law() -> None:
    fall = {"name": "stribeck", "rise": 0.5, "velocity": 4e-4}
    recording = run(stage(friction=bank(ELEMENTS, 1.0), effects=[fall]), there_and_back(12.0))
    found = diagnose(stage(), [recording], budget=120.0)
    assert [e.names[0] for e in found.effects] == ["stribeck"]
    assert {r.parameter: r.after.value for r in found.retuned}["friction.exponent"] == 1.0


@pytest.mark.slow
def test_beside_an_effect_it_is_told_and_the_effect_named() -> None:
    hidden = {"name": "parallel-spring", "stiffness": 4000.0}
    recording = run(stage(friction=bank(ELEMENTS, 1.0), effects=[hidden]), there_and_back(12.0))
    found = diagnose(stage(), [recording], budget=120.0)
    assert [e.names for e in found.effects] == [("parallel-spring",)]
    told = {r.parameter: r.after.value for r in found.retuned}
    assert told["friction.exponent"] == pytest.approx(1.0, abs=0.05)
    assert found.fit.after < 0.01 < found.fit.retuned
    assert (
        isinstance(found.stage.friction, MaxwellSlip)
        and found.stage.friction.exponent == told["friction.exponent"]
    )


@pytest.mark.parametrize(("exponent", "travel"), [(0.0, 0.5), (1.0, np.log(2.0)), (2.0, 1.0)])
def test_the_travel_to_half_of_the_level_is_that_of_the_virgin_curve(exponent: float, travel: float) -> None:
    level, reach = level_and_reach([(2e5, 4e-6)], exponent=exponent)
    assert level == pytest.approx(0.8)
    assert reach == pytest.approx(travel * 4e-6, rel=1e-3)
