"""The page in a real browser: every plot drawn, no error, light and dark."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rtcomp.report import palette
from rtcomp.report.figures import (
    Curve,
    Figures,
    error_bars_figure,
    lateness_figure,
    learning_figure,
    loop_figure,
    tracking_figure,
    virgin_figure,
)
from rtcomp.report.figures.branches import branches_figure, difference_figure, mirrored_figure
from rtcomp.report.page import Page, Section, write_page

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-logging=stderr", "--virtual-time-budget=10000",
]  # fmt: skip

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no chromium or chrome on this machine to open the page in"),
]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    t = np.arange(20_000) * 1e-3
    x = 3e-5 * np.sin(t)
    gaps = np.where((t > 3) & (t < 4), np.nan, x)
    nothing = np.empty(0)
    figures = [
        loop_figure(x, gaps * 1e5, np.tanh(x * 1e5), virgin_rows=1500),
        virgin_figure(np.full(20, 3e-6), np.linspace(1e5, 0, 20), reached=np.arange(20) < 18),
        learning_figure([Curve("<b>RLS</b>", range(60), 40.0 / np.arange(1, 61))], levels={"paper": 5.0}),
        tracking_figure((t, gaps), (t, x / 50)),
        error_bars_figure({"without": Figures(1e-6, 3e-6), "with": Figures(2e-8, 1e-7)}),
        lateness_figure(np.abs(np.random.default_rng(1).standard_cauchy(5000)), period_us=1000.0),
        lateness_figure(np.zeros(100)),
        tracking_figure(None, (nothing, nothing)),
        branches_figure([(x[:1500], t[:1500])], [(x[1600:4600], t[1600:4600])], [(x[5000:], t[5000:])]),
        mirrored_figure([(x[:1500], t[:1500])], [(-x[:1500], -t[:1500])]),
        difference_figure(np.linspace(-3e-5, 3e-5, 50), np.arange(50.0), 2.0),
    ]
    page = Page("Browser", sections=[Section(f"Figure {i}", "", f) for i, f in enumerate(figures)])
    return write_page(tmp_path_factory.mktemp("page") / "report.html", page)


def opened(report: Path, profile: Path, *flags: str) -> tuple[str, str]:
    """Return the page's document after its scripts have run, and what the browser's console said."""
    assert BROWSER is not None
    run = subprocess.run(
        [BROWSER, *FLAGS, f"--user-data-dir={profile}", *flags, "--dump-dom", report.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    console = "\n".join(line for line in run.stderr.splitlines() if "CONSOLE" in line)
    return run.stdout, console


@pytest.mark.parametrize("dark", [False, True])
def test_every_plot_is_drawn_without_an_error(report: Path, tmp_path: Path, dark: bool) -> None:
    document, console = opened(report, tmp_path, f"--blink-settings=preferredColorScheme={0 if dark else 1}")
    root = re.search(r"<html[^>]*>", document)
    assert root is not None
    assert 'data-plots="11"' in root[0] and 'data-errors="0"' in root[0]
    assert console == ""
    assert document.count('class="main-svg"') >= 11
    body = document[document.index("<main>") : document.index('<script type="application/json"')]
    assert "no data" in body
    # Colours of the drawn lines are those of the page.
    rgb = ", ".join(str(int(palette.DARK[palette.WITHOUT][i : i + 2], 16)) for i in (1, 3, 5))
    assert (f"rgb({rgb})" in body) == dark
    # Text from a file shows as text.
    assert "&lt;b&gt;RLS&lt;/b&gt;" in body
    # Nothing offers to send the figures anywhere.
    assert "Share" not in body and "cloud" not in body.lower()
