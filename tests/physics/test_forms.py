"""The forms of the catalogue's effects give what their equations say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtcomp import physics
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.rows import motion_rows, new_rows, over_rows
from rtcomp.physics.waves import triangle
from rtcomp.physics.wires import (
    FRICTION,
    GAIN,
    GRIP,
    POSITION,
    PUSH,
    REACH,
    SCALE,
    TIME,
    VELOCITY,
)  # fmt: skip


def one(wire: int, text: dict[str, object], **wires: float) -> float:
    """What one row of an effect leaves on a wire."""
    places = {"time": TIME, "x": POSITION, "v": VELOCITY}
    row = new_rows(1)
    for key, value in wires.items():
        row[0, places[key]] = value
    return float(over_rows([physics.build(text)], row)[0, wire])


def test_a_triangle_has_the_zeros_and_peaks_of_the_sine_and_lines_between() -> None:
    angles = 0.5 * math.pi * np.arange(-8, 9)
    np.testing.assert_allclose([triangle(a) for a in angles], np.sin(angles), atol=1e-12)
    assert triangle(0.25 * math.pi) == pytest.approx(0.5)
    assert triangle(0.8 * math.pi) == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("name", "wire", "whole"),
    [("cogging", PUSH, 0.0), ("torque-ripple", GAIN, 1.0), ("position-dependent-friction", REACH, 1.0)],
)
def test_what_varies_along_the_stroke_may_be_a_triangle(name: str, wire: int, whole: float) -> None:
    text = {"name": name, "form": "triangle", "amplitude": 0.4, "period": 8.0, "phase": 0.25 * math.pi}
    assert one(wire, text, x=0.0) == pytest.approx(whole + 0.2)
    assert one(wire, text, x=1.0) == pytest.approx(whole + 0.4)
    assert one(wire, text, x=3.5) == pytest.approx(whole - 0.1)


def test_harmonics_of_a_triangular_cogging_are_sines() -> None:
    harmonics = [{"order": 2.0, "amplitude": 0.3, "phase": 0.1}]
    text = {"name": "cogging", "form": "triangle", "amplitude": 0.4, "period": 8.0, "harmonics": harmonics}
    assert one(PUSH, text, x=0.5) == pytest.approx(0.4 * 0.25 + 0.3 * math.sin(0.25 * math.pi + 0.1))


@pytest.mark.parametrize(("form", "exponent"), [("gaussian", 2.0), ("exponential", 1.0), ("root", 0.5)])
def test_stribeck_falls_with_its_exponent(form: str, exponent: float) -> None:
    text = {"name": "stribeck", "form": form, "rise": 0.5, "velocity": 2e-3}
    for v in (0.0, 1e-3, -2e-3, 9e-3):
        assert one(REACH, text, v=v) == pytest.approx(1.0 + 0.5 * math.exp(-((abs(v) / 2e-3) ** exponent)))


def test_friction_drifts_as_a_whole_or_in_its_level() -> None:
    text = {"name": "friction-drift", "change": 0.4, "time_constant": 2.0}
    grown = 1.0 + 0.4 * -math.expm1(-0.5)
    for form, wire, still, expected in (
        ("force", SCALE, REACH, grown), ("level", REACH, SCALE, grown), ("linear", REACH, SCALE, 1.2),
        ("late", REACH, SCALE, 1.05), ("back", REACH, SCALE, 1.4),
    ):  # fmt: skip
        entry = {**text, "form": form}
        assert one(wire, entry, time=1.0) == pytest.approx(expected)
        assert one(still, entry, time=1.0) == 1.0
    for form, end in (("linear", 1.4), ("late", 1.4), ("back", 1.0)):
        assert one(REACH, {**text, "form": form}, time=50.0) == pytest.approx(end)
    for form, time in (("level", 1e3), ("linear", 1e3), ("late", 1e3), ("back", 1.0)):
        assert one(REACH, {**text, "form": form, "change": -1.0}, time=time) > 0.0


def presliding() -> np.ndarray:
    t = np.linspace(0.0, 1.0, 4001)[1:]
    return motion_rows(1e-5 * t * np.sin(2 * np.pi * 3 * t) + 2e-6 * np.sin(2 * np.pi * 31 * t), 1e-3)


def test_elements_soften_each_by_its_deflection_over_its_reach() -> None:
    elements = [(8e5, 2e-6), (4e5, 7e-6)]
    soft = physics.build({"name": "non-congruent-friction", "form": "elements", "softening": 0.3})
    bent = over_rows([soft, MaxwellSlip(elements)], presliding())[:, FRICTION]
    expected = np.zeros_like(bent)
    for k, r in elements:
        z = over_rows([MaxwellSlip([(1.0, r)])], presliding())[:, FRICTION]
        expected += k * z * (1.0 + 0.3 * (1.0 - np.abs(z) / r))
    np.testing.assert_allclose(bent, expected, rtol=1e-12, atol=1e-12)


MODELS = ("maxwell-slip", "dahl", "lugre", "gms", "leuven", "modified-leuven")


@pytest.mark.parametrize("name", MODELS)
def test_elements_of_every_model_soften(name: str) -> None:
    """Of a model with one element as its whole force does."""
    entry = physics.entry(name)
    model = {"name": name, **entry.example}
    if name in ("leuven", "modified-leuven"):
        model["damping"] = 0.0
    plain = {"name": "non-congruent-friction", "softening": 0.3}
    soft = {**plain, "form": "elements"}

    def grips(*texts: dict[str, object]) -> np.ndarray:
        chain = sorted((physics.build(t) for t in texts), key=lambda e: e.order)
        return over_rows(chain, presliding())

    without, with_it = grips(model), grips(model, soft)
    assert np.max(np.abs(with_it[:, GRIP] - without[:, GRIP])) > 0.03 * np.max(np.abs(without[:, GRIP]))
    if name == "dahl":
        summed = grips(model, plain)[:, GRIP]
        np.testing.assert_allclose(with_it[:, GRIP], summed, atol=1e-9 * np.max(np.abs(summed)))


def test_forms_of_non_congruent_friction_run_where_they_can() -> None:
    text = {"name": "non-congruent-friction", "softening": 0.3}
    whole, elements = physics.build(text), physics.build({**text, "form": "elements"})
    assert whole.order > MaxwellSlip.order > elements.order
    assert whole.whole_friction and not elements.whole_friction
