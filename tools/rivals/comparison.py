"""Rivals held against each other: each gets what errs least on motions left out, and is judged on others."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from rivals import Motion, Rival, error
from rtcomp.kernels import Floats

RIDGES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)


def left_out(rival: Rival, motions: Sequence[Motion], ridge: float) -> float:
    """Return the rms error on each motion, the rival fitted to the others; never on the largest.

    What is judged lies within what was learned from: the largest motion would ask for what lies beyond it.
    """
    largest = max(motions, key=lambda m: float(np.abs(m.u).max()))
    squares = []
    for out in motions:
        if out is not largest or len(motions) < 3:
            rival.fit([m for m in motions if m is not out], ridge)
            squares.append(error(rival, [out]) ** 2)
    return float(np.sqrt(np.mean(squares)))


def fitted(rival: Rival, motions: Sequence[Motion]) -> tuple[float, float]:
    """Return the ridge that errs least on motions left out, and that error."""
    missed = {ridge: left_out(rival, motions, ridge) for ridge in RIDGES}
    best = min(missed, key=lambda ridge: missed[ridge])
    return best, missed[best]


def nanoseconds(rival: Rival, u: Floats) -> float:
    """Return the time a sample of predicting, on 20,000 samples at least."""
    many = np.tile(u, -(-20_000 // u.size))
    best = np.inf
    for _ in range(3):
        begin = time.thread_time()
        rival.predict(many, many[:1])
        best = min(best, time.thread_time() - begin)
    return best / many.size * 1e9


def compared(
    train: Sequence[Motion], test: Sequence[Motion], factor: float, others: Sequence[Rival]
) -> list[dict[str, Any]]:
    """Fit and judge every rival; errors times `factor`."""
    rows = []
    for rival in others:
        kindest = []
        for ridge in RIDGES:
            rival.fit(train, ridge)
            kindest.append(error(rival, test))
        ridge, missed = fitted(rival, train)
        began = time.thread_time()
        rival.fit(train, ridge)
        fit_s = time.thread_time() - began
        rows.append(
            {
                "name": rival.name, "source": rival.source, "ridge": ridge,
                "held_out": factor * error(rival, test),
                "left_out": factor * missed,
                "kindest": factor * min(kindest),
                "each": {m.name: factor * error(rival, [m]) for m in test},
                "in_sample": factor * error(rival, train),
                "fit_s": fit_s, "ns_a_sample": nanoseconds(rival, train[0].u), "bytes": 8 * rival.numbers(),
            }
        )  # fmt: skip
    return rows


def table(title: str, unit: str, rows: Sequence[dict[str, Any]]) -> None:
    sheet = Table(title=title, title_justify="left", box=box.SIMPLE)
    sheet.add_column("")
    for head in ("held out", "each", "left out", "kindest", "in sample", "s to fit", "ns a sample", "bytes"):
        sheet.add_column(head, justify="right")
    for r in sorted(rows, key=lambda r: float(r["held_out"])):
        each = ", ".join(f"{k} {v:.3g}" for k, v in r["each"].items()) if len(r["each"]) > 1 else ""
        errors = [f"{r['held_out']:.3g} {unit}", each, f"{r['left_out']:.3g}", f"{r['kindest']:.3g}"]
        errors.append(f"{r['in_sample']:.3g} {unit}")
        sheet.add_row(r["name"], *errors, f"{r['fit_s']:.2g}", f"{r['ns_a_sample']:.0f}", f"{r['bytes']}")
    Console(width=150).print(sheet)


def value(rows: Sequence[dict[str, Any]], name: str) -> float:
    return float(next(r["held_out"] for r in rows if r["name"] == name))
