"""Dead times: exact for held commands, at steps of any length; late readings by the line between them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.physics import build
from rtcomp.physics.delay import HELD
from rtcomp.physics.rows import motion_rows, new_rows, over_rows
from rtcomp.physics.wires import SENSED, STEP, TIME, VOLTS

TICK = 1e-3
COMMANDS = np.random.default_rng(1).uniform(-5, 5, 60)


def late_impulse(delay, t):
    """Integral of the held commands, `delay` late, up to the times `t`."""
    edges = TICK * np.arange(COMMANDS.size + 1)
    return np.interp(np.asarray(t) - delay, edges, np.concatenate([[0.0], np.cumsum(COMMANDS) * TICK]))


@settings(max_examples=40, deadline=None)
@given(delay=st.floats(1e-6, 2e-2), parts=st.sampled_from([1, 3, 10, 200]))
def test_the_impulse_of_a_late_command_is_exact_at_any_step(delay, parts):
    rows = new_rows(COMMANDS.size * parts)
    rows[:, STEP] = TICK / parts
    rows[:, VOLTS] = np.repeat(COMMANDS, parts)
    out = over_rows([build({"name": "drive-delay", "delay": delay})], rows)[:, VOLTS]
    t = TICK / parts * np.arange(1, len(rows) + 1)
    np.testing.assert_allclose(np.cumsum(out) * TICK / parts, late_impulse(delay, t), atol=1e-12)


def test_a_call_without_length_shows_what_acts_now_and_changes_nothing():
    rows = new_rows(20)
    rows[:, VOLTS] = np.repeat(np.arange(1.0, 11.0), 2)
    rows[1::2, STEP] = TICK
    effect = build({"name": "drive-delay", "delay": 3 * TICK})
    out = over_rows([effect], rows.copy())[:, VOLTS]
    np.testing.assert_allclose(out[1::2], [0, 0, 0, 1, 2, 3, 4, 5, 6, 7])
    np.testing.assert_allclose(over_rows([effect], rows[1::2].copy())[:, VOLTS], out[1::2])


def test_a_delay_of_more_commands_than_are_held_is_as_short_as_they_are():
    rows = new_rows(3 * HELD)
    rows[:, STEP], rows[:, VOLTS] = TICK, np.arange(3 * HELD)
    out = over_rows([build({"name": "drive-delay", "delay": 10.0})], rows)[:, VOLTS]
    assert out[-1] == pytest.approx(2 * HELD)


@settings(max_examples=30, deadline=None)
@given(delay=st.floats(1e-5, 5e-2))
def test_a_late_reading_of_even_motion_is_exact(delay):
    rows = motion_rows(2e-3 * TICK * np.arange(1, 201), TICK)
    out = over_rows([build({"name": "sensor-delay", "delay": delay})], rows)[:, SENSED]
    expected = 2e-3 * np.maximum(rows[:, TIME] - delay, TICK)
    np.testing.assert_allclose(out, expected, atol=1e-15)


def test_reading_twice_at_one_time_is_one_reading():
    rows = new_rows(6)
    rows[:, TIME] = [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]
    rows[:, SENSED] = [5.0, 1.0, 9.0, 3.0, 7.0, 7.0]
    out = over_rows([build({"name": "sensor-delay", "delay": 0.5})], rows)[:, SENSED]
    np.testing.assert_allclose(out[[1, 3, 5]], [1.0, 2.0, 5.0])
