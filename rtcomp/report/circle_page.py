"""The part of a page that shows the circle closed: hidden, suffered, named, compensated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rtcomp.circle.demonstrate import Circle
from rtcomp.report.diagnosis_words import joined, percent
from rtcomp.report.figures.tracking import Figures, error_bars_figure, tracking_figure
from rtcomp.report.page import Page, Row, Section
from rtcomp.report.quantities import si

RUNS = ("as believed", "with the hidden effect", "after the diagnosis")


def described(entry: dict[str, Any]) -> str:
    """Return the values of an effect in one line."""
    from rtcomp.physics import catalogue

    units = {p.name: p.unit for p in catalogue.entry(entry["name"]).parameters}
    return ", ".join(f"{k} {si(v, units[k], 3)}" for k, v in entry.items() if k != "name" and v)


def named(circle: Circle) -> str:
    """Return what the diagnosis said was missing."""
    sets = [joined(e.names, "or") for e in circle.found.effects]
    return ", ".join(sets) or "nothing"


def judged(circle: Circle) -> str:
    """Say whether what was named is what was hidden."""
    name = circle.hidden["name"]
    if circle.right:
        return "right"
    if any(name in e.names for e in circle.found.effects):
        return "the hidden effect among others"
    return "wrong"


def circle_rows(circle: Circle, unit: str) -> list[Row]:
    """Return the figures of the circle, for the page and the terminal."""
    believed, before, after = circle.errors
    return [
        Row("Hidden", circle.hidden["name"], "", described(circle.hidden)),
        Row("Named by the diagnosis", named(circle), "", judged(circle)),
        Row("Tracking error before hiding, rms", believed.rms, unit, "the stage as believed"),
        Row("Tracking error with it hidden, rms", before.rms, unit, "the same model"),
        Row("Tracking error, diagnosed, rms", after.rms, unit, "the extended stage fed forward"),
        Row("Smaller again by", f"{circle.improvement:.1f} times"),
    ]


def with_circle(page: Page, circle: Circle, unit: str) -> Page:
    """Return the page of a demonstration with the circle in it, before what stood there."""
    believed, before, after = circle.errors
    fit = circle.found.fit
    verdict = [page.verdict] if isinstance(page.verdict, str) else list(page.verdict)
    ran = "wrongly " if judged(circle) == "wrong" else ""
    verdict.append(
        f"Then {circle.hidden['name']} ({described(circle.hidden)}) was hidden in the stage, and the error "
        f"rose from {si(believed.rms, unit)} to {si(before.rms, unit)}. The diagnosis of that recording "
        f"{ran}named {named(circle)}; with it fed forward the error is {si(after.rms, unit)}."
    )
    bars = {name: Figures(e.rms, e.peak) for name, e in zip(RUNS, circle.errors, strict=True)}
    errors = [run.tracking_error(circle.settle) for run in (circle.ignorant, circle.extended)]
    prose = (
        "One reference, one controller. The loop believes the ordinary stage throughout; from the second run "
        "on the simulated one has the hidden effect. The extended stage is what the diagnosis made of the "
        f"recording of that run: it explains the force to {percent(fit.after)} where the ordinary stage was "
        f"off by {percent(fit.before)} (on parts that it was not fitted to; noise alone would leave "
        f"{percent(fit.floor)}). The whole diagnosis is in diagnosis.html."
    )
    sections = [
        Section("An effect hidden, diagnosed, compensated", prose, error_bars_figure(bars, unit=unit)),
        Section(
            "Tracking error before and after the diagnosis", "",
            tracking_figure(*errors, unit=unit, names=(RUNS[1], RUNS[2])),
        ),
    ]  # fmt: skip
    return replace(
        page,
        title="Friction hysteresis, identified, compensated, and what else is there, diagnosed",
        verdict=verdict,
        summary=[*page.summary, *circle_rows(circle, unit)],
        sections=[*sections, *page.sections],
        tone=page.tone if circle.improvement > 2 else "poor",
    )
