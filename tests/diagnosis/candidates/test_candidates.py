"""Candidates: which effects are looked at, and what stands in another's place."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from recorded import RATE, run, stage, there_and_back

from rtcomp.diagnosis.candidates.effects import candidates, started
from rtcomp.diagnosis.candidates.scales import Scales
from rtcomp.diagnosis.candidates.screening import look
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.confidence import explains_another
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

WAVE = {"name": "cogging", "amplitude": 0.4, "period": 1.3e-4, "phase": 0.4}
TONE = {"name": "tonal-disturbance", "amplitude": 0.4, "frequency": 23.0, "phase": 0.0}


def fitter_of(reference: Floats, *effects: dict[str, object], run_in: int = 0) -> Fitter:
    """A fitter on a recording of an axis with these effects, of which the belief has none."""
    data = load_data([run(stage(effects=list(effects)), reference)])
    balance = ForceBalance(stage(), replace(data, segments=(replace(data.segments[0], run_in=run_in),)))
    baseline(balance)
    return Fitter(balance)


def test_an_effect_that_changes_nothing_where_it_is_tried_first_is_tried_elsewhere() -> None:
    """A stop is tried from the lowest position on, where the axis is only in the run-in."""
    reference = there_and_back(12.0)
    moment = np.arange(reference.size) / RATE
    low_once = 2e-3 * np.sin(np.pi * np.clip(moment / 0.8, 0.0, 1.0)) ** 2
    fitter = fitter_of(reference - low_once, run_in=1000)
    low, _ = fitter.balance.data.stroke
    places = fitter.balance.plain([s.position for s in fitter.balance.data.segments])
    assert places.min() > 0.5 * low
    assert "end-stop" in {c.name for c in candidates(fitter, fitter.fit([]))}


def test_what_rounding_alone_makes_is_no_candidate() -> None:
    """Damping of nothing differs by no direction. It may later: what was looked at is not looked at again."""
    slow = stage(viscous=0.0, effects=[{"name": "drive-delay", "delay": 2e-3}])
    balance = ForceBalance(slow, load_data([run(stage(), there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    assert base.coefficients[1] == 0.0
    found = candidates(fitter, base)
    assert "asymmetric-viscous-friction" not in {c.name for c in found}


def test_what_is_tried_as_it_is_leaves_what_all_of_it_leaves() -> None:
    """A part of a far delay leaves less than all of it, and a fit that begins there goes elsewhere."""
    recording = run(stage(effects=[{"name": "drive-delay", "delay": 4e-3}]), there_and_back(12.0))
    balance = ForceBalance(stage(), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    seen = look(fitter, base)
    model, rows = seen.screen.columns_beside(base)[:, fitter.rows].T, fitter.rows
    whole = [
        (c, s) for c, s in zip(seen.candidates, seen.screened, strict=True) if c.parts == (c.term.entry,)
    ]
    assert {c.name for c, _ in whole} >= {"drive-delay", "drive-deadband"}
    for candidate, screened in whole:
        rest = base.residual[rows] - candidate.columns[0, rows]
        left = rest - model @ np.linalg.lstsq(model, rest, rcond=1e-10)[0]
        assert screened.left == pytest.approx(float(left @ left), rel=0.2)


def test_voltages_are_tried_between_what_is_usual_and_what_is_commanded_once() -> None:
    recording = run(stage(), there_and_back(12.0))
    volts = recording.voltage.copy()
    volts[7000:7150] = 9.0
    shocked = replace(recording, columns={**recording.columns, "voltage": volts})
    balance = ForceBalance(stage(), load_data([shocked]))
    baseline(balance)
    tried = Scales.of(Fitter(balance), Fitter(balance).fit([])).volts
    usual = float(np.quantile(np.abs(volts), 0.95))
    assert tried[-1] == 9.0 > 4.0 * usual
    assert np.all(np.diff(np.log(tried)) <= np.log(2.0) + 1e-9)


@pytest.fixture(scope="module")
def shaken() -> Fitter:
    """A recording in which a wave of the position and a tone act."""
    return fitter_of(there_and_back(12.0), WAVE, TONE)


@pytest.mark.parametrize(
    ("chosen", "other", "apart"),
    [
        (WAVE, TONE, True),
        (TONE, WAVE, True),
        (WAVE, {**WAVE, "period": 1.31e-4}, False),
        ({"name": "drive-delay", "delay": 1e-3}, {"name": "sensor-delay", "delay": 1e-3}, False),
    ],
)
def test_a_rival_of_an_effect_explains_the_same(
    shaken: Fitter, chosen: dict[str, object], other: dict[str, object], apart: bool
) -> None:
    """Two that gain as much together as one after the other are no rivals."""
    rest = shaken.fit([])
    models = [shaken.fit([Term.of(e)], rest) for e in (chosen, other)]
    assert explains_another(shaken, models[0], rest, models[1], math.inf) is apart


def test_waves_are_looked_for_in_what_the_fit_leaves_of_all_blocks_but_the_reserved() -> None:
    """On an air bearing what is slow counts ten thousandfold: cut out as a force, it would ring."""

    def air(*effects: dict[str, object]) -> Stage:
        own = {"mass": 8.0, "force_constant": 40.0, "viscous": 5.0, "voltage_limit": 10.0}
        return Stage.from_dict(
            {
                "stage": {**own, "effects": list(effects)},
                "sensor": {"noise": 3e-9, "resolution": 5e-9},
                "controller": {"kp": 1.9e4, "ki": 9.7e5, "kd": 88.0},
                "rate": RATE,
            }
        )

    t = np.arange(20_000) / RATE
    reference = 2e-2 * (1.0 - np.exp(-t)) * (np.sin(2 * np.pi * 0.7 * t) + 0.5 * np.sin(2 * np.pi * 1.9 * t))
    balance = ForceBalance(air(), load_data([run(air({**TONE, "frequency": 7.3}), reference)]))
    base, fitter = baseline(balance), Fitter(balance)
    np.testing.assert_array_equal(Scales.of(fitter, base).residual[1], base.residual * fitter.rows)


def test_a_fit_begins_near_a_scale_though_its_neutral_value_is_one() -> None:
    """A weight repeats with the turn: its law tells the unit of the angle, which all other numbers follow."""
    weight = {"name": "gravity", "amplitude": 8.0, "phase": 0.3}
    axis = {"axis": "rotary", "mass": 0.3, "viscous": 0.1, "micro_damping": 0.0}
    hidden = stage(**axis, effects=[weight, {"name": "sensor-scale", "scale": 1.06}])
    data = load_data([run(hidden, 1000.0 * there_and_back(12.0))])
    balance = ForceBalance(stage(**axis, effects=[weight]), data)
    base, fitter = baseline(balance), Fitter(balance)
    seen = look(fitter, base)
    begun = {c.name: started(c, s.sizes).entry for c, s in zip(seen.candidates, seen.screened, strict=True)}
    assert begun["sensor-scale"]["scale"] == pytest.approx(1.06, abs=0.02)
