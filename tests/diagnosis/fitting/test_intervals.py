"""Intervals of the stage's numbers, by blocks left out."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import RATE, run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.intervals import numbers, told
from rtcomp.diagnosis.fitting.unbiased import unbiased
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.spread import MODEL
from rtcomp.diagnosis.recordings.data import load_data


@pytest.mark.parametrize(("bursts", "least", "most"), [(1, 3.0, 30.0), (10, 0.0, 2.0)])
def test_a_number_that_one_block_tells_is_as_sure_as_the_others_make_it(
    bursts: int, least: float, most: float
) -> None:
    """Mass shows where the axis is fast: in one block, or in all."""
    t = np.arange(int(24.0 * RATE)) / RATE
    slow = 1e-4 * np.sin(2 * np.pi * 0.5 * t)
    fast = np.zeros_like(t)
    for middle in 24.0 * (np.arange(bursts) + 0.5) / bursts if bursts > 1 else (7.0,):
        fast += np.exp(-(((t - middle) / 0.3) ** 2)) * 2e-4 * np.sin(2 * np.pi * 9.0 * t)
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, slow + fast)]))
    found = numbers(Fitter(balance), believed, baseline(balance))
    half = found.half[0] / found.values[0]
    assert least * MODEL <= half <= most * MODEL
    assert abs(found.values[0] - believed.mechanics.mass) <= found.half[0]


def test_a_number_of_little_force_is_known_less_well() -> None:
    """Kernels and rows are right to a part of the force, whatever the noise."""
    t = np.arange(int(24.0 * RATE)) / RATE
    motion = 1e-4 * np.sin(2 * np.pi * 0.5 * t) + 2e-5 * np.sin(2 * np.pi * 5.0 * t)
    half = {}
    for viscous in (8.0, 800.0):
        believed = stage(viscous=viscous)
        balance = ForceBalance(believed, load_data([run(believed, motion)]))
        found = numbers(Fitter(balance), believed, baseline(balance))
        half[viscous] = found.half[1] / viscous
        assert abs(found.values[1] - viscous) <= found.half[1]
    assert half[800.0] < 3.0 * MODEL < 0.1 < half[8.0]


@pytest.mark.parametrize(("hidden", "at_bound"), [(2e-4, True), (2e-2, False)])
def test_a_number_below_what_a_recording_can_show_is_told_to_be_at_its_bound(
    hidden: float, at_bound: bool
) -> None:
    """A time within a row is no finding, however well it fits."""
    creep = {"name": "creep", "fraction": 0.5, "time_constant": hidden}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[creep]), there_and_back(12.0))]))
    baseline(balance)
    fitter = Fitter(balance)
    found = fitter.fit([Term.of({**creep, "time_constant": 6e-3})])
    assert ("time_constant" in told(fitter, found)[0].bound) is at_bound


def test_what_replicates_are_off_by_is_part_of_an_interval() -> None:
    """It was taken off, and is known to its own size; without replicates a part of the force counts."""
    spring = {"name": "parallel-spring", "stiffness": 3000.0}
    believed = stage()
    balance = ForceBalance(believed, load_data([run(stage(effects=[spring]), there_and_back())]))
    baseline(balance)
    fitter = Fitter(balance)
    model = fitter.fit([Term.of({**spring, "stiffness": 1.0})])
    off = np.zeros(model.whole.size)
    off[0], off[balance.size] = 0.05 * model.coefficients[0], 400.0
    exact, bent = (unbiased(fitter, model, (model.whole + each)[None]) for each in (0.0 * off, off))

    def half(one: Fitted) -> float:
        value = told(fitter, one)[0].values["stiffness"]
        return 0.5 * (value.high - value.low)

    assert half(exact) < 0.1 * 400.0 < half(bent) == pytest.approx(400.0, rel=0.1)
    mass = {str(i): numbers(fitter, believed, one) for i, one in enumerate((model, exact, bent))}
    sizes = [found.half[0] / found.values[0] for found in mass.values()]
    assert sizes[1] < sizes[0] and sizes[2] == pytest.approx(0.05, rel=0.15)


@pytest.mark.parametrize(("amplitude", "nothing"), [(0.4, False), (0.0, True)])
def test_a_weight_on_a_short_arc_is_something_though_its_amplitude_is_open(
    amplitude: float, nothing: bool
) -> None:
    """Its sine is that of a spring, which blocks cannot part from the believed one; its cosine is sure."""
    spring = {"name": "parallel-spring", "stiffness": 30.0}
    axis = {"axis": "rotary", "mass": 0.3, "viscous": 0.1, "micro_damping": 0.0, "effects": [spring]}
    weight = {"name": "gravity", "amplitude": amplitude, "phase": 2.2}
    hidden = stage(**{**axis, "effects": [spring, weight]})
    balance = ForceBalance(stage(**axis), load_data([run(hidden, 1000.0 * there_and_back(12.0))]))
    baseline(balance)
    fitter = Fitter(balance)
    found = told(fitter, fitter.fit([Term.of({**weight, "amplitude": 0.3, "phase": 1.0})]))[0]
    size, angle = found.values["amplitude"], found.values["phase"]
    assert found.nothing is nothing
    if nothing:
        assert size.low <= 0.0
    else:
        assert 0.9 * amplitude * abs(np.cos(2.2)) < size.low < amplitude < size.high
        assert angle.low < 2.2 < angle.high


def test_the_interval_of_a_wave_is_that_of_its_sizes_where_both_are_sure() -> None:
    """Along a small ellipse amplitude and phase go by it to first order: as far down as up."""
    wave = {"name": "cogging", "amplitude": 0.5, "period": 2e-4, "phase": 0.7}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[wave]), there_and_back(12.0))]))
    baseline(balance)
    fitter = Fitter(balance)
    found = told(fitter, fitter.fit([Term.of(wave)]))[0]
    size, angle = found.values["amplitude"], found.values["phase"]
    assert size.low < 0.5 < size.high < 0.55 and angle.low < 0.7 < angle.high < 0.8
    assert size.high - size.value == pytest.approx(size.value - size.low, rel=0.1)
