"""What every reference keeps to, whatever its kind and numbers: derivatives, rest, bounds, repetition."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtcomp.control.references import Reference

amplitudes = st.floats(1e-6, 1e-2)
frequencies = st.floats(0.1, 20.0)
offsets = st.floats(-1e-3, 1e-3)
phases = st.floats(-7.0, 7.0)


@st.composite
def periodic(draw):
    entry = {
        "kind": draw(st.sampled_from(["triangle", "sine", "multisine"])),
        "offset": draw(offsets),
        "start": draw(offsets),
        "delay": draw(st.sampled_from([0.0, 0.3])),
    }
    if entry["kind"] == "multisine":
        if draw(st.booleans()):
            low = draw(st.sampled_from([0.5, 1.0]))
            count = draw(st.integers(2, 12))
            entry["band"] = {"low": low, "high": low * count, "count": count}
            entry["amplitude"] = draw(amplitudes)
        else:
            n = draw(st.integers(1, 4))
            entry["frequencies"] = [draw(st.sampled_from([0.5, 1.0, 1.5, 2.5, 4.0])) for _ in range(n)]
            entry["amplitudes"] = [draw(amplitudes) for _ in range(n)]
            entry["phases"] = [draw(phases) for _ in range(n)]
        return entry
    entry |= {"amplitude": draw(amplitudes), "frequency": draw(frequencies), "phase": draw(phases)}
    if entry["kind"] == "triangle":
        entry["corner"] = draw(st.floats(0.02, 1.0))
    if draw(st.booleans()):
        entry["fade"] = draw(st.floats(0.2, 3.0))
    return entry


@st.composite
def stroked(draw):
    entry = {
        "kind": draw(st.sampled_from(["nested-reversals", "minor-loops"])),
        "offset": draw(offsets),
        "start": draw(offsets),
        "delay": draw(st.sampled_from([0.0, 0.3])),
        "shape": draw(st.sampled_from(["triangle", "sine"])),
        "corner": draw(st.floats(0.05, 1.0)),
    }
    if entry["kind"] == "minor-loops":
        entry["amplitude"] = 1e-3
        entry["frequency"] = draw(frequencies)
        entry["loops"] = [
            {
                "position": draw(st.floats(-4e-4, 4e-4)),
                "size": draw(st.floats(1e-5, 5e-4)),
                "branch": draw(st.sampled_from(["up", "down", "both"])),
            }
            for _ in range(draw(st.integers(1, 4)))
        ]
        return entry
    if draw(st.booleans()):
        entry["amplitudes"] = draw(st.lists(amplitudes, min_size=1, max_size=6))
    else:
        entry |= {"amplitude": draw(amplitudes), "ratio": draw(st.floats(0.3, 0.95)), "count": 7}
    entry |= draw(st.sampled_from([{"speed": 1e-3}, {"stroke_time": 0.4}]))
    entry["direction"] = draw(st.sampled_from([1, -1]))
    return entry


any_motion = st.one_of(periodic(), stroked())


def times(reference, n=20001):
    return np.linspace(-0.1, reference.duration + 0.1, n)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_motion, st.integers(0, 1000))
def test_velocity_and_acceleration_are_the_derivatives(entry, seed):
    """Trapezoid of v gives x, of a gives v: over random windows, to second order of a fine step."""
    r = Reference.from_dict(entry)
    window = min(r.duration, 2.0)
    begin = np.random.default_rng(seed).uniform(-0.05, r.duration - 0.5 * window)
    t = np.linspace(begin, begin + window, 200001)
    x, v, a = r.evaluate(t)
    h = t[1] - t[0]
    gained = np.concatenate([[0.0], np.cumsum(0.5 * h * (v[1:] + v[:-1]))])
    assert np.abs(x - x[0] - gained).max() <= 1e-6 * np.ptp(x) + r.peak_acceleration * h * h * 200 + 1e-15
    gained = np.concatenate([[0.0], np.cumsum(0.5 * h * (a[1:] + a[:-1]))])
    # Where an acceleration jumps inside a step, half a step of it is lost.
    jumps = np.count_nonzero(np.abs(np.diff(a)) > 0.02 * r.peak_acceleration) + 2
    allowed = r.peak_acceleration * h * (jumps + 1) + 1e-6 * r.peak_speed
    assert np.abs(v - v[0] - gained).max() <= allowed


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_motion)
def test_starts_at_rest_never_jumps_and_keeps_its_bounds(entry):
    r = Reference.from_dict(entry)
    t = times(r)
    x, v, a = r.evaluate(t)
    assert np.isfinite(x).all() and np.isfinite(v).all() and np.isfinite(a).all()
    assert np.abs(v).max() <= r.peak_speed * (1 + 1e-9)
    assert np.abs(a).max() <= r.peak_acceleration * (1 + 1e-9)
    low, high = r.span
    slack = 1e-12 + 1e-9 * (high - low)
    assert low - slack <= x.min() and x.max() <= high + slack
    assert np.abs(np.diff(x)).max() <= r.peak_speed * (t[1] - t[0]) * (1 + 1e-9) + 1e-15
    assert np.abs(np.diff(v)).max() <= r.peak_acceleration * (t[1] - t[0]) * (1 + 1e-9) + 1e-15
    at_rest = t <= r.delay
    assert (x[at_rest] == entry["start"]).all()
    assert not v[t < r.delay].any() and not a[t < r.delay].any()


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_motion)
def test_bounds_are_reached(entry):
    r = Reference.from_dict(entry)
    end = max(r.duration, r.delay + r.fade + 2.0 * (r.period or 0.0))  # the way to a cycle, and the cycle
    x, v, a = r.evaluate(np.linspace(0.0, end, 400001))
    assert np.abs(v).max() >= 0.98 * r.peak_speed
    assert x.max() >= r.span[1] - 0.01 * np.ptp(r.span) and x.min() <= r.span[0] + 0.01 * np.ptp(r.span)
    if entry["kind"] != "minor-loops":
        assert np.abs(a).max() >= 0.95 * r.peak_acceleration


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(periodic())
def test_repeats_after_the_start(entry):
    r = Reference.from_dict(entry)
    t = r.delay + r.fade + np.linspace(0.0, 2.0, 301)
    for one, next_turn in zip(r.evaluate(t), r.evaluate(t + 3 * r.period), strict=True):
        assert np.allclose(one, next_turn, rtol=0, atol=1e-7 * np.abs(one).max() + 1e-12)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_motion)
def test_dictionary_round_trip(entry):
    r = Reference.from_dict(entry)
    again = Reference.from_dict(r.to_dict())
    t = np.linspace(0.0, 3.0, 500)
    for one, other in zip(r.evaluate(t), again.evaluate(t), strict=True):
        assert np.array_equal(one, other)
    assert (r.duration, r.period, r.span) == (again.duration, again.period, again.span)
