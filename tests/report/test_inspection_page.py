"""The page of an inspection and its figures: what is drawn, and what is said where a test lacks something."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.inspect import Inspected, inspect
from rtcomp.recording.reader import Recording
from rtcomp.report.figures.branches import BRANCHES, branches_figure, difference_figure, mirrored_figure
from rtcomp.report.inspection_page import Units, answers, inspected_page, inspected_rows
from rtcomp.report.page import render_page

UNITS = Units("m", "N")


def inspected(sizes: tuple[float, ...] = (1.0, 1.0, 0.5), **options: Any) -> Inspected:
    time = np.arange(12_000) / 1000.0
    size = np.array(sizes)[(time // 1.0).astype(int) % len(sizes)]
    position = 1e-4 * size * np.sin(2 * np.pi * time)
    model = HysteresisModel(IntervalBasis(np.array([2e-5, 6e-5])), np.array([4e4, 2e4]))
    columns = {"time": time, "position": position, "voltage": model.response(position)}
    return inspect(Recording(columns, 1000.0), **options)


def drawn(figure: Any) -> dict[str, np.ndarray]:
    return {trace.name: np.asarray(trace.y, dtype=float) for trace in figure.data}


def test_the_page_holds_the_papers_two_figures_and_every_answer() -> None:
    done = inspected()
    page = inspected_page(done, UNITS, "stage.yaml")
    headings = [section.heading for section in page.sections]
    assert [h.split(":")[0] for h in headings] == [
        "The loop and its branches", "Symmetry", "Where it is not symmetric", "Congruency",
        "The differences alone",
    ]  # fmt: skip
    text = render_page(page)
    for answer in answers(done):
        assert answer in text.replace("&#x27;", "'")
    assert "force by stage.yaml" in text
    assert page.tone == "plain"  # nothing fails, and the rate could not be tested


def test_what_could_not_be_tested_is_said_and_not_drawn() -> None:
    done = inspected(settle=10.6)  # what is left is too little for a loop
    page = inspected_page(done, UNITS)
    assert page.sections[0].heading == "The loop and its branches"
    assert not any(s.heading.startswith("Symmetry") for s in page.sections)
    assert sum("not testable" in answer for answer in answers(done)) == 4
    assert "voltage as force" in render_page(page)


def test_rows_name_figures_in_their_units() -> None:
    rows = {row.name: row for row in inspected_rows(inspected(), UNITS)}
    assert rows["Force range"].unit == "N" and rows["Smallest reversal"].unit == "m"
    assert rows["Mirrored branch over branch"].unit == "%"
    assert float(rows["Mirrored branch over branch"].value) < 1.0


def test_branches_are_drawn_by_direction_with_gaps_between() -> None:
    one = (np.array([0.0, 1e-6, 2e-6]), np.array([0.0, 1.0, 1.5]))
    figure = branches_figure([one, one], [one], unit="m", force_unit="N")
    curves = drawn(figure)
    assert list(curves) == ["rising", "falling"]
    assert np.isnan(curves["rising"]).sum() == 2 and np.nanmax(curves["rising"]) == 1.5
    assert "µm" in figure.layout.xaxis.title.text


def test_many_branches_are_thinned_and_it_is_said() -> None:
    one = (np.arange(3.0), np.arange(3.0))
    figure = branches_figure([one] * (3 * BRANCHES), [])
    assert np.isnan(drawn(figure)["rising"]).sum() == BRANCHES
    assert f"Of {3 * BRANCHES} rising branches {BRANCHES} are drawn" in figure.layout.meta["notes"][0]


def test_a_branch_of_two_lengths_is_refused_and_none_is_said() -> None:
    with pytest.raises(ValueError, match="differ in length"):
        branches_figure([(np.arange(3.0), np.arange(4.0))], [])
    assert branches_figure([], []).layout.annotations[0].text == "no branches"
    assert mirrored_figure([], []).layout.annotations[0].text == "no loop"


def test_the_difference_is_the_sum_of_its_two_parts() -> None:
    u = np.linspace(-1.0, 1.0, 101)
    curves = drawn(difference_figure(u, 3.0 * u**2 + u, 0.5))
    assert np.allclose(curves["in the mean curve"], 3.0 * u**2, atol=1e-6)
    assert np.allclose(curves["in the opening"], u, atol=1e-6)
