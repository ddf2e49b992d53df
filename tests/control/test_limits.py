from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.control import limits
from rtcomp.control.limits import limit_state, limit_step, limit_vector
from rtcomp.errors import ConfigError


def run(p, commands, step=limit_step):
    s = limit_state()
    return np.array([step(p, s, c) for c in commands]), s


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=50),
    st.floats(0.1, 100.0),
    st.floats(0.1, 1e5),
)
def test_whatever_comes_in_what_goes_out_is_finite_and_within_limits(commands, limit, slew):
    period = 1e-3
    out, s = run(limit_vector(limit, period, slew), commands)
    assert np.isfinite(out).all()
    assert np.abs(out).max() <= limit
    moved = np.abs(np.diff(np.concatenate(([0.0], out))))
    numbers = np.isfinite(commands)
    assert (moved[numbers] <= slew * period * (1 + 1e-12) + 1e-15).all()
    assert s[limits.NOT_FINITE_TICKS] == np.count_nonzero(~numbers)
    assert (out[~numbers] == 0.0).all()


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=30))
def test_commands_within_limits_pass_unchanged_and_unflagged(commands):
    out, s = run(limit_vector(5.0, 1e-3), commands)
    assert out.tolist() == [0.0 if abs(v) < sys.float_info.min else v for v in commands]
    assert s[limits.FLAGS] == 0.0
    assert s[limits.CLAMPED_TICKS] == s[limits.SLEWED_TICKS] == 0.0


def test_flags_say_what_was_done_and_counts_add_up():
    p, s = limit_vector(10.0, 1e-3, 5000.0), limit_state()
    assert limit_step(p, s, 12.0) == 5.0
    assert s[limits.FLAGS] == limits.CLAMPED + limits.SLEWED
    assert limit_step(p, s, 9.0) == 9.0
    assert s[limits.FLAGS] == 0.0
    assert limit_step(p, s, math.nan) == 0.0
    assert s[limits.FLAGS] == limits.NOT_FINITE
    assert limit_step(p, s, -7.0) == -5.0
    assert s[limits.FLAGS] == limits.SLEWED
    assert s[[limits.CLAMPED_TICKS, limits.SLEWED_TICKS, limits.NOT_FINITE_TICKS]].tolist() == [1, 2, 1]


def test_compiled_and_python_agree():
    commands = np.random.default_rng(0).normal(0.0, 8.0, 200)
    commands[::17] = math.nan
    p = limit_vector(10.0, 1e-3, 3000.0)
    compiled, s1 = run(p, commands)
    plain, s2 = run(p, commands, limit_step.py_func)
    assert np.array_equal(compiled, plain)
    assert np.array_equal(s1, s2)


@pytest.mark.parametrize(
    "arguments", [(0.0, 1e-3), (-1.0, 1e-3), (math.inf, 1e-3), (math.nan, 1e-3), (1.0, 0.0), (1.0, 1e-3, 0.0)]
)
def test_limits_that_are_none_are_refused_in_one_line(arguments):
    with pytest.raises(ConfigError, match="must be a positive number") as caught:
        limit_vector(*arguments)
    assert "\n" not in str(caught.value)
