"""Each kind of reference by itself: where it turns, how fast it is, what it follows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.control.references import Reference, check
from rtcomp.errors import LimitError

SINE = {"kind": "sine", "amplitude": 1e-3, "frequency": 1.0}


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
@given(st.floats(1e-6, 1e-2), st.floats(0.1, 20.0), st.floats(0.01, 1.0))
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
