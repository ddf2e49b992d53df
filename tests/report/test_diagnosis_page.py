"""The report of a diagnosis says what the diagnosis says, and draws it."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up
import numpy as np
import pytest

from rtcomp.diagnosis.result import Diagnosis, Named, Place, Value
from rtcomp.report.columns import Columns, render_columns
from rtcomp.report.diagnosis_page import diagnosed_page
from rtcomp.report.diagnosis_text import diagnosis_text
from rtcomp.report.diagnosis_words import share_explained, within
from rtcomp.report.figures.candidates import Bar, candidates_figure, fit_figure
from rtcomp.report.figures.residual import named_figure, place_figure, residual_figure
from rtcomp.report.page import Page, Section, render_page, write_page

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
ALL = [made_up.missing, made_up.consistent, made_up.unexplained]


def page_of(found: Diagnosis) -> Page:
    return diagnosed_page(found, ["log.csv"], "stage.yaml", "out/d")


def section(page: Page, begins: str) -> Section:
    return next(s for s in page.sections if s.heading.startswith(begins))


def cells(page: Page, begins: str) -> dict[str, list[str]]:
    table = section(page, begins).table
    assert table is not None
    return {row[0]: list(row[1:]) for row in table.rows}


def test_the_verdict_comes_first_and_the_four_errors_after_it() -> None:
    found = made_up.missing()
    page = page_of(found)
    assert page.verdict[0] == found.sentence()
    assert "Position, period 0.611 mm" in page.verdict[1]
    assert [row.value for row in page.summary[:4]] == pytest.approx([13.1, 12.8, 0.93, 0.81])
    assert page.notes == found.notes
    assert "mass: 2.11" in page.configuration and "cogging" in page.configuration


def test_each_place_and_each_effect_has_its_figure() -> None:
    found = made_up.missing()
    page = page_of(found)
    for place in found.where:
        part = section(page, f"Where: against {place.axis}")
        assert place.says[1:] in part.prose and part.figure is not None
    part = section(page, "Named: cogging")
    assert "83 %" in part.prose and part.figure is not None
    named = found.effects[0].curve
    assert named is not None
    data, curve = part.figure.data
    assert np.asarray(data.y, float) == pytest.approx(1e3 * named[3], abs=1e-3)  # drawn in mN
    assert np.asarray(curve.y, float) == pytest.approx(1e3 * named[4], abs=1e-3)
    assert cells(page, "Named: cogging")["period"] == ["611.1 µm", "610.8 to 611.4 µm"]
    assert "cannot tell apart drive-offset, constant-force and gravity" in section(page, "Named: drive").prose
    assert "axis turned over" in section(page, "Named: drive").prose


def test_tables_hold_candidates_retuned_parameters_and_what_was_not_seen() -> None:
    found = made_up.missing()
    page = page_of(found)
    rows = cells(page, "Candidates")
    assert list(rows) == [k.name for k in found.candidates]
    assert rows["cogging"] == ["83 %", "41.0", "amplitude 12 mN", "named"]
    assert rows["constant-force"][3] == "cannot be told apart"
    assert rows["back-emf"][0] == "0 %"
    assert rows["resonance"] == ["", "", "", "cannot be seen; needs motion above 80 Hz"]
    table = section(page, "Candidates").table
    assert table is not None and [found.candidates[i].observable for i in table.muted] == [False, False]
    assert cells(page, "Retuned")["mass"] == ["2 kg", "2.11 kg", "2.09 to 2.13 kg", "+5.5 %"]
    assert list(cells(page, "What could not be seen")) == list(found.not_observable)


def test_the_next_experiment_is_drawn_with_the_command_that_runs_it() -> None:
    part = section(page_of(made_up.missing()), "The next experiment")
    assert "--reference out/d/reference.yaml" in part.prose and part.figure is not None
    drawn = np.asarray(part.figure.data[0].y, float)
    assert 150 < np.abs(drawn).max() <= 301  # um


def test_nothing_missing_says_so_without_empty_sections() -> None:
    found = made_up.consistent()
    page = page_of(found)
    agree = f"to {100.0 * found.fit.after:.2g} % of the force"
    assert found.fit.after > found.fit.floor
    assert list(page.verdict) == [f"Nothing is missing: simulation and recording agree {agree}."]
    quiet = replace(found, fit=replace(found.fit, after=found.fit.floor))
    assert quiet.sentence().endswith("agree within the noise.")
    assert page.tone == "good" and math.isnan(share_explained(found))
    headings = [s.heading for s in page.sections]
    assert not any(h.startswith(("Named", "Where", "Retuned", "The next")) for h in headings)
    assert "What could not be seen in this recording" in headings
    (would,) = [s for s in page.sections if s.heading == "The smallest that would have been seen"]
    assert would.table is not None
    assert [row[:2] for row in would.table.rows] == [
        ("cogging", "amplitude 12 mN"),
        ("inertia", "mass by 30 g"),
    ]
    assert "cogging amplitude 12 mN" in diagnosis_text(found, "out")


def test_what_no_entry_explains_is_not_shown_as_named() -> None:
    page = page_of(made_up.unexplained())
    assert page.tone == "poor" and "no entry of the catalogue" in page.verdict[0]
    headings = [s.heading for s in page.sections]
    assert "Named: cogging" in headings and "Something that no entry explains" in headings
    assert not any(h.startswith("Named: unexplained") for h in headings)


@pytest.mark.parametrize("make", ALL)
def test_the_terminal_says_the_verdict_first_and_names_everything(make: type) -> None:
    found = make()
    text = diagnosis_text(found, "out/d")
    lines = text.splitlines()
    assert lines[0] == found.sentence()
    assert max(map(len, lines)) <= 100
    for effect in found.effects:
        for name, value in effect.parameters.items():
            assert re.search(rf"  {name} \S+ \S+ \({re.escape(within(value, printed=False))}\)", text)
    assert ("Next" in text) == (found.next_experiment is not None)
    assert "noise alone 0.81 %" in text


def test_an_interval_shows_its_width() -> None:
    assert within(Value(6.111e-4, 6.1108e-4, 6.1112e-4, "m"), printed=False) == "611.08 to 611.12 um"
    assert within(Value(2.0, 1.0, 3.0, "kg"), printed=False) == "1 to 3 kg"
    assert within(Value(2.0, math.nan, 3.0, "kg"), printed=False) == ""
    assert within(Value(-0.33, -0.34, -0.32, "V"), printed=False) == "-340 to -320 mV"


def test_text_from_files_stays_text() -> None:
    found = made_up.missing(500)
    nasty = "<script>alert(1)</script>"
    found = replace(found, notes=[nasty], where=[replace(found.where[0], says=nasty)], not_observable=[nasty])
    html = render_page(diagnosed_page(found, [nasty], nasty, nasty))
    assert nasty not in html.replace("\\u003c", "<no>")


def test_a_rotary_axis_reads_in_its_units() -> None:
    found = made_up.missing(500)
    data = found.stage.to_dict()
    data["stage"]["axis"] = "rotary"
    place = replace(found.where[0], unit="rad")
    found = replace(found, stage=type(found.stage).from_dict(data), where=[place])
    figure = section(page_of(found), "Where: against position").figure
    assert figure is not None
    assert figure.layout.yaxis.title.text == "Residual force (N·m)"
    assert figure.layout.xaxis.title.text == "Position (µrad)"


def test_forces_with_the_sign_of_the_motion_are_told_from_those_as_they_are() -> None:
    found = made_up.missing(0)
    both = [replace(found.where[0], axis="position"), replace(found.where[0], axis="position", signed=True)]
    page = page_of(replace(found, where=both))
    plain, signed = (s for s in page.sections if s.heading.startswith("Where: against position"))
    assert signed.heading == f"{plain.heading}, with the sign of the motion"
    assert plain.figure is not None and signed.figure is not None
    assert plain.figure.layout.yaxis.title.text == "Residual force (N)"
    assert signed.figure.layout.yaxis.title.text == "Residual force, with the sign of the motion (N)"


def test_an_effect_without_curve_or_parameters_and_a_place_without_after_are_shown() -> None:
    bare = Place("time", "s", (0.0, 1.0), 0.4, 0.0, "", np.arange(30.0), np.ones(30))
    found = replace(
        made_up.missing(0), effects=[Named(("creep",), 0.9, {}, 0.4)], where=[bare], candidates=[]
    )
    page = page_of(found)
    assert section(page, "Named: creep").table is None
    figure = section(page, "Where: against time").figure
    assert figure is not None and len(figure.data) == 1
    render_page(page)


def test_the_band_is_two_standard_errors_and_the_region_is_shaded() -> None:
    x, y, s = np.linspace(0, 1e-3, 20), np.linspace(-1, 1, 20), np.full(20, 0.25)
    figure = place_figure("position", "m", x, y, spread=s, region=(0.0, 2e-4))
    band = np.asarray(figure.data[0].y, float)
    assert band[:20] == pytest.approx(y + 0.5, abs=1e-6)
    assert band[20:] == pytest.approx((y - 0.5)[::-1], abs=1e-6)
    rectangles = [shape for shape in figure.layout.shapes if shape.type == "rect"]
    assert [(r.x0, r.x1) for r in rectangles] == [(0.0, pytest.approx(0.2))]  # mm
    with pytest.raises(ValueError, match="differ in length"):
        place_figure("position", "m", x, y[:5])


def test_speeds_over_decades_are_drawn_on_a_log_axis_and_two_directions_as_points() -> None:
    speed = np.geomspace(1e-5, 1e-2, 20)
    assert place_figure("speed", "m/s", speed, speed).layout.xaxis.type == "log"
    even = np.linspace(1e-5, 1e-2, 20)
    assert place_figure("speed", "m/s", even, even).layout.xaxis.type != "log"
    two = place_figure("direction", "1", [-1, 1], [0.1, 0.2], spread=[0.05, 0.05])
    assert two.data[0].mode == "markers" and list(two.data[0].error_y.array) == [100.0, 100.0]  # mN
    assert list(two.layout.xaxis.ticktext) == ["down", "up"]


def test_unseen_rows_are_shaded_and_recordings_follow_one_another() -> None:
    time = np.concatenate([np.arange(100.0), np.arange(50.0)])
    unseen = np.zeros(150)
    unseen[20:40] = unseen[120:] = 1
    figure = residual_figure(time, np.ones(150), np.zeros(150), unseen=unseen)
    shaded = [(s.x0, s.x1) for s in figure.layout.shapes if s.type == "rect"]
    assert shaded == [(20.0, 39.0), (120.0, 149.0)]
    assert np.all(np.diff(np.asarray(figure.data[0].x, float)) > 0)
    assert any("2 recordings" in note for note in figure.layout.meta["notes"])


def test_many_unseen_stretches_stay_few_shapes() -> None:
    unseen = (np.arange(100_000) % 100 < 30).astype(float)
    figure = residual_figure(np.arange(1e5), np.ones(100_000), np.zeros(100_000), unseen=unseen)
    assert len(figure.layout.shapes) <= 61


def test_bars_are_in_order_and_what_cannot_be_seen_has_no_number() -> None:
    bars = [Bar("a", 0.5, named=True), Bar("<b>", 0.1), Bar("c", 0.0, observable=False)]
    figure = candidates_figure(bars)
    assert list(figure.layout.yaxis.categoryarray) == ["a", "&lt;b&gt;", "c"]
    texts = {label: text for trace in figure.data for label, text in zip(trace.y, trace.text, strict=True)}
    assert texts == {"a": "50 %", "&lt;b&gt;": "10 %", "c": "cannot be seen"}
    assert candidates_figure([]).layout.annotations[0].text == "no data"
    line = fit_figure({"as believed": 0.1}, 0.02).layout.shapes[0]
    assert line.x0 == line.x1 == pytest.approx(2.0)


def test_nothing_to_draw_says_so() -> None:
    for figure in (
        place_figure("position", "m", [], []),
        named_figure("position", "m", [], [], []),
        residual_figure([], [], []),
    ):
        assert figure.layout.annotations[0].text == "no data"


def test_a_table_is_as_wide_as_its_head_and_escapes_its_cells() -> None:
    html = render_columns(Columns(("a", "b"), [("<i>", "1")], figures=(1,), muted=(0,)))
    assert "&lt;i&gt;" in html and '<tr class="muted">' in html and 'data-label="b"' in html
    with pytest.raises(ValueError, match="row 0 of the table has 1 cells, its head 2"):
        render_columns(Columns(("a", "b"), [("1",)]))


def test_every_key_of_the_answer_stands_in_the_formats() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    text = page[page.index("\n## A diagnosis\n") : page.index("\n## The command line\n")]
    known = set(re.findall(r"[\w-]+", " ".join(re.findall(r"`([^`\n]+)`", text))))

    def keys(value: Any) -> set[str]:
        if isinstance(value, list):
            return set().union(*map(keys, value))
        return set(value).union(*map(keys, value.values())) if isinstance(value, dict) else set()

    answer = made_up.missing(500).to_json()
    for effect in answer["effects"]:
        effect["parameters"] = list(effect["parameters"].values())  # their names are the catalogue's
    for size in answer["smallest_seen"]:
        size["at"] = list(size["at"].values())
    assert keys(answer) - known == set()
    assert {"consistent", "retuned", "missing-physics", "unexplained"} <= known


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no chromium or chrome on this machine to open the page in")
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("make", ALL)
def test_every_figure_is_drawn_in_a_browser(make: type, tmp_path: Path, dark: bool) -> None:
    assert BROWSER is not None
    page = page_of(make())
    path = write_page(tmp_path / "report.html", page)
    run = subprocess.run(
        [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--enable-logging=stderr",
         "--disable-background-networking", "--virtual-time-budget=10000",
         f"--user-data-dir={tmp_path / 'profile'}",
         f"--blink-settings=preferredColorScheme={0 if dark else 1}",
         "--dump-dom", path.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    root = re.search(r"<html[^>]*>", run.stdout)
    count = sum(1 for s in page.sections if s.figure is not None)
    assert root is not None and f'data-plots="{count}"' in root[0] and 'data-errors="0"' in root[0]
    assert "CONSOLE" not in run.stderr


def test_within_the_noise_there_is_no_table_of_candidates_that_nobody_tried() -> None:
    found = made_up.consistent()
    untried = [replace(k, z=math.nan, observable=False) for k in found.candidates]
    headings = [s.heading for s in page_of(replace(found, candidates=untried)).sections]
    assert "Candidates" not in headings and "What could not be seen in this recording" in headings
