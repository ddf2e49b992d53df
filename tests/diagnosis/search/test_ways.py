"""Two ways to take the command are compared on one footing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.ways import Left, alike, doubted, outdone

LOGARITHMS = st.floats(-12.0, 0.0)


def test_blocks_that_only_one_way_reserves_change_nothing() -> None:
    """The same model, once fitted on the loud blocks and once on the quiet ones as well."""
    recording = run(
        stage(effects=[{"name": "cogging", "amplitude": 0.3, "period": 1e-4}]), there_and_back(20.0)
    )
    balances = [ForceBalance(stage(), load_data([recording])) for _ in range(2)]
    bases = [baseline(one) for one in balances]
    for balance, first in zip(balances, (0, 3), strict=True):
        balance._reserved = np.arange(balance.blocks) % 5 == first
    fitters = [Fitter(one) for one in balances]
    models = [fitter.fit([], base) for fitter, base in zip(fitters, bases, strict=True)]
    blocks = alike(*balances)
    one, other = (
        Left.by(fitter, model, some) for fitter, model, some in zip(fitters, models, blocks, strict=True)
    )
    assert one.weighed == pytest.approx(other.weighed, abs=0.05)
    assert not np.any(blocks[0] & (balances[0].reserved | balances[1].reserved))


@given(LOGARITHMS, LOGARITHMS, LOGARITHMS)
def test_an_effect_must_matter_against_the_other_way_without_it(own: float, same: float, more: float) -> None:
    there, mine, with_it = (Left(each, each) for each in (0.0, own, same))
    assert outdone(there, mine, with_it, mine)
    assert outdone(there, mine, with_it, Left(own, more))
    large = Left(0.0, 0.0)
    assert outdone(there, mine, with_it, large) == (same < own or own > 2.0 * np.log(0.98))


def test_a_part_of_the_force_that_does_not_matter_makes_no_delay() -> None:
    """One way weighs frequencies otherwise and leaves more of its residual, but as much of the force."""
    first, own = Left(-10.8, -8.0), Left(-16.1, -10.3)
    assert outdone(first, own, Left(-15.38, -10.2), Left(-15.38, -10.29))
    assert not outdone(first, own, Left(-15.38, -10.2), Left(-12.0, -8.5))


def test_a_delay_of_half_a_row_only_makes_up_for_the_way_that_the_command_goes() -> None:
    """Not so a wave of force. And the other way is left as it was."""
    wave = {"name": "cogging", "amplitude": 0.5, "period": 1e-4, "phase": 0.0}
    recording = run(stage(effects=[wave]), there_and_back(20.0))
    balances = [ForceBalance(stage(), load_data([recording], held=held)) for held in (False, True)]
    bases = [baseline(one) for one in balances]
    wrong, right = (Fitter(one) for one in balances)
    blocks, reaches = alike(*balances), balances[1].reaches
    model = wrong.fit([Term.of(wave)], bases[0])
    late = wrong.fit([*model.terms, Term.of({"name": "drive-delay", "delay": 5e-4})], model)
    assert doubted(wrong, bases[0], right, blocks, math.inf, late)
    assert not doubted(right, bases[1], wrong, blocks[::-1], math.inf, right.fit([Term.of(wave)], bases[1]))
    assert balances[1].reaches is reaches
