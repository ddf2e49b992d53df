"""Other forms of an effect: what only makes up for its form is neither a candidate nor a further effect."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.candidates.screening import Screen, Screened, look
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.other_forms import errors_beside, force_of, in_any_form, overtones
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.factor import larger_by
from rtcomp.diagnosis.mismatch.where import as_white
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.free_function import rival
from rtcomp.kernels import Floats
from rtcomp.physics import build


@pytest.mark.parametrize("name", ["cogging", "torque-ripple", "position-dependent-friction"])
def test_another_form_of_a_wave_has_its_overtones_and_no_other_waves(name: str) -> None:
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0))]))
    fitter, fitted = Fitter(balance), baseline(balance)
    entry = {"name": name, "amplitude": 0.01, "period": 1e-4, "phase": 0.3}
    columns = overtones(fitter, fitted, entry)

    def left(period: float) -> float:
        other = {**entry, "period": period, "phase": 1.1}
        wave = fitter.units([other])[0] if name == "cogging" else fitter.change(fitted, other)
        rest = wave - np.linalg.lstsq(columns.T, wave, rcond=None)[0] @ columns
        return float(np.linalg.norm(rest) / np.linalg.norm(wave))

    assert left(0.5e-4) < 0.01
    assert left(1.002 * 0.5e-4) < 0.3
    assert left(2.0e-4) < 0.03
    assert left(0.77e-4) > 0.8


def test_what_only_makes_up_for_the_form_of_a_wave_is_no_candidate() -> None:
    """Three waves to one explain what a sine lacks of a triangle, but not beside any form of it."""
    entry = {"name": "cogging", "form": "triangle", "amplitude": 2.0, "period": 1e-4, "phase": 0.3}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[entry]), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term.of({**entry, "form": "sine"})], base)
    seen = look(fitter, model)
    plainly = Screen(seen.candidates, fitter).beside(model)

    def most(gains: list[Screened]) -> float:
        periods = [c.term.entry.get("period", 0.0) for c in seen.candidates]
        thirds = [abs(3.0 * period / entry["period"] - 1.0) < 0.02 for period in periods]
        return max(s.gain for s, third in zip(gains, thirds, strict=True) if third)

    assert most(plainly) > 0.05
    assert most(seen.screened) < 0.3 * most(plainly)


LAWS: list[tuple[dict[str, Any], dict[str, Any]]] = [
    (
        {"name": "friction-drift", "form": "linear", "change": 0.4, "time_constant": 20.0},
        {"form": "level", "time_constant": 6.0},
    ),
    ({"name": "stribeck", "rise": 0.3, "velocity": 2e-3}, {"form": "exponential"}),
    ({"name": "stiction-ageing", "growth": 0.3, "distance": 2e-5}, {"onset": 0.3}),
    ({"name": "non-congruent-friction", "softening": 0.5}, {"form": "elements"}),
    (
        {"name": "position-dependent-friction", "amplitude": 0.3, "period": 6e-4, "phase": 0.3},
        {"period": 4.5e-4, "phase": 1.7},
    ),
]
"""Effects, and other laws of the same."""


@pytest.mark.parametrize(("entry", "other"), LAWS)
def test_another_law_of_what_an_effect_goes_by_is_the_same_effect(
    entry: dict[str, Any], other: dict[str, Any]
) -> None:
    """The columns make up for a part of what no other numbers of the first law do."""
    recording = run(stage(effects=[entry]), there_and_back(20.0))
    balance = ForceBalance(stage(), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term.of(entry)], base)
    law, own = fitter.change(base, {**entry, **other}), fitter.change(base, entry)[None, :]

    def left(forms: Floats) -> float:
        columns = np.concatenate([forms, model.tangents, own])
        rest = law - np.linalg.lstsq(columns.T, law, rcond=None)[0] @ columns
        return float(np.linalg.norm(rest) / np.linalg.norm(law))

    forms = fitter.variants(model, 0)
    assert left(forms) < 0.9 * left(forms[:0])


@pytest.mark.parametrize(
    "entry",
    [
        {"name": "drive-delay", "delay": 2e-3},
        {"name": "asymmetric-viscous-friction", "ratio": 0.2},
        {"name": "constant-force", "force": 0.5},
    ],
)
def test_what_goes_by_nothing_of_its_own_has_one_law(entry: dict[str, Any]) -> None:
    balance = ForceBalance(stage(), load_data([run(stage(effects=[entry]), there_and_back(8.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    assert not fitter.variants(fitter.fit([Term.of(entry)], base), 0).size


@pytest.mark.parametrize("noise", [1.5e-8, 3e-10])
def test_friction_is_larger_by_as_much_as_an_effect_makes_it(noise: float) -> None:
    """Where it slides, whatever friction the stage has: here by what the level of Stribeck's curve is."""
    axis = stage().with_changes(sensor={"noise": noise, "resolution": 0.0})
    balance = ForceBalance(axis, load_data([run(axis, there_and_back(8.0))]))
    law = build({"name": "stribeck", "rise": 0.3, "velocity": 2e-3})
    (larger,), (path,) = larger_by(balance, law), balance.paths()
    fast = np.abs(path.v) > 2e-4
    expected = 0.3 * np.exp(-((path.v / 2e-3) ** 2))
    np.testing.assert_allclose(larger[fast][5:], expected[fast][5:], atol=5e-3)
    (none,) = larger_by(balance, build({"name": "creep", "fraction": 0.1, "time_constant": 1.0}))
    assert np.abs(none).max() < 1e-3


