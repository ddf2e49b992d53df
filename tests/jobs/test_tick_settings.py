"""What a configuration's limits become in the tick."""

from __future__ import annotations

import math

import pytest

from rtcomp.errors import ConfigError
from rtcomp.jobs.configuration import RunFile
from rtcomp.jobs.tick_settings import MOST_WITH_PRIOR, MOST_WITH_RLS, check_size, tick_settings
from rtcomp.stage.schema import RUN_SECTIONS, StageFile


def test_a_stage_file_leaves_out_every_section_of_a_run():
    assert set(RunFile.model_fields) == {*StageFile.model_fields, *RUN_SECTIONS}


def test_in_open_loop_nothing_is_held_against_positions_that_were_measured_long_ago(leuven):
    s = tick_settings(leuven.changed(limits={"age": 0.01, "jump": 1e-6, "stuck": 0.1}), 0, False)
    assert s.travel == (-math.inf, math.inf)
    assert {s.speed, s.jump, s.stuck_volts, s.sign_volts, s.age_ticks, s.slots_lost} == {math.inf}


def test_whether_the_axis_follows_is_checked_on_real_devices_and_where_it_is_asked_for(leuven):
    off = tick_settings(leuven, 0, True)
    assert {off.stuck_volts, off.sign_volts, off.stuck_ticks} == {math.inf}
    asked = tick_settings(leuven.changed(limits={"stuck": 0.1, "voltage": 4.0}), 0, True)
    assert asked.stuck_volts == asked.sign_volts == pytest.approx(3.92) and asked.stuck_ticks == 100
    real = tick_settings(leuven.changed(device={"driver": "serial", "port": "/dev/null"}), 1, True)
    assert real.stuck_ticks == 250 and real.stuck_volts == pytest.approx(9.8) and real.sign_ticks == 8
    assert real.one_count == pytest.approx(10e-9 + 6 * 15e-9)


def test_times_become_ticks_of_the_rate(leuven):
    fast = tick_settings(leuven.changed(rate=10_000.0, limits={"age": 0.05, "invalid": 0.01}), 0, True)
    assert (fast.age_ticks, fast.invalid_ticks, fast.sign_ticks) == (500, 100, 50)
    usual = tick_settings(leuven, 0, True)
    assert (usual.age_ticks, usual.invalid_ticks, usual.slots_lost) == (100, 0, 20)
    paced = tick_settings(leuven.changed(loop={"overrun": "device-paced", "slots_lost": 3}), 0, True)
    assert paced.device_paced and paced.slots_lost == 3


SERIAL = {"driver": "serial", "port": "/dev/null"}


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        ({"limits": {"voltage": 2.0, "moves_at": 3.0}}, r"moves_at: 3 V is more than limits.voltage \(2 V\)"),
        ({"limits": {"moves_at": 20.0}}, r"moves_at: 20 V is more than the stage's voltage_limit \(10 V\)"),
        ({"limits": {"voltage": 11.0}}, r"limits.voltage: is 11 V; .* at most 10 V"),
        ({"limits": {"age": 5e-4}}, r"limits.age: 0.0005 s is less than a tick \(0.001 s at 1000 Hz\)"),
        ({"limits": {"stuck": 1e-9}}, r"limits.stuck: 1e-09 s is less than a tick"),
        ({"limits": {"invalid": 5.0}}, r"limits.invalid: 5 s is more than limits.age \(0.1 s\)"),
        ({"limits": {"jump": 1e-8}}, r"limits.jump: 1e-08 m is less than a resting .* \(1e-07 m"),
        ({"device": {**SERIAL, "voltage_limit": 2.0}}, r"device.voltage_limit: 2 V is less than the stage's"),
        (
            {"device": {**SERIAL, "voltage_limit": 2.0}, "limits": {"voltage": 3.0}},
            r"device.voltage_limit: 2 V is less than limits.voltage \(3 V\)",
        ),
    ],
)
def test_limits_that_contradict_each_other_are_refused(leuven, sections, says):
    with pytest.raises(ConfigError, match=says):
        tick_settings(leuven.changed(**sections), 0, True)


def test_limits_that_just_go_together_are_taken(leuven):
    limits = {"voltage": 10.0, "moves_at": 10.0, "age": 1e-3, "stuck": 1e-3, "invalid": 1e-3, "jump": 1e-7}
    assert tick_settings(leuven.changed(limits=limits), 0, True).invalid_ticks == 1
    board = {**SERIAL, "voltage_limit": 2.0}
    assert tick_settings(leuven.changed(device=board, limits={"voltage": 2.0}), 1, True).age_ticks == 100


def test_a_recording_is_learned_from_whatever_its_rate_makes_of_the_limits(leuven):
    slow = leuven.changed(rate=5.0, limits={"age": 0.1, "stuck": 0.1})
    assert tick_settings(slow, 0, False).age_ticks == math.inf
    # An age that nobody gave is no contradiction.
    assert tick_settings(leuven.changed(rate=5.0, limits={}), 0, True).age_ticks == 1


@pytest.mark.parametrize(
    ("section", "size", "says"),
    [
        ({}, MOST_WITH_PRIOR, ""),
        ({}, MOST_WITH_PRIOR + 1, r"identify.intervals: 1001 elements are too many for identify.prior; take"),
        ({"prior": "none"}, MOST_WITH_RLS, ""),
        ({"prior": "none"}, MOST_WITH_RLS + 1, r"5001 elements are too many for the learner rls, which"),
        ({"prior": "none", "learner": {"learner": "nlms"}}, 100_000, ""),
    ],
)
def test_more_elements_than_memory_or_time_allow_are_refused_before_anything_is_allocated(
    leuven, section, size, says
):
    config = leuven.changed(identify={**leuven.file.data["identify"], **section})
    if says:
        with pytest.raises(ConfigError, match=says):
            check_size(config, size)
    else:
        check_size(config, size)
