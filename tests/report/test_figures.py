"""Figures: right numbers in right units, the same colours everywhere, and no data that breaks them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.report import palette
from rtcomp.report.figures import (
    Curve,
    Figures,
    error_bars_figure,
    execution_figure,
    first_reversal,
    force_figure,
    lateness_figure,
    learning_figure,
    loop_figure,
    overlay_figure,
    position_figure,
    rms_and_peak,
    tracking_figure,
    virgin_curve,
    virgin_figure,
)

FAMILIES: dict[str, Callable[[np.ndarray], go.Figure]] = {
    "position": lambda y: position_figure(np.arange(len(y)) * 1e-3, y, y + 1e-6),
    "position alone": lambda y: position_figure(np.arange(len(y)) * 1e-3, y),
    "force": lambda y: force_figure(np.arange(len(y)) * 1e-3, y, y * 1.01),
    "loop": lambda y: loop_figure(y, y * 2.0, y * 2.1, virgin_rows=len(y) // 3, held_out_percent=1.0),
    "loop against noise": lambda y: loop_figure(np.arange(float(len(y))), y),
    "virgin": lambda y: virgin_figure(np.abs(y) + 1e-7, y, reached=y > 0.0, truth=(np.abs(y), y)),
    "learning": lambda y: learning_figure([Curve("a", np.arange(len(y)), y)], levels={"five": 5.0}),
    "learning, log": lambda y: learning_figure([Curve("a", np.arange(len(y)), y)], log_x=True),
    "tracking": lambda y: tracking_figure((np.arange(len(y)), y), (np.arange(len(y)), y / 50.0)),
    "tracking, one run": lambda y: tracking_figure(None, (np.arange(len(y)), y)),
    "bars": lambda y: error_bars_figure({"without": rms_and_peak(y), "with": rms_and_peak(y / 9.0)}),
    "lateness": lambda y: lateness_figure(y, period_us=1000.0),
    "lateness alone": lambda y: lateness_figure(y),
    "execution": lambda y: execution_figure(np.abs(y), period_us=1000.0),
    "overlay": lambda y: overlay_figure(
        [Curve("a", y, y), Curve("b", y, -y, "model")],
        x_title="Travel", x_unit="m", y_title="Force", y_unit="N", log_x=True, log_y=True,
    ),
}  # fmt: skip

AWKWARD: dict[str, np.ndarray] = {
    "empty": np.empty(0),
    "one": np.array([1e-6]),
    "one NaN": np.array([np.nan]),
    "two": np.array([0.0, 1e-6]),
    "zeros": np.zeros(50),
    "constant": np.full(50, 0.123456),
    "negative": np.full(50, -3.0),
    "all NaN": np.full(50, np.nan),
    "gaps": np.where(np.arange(20_000) % 3000 < 200, np.nan, np.sin(np.arange(20_000) / 100.0)),
    "infinite": np.array([1.0, np.inf, -np.inf, 2.0, 3.0]),
    "far tail": np.concatenate((np.full(5_000, 2.0), [1e7])),
    "huge": np.array([1e300, -1e300, 1.0]),
    "tiny": np.array([1e-300, 2e-300, 3e-300]),
}


@pytest.mark.parametrize("data", AWKWARD)
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.filterwarnings("error")
def test_no_data_breaks_a_figure(family: str, data: str) -> None:
    with np.errstate(over="ignore", invalid="ignore"):  # of the test's own arithmetic on 1e300 and infinity
        figure = FAMILIES[family](AWKWARD[data])
    text = figure.to_json()
    assert len(text) < 900_000
    assert "Infinity" not in text
    y_range = figure.layout.yaxis.range
    assert y_range is None or np.isfinite(y_range).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_nothing_to_show_is_said(family: str) -> None:
    figure = FAMILIES[family](np.empty(0))
    assert [a.text for a in figure.layout.annotations if a.text.startswith("no ")]


def named(figure: go.Figure, name: str) -> Any:
    (found,) = (t for t in figure.data if t.name == name)
    return found


@given(st.integers(-8, 1), st.integers(-6, 3))
@settings(max_examples=25, deadline=None)
def test_drawn_numbers_are_the_data_in_the_unit_of_the_axis(power: int, seconds: int) -> None:
    exponent = {
        "fs": -15,
        "ps": -12,
        "ns": -9,
        "µs": -6,
        "ms": -3,
        "s": 0,
        "nm": -9,
        "µm": -6,
        "mm": -3,
        "m": 0,
    }
    time, position = np.linspace(0, 3.0 * 10.0**seconds, 300), np.linspace(-1, 2, 300) * 10.0**power
    figure = position_figure(time, position)
    for axis, shown, true in (
        (figure.layout.xaxis, figure.data[0].x, time),
        (figure.layout.yaxis, figure.data[0].y, position),
    ):
        unit = axis.title.text.split("(")[1].rstrip(")")
        assert np.asarray(shown, dtype=float) * 10.0 ** exponent[unit] == pytest.approx(true, rel=1e-6)
        assert np.max(np.abs(np.asarray(shown, dtype=float))) >= 0.999


def test_axes_name_what_they_show_with_its_unit() -> None:
    figure = loop_figure(np.linspace(0, 3e-3, 9), np.linspace(0, 2e-2, 9), unit="rad", force_unit="N m")
    assert figure.layout.xaxis.title.text == "Position (mrad)"
    assert figure.layout.yaxis.title.text == "Force (mN·m)"


def test_the_same_thing_has_the_same_colour_in_every_figure() -> None:
    t, y = np.arange(100.0), np.sin(np.arange(100.0))
    assert named(position_figure(t, y, y), "measured").line.color == palette.MEASURED
    assert named(position_figure(t, y, y), "reference").line.color == palette.REFERENCE
    for figure in (force_figure(t, y, y), loop_figure(t, y, y)):
        assert named(figure, "measured").line.color == palette.MEASURED
        assert named(figure, "model").line.color == palette.MODEL
    tracking = tracking_figure((t, y), (t, y))
    assert [trace.line.color for trace in tracking.data] == [palette.WITHOUT, palette.WITH, palette.WITH]
    bars = error_bars_figure({"without": Figures(2.0, 3.0), "with": Figures(1.0, 2.0)})
    assert [trace.marker.color for trace in bars.data] == [palette.WITHOUT] * 2 + [palette.WITH] * 2


def test_every_colour_in_every_figure_has_a_dark_one() -> None:
    def colours(node: Any) -> set[str]:
        if isinstance(node, dict):
            return set().union(*(colours(v) for v in node.values()))
        if isinstance(node, list | tuple):
            return set().union(*(colours(v) for v in node))
        return {node} if isinstance(node, str) and node.startswith("#") else set()

    for family in FAMILIES.values():
        for data in ("gaps", "far tail", "empty"):
            assert colours(family(AWKWARD[data]).to_plotly_json()) <= set(palette.DARK)


def test_a_gap_stays_a_gap_and_a_spike_a_spike_in_a_million_samples() -> None:
    time = np.arange(1_000_000) * 1e-4
    position = 1e-6 * np.sin(time)
    position[400_000:450_000] = np.nan
    position[123_457] = 9e-6
    drawn = position_figure(time, position, points=1000).data[0]
    assert len(drawn.y) <= 1000
    assert np.nanmax(drawn.y) == pytest.approx(9.0)
    assert np.isnan(drawn.y).any()


def test_small_motion_far_from_zero_keeps_its_shape() -> None:
    position = 0.2 + 1e-9 * np.sin(np.arange(500) / 20.0)
    drawn = position_figure(np.arange(500.0), position).data[0].y
    assert np.asarray(drawn, dtype=float) / 1e3 == pytest.approx(position, abs=1e-14)


def test_arrays_of_different_length_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="time 3, measured 4"):
        position_figure(np.zeros(3), np.zeros(4))
    with pytest.raises(ValueError, match="position 3"):
        loop_figure(np.zeros(3), np.zeros(4))
    with pytest.raises(ValueError, match="needs the measured"):
        loop_figure(np.zeros(3), None)
    with pytest.raises(ValueError, match="widths 2, weights 3"):
        virgin_figure(np.ones(2), np.ones(3))


def test_the_virgin_part_of_a_loop_is_a_line_of_its_own_that_joins_the_rest() -> None:
    x = np.concatenate((np.linspace(0, 1, 50), np.linspace(1, -1, 100)[1:]))
    figure = loop_figure(x, np.sqrt(np.abs(x)), virgin_rows=50)
    virgin, rest = named(figure, "measured, virgin"), named(figure, "measured")
    assert virgin.line.dash == "dot" and rest.line.dash == "solid"
    assert (virgin.x[-1], virgin.y[-1]) == (rest.x[0], rest.y[0])
    assert virgin.x[0] == 0.0 and rest.x[-1] == -1.0
    assert virgin.mode == rest.mode == "lines"


@given(st.integers(20, 400), st.sampled_from([-1.0, 1.0]), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_the_first_reversal_is_found_through_noise(rows: int, way: float, seed: int) -> None:
    rest = np.zeros(rows // 4)
    motion = np.concatenate((rest, np.linspace(0, 1, rows), np.linspace(1, -1, 2 * rows)[1:]))
    noise = 2e-3 * np.random.default_rng(seed).uniform(-1, 1, motion.size)
    true = rest.size + rows
    assert first_reversal(way * motion) == true
    assert abs(first_reversal(way * (motion + noise)) - true) <= 1 + rows // 100


@pytest.mark.parametrize(
    "motion", [[], [1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 2.0, 3.0], [0.0, np.nan, 1.0, 0.0]]
)
def test_motion_that_never_turns_back_has_no_virgin_part(motion: list[float]) -> None:
    assert first_reversal(motion) == 0


def test_a_noisy_loop_is_drawn_whole_and_not_cut_for_its_noise() -> None:
    t = np.arange(9000) * 1e-3
    x = np.exp(-t / 6) * np.sin(5 * t)
    noisy = x + 3e-3 * np.random.default_rng(2).standard_normal(t.size)
    assert not any("last" in note for note in loop_figure(x, noisy, x).layout.meta["notes"])


def test_a_long_loop_says_that_only_its_end_is_drawn() -> None:
    phase = np.arange(300_000) / 50.0
    figure = loop_figure(np.cos(phase), np.sin(phase))
    assert any("last" in note and "of 300000" in note for note in figure.layout.meta["notes"])


@given(
    st.lists(st.tuples(st.floats(1e-7, 1e-5), st.floats(0.0, 1e6)), min_size=1, max_size=12),
    st.floats(0.05, 0.95),
)
@settings(max_examples=25, deadline=None)
def test_the_virgin_curve_is_what_the_operator_does_from_rest(
    intervals: list[tuple[float, float]], part: float
) -> None:
    widths, weights = np.array(intervals).T
    travel, force = virgin_curve(widths, weights)
    ramp = np.concatenate((travel, [part * travel[-1]]))
    ramp.sort()
    expected = np.interp(ramp, travel, force)
    response = HysteresisModel(IntervalBasis(widths), weights).response(ramp)
    assert response == pytest.approx(expected, abs=1e-9 * max(1.0, float(force[-1])))


def test_intervals_never_reached_are_hollow_and_said() -> None:
    figure = virgin_figure(np.full(5, 2e-6), np.arange(5.0, 0.0, -1.0) * 1e5, reached=[1, 1, 0.4, 0, 0])
    dead = [t for t in figure.data if t.name == "never reached" and t.mode == "markers"]
    live = [t for t in figure.data if t.name == "model" and t.mode == "markers"]
    assert len(dead[0].x) == 2 and dead[0].marker.color == palette.PAPER
    assert len(live[0].x) == 3 and live[0].marker.color == palette.MODEL
    assert live[0].x == pytest.approx([1.0, 2.0, 3.0])
    assert any("2 of 5 intervals were never reached" in note for note in figure.layout.meta["notes"])


def test_interval_boundaries_stand_at_half_widths() -> None:
    figure = virgin_figure([2e-6, 4e-6, 6e-6], [1e6, 1e5, 1e4])
    stems = np.asarray(named(figure, "interval boundaries").x, dtype=float)
    assert stems[~np.isnan(stems)] == pytest.approx([1, 1, 3, 3, 6, 6])


def test_thousands_of_intervals_stay_drawable() -> None:
    figure = virgin_figure(np.full(5000, 1e-8), np.ones(5000))
    assert len(figure.to_json()) < 400_000
    assert len(named(figure, "interval boundaries").x) <= 3 * 120


def test_learning_is_on_a_log_axis_with_plain_ticks_and_levels() -> None:
    errors = [40.0, 3.0, 0.9, 0.0, np.nan, 0.7]
    figure = learning_figure([Curve("RLS", range(1, 7), errors)], levels={"paper": 5.0})
    assert figure.layout.yaxis.type == "log"
    assert {"1", "5", "10"} <= set(figure.layout.yaxis.ticktext)
    assert figure.data[0].name == "RLS: 0.7 %"
    assert np.isnan(np.asarray(figure.data[0].y, dtype=float)).sum() == 2
    (level,) = figure.layout.annotations
    assert level.y == pytest.approx(np.log10(5.0)) and level.text == "paper: 5 %"
    low, high = figure.layout.yaxis.range
    assert low < np.log10(0.7) and high > np.log10(40.0)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=50))
def test_rms_and_peak_are_those_of_the_finite_part(values: list[float]) -> None:
    size = rms_and_peak([*values, np.nan, np.inf])
    assert size.rms == pytest.approx(np.sqrt(np.mean(np.square(values))))
    assert size.peak == max(abs(v) for v in values)


def test_tracking_shows_both_sizes_and_the_small_one_enlarged() -> None:
    t = np.arange(1000) * 1e-3
    e = 2e-6 * np.sign(np.sin(9 * t) + 1e-12)
    figure = tracking_figure((t, e), (t, e / 100.0))
    assert figure.data[0].name == "without compensation: rms 2 µm, peak 2 µm"
    assert figure.data[1].name == "with compensation: rms 20 nm, peak 20 nm"
    assert figure.layout.yaxis2.title.text.endswith("(nm)")
    assert np.max(figure.data[2].y) == pytest.approx(20.0)
    assert np.max(figure.data[1].y) == pytest.approx(0.02)


@pytest.mark.parametrize("figure_of", [lateness_figure, execution_figure])
def test_every_tick_is_in_the_histogram_and_its_quantiles_are_named(
    figure_of: Callable[..., go.Figure],
) -> None:
    rng = np.random.default_rng(5)
    us = np.concatenate((rng.lognormal(3.5, 0.3, 20_000), [40_000.0]))
    figure = figure_of(us, period_us=1000.0)
    # The outline is: foot, every bin twice (an empty one at the floor of the axis, a half), foot.
    bins = np.asarray(figure.data[0].y, dtype=float)[1:-1:2]
    assert bins[bins >= 1.0].sum() == us.size
    texts = [a.text for a in figure.layout.annotations]
    assert [t.split()[0] for t in texts] == ["p50", "p99", "p99.9", "max", "period"]
    assert texts[3] == "max 40 ms" and texts[4] == "period 1 ms"
    assert figure.layout.yaxis.type == "log"
    right = 10.0 ** figure.layout.xaxis.range[1] if figure.layout.xaxis.type == "log" else np.inf
    assert right >= np.max(figure.data[0].x) * 0.999


def test_names_from_files_are_text_not_markup() -> None:
    evil = '<a href="javascript:alert(1)">x</a>'
    figures = [
        overlay_figure([Curve(evil, [0, 1], [0, 1])], x_title=evil, y_title=evil),
        learning_figure([Curve(evil, [0, 1], [1, 2])], levels={evil: 1.0}),
        error_bars_figure({evil: Figures(1.0, 2.0)}),
    ]
    for figure in figures:
        assert "<a" not in figure.to_json().replace("\\u003c", "<")
