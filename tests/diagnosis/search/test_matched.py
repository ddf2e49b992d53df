"""A coarse sensor bends a fit: a model that would be fitted alike is what the recording may come from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from joints import MASS, joint, swings
from recorded import run

from rtcomp.diagnosis.candidates.screening import Look, Screen, look
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.acceptance import accepted
from rtcomp.diagnosis.search.beam import shown_by_more_than_fitting
from rtcomp.diagnosis.search.matched import matched
from rtcomp.diagnosis.search.replicates import null_of
from rtcomp.diagnosis.search.selection import Search, sound
from rtcomp.diagnosis.settings import LEVEL
from rtcomp.kernels import Floats


def test_the_mass_that_a_coarse_encoder_hides_is_found_by_fits_of_replicates() -> None:
    """The fit finds hardly more than half of it, and replicates of that fit are not as loud."""
    resolution, true = 2e-4, 1.07 * MASS
    balance = ForceBalance(joint(resolution), load_data([run(joint(resolution, true), swings())]))
    base, fitter = baseline(balance), Fitter(balance)
    assert base.coefficients[0] < 0.7 * true
    for model, more in matched(fitter, base, 0):
        assert model.coefficients[0] == pytest.approx(true, rel=0.1)
        assert more[0] == pytest.approx(model.coefficients[0] - base.coefficients[0])
    null = null_of(fitter, base, Screen([], fitter), 0.0, 0)
    assert null.p_of_error(base.errors) >= LEVEL
    assert null.numbers is not None
    assert 2.0 * base.coefficients[0] - null.numbers[:, 0].mean() == pytest.approx(true, rel=0.1)


def test_what_a_full_fit_of_replicates_finds_as_well_goes_on_no_further() -> None:
    """A second mass on a soft spring makes up for a bent mass, there as here; a dead zone is not there."""
    dead, soft = (
        {"name": "drive-deadband", "width": 0.09},
        {"name": "resonance", "frequency": 7.0, "damping": 0.5, "mass_ratio": 0.4},
    )
    balance = ForceBalance(joint(1e-4), load_data([run(joint(1e-4, MASS, dead), swings())]))
    base, fitter = baseline(balance), Fitter(balance)
    true = fitter.fit([Term.of(dead)], base)
    null = null_of(fitter, base, look(fitter, base).screen, 0.0, 0)
    assert shown_by_more_than_fitting([true], base, null) == [true]
    both = fitter.fit([*true.terms, Term.of(soft)], true)
    assert both.errors.sum() < 0.9 * true.errors.sum()
    null = null_of(fitter, true, look(fitter, true).screen, 0.0, 0)
    assert shown_by_more_than_fitting([both], true, null) == []


def test_a_lag_with_hardly_any_mass_is_further_from_its_own_recordings() -> None:
    """Noise of a coarse reading is a force by the mass: without it most of what is left is gone."""
    dead = {"name": "drive-deadband", "width": 0.09}
    balance = ForceBalance(joint(2e-4), load_data([run(joint(2e-4, 1.07 * MASS, dead), swings())]))
    base, fitter = baseline(balance), Fitter(balance)
    lag = fitter.fit([Term.of({"name": "drive-lag", "time_constant": 0.05})], base)
    assert lag.coefficients[0] < 0.3 * base.coefficients[0]
    assert lag.errors.sum() < 0.6 * base.errors.sum()
    nothing = Screen([], fitter)
    before, own = (null_of(fitter, m, nothing, 0.0, 0) for m in (base, lag))
    assert not accepted(fitter, lag, base, before, float(base.errors.sum()))
    step = Search(base, base, before)
    assert sound(Look([], [], nothing, own), lag, math.inf, step) is None
    assert sound(Look([], [], nothing, before), base, math.inf, Search(base, base)) is not None


def test_what_is_quieter_beside_a_model_of_the_same_mass_was_not_noise() -> None:
    """Replicates of a belief may be loud by what is missing in it, which the true model is not to pay for."""
    dead = {"name": "drive-deadband", "width": 0.09}
    balance = ForceBalance(joint(1e-4), load_data([run(joint(1e-4, MASS, dead), swings())]))
    base, fitter = baseline(balance), Fitter(balance)
    true = fitter.fit([Term.of(dead)], base)
    assert true.coefficients[0] > 0.8 * base.coefficients[0]
    scatter = np.linspace(0.9, 1.1, 6)[:, None]

    def null(errors: Floats, number: float) -> Null:
        return Null(np.zeros(6), scatter * errors, np.full((6, 1), number))

    loud, quiet = null(0.5 * base.errors, base.coefficients[0]), null(0.01 * true.errors, MASS)
    seen = Look([], [], Screen([], fitter), quiet)
    assert sound(seen, true, math.inf, Search(base, base, loud)) is seen


@pytest.mark.slow
@pytest.mark.parametrize("resolution", [1e-4, 2e-4, 4e-4])
def test_a_joint_as_believed_is_left_in_peace_whatever_its_encoder(resolution: float) -> None:
    found = diagnose(joint(resolution), [run(joint(resolution, 1.07 * MASS), swings())])
    assert found.verdict in ("consistent", "retuned")
    for moved in found.retuned:
        assert moved.parameter != "mass" or moved.after.value == pytest.approx(1.07 * MASS, rel=0.1)


@pytest.mark.slow
def test_a_dead_zone_behind_a_coarse_encoder_is_all_that_is_named() -> None:
    """A second mass on a soft spring would make up for the bent mass as well, on replicates too."""
    dead = {"name": "drive-deadband", "width": 0.09}
    found = diagnose(joint(1e-4), [run(joint(1e-4, 1.07 * MASS, dead), swings())])
    assert [e.names for e in found.effects] == [("drive-deadband",)]
    width = found.effects[0].parameters["width"]
    assert math.isclose(width.value, 0.09, rel_tol=0.05)
    assert width.low < 0.09 < width.high
