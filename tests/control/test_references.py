from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtcomp.control.references import Reference, check
from rtcomp.errors import ConfigError, LimitError, RecordingError

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


def test_minor_loops_repeat_and_turn_where_told():
    loops = [{"position": 2e-4, "size": 1e-4, "branch": "up"}, {"position": -3e-4, "size": 5e-5}]
    entry = {"kind": "minor-loops", "amplitude": 1e-3, "frequency": 1.0, "loops": loops, "duration": 20.0}
    r = Reference.from_dict(entry)
    t = np.linspace(3.0, 3.0 + r.period, 400001)
    x, v, _ = r.evaluate(t)
    assert np.allclose(x, r.evaluate(t + r.period)[0], atol=1e-12)
    turns = x[1:-1][np.diff(np.sign(v[:-1])) != 0]
    wanted = [-1e-3, -3e-4, -3.5e-4, 2e-4, 1e-4, 1e-3, -3e-4, -2.5e-4]
    assert sorted(np.round(turns, 9)) == pytest.approx(sorted(wanted), abs=1e-8)


def test_nested_reversals_turn_exactly_where_told_and_end_at_rest_in_the_middle():
    entry = {
        "kind": "nested-reversals",
        "amplitude": 1e-4,
        "ratio": 0.5,
        "count": 4,
        "speed": 1e-4,
        "offset": 2e-5,
    }
    r = Reference.from_dict(entry)
    x, v, _ = r.evaluate(np.linspace(0.0, r.duration, 300001))
    way = np.sign(np.diff(x))
    turns = x[1:-1][way[1:] * way[:-1] < 0]
    assert turns - 2e-5 == pytest.approx([1e-4, -5e-5, 2.5e-5, -1.25e-5], abs=1e-9)
    assert np.abs(v).max() == pytest.approx(1e-4, rel=1e-6)
    later = r.evaluate(np.array([r.duration, r.duration + 5.0]))
    assert later[0].tolist() == [2e-5, 2e-5] and not later[1].any() and not later[2].any()


def test_equal_time_strokes_take_that_time():
    entry = {"kind": "nested-reversals", "amplitudes": [3e-6, 2e-6, 1e-6], "stroke_time": 0.25}
    assert Reference.from_dict(entry).duration == pytest.approx(1.0)


@settings(max_examples=20, deadline=None)
@given(amplitudes, frequencies, st.floats(0.01, 1.0))
def test_triangle_has_constant_speed_between_its_arcs(amplitude, frequency, corner):
    r = Reference.from_dict(
        {
            "kind": "triangle",
            "amplitude": amplitude,
            "frequency": frequency,
            "corner": corner,
            "duration": 100.0,
        }
    )
    t = r.fade + np.linspace(0.0, r.period, 20001)
    x, v, a = r.evaluate(t)
    speed = 4 * amplitude * frequency / (1 - corner / 2)
    assert np.abs(v).max() == pytest.approx(speed, rel=1e-3)
    assert x.max() == pytest.approx(amplitude, rel=1e-5)
    assert np.mean(a != 0.0) == pytest.approx(corner, abs=2e-3)


def test_sine_is_the_sine():
    r = Reference.from_dict({"kind": "sine", "amplitude": 2.0, "frequency": 0.5, "phase": 0.4, "fade": 1.0})
    t = np.linspace(1.0, 9.0, 999)
    w = math.pi
    x, v, a = r.evaluate(t)
    assert np.allclose(x, 2 * np.sin(w * t + 0.4))
    assert np.allclose(v, 2 * w * np.cos(w * t + 0.4))
    assert np.allclose(a, -2 * w * w * np.sin(w * t + 0.4))


def test_schroeder_phases_keep_the_crest_low():
    r = Reference.from_dict(
        {
            "kind": "multisine",
            "band": {"low": 1.0, "high": 20.0, "count": 20},
            "amplitude": 1e-3,
            "duration": 9.0,
        }
    )
    x = r.evaluate(np.linspace(2.0, 3.0, 10001))[0]
    assert np.abs(x).max() == pytest.approx(1e-3, rel=1e-3)
    assert np.abs(x).max() / np.sqrt(np.mean(x**2)) < 2.0  # 20 sines in phase: 6.3


def test_hold_moves_there_and_stays():
    r = Reference.from_dict({"kind": "hold", "offset": 1e-3, "start": 2e-4, "fade": 0.5, "duration": 2.0})
    x, v, a = r.evaluate(np.linspace(0.0, 3.0, 301))
    assert x[0] == 2e-4 and (x[51:] == 1e-3).all() and not v[51:].any() and not a[51:].any()
    assert r.period is None and r.duration == 2.0


