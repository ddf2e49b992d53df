"""Effects that go by the whole of friction, fitted together with it."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.at_hand import system_around
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.errors import ConfigError
from rtcomp.physics import Place, catalogue

CREEP = {"name": "creep", "fraction": 0.7, "time_constant": 0.15}


@pytest.fixture(scope="module")
def fitter() -> Fitter:
    """A recording of an axis that creeps much, and the belief that it does not."""
    recording = run(stage(effects=[CREEP]), there_and_back(16.0))
    balance = ForceBalance(stage(), load_data([recording]))
    baseline(balance)
    return Fitter(balance)


@pytest.mark.parametrize("start", [0.2, 0.6, 1.5])
def test_a_strong_creep_is_fitted_from_anywhere(fitter: Fitter, start: float) -> None:
    """Creep goes by the friction that is fitted with it: a recording shows the ratio of both."""
    found = fitter.fit([Term.of({**CREEP, "fraction": start, "time_constant": 0.4})])
    creep = found.entries[0]
    stiffness = sum(e["stiffness"] for e in stage().to_dict()["stage"]["friction"])
    assert creep["time_constant"] == pytest.approx(CREEP["time_constant"], rel=0.1)
    assert creep["fraction"] / found.weights.sum() == pytest.approx(CREEP["fraction"] / stiffness, rel=0.1)
    true = fitter.balance.error(found.entries, found.coefficients, found.weights)
    assert np.sum(true[fitter.rows] ** 2) == pytest.approx(found.sse, rel=0.02)


@pytest.mark.filterwarnings("error")
def test_friction_that_grows_beyond_all_bounds_is_refused(fitter: Fitter) -> None:
    """It is an error that ends a candidate, not a number that spoils the sums of the others."""
    around = fitter.fit([Term.of(CREEP)])
    huge = np.full_like(around.weights, 1e152)
    with pytest.raises(ConfigError, match="times the noise"):
        system_around(fitter.balance, around.entries, huge, 1e152 * around.coefficients)


def _at_work() -> list[dict[str, object]]:
    """Return entries that change friction, in every form and with every choice."""
    found = []
    for kind in catalogue.entries():
        if kind.place is Place.FRICTION and kind.searchable:
            base = {"name": kind.name, **kind.example}
            forms = [{**base, "form": form} for form in kind.forms] or [base]
            choices = [(p.name, value) for p in kind.parameters if p.choice for value in (0.0, 1.0)]
            found += [{**e, name: value} for e in forms for name, value in choices] or forms
    return found


@pytest.mark.parametrize("entry", _at_work(), ids=lambda e: " ".join(map(str, e.values())))
def test_columns_sum_up_to_the_error(fitter: Fitter, entry: dict[str, object]) -> None:
    """What a model leaves open is made in one pass, without its columns; any of them show the same."""
    b, base = fitter.balance, fitter.fit([])
    c = base.coefficients * np.random.default_rng(1).uniform(0.8, 1.2, base.coefficients.size)
    c = np.append(c, np.ones(len(ent.basis(entry)) if ent.adds_force(ent.kind_of(entry)) else 0))
    at_hand = base.coefficients[b.friction]
    summed = b.error([entry], c, at_hand)
    system = b.system([entry], at_hand)
    assert summed == pytest.approx(system.y - c @ system.columns, abs=1e-4 * np.abs(system.y).max())


def test_friction_by_load_is_fitted_with_what_loads_it() -> None:
    """Its level is fitted with it, and no number of it makes blocks left out seem explained."""
    hidden = [
        {"name": "load-dependent-friction", "coefficient": 0.3},
        {"name": "parallel-spring", "stiffness": 4000.0},
    ]
    recording = run(stage(effects=hidden), there_and_back(16.0))
    balance = ForceBalance(stage(), load_data([recording]))
    baseline(balance)
    fitter = Fitter(balance)
    starts = [{**hidden[0], "coefficient": 0.2, "stiffening": 0.0}, {**hidden[1], "stiffness": 2500.0}]
    found = fitter.fit([Term.of(e) for e in starts])
    assert found.entries[0]["coefficient"] == pytest.approx(0.3, rel=0.03)
    assert found.entries[1]["stiffness"] == pytest.approx(4000.0, rel=0.03)
    alone = fitter.fit([Term.of(starts[0])])  # a model that lacks something leaves more out than in
    assert found.sse < found.errors.sum() < alone.errors.sum()
    assert alone.sse < alone.errors.sum()
