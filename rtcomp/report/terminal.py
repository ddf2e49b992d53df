"""What the terminal shows: progress with figures, and the summary. The only module that knows rich."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from textwrap import wrap
from types import TracebackType
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task, TaskID, TextColumn
from rich.progress import Progress as RichProgress
from rich.table import Table
from rich.text import Text

from rtcomp.report.page import Row
from rtcomp.report.quantities import si, written

__all__ = ["Progress", "Row", "print_claims", "print_summary", "print_verdicts", "say", "si", "summary_table"]

_PERIOD = 1.0 / 8.0
_NAMES, _LEAST = 40, 20
"""Characters of a summary that names may take, and that notes are left where there are as many."""


class _Percent(ProgressColumn):
    """Done in whole percent; 100 only when it is done."""

    def render(self, task: Task) -> Text:
        return Text(f"{int(task.completed * 100.0):3d} %", style="bold")


class _Elapsed(ProgressColumn):
    """Seconds since the start."""

    def render(self, task: Task) -> Text:
        seconds = int(task.elapsed or 0.0)
        return Text(f"{seconds // 60}:{seconds % 60:02d}", style="dim")


class _Figures(ProgressColumn):
    """The figures of the job: ``held-out 1.3 %  rms 12 nm``."""

    def render(self, task: Task) -> Text:
        line = Text(no_wrap=True, overflow="ellipsis")
        for name, value in task.fields["figures"].items():
            line.append(f"{name} ", style="dim")
            line.append(f"{value}  ")
        line.rstrip()
        return line


class Progress:
    """A progress line with figures, for a ``with`` statement; updates at most eight times a second.

    Silent when `quiet` (``--json``) or when the output (standard error unless `console` is given) is not a
    terminal. It starts no thread: it draws inside `update`, so a loop that shares the interpreter is never
    held up by it. Ask `due` first where the figures cost time to make.
    """

    def __init__(self, title: str, *, quiet: bool = False, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._on = not quiet and self._console.is_terminal
        self._next = 0.0
        self._bar: RichProgress | None = None
        self._task = TaskID(0)
        self._title = title
        self._done = 0.0
        self._figures: dict[str, Any] = {}

    def __enter__(self) -> Progress:
        if self._on:
            self._bar = RichProgress(
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=24 if self._console.width >= 100 else 10),
                _Percent(), _Elapsed(), _Figures(), console=self._console, auto_refresh=False,
            )  # fmt: skip
            self._bar.start()
            self._task = self._bar.add_task(self._title, total=1.0, figures={})
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._draw()
            self._bar.stop()
            self._bar = None

    @property
    def due(self) -> bool:
        """Whether `update` would draw now."""
        return self._bar is not None and time.monotonic() >= self._next

    def update(self, done: float, figures: Mapping[str, Any] | None = None) -> None:
        """Say that the share `done` (0 to 1, clipped) is finished, with figures as they are to be read."""
        self._done = min(max(done, 0.0), 1.0)
        if figures is not None:
            self._figures = dict(figures)
        if self.due:
            self._next = time.monotonic() + _PERIOD
            self._draw()

    def _draw(self) -> None:
        assert self._bar is not None
        self._bar.update(self._task, completed=self._done, figures=self._figures, refresh=True)


def say(text: str, *, quiet: bool = False, console: Console | None = None) -> None:
    """Print lines beside the progress: on standard error where it is a terminal, unless `quiet`."""
    console = console or Console(stderr=True)
    if not quiet and console.is_terminal:
        console.print(Text(text), soft_wrap=True)


def summary_table(title: str, rows: Sequence[Row | tuple[Any, ...]], width: int = 120) -> Table:
    """Return the closing table, at most `width` characters; rows as in the page: name, value, unit, note."""
    table = Table(
        title=Text(title, style="bold"), title_justify="left", show_header=False, box=box.HORIZONTALS
    )
    lines = [(str(row.name), written(row.value, row.unit), str(row.note)) for row in (Row(*r) for r in rows)]
    count = 3 if any(note for *_, note in lines) else 2
    widths = _widths([max((len(line[i]) for line in lines), default=0) for i in range(count)], width)
    styles: tuple[dict[str, Any], ...] = ({}, {"justify": "right", "style": "bold"}, {"style": "dim"})
    for style, own in zip(styles, widths, strict=False):
        table.add_column(overflow="fold", width=own, **style)
    for line in lines:
        # Text, not markup: a name from a file may hold square brackets.
        table.add_row(*(Text("\n".join(wrap(cell, own))) for cell, own in zip(line, widths, strict=False)))
    return table


def _widths(longest: Sequence[int], room: int) -> list[int]:
    """Return the widths of the columns: where it is narrow the notes wrap first, then values, names last."""
    room -= 3 * len(longest) + 1  # edges, padding and what stands between
    names = min(longest[0], _NAMES, max(room // 2, 1))
    least = min(longest[-1], _LEAST) if len(longest) > 2 else 0
    values = min(longest[1], max(room - names - least, (room - names) // 2, 1))
    rest = max(room - names - values, 1)
    return [names, values, *(min(one, rest) for one in longest[2:])]


def print_summary(title: str, rows: Sequence[Row | tuple[Any, ...]], console: Console | None = None) -> None:
    """Print `summary_table` to standard output."""
    console = console or Console()
    console.print(summary_table(title, rows, console.width))


def print_verdicts(
    title: str, rows: Sequence[tuple[str, str, str, str, bool]], console: Console | None = None
) -> None:
    """Print a table of verdicts to standard output: link, what, required, seen, and whether it holds."""
    table = Table(title=Text(title, style="bold"), title_justify="left", box=box.HORIZONTALS)
    for head in ("link", "what", "required", "seen"):
        table.add_column(head, overflow="fold")
    table.add_column("verdict", no_wrap=True)
    before = ""
    for link, what, required, seen, good in rows:
        mark = Text("holds", style="green") if good else Text("BAD", style="bold red")
        shown = link if link != before else ""
        table.add_row(Text(shown), Text(what), Text(required), Text(seen), mark)
        before = link
    (console or Console()).print(table)


def print_claims(
    title: str, rows: Sequence[tuple[str, str, str, str, bool]], console: Console | None = None
) -> None:
    """Print a table of claims to standard output: name, what is claimed, true or false, the number."""
    table = Table(title=Text(title, style="bold"), title_justify="left", box=box.HORIZONTALS)
    table.add_column("claim", no_wrap=True)
    table.add_column("says", overflow="fold")
    table.add_column("here", no_wrap=True)
    table.add_column("number", overflow="fold")
    for name, says, number, quantity, good in rows:
        mark = Text("true", style="green") if good else Text("false", style="bold red")
        table.add_row(Text(name), Text(says), mark, Text(f"{number}: {quantity}"))
    (console or Console()).print(table)
