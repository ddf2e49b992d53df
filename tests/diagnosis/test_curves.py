"""The curve that is drawn of a named effect is that of the effect, over the force that was recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.base import Fitted, fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.curves import Curve, curves, left_over
from rtcomp.diagnosis.motion import Motion, prepare
from rtcomp.diagnosis.result import Place

COGGING = {"name": "cogging", "amplitude": 0.4, "period": 1e-4, "phase": 0.5}
DEADBAND = {"name": "drive-deadband", "width": 0.2}
UNEVEN = {"name": "position-dependent-friction", "amplitude": 0.3, "period": 2e-4, "phase": 0.0}


def fitted(entries: list[dict[str, Any]]) -> tuple[Motion, Fitted]:
    recording = run(stage(effects=entries), there_and_back(8.0))
    motion = prepare(stage(), [recording])
    return motion, fit_base(stage(), motion, [effect_of(e) for e in entries])


def drawn(entries: list[dict[str, Any]]) -> list[Curve]:
    found = curves(*fitted(entries), entries, "linear")
    return [c for c in found if c is not None]


def test_cogging_is_drawn_along_position_over_its_data() -> None:
    (curve,) = drawn([COGGING])
    assert (curve.axis, curve.unit) == ("position", "m")
    expected = -0.4 * np.sin(2 * np.pi * curve.x / 1e-4 + 0.5)
    sign = np.sign(np.corrcoef(curve.curve, expected)[0, 1])
    assert sign * curve.curve == pytest.approx(expected, abs=0.06)
    assert np.std(curve.data - curve.curve) < 0.1 * np.std(curve.curve)
    assert np.ptp(curve.x) <= 8e-4


def test_each_of_two_is_drawn_without_the_other() -> None:
    first, second = drawn([COGGING, DEADBAND])
    assert np.std(first.data - first.curve) < 0.15 * np.std(first.curve)
    assert np.std(second.data - second.curve) < 0.15 * np.std(second.curve)
    assert np.abs(second.curve).max() == pytest.approx(0.2 * 4.0, rel=0.3)


def test_what_changes_sign_with_the_motion_is_drawn_so() -> None:
    (curve,) = drawn([UNEVEN])
    assert curve.axis == "position" and curve.signed
    wave = np.sin(2 * np.pi * curve.x / 2e-4)
    assert abs(np.corrcoef(curve.curve, wave)[0, 1]) > 0.8


def test_friction_that_drifts_is_drawn_along_time_with_the_sign_of_the_motion() -> None:
    (curve,) = drawn([{"name": "friction-drift", "change": 0.3, "time_constant": 3.0}])
    assert (curve.axis, curve.unit, curve.signed) == ("time", "s", True)
    grown = -np.expm1(-curve.x / 3.0)
    assert abs(np.corrcoef(curve.curve, grown)[0, 1]) > 0.5
    assert np.std(curve.data - curve.curve) < 0.1 * np.std(curve.curve)


def test_an_effect_that_does_nothing_has_no_curve() -> None:
    motion, base = fitted([COGGING])
    nothing = {**COGGING, "amplitude": 0.0}
    assert curves(motion, base, [COGGING, nothing], "linear")[1] is None


def test_what_no_entry_explains_is_drawn_along_its_strongest_place() -> None:
    x = np.linspace(-1.0, 1.0, 24)
    tone = Place("frequency", "Hz", (1.0, 2.0), 0.9, 0.005, "", x, x)
    bump = Place("position", "m", (-1.0, 1.0), 0.5, 0.005, "", x, np.exp(-10 * x**2))
    curve = left_over([tone, bump])
    assert curve is not None and curve.axis == "position"
    assert curve.curve == pytest.approx(curve.data, abs=0.06)
    assert left_over([tone]) is None and left_over([]) is None
