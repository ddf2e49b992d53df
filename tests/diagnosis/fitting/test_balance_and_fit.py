"""The balance and its fits: properties and known truths of entries, regression and noise."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import RATE, STAGE, run, stage, there_and_back

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import started
from rtcomp.diagnosis.candidates.scales import tones_of
from rtcomp.diagnosis.candidates.screening import look
from rtcomp.diagnosis.fitting.baseline import baseline, settle
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.stage_of import stage_of
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.mismatch.where import as_force
from rtcomp.diagnosis.numerics.regression import Grams
from rtcomp.diagnosis.recordings.data import MOST_ROWS, load_data
from rtcomp.errors import ConfigError
from rtcomp.physics import Effect, catalogue
from rtcomp.stage.stage import Stage
from rtcomp.trial.motion import draw_reference

FORMS = [
    (kind, form)
    for kind in catalogue.entries()
    if kind.searchable and ent.adds_force(kind) and kind.linear
    for form in (list(kind.forms) or [""])
]


@pytest.mark.parametrize(("kind", "form"), FORMS, ids=[f"{k.name} {f}".strip() for k, f in FORMS])
@given(data=st.data())
@settings(max_examples=8, deadline=None)
def test_sizes_of_a_basis_make_the_entry(kind: type[Effect], form: str, data: st.DataObject) -> None:
    entry: dict[str, Any] = {"name": kind.name, **kind.example, **({"form": form} if form else {})}
    for name in kind.linear:
        if name in entry:
            entry[name] = float(entry[name]) * data.draw(st.floats(0.1, 3.0))
    sizes = ent.sizes_of(entry)
    low, high = ent.bounds_of(entry)
    assert len(ent.basis(entry)) == sizes.size == low.size == high.size
    again = ent.composed(entry, sizes)
    for name, value in entry.items():
        if isinstance(value, float) and name != "phase":
            assert again[name] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("frequency", [3.37, 52.89, 111.13])
def test_a_tone_is_found_through_gaps(frequency: float) -> None:
    """Of a long recording windows are taken: lines are as narrow as all of it is long."""
    seconds = 1.6 * MOST_ROWS / RATE
    balance = ForceBalance(stage(), load_data([run(stage(), there_and_back(seconds))]))
    baseline(balance)
    assert len(balance.data.segments) > 1
    time = balance.plain([s.time for s in balance.data.segments])
    found = tones_of(balance, np.sin(2.0 * np.pi * frequency * time + 0.7))
    assert np.min(np.abs(found - frequency)) < 0.25 / seconds


def test_a_drive_that_gives_nothing_is_the_worst_of_models() -> None:
    """It leaves no force to explain: by the force that is left alone it would explain everything."""
    balance = ForceBalance(stage(), load_data([run(stage(), there_and_back())]))
    base, fitter = baseline(balance), Fitter(balance)
    nothing = fitter.fit([Term.of({"name": "drive-deadband", "width": 9.0})], base)
    assert nothing.sse > balance.power > base.sse
    assert np.isfinite(nothing.sse)


def test_noise_is_what_replicates_leave_but_no_more_than_white_noise() -> None:
    """Without any all of the error is above it; from some size on replicates say no more than white noise."""
    balance = ForceBalance(stage(), load_data([run(stage(viscous=30.0), there_and_back())]))
    baseline(balance)
    fitter = Fitter(balance)
    model = fitter.fit([])
    left = [fitter.above_noise(model, noise=part * float(model.errors.sum())) for part in (0.0, 1e-3, 1.0)]
    assert left[0] == pytest.approx(fitter.relative(model))
    assert left[0] > left[1] >= left[2]
    assert min(left) >= fitter.above_noise(model)


def test_a_fit_is_blind_to_reserved_rows() -> None:
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0))]))
    fitter, fitted = Fitter(balance), baseline(balance)
    rows = balance.reserved[balance.block]
    assert 0.1 < rows.mean() < 0.3
    spoilt = np.where(rows, 1e6, fitted.system.y)
    grams = Grams.of(fitted.system.columns, spoilt, balance.block, balance.blocks)
    found = grams.solve(fitter.use, fitted.prior, fitted.variance)
    assert found == pytest.approx(fitted.coefficients, rel=0.05, abs=1.0)
    assert grams.errors(found, fitter.use).sum() == pytest.approx(fitted.sse, rel=1e-3)


def test_what_was_made_of_a_recording_goes_with_it() -> None:
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(5.0))]))
    fitted = baseline(balance)
    gone = weakref.ref(balance)
    as_force(balance, fitted.residual)
    del balance, fitted
    gc.collect()
    assert gone() is None


def test_a_stage_of_a_fit_is_the_belief_where_nothing_is_missing() -> None:
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0))]))
    fitted = baseline(balance)
    found = stage_of(balance, fitted)
    assert found.mass == pytest.approx(2.0, rel=0.02)
    drive, needed = balance.both_sides(found)
    assert np.sqrt(np.mean((drive - needed) ** 2) / np.mean(drive**2)) < 0.02


def test_a_friction_of_next_to_nothing_is_kept_where_a_load_multiplies_it() -> None:
    balance = ForceBalance(stage(), load_data([run(stage(), there_and_back())]))
    base, fitter = baseline(balance), Fitter(balance)
    kept = []
    for terms in ([], [Term.of({"name": "load-dependent-friction", "coefficient": 0.3})]):
        model = fitter.fit(terms, base, steps=0)
        c = model.coefficients.copy()
        c[balance.friction] *= 1e-8
        kept.append(stage_of(balance, replace(model, coefficients=c)).friction is not None)
    assert kept == [False, True]


def test_a_fit_that_ran_away_is_no_stage() -> None:
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back())]))
    model = baseline(balance)
    with pytest.raises(ConfigError, match="ran away"):
        stage_of(balance, replace(model, coefficients=1e12 * model.coefficients))


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9))
def test_a_wave_is_no_larger_than_it_may_be(sine: float, cosine: float) -> None:
    weight = ent.composed({"name": "gravity", "amplitude": 1.0, "phase": 0.0}, np.array([sine, cosine]))
    most = ent.parameter(ent.kind_of(weight), "amplitude").high
    assert weight["amplitude"] == pytest.approx(min(np.hypot(sine, cosine), most))
    assert ent.build(weight).name == "gravity"


def test_friction_that_nobody_believes_is_found_to_the_noise() -> None:
    """A belief without friction: a dense grid of yield displacements, thinned, leaves what noise leaves."""
    truth = stage()
    thin = type(truth).from_dict({"stage": {"mass": 2.0, "force_constant": 4.0, "voltage_limit": 10.0}})
    recording = run(truth, there_and_back(20.0))
    known = ForceBalance(truth, load_data([recording]))
    open_to_all = ForceBalance(thin, load_data([recording]))
    right, found = baseline(known), baseline(open_to_all)
    whole = float(known.power), float(open_to_all.power)
    assert found.sse / whole[1] < 4.0 * right.sse / whole[0] + 1e-4
    assert found.coefficients[0] == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize("speed", [1.0e-3, 1.5e-3])
def test_a_speed_of_micro_damping_that_nobody_believes_moves_with_the_effects(speed: float) -> None:
    """One after the other, it and a fall of friction at much the same speed crawl, and end far off."""
    falls = {"name": "stribeck", "rise": 0.3, "velocity": 8e-4}
    true = stage(effects=[falls], micro_damping=2000.0, micro_damping_speed=speed)
    thin = {**STAGE, "stage": {k: STAGE["stage"][k] for k in ("mass", "force_constant", "voltage_limit")}}
    balance = ForceBalance(Stage.from_dict(thin), load_data([run(true, there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term.of({**falls, "rise": 0.1, "velocity": 3e-4})], base)
    settle(fitter, model.terms)
    model = fitter.fit(model.terms, model)
    assert balance.stage.mechanics.micro_damping_speed == pytest.approx(speed, rel=0.02)
    assert model.entries[0]["rise"] == pytest.approx(falls["rise"], rel=0.05)
    assert model.entries[0]["velocity"] == pytest.approx(falls["velocity"], rel=0.05)


def test_a_fit_stays_within_the_range_of_its_form() -> None:
    """The whole force may soften by 1 at most, the others by more; started beyond that, all are fitted."""
    soft = {"name": "non-congruent-friction", "form": "elements", "softening": 3.0}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[soft]), there_and_back())]))
    base, fitter = baseline(balance), Fitter(balance)
    made = [c for c in look(fitter, base).candidates if c.name == "non-congruent-friction"]
    for candidate in made:
        term = started(candidate, np.array([1e3]))
        most = 1.0 if term.entry["form"] == "force" else 10.0
        assert term.entry["softening"] == pytest.approx(0.9 * most)
        model = fitter.fit([term], base)
        assert model.entries[0]["softening"] <= most
        assert model.at_bound == (term.entry["form"] == "force")
        if term.entry["form"] == "elements":
            assert model.entries[0]["softening"] == pytest.approx(3.0, rel=0.02)
    assert {c.term.entry["form"] for c in made} == {"force", "elements", "branches"}


def test_a_stiff_axis_is_smoothed_less_and_a_soft_one_by_wiener() -> None:
    """What Wiener smooths away where a stiff axis sticks is three quarters of what a right model leaves."""
    friction = [(6e5, 8e-7), (6e5, 2e-6), (5e5, 4e-6), (3e5, 7e-6)]
    mechanics = {
        "mass": 4.3, "force_constant": 5.0, "voltage_limit": 10.0, "viscous": 80.0, "micro_damping": 1100.0,
        "micro_damping_speed": 1.4e-3, "friction": [{"stiffness": k, "reach": r} for k, r in friction],
    }  # fmt: skip
    controller = {"kp": 6e4, "ki": 6e5, "kd": 300.0}
    stiff = Stage.from_dict({**STAGE, "stage": mechanics, "controller": controller})
    motion = {"seconds": 20.0, "stroke": 6e-4, "reach": 9e-6, "fastest": 8.0}
    reference = draw_reference(np.random.default_rng(2), 1000.0, **motion)
    sse = {}
    for axis, recording in ((stiff, run(stiff, reference)), (stage(), run(stage(), there_and_back(20.0)))):
        balance = ForceBalance(axis, load_data([recording]))
        least = baseline(balance).sse
        balance.smooth_for(1.0)
        sse[axis.mass] = least / Fitter(balance).fit([], steps=0).sse
    assert sse[4.3] < 0.5 and sse[2.0] == pytest.approx(1.0)


def test_a_model_fits_as_well_whatever_a_poorer_one_left_before_it() -> None:
    """Far more than noise: a belief that is thirty times off would count as if it were all that is known."""
    there = [{"name": "constant-force", "force": 0.5}, {"name": "parallel-spring", "stiffness": 2e4}]
    believed = stage(micro_damping=0.0, effects=[{"name": "parallel-spring", "stiffness": 1.8e4}])
    recording = run(stage(micro_damping=0.0, viscous=240.0, effects=there), there_and_back(12.0))
    balance = ForceBalance(believed, load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    push = [Term.of({"name": "constant-force", "force": 0.1})]
    after, alone = fitter.fit(push, base), fitter.fit(push)
    assert base.sse > 100.0 * alone.sse
    assert alone.coefficients[1] == pytest.approx(240.0, rel=0.02)
    assert after.sse == pytest.approx(alone.sse, rel=0.01)
