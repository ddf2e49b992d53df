"""The colours: the same thing has the same colour in every figure, in light and in dark.

Neighbouring roles stay apart for red-green colour-blind eyes (tested on simulated vision), and no figure
relies on colour alone: lines differ in width or dash too.
"""

from __future__ import annotations

REFERENCE = "#707a88"
MEASURED = "#1b6ec2"
MODEL = "#d97b00"
WITHOUT = "#a31d14"
WITH = "#17916a"
EXTRA = "#7d58c2"

INK = "#1f2733"
MUTED = "#5c6675"
GRID = "#e4e8ee"
AXIS = "#a9b2bf"
PAPER = "#ffffff"

DARK: dict[str, str] = {
    REFERENCE: "#9aa5b5",
    MEASURED: "#5fb0f5",
    MODEL: "#f6a93b",
    WITHOUT: "#e5483f",
    WITH: "#80e6b6",
    EXTRA: "#b79cf2",
    INK: "#e6eaf0",
    MUTED: "#a3adbb",
    GRID: "#2b323d",
    AXIS: "#566171",
    PAPER: "#14181f",
}
"""What each colour of a figure becomes on a dark page."""

ROLES: dict[str, str] = {
    "reference": REFERENCE,
    "measured": MEASURED,
    "model": MODEL,
    "without": WITHOUT,
    "with": WITH,
}

SERIES: tuple[tuple[str, str], ...] = (
    (MEASURED, "solid"),
    (MODEL, "solid"),
    (WITH, "dash"),
    (EXTRA, "dashdot"),
    (WITHOUT, "dot"),
    (REFERENCE, "longdash"),
)
"""Colour and dash of curves that have no role of their own (learners, runs), in order."""


def series(index: int) -> tuple[str, str]:
    """Return colour and dash of the `index`-th curve; they repeat after the last."""
    return SERIES[index % len(SERIES)]
