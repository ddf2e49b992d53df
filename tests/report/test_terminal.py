"""What the terminal shows, on a real pseudo-terminal and off it."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
import textwrap
import time
from io import StringIO

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rich.console import Console

from rtcomp.report.terminal import Progress, print_summary, summary_table

JOB = textwrap.dedent(
    """
    import sys
    from rtcomp.report.terminal import Progress
    with Progress("identify [bold]", quiet="--json" in sys.argv) as progress:
        for i in range(2001):
            progress.update(i / 2000, {"held-out": "1.3 %", "late": i})
    print("done")
    """
)


def on_a_terminal(*arguments: str) -> str:
    """Run the job with all its streams on a pty and return what it wrote."""
    leader, follower = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    process = subprocess.Popen(
        [sys.executable, "-c", JOB, *arguments],
        stdin=follower, stdout=follower, stderr=follower, close_fds=True, env=environment,
    )  # fmt: skip
    os.close(follower)
    pieces = []
    try:
        while piece := os.read(leader, 65536):
            pieces.append(piece)
    except OSError:  # Linux says EIO, not end of file, when the last writer of a pty has gone
        pass
    finally:
        os.close(leader)
    assert process.wait(timeout=30) == 0
    return b"".join(pieces).decode()


def test_progress_shows_figures_on_a_terminal_and_ends_at_the_last() -> None:
    text = on_a_terminal()
    assert "identify [bold]" in text
    assert "held-out" in text and "1.3 %" in text
    assert "100 %" in text and "2000" in text
    assert text.rstrip().endswith("done")


def test_progress_is_silent_for_machines() -> None:
    assert on_a_terminal("--json").split() == ["done"]
    run = subprocess.run([sys.executable, "-c", JOB], capture_output=True, text=True, timeout=60, check=True)
    assert (run.stdout, run.stderr) == ("done\n", "")


class Counting(StringIO):
    """A terminal that counts the drawings."""

    drawings = 0

    def write(self, text: str) -> int:
        self.drawings += "job" in text
        return super().write(text)


def test_progress_draws_at_most_eight_times_a_second_and_costs_next_to_nothing_between() -> None:
    out = Counting()
    console = Console(file=out, force_terminal=True, width=80)
    start = time.monotonic()
    updates = 0
    with Progress("job", console=console) as progress:
        while time.monotonic() - start < 0.6:
            progress.update(0.5, {"n": updates})
            updates += 1
    elapsed = time.monotonic() - start
    # Beside the periodic drawings: one at the start, one when it ends, one when rich stops.
    assert 2 <= out.drawings <= 8 * elapsed + 4
    assert updates > 5_000


def test_due_tells_when_figures_are_wanted() -> None:
    with Progress("job", console=Console(file=StringIO())) as silent:
        assert not silent.due
    with Progress("job", console=Console(file=StringIO(), force_terminal=True)) as progress:
        assert progress.due
        progress.update(2.0)
        assert not progress.due


def test_an_error_passes_through_and_leaves_the_terminal_in_order() -> None:
    out = StringIO()
    with pytest.raises(KeyError), Progress("job", console=Console(file=out, force_terminal=True)) as progress:
        progress.update(0.2)
        raise KeyError
    assert out.getvalue().rindex("\x1b[?25h") > out.getvalue().rindex("\x1b[?25l")


def test_the_summary_is_text_with_units_whatever_the_names() -> None:
    out = StringIO()
    rows = [
        ("Tracking [red]", 28.3e-9, "m", "rms"),
        ("Ticks", 60_000, "", "[link=x]all[/link]"),
        ("Class", "none"),
    ]
    print_summary("Run [bold]", rows, Console(file=out, width=100))
    text = out.getvalue()
    for part in ("Run [bold]", "Tracking [red]", "28.3 nm", "60000", "[link=x]all[/link]", "none"):
        assert part in text


def test_a_summary_without_notes_has_no_empty_column() -> None:
    assert len(summary_table("x", [("a", 1), ("b", 2.0, "m")]).columns) == 2


def test_where_it_is_narrow_the_notes_wrap_and_the_names_do_not() -> None:
    out = StringIO()
    rows = [("Live run, before feedforward, rms", 2.38e-5, "m", "a note " * 12), ("b", 1, "", "")]
    print_summary("t", rows, Console(file=out, width=80))
    assert "Live run, before feedforward, rms" in out.getvalue()
    assert max(len(line) for line in out.getvalue().splitlines()) <= 80


WORDS = st.lists(st.text("abcdefgh", min_size=1, max_size=9), min_size=1, max_size=8).map(" ".join)


@given(st.lists(st.tuples(WORDS, WORDS, st.just(""), st.one_of(st.just(""), WORDS)), min_size=1, max_size=4))
@example([("Named by the diagnosis", "position-dependent-friction", "", "amplitude 0.39, period 156 um")])
@example([("Held-out error", "0.599 %", "", "frozen weights, other motion, rms over peak force")])
@settings(max_examples=60, deadline=None)
def test_no_word_is_lost_however_narrow(rows: list[tuple[str, str, str, str]]) -> None:
    for width in (60, 80, 100, 132):
        out = StringIO()
        print_summary("t", rows, Console(file=out, width=width))
        lines = out.getvalue().splitlines()
        assert max(map(len, lines)) <= width
        shown = set(out.getvalue().replace("-", " ").split())
        assert {word for row in rows for cell in row for word in cell.replace("-", " ").split()} <= shown
