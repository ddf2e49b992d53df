"""The simulated device is the simulator, one period an exchange."""

from __future__ import annotations

import math

import pytest
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create

from rtcomp.stage.simulate import Simulator

PERIOD = 1e-3
COMMANDS = [3.0 * math.sin(0.2 * k) for k in range(60)]


def device(stage, **settings):
    made = create({"driver": "simulated", **settings}, Bench(stage=stage, period=PERIOD, seed=3))
    made.open()
    return made


def test_each_exchange_is_a_period_with_its_command_and_then_a_measurement(stage):
    simulator = Simulator(stage, seed=3)
    wanted = [simulator.measure()]
    for volts in COMMANDS[1:]:
        simulator.advance(volts, PERIOD)
        wanted.append(simulator.measure())
    simulated = device(stage)
    samples = [simulated.exchange(v) for v in COMMANDS]
    assert [s.position for s in samples] == wanted
    assert [s.time for s in samples] == pytest.approx([PERIOD * k for k in range(60)], abs=1e-12)


def test_a_delay_of_one_tick_holds_each_command_back_a_tick(stage):
    late, prompt = device(stage, delay_ticks=1), device(stage)
    from_late = [late.exchange(v).position for v in COMMANDS]
    # A real link: what is handed over with one measurement acts until the next.
    from_prompt = [prompt.exchange(v).position for v in [0.0, *COMMANDS[:-1]]]
    assert from_late == from_prompt


def test_commands_end_at_the_voltage_limit(stage):
    limit = stage.voltage_limit
    wild, tame = device(stage), device(stage)
    for sign in (1.0, 1.0, -1.0):
        assert wild.exchange(50.0 * limit * sign) == tame.exchange(limit * sign)


def test_opening_again_begins_again(stage):
    simulated = device(stage)
    first = [simulated.exchange(v) for v in COMMANDS]
    simulated.close()
    simulated.open()
    assert [simulated.exchange(v) for v in COMMANDS] == first