@pytest.mark.parametrize("interpolation", ["cubic", "pchip"])
def test_file_is_followed_and_rests_at_both_ends(tmp_path, interpolation):
    t = np.linspace(5.0, 7.0, 41)
    x = 1e-3 * np.sin(2 * math.pi * (t - 5.0))
    path = tmp_path / "motion.csv"
    path.write_text(
        "note, time ,reference\n" + "".join(f"0,{a:.17g},{b:.17g}\n" for a, b in zip(t, x, strict=True))
    )
    entry = {"kind": "file", "path": "motion.csv", "interpolation": interpolation, "delay": 0.5}
    r = Reference.from_dict(entry, start=3e-4, folder=tmp_path)
    assert r.duration == pytest.approx(2.5)
    fade = r.delay + r.fade
    rows = t - 5.0 + 0.5
    assert r.evaluate(0.0)[0] == 3e-4
    after = rows > fade
    assert np.allclose(r.evaluate(rows)[0][after], x[after], atol=1e-15)
    fine = np.linspace(-0.2, 2.7, 290001)
    px, pv, pa = r.evaluate(fine)
    assert (
        np.abs(px - px[0] - np.concatenate([[0], np.cumsum(np.diff(fine) * (pv[1:] + pv[:-1]) / 2)])).max()
        < 1e-9
    )
    assert np.abs(pv).max() <= r.peak_speed and np.abs(pa).max() <= r.peak_acceleration
    ends = r.evaluate(np.array([0.4, 2.6]))
    assert not ends[1].any() and not ends[2].any()
    if interpolation == "pchip":
        assert px.max() <= x.max() + 1e-12
    with pytest.raises(LimitError, match="speed"):
        check(r, speed=1e-4)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t,reference\n0,1\n", "column 'time' is missing; found t, reference"),
        ("time,reference\n0,0\n1,1\n", "has 2 rows"),
        ("time,reference\n0,0\n1,1\n1,2\n3,3\n", "row 4; it must increase"),
        ("time,reference\n0,0\n1,nan\n2,2\n3,3\n", "row 3 is not finite"),
        ("time,reference\n0,0\n1,a\n2,2\n3,3\n", "no two numbers"),
        ("time,reference\n0,0\n1\n2,2\n3,3\n", "no two numbers"),
        (b"\x89HDF\r\n\x1a\n\xff\xfe", "is not text"),
    ],
)
def test_a_file_that_is_no_reference_is_refused_in_one_line(tmp_path, text, says):
    path = tmp_path / "bad.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(RecordingError) as caught:
        Reference.from_dict({"kind": "file", "path": str(path)})
    assert says in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(RecordingError, match="cannot be read"):
        Reference.from_dict({"kind": "file", "path": str(tmp_path / "none.csv")})


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_motion)
def test_dictionary_round_trip(entry):
    r = Reference.from_dict(entry)
    again = Reference.from_dict(r.to_dict())
    t = np.linspace(0.0, 3.0, 500)
    for one, other in zip(r.evaluate(t), again.evaluate(t), strict=True):
        assert np.array_equal(one, other)
    assert (r.duration, r.period, r.span) == (again.duration, again.period, again.span)


SINE = {"kind": "sine", "amplitude": 1e-3, "frequency": 1.0}


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ({"amplitude": 1.0}, "reference.kind is missing"),
        ({"kind": "sinus", "amplitude": 1.0, "frequency": 1.0}, "did you mean 'sine'"),
        ({**SINE, "amplitude": -1.0}, "amplitude is -1; allowed is (0, 1000]"),
        ({**SINE, "frequency": 0.0}, "frequency is 0"),
        ({**SINE, "amplitude": "1"}, "must be a number"),
        ({**SINE, "amplitude": math.nan}, "must be a finite number"),
        ({**SINE, "frequencey": 1.0}, "did you mean reference.frequency"),
        ({"kind": "sine", "amplitude": 1e-3}, "reference.frequency"),
        ({"kind": "multisine"}, "give frequencies and amplitudes"),
        ({"kind": "multisine", "frequencies": [1.0], "amplitudes": [1.0, 2.0]}, "amplitudes has 2 entries"),
        (
            {"kind": "multisine", "band": {"low": 2.0, "high": 1.0, "count": 3}, "amplitude": 1.0},
            "below high",
        ),
        ({"kind": "nested-reversals", "amplitude": 1.0}, "either speed"),
        ({"kind": "nested-reversals", "speed": 1.0}, "either amplitudes"),
        (
            {
                "kind": "minor-loops",
                "amplitude": 1.0,
                "frequency": 1.0,
                "loops": [{"position": 0.9, "size": 2.0}],
            },
            "inside +-1 m",
        ),
        ({"kind": "minor-loops", "amplitude": 1.0, "frequency": 1.0, "loops": []}, "has 0 entries"),
    ],
)
def test_wrong_settings_end_in_one_line_naming_the_key(entry, says):
    with pytest.raises(ConfigError) as caught:
        Reference.from_dict(entry)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_check_says_value_allowed_and_what_to_change():
    r = Reference.from_dict({**SINE, "duration": 5.0})
    check(r, stroke=(-1e-3, 1e-3), speed=r.peak_speed, acceleration=r.peak_acceleration)
    for limits, words in [
        ({"stroke": (-5e-4, 5e-4)}, ["0.001", "-0.0005 to 0.0005 m", "amplitude"]),
        ({"speed": 1e-3}, ["speed reaches 0.0", "allowed is 0.001 m/s", "frequency"]),
        ({"acceleration": 1e-2}, ["acceleration reaches 0.0", "allowed is 0.01 m/s^2", "frequency"]),
    ]:
        with pytest.raises(LimitError) as caught:
            check(r, **limits)
        assert all(word in str(caught.value) for word in words), caught.value
        assert "\n" not in str(caught.value)


def test_the_position_found_takes_the_place_of_the_start():
    r = Reference.from_dict({**SINE, "start": 1.0}, start=2e-5)
    assert r.evaluate(-3.0)[0] == 2e-5
    assert r.to_dict()["start"] == 2e-5


def test_scalar_and_any_shape_of_times():
    r = Reference.from_dict(SINE)
    assert all(part.shape == () for part in r.evaluate(0.7))
    assert all(part.shape == (3, 4) for part in r.evaluate(np.ones((3, 4))))
    nested = Reference.from_dict({"kind": "nested-reversals", "amplitude": 1.0, "speed": 1.0})
    assert all(part.shape == () for part in nested.evaluate(0.7))