@pytest.mark.parametrize(("waves", "told"), [(0.5, False), (1.0, False), (3.0, True), (4.0, True)])
def test_another_function_of_position_is_told_from_a_spring_where_it_repeats(
    waves: float, told: bool
) -> None:
    """Within the stroke: else any form of spring may be it, as one that goes by x |x|. A constant is none."""
    believed = stage(effects=[{"name": "parallel-spring", "stiffness": 2000.0}])
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0) + 1e-4)]))
    fitter, fitted = Fitter(balance), baseline(balance)
    position = balance.plain([p.x for p in balance.paths()])
    own = as_white(balance, 2000.0 * position)
    forms = np.concatenate([fitter.other_forms(fitted, "cogging"), own[None, :]])
    low, high = float(position.min()), float(position.max())

    def left(force: np.ndarray) -> float:
        white = as_white(balance, force)
        return float(
            np.linalg.norm(white - np.linalg.lstsq(forms.T, white)[0] @ forms) / np.linalg.norm(white)
        )

    assert (left(np.sin(2.0 * np.pi * waves * position / (high - low))) > 0.2) == told
    assert left(position * np.abs(position)) < 0.03
    assert left(np.ones(position.size)) > 0.3
    assert not fitter.other_forms(fitted, "parallel-spring").size


@pytest.mark.parametrize(
    "entry", [{"name": "constant-force", "force": 3.0}, {"name": "drive-offset", "offset": 0.3}]
)
def test_a_constant_has_no_other_form(entry: dict[str, Any]) -> None:
    """Neither a found nor a believed one: bent along position it would be any spring."""
    plain, pushed = stage(), stage(effects=[entry])
    run_with = run(pushed, there_and_back(20.0))
    balance = ForceBalance(plain, load_data([run_with]))
    baseline(balance)
    fitter = Fitter(balance)
    found = fitter.fit([Term.of(entry)])
    assert found.terms[0].entry["name"] == entry["name"]
    assert not fitter.other_forms(found, "parallel-spring").size
    believed = ForceBalance(pushed, load_data([run_with]))
    assert not Fitter(believed).other_forms(baseline(believed), "parallel-spring").size


@pytest.mark.parametrize(
    ("entry", "bends"),
    [
        ({"name": "parallel-spring", "stiffness": 3000.0}, True),
        ({"name": "gravity", "amplitude": 1e4, "phase": 0.2}, False),
    ],
)
def test_a_believed_spring_may_bend_and_a_weight_may_not(entry: dict[str, Any], bends: bool) -> None:
    """A constant moment beside the believed weight of a joint is no other form of that weight."""
    believed = stage(axis="rotary", effects=[entry])
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    assert bool(fitter.other_forms(base, "").size) is bends
    held = fitter.fit([Term.of({**entry, "amplitude" if "amplitude" in entry else "stiffness": 1.0})])
    assert bool(fitter.forms_of(held, 0).size) is bends


def test_other_forms_beside_a_model_do_not_make_it_a_poorer_one() -> None:
    """What is fitted to noise predicts blocks left out worse: no further effect is better for that."""
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0))]))
    fitter, fitted = Fitter(balance), baseline(balance)
    random = np.random.default_rng(3)
    some = 100.0 * random.standard_normal((20, fitted.residual.size))
    assert np.all(errors_beside(fitter, fitted, some) == fitted.errors)
    some[0] = fitted.residual + 0.3 * np.std(fitted.residual) * random.standard_normal(fitted.residual.size)
    assert np.log(errors_beside(fitter, fitted, 100.0 * some[:1])).mean() < np.log(fitted.errors).mean() - 1.0


