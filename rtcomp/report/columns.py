"""A table of several columns in a page: plain text, figures to the right, what matters less greyed."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import NamedTuple


class Columns(NamedTuple):
    """A table: headings, and rows of cells of as many; all text is plain.

    `muted` names the rows (by index) that matter less. Columns in `figures` hold numbers, to the right.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    figures: Sequence[int] = ()
    muted: Sequence[int] = ()


def render_columns(table: Columns) -> str:
    """Return the table as HTML. Raises ValueError where a row has more or fewer cells than headings."""
    right, muted = set(table.figures), set(table.muted)

    def cell(tag: str, index: int, text: str) -> str:
        style = ' class="figure"' if index in right else ""
        scope = ' scope="col"' if tag == "th" else ""
        # On a phone each row becomes a block; its cells then say their heading.
        label = f' data-label="{html.escape(table.head[index])}"' if tag == "td" else ""
        return f"<{tag}{style}{scope}{label}>{html.escape(text)}</{tag}>"

    head = "".join(cell("th", i, text) for i, text in enumerate(table.head))
    lines = []
    for number, row in enumerate(table.rows):
        if len(row) != len(table.head):
            raise ValueError(f"row {number} of the table has {len(row)} cells, its head {len(table.head)}")
        style = ' class="muted"' if number in muted else ""
        lines.append(f"<tr{style}>{''.join(cell('td', i, text) for i, text in enumerate(row))}</tr>\n")
    return (
        f'<table class="columns">\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{''.join(lines)}</tbody>\n</table>\n"
    )
