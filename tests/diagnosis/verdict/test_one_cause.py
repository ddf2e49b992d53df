"""Numbers of a belief that moved: by another unit of force or length, or each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import run, there_and_back
from recorded import stage as axis

from rtcomp.diagnosis.fitting.retuned import Numbers
from rtcomp.diagnosis.fitting.stage_of import in_units, with_effect
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.verdict.one_cause import Cause, fixed_units, force_constant, one_cause
from rtcomp.kernels import Floats
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage
from rtcomp.units import power_of

BEFORE = np.array([2.0, 30.0, 200.0, 4.0, 1e-5])
LENGTH, FORCE = np.array([1.0, 1.0, 1.0, 0.0, -1.0]), np.array([-1.0, -1.0, -1.0, -1.0, 0.0])
"""Powers of the factor of a unit by which numbers are read."""


def moves(stage: Stage, volts: Floats) -> Floats:
    simulator, position = Simulator(stage, seed=1), np.empty(volts.size)
    for k, command in enumerate(volts.tolist()):
        position[k] = simulator.measure()
        simulator.advance(command, 1.0 / stage.rate)
    return position


def numbers(relative: Floats, half: float = 0.02, before: Floats = BEFORE) -> Numbers:
    values = before * relative
    return Numbers(before, values, half * values)


@pytest.mark.parametrize(
    ("unit", "base", "power"),
    [("kg", "m", -1), ("kg", "N", 1), ("N s/m", "m", -1), ("m", "m", 1), ("N", "m", 0), ("N/m^3", "m", -3),
     ("N s^2/m^2", "m", -2), ("N s^2/m^2", "s", 2), ("m/s", "m", 1), ("1", "N", 0), ("N/V", "N", 1),
     ("N m", "N", 1), ("N m", "m", 0)],
)  # fmt: skip
def test_powers_of_a_unit(unit: str, base: str, power: int) -> None:
    assert power_of(base, unit) == power


@pytest.mark.parametrize("factor", [0.8, 1.15, 1.27])
@pytest.mark.parametrize(("unit", "power"), [("m", LENGTH), ("N", FORCE)])
def test_numbers_that_moved_by_a_unit(unit: str, power: Floats, factor: float) -> None:
    """Whatever a belief is off by itself besides, a few per cent."""
    chance, held = np.random.default_rng(3), []
    for _ in range(100):
        off = np.exp(0.015 * chance.standard_normal(5))
        found = one_cause(numbers(factor**power * off), [])
        if found is not None:
            assert found.unit == unit and found.probability > 0.99
            held.append(found.low < factor < found.high)
    assert len(held) > 70 and np.mean(held) > 0.9


@pytest.mark.parametrize("off", [0.02, 0.05, 0.2])
def test_numbers_that_moved_each_by_itself_are_no_unit(off: float) -> None:
    chance = np.random.default_rng(5)
    found = [one_cause(numbers(np.exp(off * chance.standard_normal(5))), []) for _ in range(1000)]
    assert sum(cause is not None for cause in found) <= 10


@pytest.mark.parametrize("wrong", [0.2, 0.4, 3.0])
@pytest.mark.parametrize("at", range(5))
def test_one_number_that_is_wrong_is_no_unit(at: int, wrong: float) -> None:
    """As the reach of a friction of another shape: what it moved by says nothing of the others."""
    chance = np.random.default_rng(9)
    for off in (0.0, 0.02, 0.1):
        relative = np.exp(off * chance.standard_normal(5))
        relative[at] *= wrong
        assert one_cause(numbers(relative, half=0.01), []) is None


def test_a_unit_is_told_beside_a_number_that_is_wrong() -> None:
    relative = 1.2**LENGTH
    relative[4] *= 0.4
    found = one_cause(numbers(relative, half=0.005), [])
    assert found is not None and found.unit == "m" and found.low < 1.2 < found.high


@pytest.mark.parametrize(
    "told",
    [
        numbers(np.array([1.0, 1.0, 1.0, 1.1, 1.0])),
        numbers(1.27**LENGTH, half=1.0),  # nothing is known
        numbers(1.27**LENGTH, before=BEFORE * np.array([1.0, 0.0, 0.0, 0.0, 0.0])),  # one number is believed
        numbers(1.01**FORCE, half=1e-3),  # a hundredth is no news
    ],
)
def test_too_little_to_tell(told: Numbers) -> None:
    assert one_cause(told, []) is None


def test_a_unit_in_which_something_is_fixed_did_not_move() -> None:
    stop = axis(effects=[{"name": "end-stop", "position": 1e-3, "stiffness": 1e5}])
    scaled = axis(effects=[{"name": "sensor-scale", "scale": 1.02}])
    curve = axis(effects=[{"name": "position-force", "knots": [-1e-3, 0.0, 1e-3], "values": [0.0, 0.4, 0.0]}])
    assert "m" in fixed_units(stop)
    assert {"N", "m"} <= set(fixed_units(curve))
    assert "m" in fixed_units(scaled) and "N" not in fixed_units(scaled)
    spring = axis(effects=[{"name": "parallel-spring", "stiffness": 100.0}])
    assert not set(fixed_units(spring)) & {"N", "m"}
    assert one_cause(numbers(1.27**LENGTH), ["m"]) is None
    weight = axis(axis="rotary", effects=[{"name": "gravity", "amplitude": 0.3}])  # of a turn
    assert "m" in fixed_units(weight) and "N" not in fixed_units(weight)
    assert "m" not in fixed_units(axis(effects=[{"name": "gravity", "force": 0.3}]))


def test_a_force_constant_is_told_with_its_interval() -> None:
    one = force_constant(axis(), Cause("N", 1.1, 1.05, 1.15, 0.999))
    assert one.after.value == pytest.approx(1.1 * one.before)
    assert one.after.low < one.after.value < one.after.high


def test_a_stage_in_other_units_moves_as_it_did() -> None:
    """Of force: alike for the same command. Of length: as much further, which a scale on the sensor hides."""
    spring = {"name": "parallel-spring", "stiffness": 4000.0}
    stage = axis(effects=[spring])
    volts = 0.6 * np.sin(2.0 * np.pi * 3.0 * np.arange(2000) / stage.rate)
    was = moves(stage, volts)
    stronger = moves(in_units(stage, "N", 1.3), volts)
    assert np.allclose(stronger, was, rtol=1e-6, atol=1e-9 * np.ptp(was))
    other = in_units(stage, "m", 1.3)
    assert other.mechanics.effects[0]["stiffness"] == pytest.approx(4000.0 / 1.3)
    longer = moves(with_effect(other, {"name": "sensor-scale", "scale": 1.3}), volts)
    assert np.allclose(longer, was, rtol=1e-6, atol=1e-9 * np.ptp(was))


def test_a_scale_of_the_sensor_is_named_where_all_numbers_moved_by_it() -> None:
    believed = axis()
    true = axis(effects=[{"name": "sensor-scale", "scale": 1.2}])
    done = diagnose(believed, [run(true, there_and_back(8.0))], budget=300.0)
    assert done.verdict == "missing-physics"
    (named,) = done.effects
    assert named.names == ("sensor-scale",) and named.probability > 0.99
    scale = named.parameters["scale"]
    assert scale.low < 1.2 < scale.high and scale.value == pytest.approx(1.2, rel=0.02)
    assert done.stage.mass == pytest.approx(believed.mass, rel=0.03)
    assert done.fit.after < 0.2 * done.fit.before
