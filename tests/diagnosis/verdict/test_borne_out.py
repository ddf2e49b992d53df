"""A name stands only where the stage that has it does what the fit says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import recorded
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.confidence import Alternatives
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.verdict.answer import answer, seen_by
from rtcomp.diagnosis.verdict.validation import Reserved
from rtcomp.stage.stage import Stage


@pytest.mark.parametrize(("times", "named"), [(1.0, True), (4.0, False)])
def test_a_stage_that_leaves_more_with_an_effect_names_none(times: float, named: bool) -> None:
    """Its mass is not that of the fit, as if the stage could not have it."""
    believed, wave = stage(), {"name": "cogging", "amplitude": 0.5, "period": 1e-4, "phase": 0.3}
    balance = ForceBalance(believed, load_data([run(stage(effects=[wave]), there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term.of(wave)], base)
    other = model.coefficients.copy()
    other[0] *= times
    chosen = replace(model, coefficients=other)
    null = Null(np.linspace(0.0, 0.01, 6), np.tile(model.errors, (6, 1)) * np.linspace(0.9, 1.1, 6)[:, None])
    sets = [Alternatives(chosen.terms[0], ("cogging",), 1.0, 0.9, (chosen,))]
    done = answer(believed, fitter, Search(base, chosen, null), sets, Reserved(balance), 0, math.inf)
    assert (done.verdict == "missing-physics") == named
    assert (done.verdict == "unexplained") != named
    assert any("a stage with it leaves more" in note for note in done.notes) != named
    assert done.fit.after <= done.fit.retuned


def test_a_stage_is_judged_by_forces_above_the_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coarse encoder bends the mass of the belief alone, which then makes less of its noise."""
    monkeypatch.setattr(recorded, "RATE", 250.0)
    wave = {"name": "sensor-periodic-error", "amplitude": 8e-3, "period": 0.104, "phase": 0.0}

    def joint(*effects: dict[str, object]) -> Stage:
        own = {
            "axis": "rotary",
            "mass": 0.012,
            "force_constant": 0.24,
            "voltage_limit": 12.0,
            "viscous": 0.025,
        }
        friction = [{"stiffness": 20.0, "reach": 2e-3}, {"stiffness": 15.0, "reach": 8e-3}]
        return Stage.from_dict(
            {
                "stage": {**own, "friction": friction, "effects": list(effects)},
                "sensor": {"noise": 1.5e-4, "resolution": 1.5e-3},
                "controller": {"kp": 15.0, "ki": 70.0, "kd": 1.1},
                "rate": 250.0,
            }
        )

    t = np.arange(10_000) / 250.0
    reference = (1.0 - np.exp(-t)) * (0.5 * np.sin(2 * np.pi * 0.31 * t) + 0.2 * np.sin(2 * np.pi * 0.83 * t))
    balance = ForceBalance(joint(), load_data([run(joint(wave), reference)]))
    base, fitter = baseline(balance), Fitter(balance)
    stages = [fitter.stage(model) for model in (base, fitter.fit([Term.of(wave)], base))]
    assert stages[0].mass < 0.5 * stages[1].mass
    plain = [float(np.std(fitter.left_by(one))) for one in stages]
    seen = [float(np.std(left)) for left in seen_by(fitter, *stages)]
    assert seen[1] / seen[0] < 0.9 * plain[1] / plain[0]
