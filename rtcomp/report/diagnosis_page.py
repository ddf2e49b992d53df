"""The report of `rtcomp diagnose`: what is missing, where it shows, what it explains, what is left open."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from typing import Any

import numpy as np

from rtcomp import __version__
from rtcomp.control.references import Reference
from rtcomp.diagnosis.result import Diagnosis, Experiment, Named, Place, PositionFit
from rtcomp.report.columns import Columns
from rtcomp.report.diagnosis_words import (
    UNEXPLAINED,
    about,
    cells,
    entry,
    from_size,
    holding,
    joined,
    next_command,
    percent,
    probability,
    sentence,
    share_explained,
    smallest,
    title,
    within,
)
from rtcomp.report.figures.candidates import Bar, candidates_figure, fit_figure
from rtcomp.report.figures.motion import position_figure
from rtcomp.report.figures.residual import named_figure, place_figure, residual_figure
from rtcomp.report.page import Page, Row, Section
from rtcomp.report.quantities import si, written
from rtcomp.units import for_axis
from rtcomp.yamlfile import dump_yaml

SHOWN = 14
"""Candidates that are drawn; the table holds all."""
_TICKS = 4000


def diagnosed_rows(found: Diagnosis) -> list[Row]:
    """Return the table at the head of the page."""
    fit = found.fit
    rows = [
        Row("Force error, as believed", 100 * fit.before, "%", "rms over rms, parts not seen in fitting"),
        Row("Force error, retuned", 100 * fit.retuned, "%", "the same physics, other values"),
        Row("Force error, extended stage", 100 * fit.after, "%", _explained(found)),
        Row("Force error, noise alone", 100 * fit.floor, "%", "what the sensor leaves of any stage"),
    ]
    if found.position is not None:
        rows += _position_rows(found.position, for_axis("m", found.stage.axis))
    for effect in found.effects:
        rows.append(Row(title(effect), 100 * effect.share, "%", f"of the mismatch; {_sure(effect)}"))
    for moved in found.retuned:
        before = written(moved.before, moved.after.unit, printed=True)
        note = f"believed {before}; {within(moved.after, printed=True)}"
        rows.append(Row(moved.parameter, moved.after.value, moved.after.unit, note))
    if found.not_observable:
        count = len(found.not_observable)
        rows.append(
            Row("Could not be seen", f"{count} of the catalogue", "", ", ".join(found.not_observable))
        )
    if found.next_experiment is not None:
        e = found.next_experiment
        rows.append(Row("Next experiment", e.seconds, "s", f"tells apart {joined(e.tells_apart, 'and')}"))
    return rows


def _position_rows(fit: PositionFit, unit: str) -> list[Row]:
    note = f"mean over {fit.seconds:.2g} s, let go at points not seen in fitting, driven as recorded"
    return [
        Row("Position error, as believed", fit.before, unit, note),
        Row("Position error, retuned", fit.retuned, unit, "the same physics, other values"),
        Row("Position error, extended stage", fit.after, unit, "what decided: the balance of forces cannot"),
        Row("Position error, noise alone", fit.floor, unit, "what the sensor leaves of any stage"),
    ]


def _sure(effect: Named) -> str:
    if effect.names == UNEXPLAINED:
        return "no entry of the catalogue explains it"
    values = [f"{name} {written(v.value, v.unit, printed=True)}" for name, v in effect.parameters.items()]
    return "; ".join(filter(None, [f"probability {probability(effect.probability)}", ", ".join(values)]))


def diagnosed_page(found: Diagnosis, recordings: Sequence[str], stage: str, out: str = "DIR") -> Page:
    """Return the report. `recordings`, `stage` and `out` name the files and the folder as given."""
    axis = found.stage.axis
    force, unit = for_axis("N", axis), for_axis("m", axis)
    best = max(found.where, key=lambda place: place.share, default=None)
    where = [sentence(best.says)] if best is not None and best.says and found.verdict != "consistent" else []
    return Page(
        title="What the simulation leaves out",
        subtitle=f"{joined(recordings, 'and')} against {stage}",
        verdict=[found.sentence(), *where],
        summary=diagnosed_rows(found),
        notes=found.notes,
        sections=[
            _gain(found),
            *(_named(effect, force) for effect in found.effects if effect.names != UNEXPLAINED),
            *_unexplained(found, force),
            *(_place(place, force) for place in found.where),
            *_in_time(found, force),
            *_retuned(found),
            *_candidates(found),
            *_not_seen(found),
            *_would_show(found),
            *_next(found.next_experiment, stage, out, unit),
        ],
        configuration=dump_yaml(None, found.stage.to_dict()),
        configuration_is="The extended stage (stage.yaml)",
        versions={"rtcomp": __version__, "Python": platform.python_version(), "numpy": np.__version__},
        tone=_tone(found),
    )


def _tone(found: Diagnosis) -> Any:
    if any(effect.names == UNEXPLAINED for effect in found.effects) or found.verdict == "unexplained":
        return "poor"
    return "good"


def _explained(found: Diagnosis) -> str:
    share = share_explained(found)
    if math.isnan(share):
        return "there was nothing to explain"
    return f"{percent(share)} of the mismatch explained, squared, above the noise"


def _gain(found: Diagnosis) -> Section:
    fit = found.fit
    prose = "Relative force error: the force that the balance leaves open, rms over the rms of the force."
    if len({fit.before, fit.retuned, fit.after}) > 1:
        prose += (
            " Measured on parts of the recordings that took part neither in the fit nor in the choice "
            "between explanations."
        )
    errors = {"as believed": fit.before, "retuned": fit.retuned, "extended": fit.after}
    return Section("How well it predicts", prose, fit_figure(errors, fit.floor))


def _named(effect: Named, force: str) -> Section:
    first = effect.names[0]
    lines = [about(first)]
    if len(effect.names) > 1:
        lines.append(
            f"This recording cannot tell apart {joined(effect.names, 'and')}; the likeliest is put into the "
            "stage."
        )
    if effect.separate_by:
        lines.append(sentence(f"What would tell: {effect.separate_by}"))
    lines.append(
        f"It explains {percent(effect.share)} of the mismatch. Probability that it is "
        f"{'among these' if len(effect.names) > 1 else 'this'}: {probability(effect.probability)}."
    )
    figure = None
    if effect.curve is not None:
        axis, unit, x, data, curve, signed = effect.curve
        figure = named_figure(axis, unit, x, data, curve, name=first, force_unit=force, signed=signed)
    rows = [(name, *cells(value)) for name, value in effect.parameters.items()]
    table = Columns(("Parameter", "Value", "95 % interval"), rows, figures=(1, 2)) if rows else None
    return Section(f"Named: {title(effect)}", "\n\n".join(lines), figure, table)


def _unexplained(found: Diagnosis, force: str) -> list[Section]:
    sections = []
    for effect in found.effects:
        if effect.names != UNEXPLAINED:
            continue
        figure = None
        if effect.curve is not None:
            axis, unit, x, data, curve, signed = effect.curve
            figure = named_figure(
                axis, unit, x, data, curve, name="smooth curve", force_unit=force, signed=signed
            )
        prose = f"No entry of the catalogue explains {percent(effect.share)} of the mismatch."
        if figure is not None:
            prose += (
                " It shows most against what is drawn. The curve serves as a provisional correction where it "
                "was recorded, and says nothing beyond."
            )
        else:
            prose += " It shows along none of the axes that are looked at."
        sections.append(Section("Something that no entry explains", prose, figure))
    return sections


def _place(place: Place, force: str) -> Section:
    sign = "<" if place.p_value < 1e-3 else "="
    sure = f"p {sign} {max(place.p_value, 1e-3):.2g}, all axes looked at together"
    says = place.says or f"{percent(place.share)} of the mismatch depends on {place.axis}"
    prose = sentence(f"{says} ({sure})")
    figure = place_figure(
        place.axis, place.unit, place.x, place.before, after=place.after, spread=place.spread,
        region=place.region, force_unit=force, signed=place.signed,
    )  # fmt: skip
    heading = f"Where: against {place.axis}{', with the sign of the motion' if place.signed else ''}"
    return Section(heading, prose, figure)


def _in_time(found: Diagnosis, force: str) -> list[Section]:
    if not found.time.size:
        return []
    unseen = found.unseen if found.unseen.size == found.time.size else None
    figure = residual_figure(
        found.time, found.residual_before, found.residual_after, unseen=unseen, force_unit=force
    )
    says = "The force that the stage does not account for, before and after."
    if unseen is not None and unseen.any():
        says += " Shaded: parts that took no part in fitting or selection; the figures above are of these."
    return [Section("Residual in time", says, figure)]


def _retuned(found: Diagnosis) -> list[Section]:
    if not found.retuned:
        return []
    rows = []
    for moved in found.retuned:
        change = f"{100 * (moved.after.value / moved.before - 1):+.1f} %" if moved.before else ""
        before = written(moved.before, moved.after.unit, 4, printed=True)
        rows.append((moved.parameter, before, *cells(moved.after), change))
    head = ("Parameter", "Believed", "Found", "95 % interval", "Change")
    says = "Values of the stage itself that the recording moves, fitted together with all that was named."
    return [Section("Retuned parameters", says, None, Columns(head, rows, figures=(1, 2, 3, 4)))]


def _candidates(found: Diagnosis) -> list[Section]:
    if not any(math.isfinite(k.z) for k in found.candidates):
        return []  # within the noise nothing was tried
    named = {effect.names[0] for effect in found.effects}
    tied = {name for effect in found.effects for name in effect.names[1:]}
    bars = [Bar(k.name, k.gain, k.name in named, k.observable) for k in found.candidates[:SHOWN]]
    says = (
        "What each entry of the catalogue would have gained, alone beside the refitted stage, on parts "
        "that it was not fitted to. One that gains much without being named repeats what a named one "
        "explains better."
    )
    rows, muted = [], []
    for index, k in enumerate(found.candidates):
        told = "named" if k.name in named else "cannot be told apart" if k.name in tied else ""
        gain = _gained(max(k.gain, 0.0)) if k.observable else ""
        z = f"{k.z:.1f}" if k.observable and math.isfinite(k.z) else ""
        said = "; ".join(filter(None, [told, "" if k.observable else "cannot be seen", k.note]))
        rows.append((k.name, gain, z, smallest(k) if k.observable else "", said))
        if not k.observable:
            muted.append(index)
    table = Columns(
        ("Effect", "Would gain", "Over its error", "Would be seen from", "Remark"), rows, (1, 2, 3), muted
    )
    return [Section("Candidates", says, candidates_figure(bars), table)]


def _gained(share: float) -> str:
    return percent(share) if share > 0.01 or share <= 0.0 else f"{100 * share:.1f} %"


def _not_seen(found: Diagnosis) -> list[Section]:
    if not found.not_observable:
        return []
    rows = []
    for name in found.not_observable:
        known = entry(name)
        rows.append((name, known.says if known else "", known.experiment if known else ""))
    says = (
        "The motion of these recordings would look the same with and without them: of any plausible size, "
        "other values of the stage would make up for them to within the noise."
    )
    table = Columns(("Effect", "What it is", "Seen by"), rows)
    return [Section("What could not be seen in this recording", says, None, table)]


def _would_show(found: Diagnosis) -> list[Section]:
    axis = found.stage.axis
    rows = [(s.name, from_size(s, axis, printed=True), holding(s, axis)) for s in found.sights if s.seen]
    if not rows:
        return []
    says = (
        "From these sizes on each effect would stand out of the noise of these recordings, with everything "
        "else refitted. Smaller ones may be there."
    )
    return [
        Section(
            "The smallest that would have been seen", says, None, Columns(("Effect", "From", "With"), rows)
        )
    ]


def _next(experiment: Experiment | None, stage: str, out: str, unit: str) -> list[Section]:
    if experiment is None:
        return []
    reference = Reference.from_dict(experiment.reference)
    time = np.linspace(0.0, experiment.seconds, _TICKS)
    position, velocity, _ = reference.evaluate(time)
    speed = for_axis("m/s", "rotary" if unit == "rad" else "linear")
    fastest = si(float(np.abs(velocity).max()), speed)
    prose = (
        f"{sentence(experiment.says)} {si(experiment.seconds, 's')} tell apart "
        f"{joined(experiment.tells_apart, 'and')}; at most {fastest}.\n\n{next_command(out)}"
    )
    figure = position_figure(time, position, unit=unit)
    figure.data[0].name = "reference"
    return [Section("The next experiment", prose.strip(), figure)]
