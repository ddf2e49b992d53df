"""One HTML file that carries everything: text, figures and plotly's JavaScript; opens from disk without a
network.
"""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from rtcomp.report import palette
from rtcomp.report.columns import Columns, render_columns
from rtcomp.report.quantities import printed, written
from rtcomp.yamlfile import write_text

if TYPE_CHECKING:
    import plotly.graph_objects as go

_HERE = Path(__file__).parent
# The browser itself refuses every connection, whatever the plots' library would like to load.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "form-action 'none'; base-uri 'none'"
)


class Row(NamedTuple):
    """One line of the summary. Numbers get a prefix that fits their `unit`; all else is shown as text."""

    name: str
    value: Any
    unit: str = ""
    note: str = ""


class Section(NamedTuple):
    """A heading, plain text (blank lines part paragraphs), figure and table, all optional but the heading."""

    heading: str
    prose: str = ""
    figure: go.Figure | None = None
    table: Columns | None = None


@dataclass(frozen=True)
class Page:
    """What a report says. All text is plain: nothing in it is read as HTML.

    `verdict` is the answer in a sentence or several; `tone` colours it. `notes` say what else a person should
    know, below the figures. `configuration` is the file as run, shown folded; `versions` and other metadata
    stand at the foot.
    """

    title: str
    subtitle: str = ""
    verdict: str | Sequence[str] = ()
    summary: Sequence[Row] = ()
    notes: Sequence[str] = ()
    sections: Sequence[Section] = ()
    configuration: str = ""
    configuration_is: str = "Configuration as run"
    versions: Mapping[str, Any] = field(default_factory=dict)
    tone: Literal["plain", "good", "poor"] = "plain"


def write_page(path: str | Path, page: Page) -> Path:
    """Write `page` as one HTML file and return its path.

    The file appears whole or not at all; a file of that name is replaced. Raises RtcompError where it cannot
    be written.
    """
    write_text(path, render_page(page))
    return Path(path)


def render_page(page: Page) -> str:
    """Return `page` as HTML text."""
    figures = [s.figure for s in page.sections if s.figure is not None]
    scripts = ""
    if figures:
        from plotly.offline import get_plotlyjs

        scripts = (
            _data("figures", "[" + ",".join(f.to_json() for f in figures) + "]")
            + _data("dark", json.dumps(palette.DARK))
            + f"<script>{get_plotlyjs()}</script>\n"
            + f"<script>{(_HERE / 'page.js').read_text(encoding='utf-8')}</script>\n"
        )
    title = _text(page.title)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{title}</title>\n<style>\n{_style()}</style>\n</head>\n<body>\n<main>\n"
        f"<header>\n<h1>{title}</h1>\n{_if(page.subtitle, 'p', 'subtitle')}</header>\n"
        f"{_verdict(page)}{_summary(page.summary)}{_notes(page.notes)}{_contents(page.sections)}{_sections(page.sections)}"
        f"{_foot(page)}</main>\n{scripts}</body>\n</html>\n"
    )


def _text(value: Any) -> str:
    return html.escape(str(value), quote=True)


def _prose(sentences: str) -> str:
    return _text(printed(sentences))


def _if(text: str, tag: str, style: str) -> str:
    return f'<{tag} class="{style}">{_text(text)}</{tag}>\n' if text else ""


def _data(name: str, text: str) -> str:
    # "<" would let a string from a file end the script element.
    return f'<script type="application/json" id="{name}">{text.replace("<", chr(92) + "u003c")}</script>\n'


def _style() -> str:
    names = {
        "ink": palette.INK,
        "muted": palette.MUTED,
        "grid": palette.GRID,
        "axis": palette.AXIS,
        "paper": palette.PAPER,
        "good": palette.WITH,
        "poor": palette.WITHOUT,
        "link": palette.MEASURED,
    }
    light = "".join(f"--{k}: {v}; " for k, v in names.items())
    dark = "".join(f"--{k}: {palette.DARK[v]}; " for k, v in names.items())
    sheet = (_HERE / "page.css").read_text(encoding="utf-8")
    # Paper is white whatever the screen: the dark colours are for screens only.
    return (
        f":root {{ {light}}}\n@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark}}} }}\n{sheet}"
    )


def _verdict(page: Page) -> str:
    sentences = [page.verdict] if isinstance(page.verdict, str) else list(page.verdict)
    inner = "".join(f"<p>{_prose(s)}</p>\n" for s in sentences if s)
    return f'<div class="verdict {page.tone}">\n{inner}</div>\n' if inner else ""


def _summary(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    cells = []
    for row in (Row(*r) for r in rows):
        value = written(row.value, row.unit, printed=True)
        cells.append(
            f'<tr><th scope="row">{_text(row.name)}</th><td class="value">{_text(value)}</td>'
            f'<td class="note">{_prose(row.note)}</td></tr>\n'
        )
    return f'<table class="summary">\n<tbody>\n{"".join(cells)}</tbody>\n</table>\n'


def _notes(notes: Sequence[str]) -> str:
    lines = "".join(f"<li>{_prose(note[:1].upper() + note[1:])}</li>\n" for note in notes if note)
    return f'<ul class="notes">\n{lines}</ul>\n' if lines else ""


def _contents(sections: Sequence[Section]) -> str:
    if len(sections) < 3:
        return ""
    links = "".join(f'<li><a href="#s{i}">{_text(s.heading)}</a></li>\n' for i, s in enumerate(sections, 1))
    return f'<nav aria-label="Contents">\n<ol>\n{links}</ol>\n</nav>\n'


def _sections(sections: Sequence[Section]) -> str:
    parts = []
    number = 0
    for index, section in enumerate(sections, 1):
        prose = "".join(f"<p>{_prose(p.strip())}</p>\n" for p in section.prose.split("\n\n") if p.strip())
        drawing = ""
        if section.figure is not None:
            meta = section.figure.layout.meta or {}
            notes = " ".join(dict.fromkeys(meta.get("notes", []))) if isinstance(meta, dict) else ""
            height = int(section.figure.layout.height or 360)
            drawing = (
                f'<figure><div class="plot" data-figure="{number}" style="height:{height}px" role="img" '
                f'aria-label="{_text(section.heading)}"></div>\n'
                f"{_if(notes, 'figcaption', 'caption')}</figure>\n"
            )
            number += 1
        table = render_columns(section.table) if section.table is not None else ""
        parts.append(
            f'<section id="s{index}">\n<h2>{_text(section.heading)}</h2>\n{prose}{drawing}{table}</section>\n'
        )
    noscript = (
        "<noscript><p>The figures need JavaScript, which is in this file.</p></noscript>\n" if number else ""
    )
    return noscript + "".join(parts)


def _foot(page: Page) -> str:
    configuration = versions = ""
    if page.configuration:
        inner = _text(page.configuration)
        title = _text(page.configuration_is)
        configuration = f"<details><summary>{title}</summary>\n<pre>{inner}</pre></details>\n"
    if page.versions:
        lines = "".join(
            f"<div><dt>{_text(k)}</dt><dd>{_text(v)}</dd></div>\n" for k, v in page.versions.items()
        )
        versions = f"<dl>\n{lines}</dl>\n"
    return f"<footer>\n{configuration}{versions}</footer>\n" if configuration or versions else ""