def test_a_force_that_goes_by_one_thing_by_an_unknown_law_is_a_rival_of_a_name() -> None:
    """A bump at one place takes a wave's name, beside which it leaves much; not so a wave."""
    axis, wave = stage(), {"name": "cogging", "amplitude": 1.0, "period": 3e-4, "phase": 0.3}
    recording = run(axis, there_and_back(20.0))
    x, found = recording.position, []
    for force in (np.exp(-(((x - 1.2e-4) / 4e-5) ** 2)), np.sin(2.0 * np.pi * x / 1.0e-4) ** 3):
        pushed = {**recording.columns, "voltage": recording.voltage + force / axis.force_constant}
        balance = ForceBalance(axis, load_data([replace(recording, columns=pushed)]))
        base, fitter = baseline(balance), Fitter(balance)
        period = 1.0e-4 if found else 3.0e-4
        model = fitter.fit([Term.of({**wave, "period": period})], base)
        errors = errors_beside(fitter, model, overtones(fitter, model, model.entries[0]))
        found.append(rival(fitter, base, errors, [(model.entries[0], force_of(fitter, model, 0))]))
    assert found == ["position", ""]


def test_what_goes_by_speed_beside_a_law_of_speed_that_no_number_bends_is_a_further_effect() -> None:
    """A damping by direction stays one where a hump over speed is missing too; a fall with speed does not."""
    damped = {"name": "asymmetric-viscous-friction", "ratio": 0.5}
    falls = {"name": "stribeck", "rise": 0.2, "velocity": 3e-4}
    believed, found = stage(viscous=400.0), []
    for entry, there, hump in ((damped, [damped], 0.3), (falls, [], 1.0)):
        recording = run(stage(viscous=400.0, effects=there), there_and_back(20.0))
        v = np.gradient(recording.position, recording.time)
        fast = float(np.quantile(np.abs(v), 0.9))
        force = hump * np.sign(v) * np.exp(-(((np.abs(v) - 0.5 * fast) / (0.1 * fast)) ** 2))
        pushed = {**recording.columns, "voltage": recording.voltage + force / believed.force_constant}
        balance = ForceBalance(believed, load_data([replace(recording, columns=pushed)]))
        base, fitter = baseline(balance), Fitter(balance)
        model = fitter.fit([Term.of(entry)], base)
        found.append(rival(fitter, base, model.errors, [(model.entries[0], force_of(fitter, model, 0))]))
    assert found == ["", "speed"]


@pytest.mark.parametrize(
    ("name", "times", "harmonics"),
    [
        ("cogging", 1.8, 0),
        ("cogging", 2.6, 2),
        ("cogging", 4.4, 4),
        ("position-dependent-friction", 1.8, 4),
    ],
)
def test_harmonics_are_of_a_wave_that_repeats_within_the_stroke(
    name: str, times: float, harmonics: int
) -> None:
    """Those of twice the period too, where that comes twice; two columns each, and one by the period.

    Friction may go by the position in any way.
    """
    axis = stage()
    balance = ForceBalance(axis, load_data([run(axis, there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    low, high = balance.data.stroke
    wave = {"name": name, "amplitude": 0.5, "period": (high - low) / times, "phase": 0.3}
    model = fitter.fit([Term(wave, frozenset())], base)
    assert overtones(fitter, model, wave).shape[0] == (2 * harmonics + 1 if harmonics else 0)


def test_a_bump_of_force_is_no_wave_of_another_form() -> None:
    """Harmonics of a wave make up for one of another form and period, and not for what comes once."""
    believed = stage()
    recording = run(believed, there_and_back(12.0))
    x = recording.position
    span = float(np.ptp(x))
    at = 2.0 * np.pi * (x - x.mean()) / (0.22 * span)
    bump = np.exp(-(((x - x.mean() + 0.15 * span) / (0.04 * span)) ** 2))
    left = []
    for force in (np.tanh(2.0 * np.sin(at)) + 0.4 * np.cos(2.0 * at), 3.0 * bump):
        pushed = {**recording.columns, "voltage": recording.voltage + force / believed.force_constant}
        balance = ForceBalance(believed, load_data([replace(recording, columns=pushed)]))
        base, fitter = baseline(balance), Fitter(balance)
        wave = {"name": "cogging", "amplitude": 1.0, "period": 0.221 * span, "phase": 0.0}
        model = fitter.fit([Term.of(wave)], base)
        rest = in_any_form(fitter, model, overtones(fitter, model, model.entries[0]))
        left.append(float(np.std(rest.residual[fitter.rows]) / np.std(base.residual[fitter.rows])))
    wave_left, bump_left = left
    assert wave_left < 0.1
    assert bump_left > 0.65
