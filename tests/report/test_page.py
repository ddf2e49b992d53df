"""The page: one file, whole, without a network, and with nothing in it that a file could make run."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from rtcomp.errors import RtcompError
from rtcomp.report.figures import Curve, overlay_figure, position_figure
from rtcomp.report.page import Page, Row, Section, render_page, write_page

EVIL = "</script><script>alert('x')</script><img src=x onerror=alert(1)> & \"quoted\""


class Tree(HTMLParser):
    """Collects elements and the text of each kind."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes something else"

    def handle_data(self, data: str) -> None:
        self.texts.setdefault(self.open[-1] if self.open else "", []).append(data)


def page() -> Page:
    t = np.arange(500) * 1e-3
    return Page(
        title=f"Identification {EVIL}",
        subtitle=EVIL,
        verdict=["It is identified.", EVIL],
        summary=[Row("Held-out error", 0.0123, "m", EVIL), Row(EVIL, EVIL), Row("Ticks", 60_000)],
        sections=[
            Section(EVIL, f"First.\n\n{EVIL}", position_figure(t, 1e-6 * np.sin(9 * t))),
            Section("Curves", "", overlay_figure([Curve(EVIL, t, t)], x_title="a", y_title="b")),
            Section("Words only", "No figure here."),
        ],
        notes=["something to know", EVIL],
        configuration=f"stage:\n  mass: 2.0  # {EVIL}\n",
        versions={"rtcomp": "0.1", EVIL: EVIL},
    )


def test_what_comes_from_files_is_text() -> None:
    text = render_page(page())
    tree = Tree(text)
    assert tree.open == []
    assert [t for t, _ in tree.tags].count("script") == 4
    assert not [t for t, _ in tree.tags if t == "img"]
    assert not [a for _, a in tree.tags if any(k.startswith("on") for k in a)]
    assert (
        sum(
            "alert(1)" in piece for kind in ("td", "th", "p", "h2", "pre", "dd") for piece in tree.texts[kind]
        )
        >= 6
    )
    assert EVIL in "".join(tree.texts["pre"])
    assert EVIL in "".join(tree.texts["title"])


def test_the_figures_in_the_page_are_those_given() -> None:
    content = page()
    text = render_page(content)
    data = re.search(r'<script type="application/json" id="figures">(.*?)</script>', text, re.S)
    assert data is not None
    figures = json.loads(data[1])
    given = [json.loads(s.figure.to_json()) for s in content.sections if s.figure is not None]
    assert figures == given
    places = [a for t, a in Tree(text).tags if a.get("class") == "plot"]
    assert [a["data-figure"] for a in places] == ["0", "1"]


def test_nothing_is_fetched_and_the_browser_is_told_so() -> None:
    tags = Tree(render_page(page())).tags
    assert not [t for t, a in tags if a.get("src") or (t == "link")]
    assert all((a.get("href") or "#").startswith("#") for _, a in tags)
    (policy,) = (a["content"] or "" for t, a in tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'") and "http" not in policy


def test_plotly_is_inlined_once_and_only_where_there_is_a_figure() -> None:
    from plotly.offline import get_plotlyjs

    assert render_page(page()).count(get_plotlyjs()[:2000]) == 1
    assert len(render_page(Page("Words"))) < 20_000


def test_summary_values_carry_fitting_units() -> None:
    cells = Tree(render_page(page())).texts["td"]
    assert "12.3 mm" in cells and "60000" in cells


def test_a_page_of_a_long_recording_stays_below_8_megabytes(tmp_path: Path) -> None:
    t = np.arange(400_000) * 1e-4
    noise = np.random.default_rng(0).standard_normal(t.size)
    sections = [Section(str(i), "", position_figure(t, noise * 1e-6, noise)) for i in range(12)]
    path = write_page(tmp_path / "report.html", Page("Long", sections=sections))
    assert path.stat().st_size < 8_000_000


def test_writing_replaces_in_one_step_and_leaves_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    target.write_text("old")
    write_page(target, page())
    assert target.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_place_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(RtcompError, match=r"report\.html") as caught:
        write_page(tmp_path / "no" / "such" / "report.html", Page("x"))
    assert "\n" not in str(caught.value)


def test_notes_stand_below_the_figures_as_sentences() -> None:
    text = render_page(page())
    assert "<li>Something to know</li>" in text
    assert text.index("</table>") < text.index("Something to know") < text.index("<nav")
    assert '<ul class="notes">' not in render_page(Page("Bare"))
