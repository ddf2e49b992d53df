"""The curve that is drawn of a named effect is that of the effect, over the force that was recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.mismatch.curves import Curve, left_over
from rtcomp.diagnosis.mismatch.where import curves
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.result import Place

COGGING = {"name": "cogging", "amplitude": 0.4, "period": 1e-4, "phase": 0.5}
TONE = {"name": "tonal-disturbance", "amplitude": 0.3, "frequency": 17.0, "phase": 0.4}
DEADBAND = {"name": "drive-deadband", "width": 0.2}
UNEVEN = {"name": "position-dependent-friction", "amplitude": 0.3, "period": 2e-4, "phase": 0.0}


def drawn(entries: list[dict[str, Any]], more: list[dict[str, Any]] | None = None) -> list[Curve | None]:
    """The curves of what was hidden, and of `more` that was not."""
    balance = ForceBalance(stage(), load_data([run(stage(effects=entries), there_and_back(8.0))]))
    baseline(balance)
    fitter = Fitter(balance)
    model = fitter.fit([Term(e, frozenset()) for e in [*entries, *(more or [])]], steps=0)
    without = [fitter.without(model, i) for i in range(len(model.terms))]
    return curves(balance, model.entries, fitter.force(model), without)


def test_cogging_is_drawn_along_position_over_its_data() -> None:
    (curve,) = drawn([COGGING])
    assert curve is not None
    assert (curve.axis, curve.unit) == ("position", "m")
    expected = -0.4 * np.sin(2 * np.pi * curve.x / 1e-4 + 0.5)
    sign = np.sign(np.corrcoef(curve.curve, expected)[0, 1])
    assert sign * curve.curve == pytest.approx(expected, abs=0.06)
    assert np.std(curve.data - curve.curve) < 0.1 * np.std(curve.curve)
    assert np.ptp(curve.x) <= 8e-4


def test_each_of_two_is_drawn_without_the_other() -> None:
    first, second = drawn([COGGING, DEADBAND])
    assert first is not None and second is not None
    assert np.std(first.data - first.curve) < 0.15 * np.std(first.curve)
    assert np.std(second.data - second.curve) < 0.15 * np.std(second.curve)
    assert np.abs(second.curve).max() == pytest.approx(0.2 * 4.0, rel=0.3)


def test_what_changes_sign_with_the_motion_is_drawn_so() -> None:
    (curve,) = drawn([UNEVEN])
    assert curve is not None
    assert curve.axis == "position" and curve.signed
    wave = np.sin(2 * np.pi * curve.x / 2e-4)
    assert abs(np.corrcoef(curve.curve, wave)[0, 1]) > 0.8


def test_a_tone_is_drawn_along_one_of_its_periods() -> None:
    (curve,) = drawn([TONE])
    assert curve is not None and curve.unit == "s"
    assert curve.x.min() >= 0.0 and curve.x.max() <= 1.0 / 17.0
    wave = 0.3 * np.sin(2 * np.pi * 17.0 * curve.x + 0.4)
    assert abs(np.corrcoef(curve.curve, wave)[0, 1]) > 0.99
    assert np.std(curve.data - curve.curve) < 0.15 * np.std(curve.curve)


def test_an_effect_that_does_nothing_has_no_curve() -> None:
    nothing = {"name": "sensor-jump", "time": 2.0, "size": 0.0}
    assert drawn([COGGING], [nothing])[1] is None


def test_what_no_entry_explains_is_drawn_along_its_strongest_place() -> None:
    x = np.linspace(-1.0, 1.0, 24)
    tone = Place("frequency", "Hz", (1.0, 2.0), 0.9, 0.005, "", x, x)
    bump = Place("position", "m", (-1.0, 1.0), 0.5, 0.005, "", x, np.exp(-10 * x**2))
    curve = left_over([tone, bump])
    assert curve is not None and curve.axis == "position"
    assert curve.curve == pytest.approx(curve.data, abs=0.06)
    assert left_over([tone]) is None and left_over([]) is None
