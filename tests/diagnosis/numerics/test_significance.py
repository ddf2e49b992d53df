"""The one test and what it is of: gains, what chance makes, the confidence set."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import run, stage, there_and_back

from rtcomp.diagnosis import clock
from rtcomp.diagnosis.candidates.effects import Candidate, candidates
from rtcomp.diagnosis.candidates.screening import Screen
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.significance import Null, confidence_set, log_gain, probabilities
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.acceptance import doubts
from rtcomp.diagnosis.search.confidence import above_noise
from rtcomp.diagnosis.search.replicates import gain_in_full, null_of
from rtcomp.diagnosis.search.selection import Search


def test_gains_are_those_of_refits_without_each_block() -> None:
    random = np.random.default_rng(11)
    rows, blocks = 1200, 12
    block = np.arange(rows) * blocks // rows
    model = random.standard_normal((3, rows))
    extra = random.standard_normal((4, rows))
    y = np.array([1.0, -2.0, 0.5]) @ model + 0.7 * extra[1] + random.standard_normal(rows)
    spans = [extra[:1], extra[1:2], extra[2:]]
    term = Term.of({"name": "constant-force", "force": 0.0})
    free = [Candidate(term, (), s.copy(), np.full(len(s), -np.inf), np.full(len(s), np.inf)) for s in spans]
    use = np.ones(blocks, dtype=np.bool_)
    use[4] = False
    seen = use[block]
    c = np.linalg.lstsq(model[:, seen].T, y[seen], rcond=None)[0]
    screen = Screen(free, SimpleNamespace(block=block, blocks=blocks, use=use))
    found = screen.gains(model, y - c @ model)
    explained = screen.explained(SimpleNamespace(free_columns=model, residual=y - c @ model))
    for columns, screened, taken in zip(spans, found, explained.tolist(), strict=True):
        both = np.concatenate([model, columns])
        logs = []
        for k in np.flatnonzero(use):
            rest, own = seen & (block != k), block == k
            errors = []
            for table in (model, both):
                fit = np.linalg.lstsq(table[:, rest].T, y[rest], rcond=None)[0]
                errors.append(np.sum((y[own] - fit @ table[:, own]) ** 2))
            logs.append(np.log(errors[0] / errors[1]))
        assert screened.gain == pytest.approx(np.mean(logs), abs=1e-4)
        whole = np.linalg.lstsq(both[:, seen].T, y[seen], rcond=None)[0]
        assert screened.sizes == pytest.approx(whole[3:], abs=1e-4)
        left = [np.sum((y - fit @ table)[seen] ** 2) for fit, table in ((c, model), (whole, both))]
        assert taken == pytest.approx(left[0] - left[1], rel=1e-4)


def test_a_gain_like_those_of_replicates_is_chance_and_a_larger_one_is_not() -> None:
    random = np.random.default_rng(2)
    null = Null(random.gumbel(0.02, 0.003, 19), random.normal(100.0, 3.0, (19, 10)))
    assert null.p_value(0.02) > 0.2
    assert null.p_value(0.06) < 0.001
    assert null.p_value(null.threshold(0.01)) == pytest.approx(0.01, rel=1e-3)
    assert null.p_of_error(np.full(10, 100.0)) > 0.2 and null.p_of_error(np.full(10, 120.0)) < 0.01
    assert [null.as_loud(np.full(10, each), 0.01) for each in (80.0, 100.0, 120.0)] == [False, True, False]


def test_the_largest_gain_is_that_of_a_fit() -> None:
    """A dead zone is not in proportion to its width: first order tells a part of its gain only."""
    hidden = stage(effects=[{"name": "drive-deadband", "width": 0.3}])
    balance = ForceBalance(stage(), load_data([run(hidden, there_and_back())]))
    base, fitter = baseline(balance), Fitter(balance)
    made = [c for c in candidates(fitter, base) if c.name == "drive-deadband"]
    screen = Screen(made, fitter)
    screened = screen.beside(base)
    best = max(range(len(made)), key=lambda i: screened[i].gain)
    fully = gain_in_full(fitter, base, made[best], screened[best])
    right = fitter.fit([Term.of({"name": "drive-deadband", "width": 0.3})], base)
    assert screened[best].gain < fully
    assert fully == pytest.approx(log_gain(base.errors, right.errors), rel=0.02)
    late = clock.now() - 1.0
    assert gain_in_full(fitter, base, made[best], screened[best], late) == screened[best].gain


def test_chance_makes_no_constant_force() -> None:
    """A residual that is constant but for noise: surrogates of it have the noise alone."""
    balance = ForceBalance(stage(), load_data([run(stage(), there_and_back())]))
    fitter, base = Fitter(balance), baseline(balance)
    constant = [c for c in candidates(fitter, base) if c.name == "constant-force"]
    screen = Screen(constant, fitter)
    noise = np.random.default_rng(3).standard_normal(base.residual.size)
    constantly = replace(base, residual=noise + 3.0)
    null = null_of(fitter, constantly, screen, gain=2.0, seed=0)
    assert null.gains.max() < 0.2


def test_a_replicate_that_went_another_way_in_one_block_hides_no_error_in_all_others() -> None:
    random = np.random.default_rng(5)
    errors = random.normal(100.0, 3.0, (19, 10))
    errors[np.arange(19), random.integers(0, 10, 19)] *= random.uniform(1.0, 100.0, 19)
    null = Null(np.ones(19), errors)
    assert null.p_of_error(np.full(10, 300.0)) < 0.01
    assert null.p_of_error(errors[7]) > 0.01


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_a_model_that_is_worse_in_every_block_is_not_in_the_confidence_set(seed: int) -> None:
    random = np.random.default_rng(seed)
    good = random.uniform(1.0, 2.0, 15)
    models = [good, good * random.uniform(1.3, 1.8, 15), good * np.exp(random.normal(0.0, 1e-3, 15))]
    members = confidence_set(models, 0.05)
    assert 0 in members or 2 in members
    assert 1 not in members
    weights = probabilities(models, 200.0, [1, 1, 1][: len(models)])
    assert weights.sum() == pytest.approx(1.0) and weights[1] < 0.01
    alike = probabilities([models[0], models[0]], 200.0, [1, 4])
    assert alike[0] / alike[1] == pytest.approx(np.exp(3.0))
    assert log_gain(models[1], models[0]) > 0.0


@pytest.mark.parametrize(("bump", "doubted"), [(0.0, False), (1.5, True), (2.0, True)])
def test_an_effect_is_doubted_where_much_is_left_beside_it(bump: float, doubted: bool) -> None:
    wave = {"name": "cogging", "amplitude": 0.2, "period": 3e-4, "phase": 0.4}
    knots = [-1e-3, 1e-4, 1.3e-4, 1.6e-4, 1e-3]
    body = {"name": "position-force", "knots": knots, "values": [0.0, 0.0, bump, 0.0, 0.0]}
    truth = stage(effects=[wave, body] if bump else [wave])
    balance = ForceBalance(stage(), load_data([run(truth, there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    chosen = fitter.fit([Term.of(wave)], base)
    noise = Null(np.ones(19), np.ones_like(chosen.errors) * np.linspace(0.9, 1.1, 19)[:, None])
    assert bool(doubts(fitter, chosen, noise)[0].why) == doubted


def test_no_effect_is_doubted_for_what_makes_the_form_of_another_one() -> None:
    wave = {"name": "cogging", "amplitude": 0.2, "period": 3e-4, "phase": 0.4}
    second = {"name": "cogging", "amplitude": 0.15, "period": 1.5e-4, "phase": 1.4}
    spring = {"name": "parallel-spring", "stiffness": 800.0}
    truth = stage(effects=[wave, second, spring])
    balance = ForceBalance(stage(), load_data([run(truth, there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    chosen = fitter.fit([Term.of(wave), Term.of(spring)], base)
    noise = Null(np.ones(19), np.ones_like(chosen.errors) * np.linspace(0.9, 1.1, 19)[:, None])
    assert [doubt.why for doubt in doubts(fitter, chosen, noise)] == ["", ""]


@pytest.mark.parametrize(("first", "others"), [(3e-4, 1.5e-4), (1.5e-4, 3e-4)])
def test_a_wave_is_not_doubted_for_what_makes_its_form_another(first: float, others: float) -> None:
    wave = {"name": "cogging", "amplitude": 0.2, "period": first, "phase": 0.4}
    second = {"name": "cogging", "amplitude": 0.15, "period": others, "phase": 1.4}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[wave, second]), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    chosen = fitter.fit([Term.of(wave)], base)
    noise = Null(np.ones(19), np.ones_like(chosen.errors) * np.linspace(0.9, 1.1, 19)[:, None])
    assert doubts(fitter, chosen, noise)[0].left < 0.05
    assert fitter.above_noise(chosen) > 0.3 * fitter.above_noise(base)


def test_rivals_are_compared_where_they_leave_more_than_noise() -> None:
    """Noise alone is likelier than a failure in some cells with less than noise in the others."""
    random = np.random.default_rng(2)
    right = 20.0 * random.uniform(0.5, 1.5, 80)
    fails = np.where(np.arange(80) % 5 == 0, 2000.0, 0.2 * right)
    assert np.log(fails).mean() < np.log(right).mean()
    null = Null(np.ones(3), np.full((3, 8), 10.0 * 20.0))
    found = cast(Search, SimpleNamespace(null=null))
    cells, rows = above_noise(found, [right, fails], 10.0)
    assert probabilities([right, fails], 10.0, [1, 1])[0] < 0.5 < 0.95 < probabilities(cells, rows, [1, 1])[0]
    assert rows == pytest.approx(10.0 * (1.0 + 20.0 / right.mean()))
