"""The low-pass in front of the identifier: one for both, no transient, gain 1, a known delay."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import sosfreqz

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.conditioning import delay_s, low_pass, memory, settle, smooth

cutoffs = st.floats(5.0, 400.0)


def filtered(sections, signal, at_rest=None):
    state = memory(sections)
    if at_rest is not None:
        settle(sections, state, at_rest)
    return np.array([smooth(sections, state, float(v)) for v in signal])


@settings(max_examples=20, deadline=None)
@given(cutoffs, st.floats(-10.0, 10.0))
def test_settled_means_no_transient(cutoff, value):
    out = filtered(low_pass(cutoff, 1000.0), np.full(100, value), at_rest=value)
    assert np.allclose(out, value, rtol=1e-9, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(cutoffs)
def test_gain_is_one_at_rest_and_minus_3_db_at_the_cutoff(cutoff):
    sections = low_pass(cutoff, 1000.0)
    sos = np.insert(sections, 3, 1.0, axis=1)
    _, response = sosfreqz(sos, [0.0, cutoff], fs=1000.0)
    assert abs(response[0]) == pytest.approx(1.0, rel=1e-9)
    assert abs(response[1]) == pytest.approx(np.sqrt(0.5), rel=1e-6)


def test_it_is_the_filter_that_scipy_designed():
    from scipy.signal import bessel, sosfilt

    signal = np.random.default_rng(0).normal(0.0, 1.0, 300)
    expected = sosfilt(bessel(4, 80.0, fs=1000.0, norm="mag", output="sos"), signal)
    assert np.allclose(filtered(low_pass(80.0, 1000.0), signal), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("cutoff", [10.0, 40.0, 100.0])
def test_a_ramp_comes_out_late_by_the_delay_it_states(cutoff):
    rate = 1000.0
    sections = low_pass(cutoff, rate)
    t = np.arange(2000) / rate
    out = filtered(sections, t)
    assert t[-1] - out[-1] == pytest.approx(delay_s(sections, rate), rel=1e-6)
    assert delay_s(sections, rate) > 0


@settings(max_examples=20, deadline=None)
@given(cutoffs, st.floats(-5.0, 5.0))
def test_position_and_force_in_proportion_stay_in_proportion(cutoff, stiffness):
    """Both go through the same filter: a spring's stiffness is the same after it."""
    sections = low_pass(cutoff, 1000.0)
    position = np.random.default_rng(1).normal(0.0, 1.0, 200).cumsum()
    assert np.allclose(
        filtered(sections, stiffness * position), stiffness * filtered(sections, position), rtol=0, atol=1e-9
    )


def test_a_step_hardly_overshoots():
    """An overshoot would be a reversal that never happened."""
    for cutoff, most in ((10.0, 1.01), (50.0, 1.015), (100.0, 1.025)):
        out = filtered(low_pass(cutoff, 1000.0), np.ones(600))
        assert out.max() < most and out[-1] == pytest.approx(1.0, abs=1e-6)


def test_none_passes_everything():
    sections = low_pass(0.0, 1000.0)
    signal = np.random.default_rng(0).normal(0.0, 1.0, 50)
    assert np.array_equal(filtered(sections, signal, at_rest=3.0), signal)
    assert delay_s(sections, 1000.0) == 0.0


@pytest.mark.parametrize("cutoff", [-1.0, 400.1, 1e6, float("nan"), float("inf")])
def test_cutoffs_beyond_the_rate_are_refused(cutoff):
    with pytest.raises(ConfigError, match=r"0\.4 of the rate"):
        low_pass(cutoff, 1000.0)
