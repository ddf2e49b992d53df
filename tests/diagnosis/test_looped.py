"""An effect acts in a simulated loop of its model as along the recording, or it is no finding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.balance import ForceBalance
from rtcomp.diagnosis.baseline import baseline
from rtcomp.diagnosis.data import load_data
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.free import Term
from rtcomp.diagnosis.looped import acts_otherwise, alike

PLACES = {"name": "position-dependent-friction", "amplitude": 0.5, "period": 3e-4, "phase": 0.3}
LIMIT = {"name": "drive-saturation", "limit": 0.42}


@given(st.floats(0.0, 1.0), st.floats(0.0, 3.0), st.floats(1e-6, 1e6), st.integers(0, 1000))
def test_the_part_that_is_repeated_is_told_from_noise(
    part: float, noise: float, unit: float, seed: int
) -> None:
    """Of each a noise of its own; what both simulations lack of the recorded force is not repeated."""
    random = np.random.default_rng(seed)
    force = random.standard_normal((20, 400))
    own = noise * random.standard_normal((3, *force.shape))
    forces = unit * (np.array([1.0, part, part])[:, None, None] * force + own)
    found, error = alike(np.einsum("fbn,gbn->bfg", forces, forces))
    assert abs(found - part) < 0.02 + 6.0 * error


def test_what_is_not_simulated_is_not_repeated() -> None:
    products = np.zeros((10, 3, 3))
    products[:, 0, 0] = 1.0
    assert alike(products) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("hidden", "told", "otherwise"),
    [(PLACES, LIMIT, True), (LIMIT, LIMIT, False), (PLACES, PLACES, False)],
    ids=["limit told for friction", "limit", "friction"],
)
def test_a_limit_that_takes_away_what_friction_asked_for_acts_otherwise(
    hidden: Entry, told: Entry, otherwise: bool
) -> None:
    balance = ForceBalance(stage(), load_data([run(stage(effects=[hidden]), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term.of(told)], base, steps=0)
    assert acts_otherwise(fitter, model, 0) == otherwise


def test_without_a_loop_nothing_acts_otherwise() -> None:
    """The recorded command acts, whatever there is."""
    recording = run(stage(effects=[PLACES]), there_and_back(10.0))
    del recording.columns["reference"]
    balance = ForceBalance(stage(), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    assert not acts_otherwise(fitter, fitter.fit([Term.of(LIMIT)], base, steps=0), 0)
