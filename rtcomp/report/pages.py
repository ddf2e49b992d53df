"""The reports of the jobs: what each page says and shows."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rtcomp import __version__
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.jobs.compensate import Compensated
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import FADE, SWITCH_AT, Demonstrated
from rtcomp.jobs.identify import Identified, friction_level
from rtcomp.jobs.judge import Judgement
from rtcomp.jobs.session import Run
from rtcomp.kernels import Floats
from rtcomp.report.figures.hysteresis import first_reversal, loop_figure, virgin_figure
from rtcomp.report.figures.learning import Curve, learning_figure
from rtcomp.report.figures.motion import force_figure, position_figure
from rtcomp.report.figures.timing import execution_figure, lateness_figure
from rtcomp.report.figures.tracking import tracking_figure
from rtcomp.report.page import Page, Row, Section
from rtcomp.report.timing_rows import timing_rows
from rtcomp.units import for_axis
from rtcomp.yamlfile import dump_yaml

if TYPE_CHECKING:
    import plotly.graph_objects as go


def identified_rows(done: Identified) -> list[Row]:
    """Return the figures of an identification, for the page and the terminal."""
    force = for_axis("N", done.config.stage.axis)
    rows = []
    if done.held_out is not None:
        h = done.held_out
        rows.append(
            Row("Held-out error", 100 * h.relative, "%", "frozen weights, other motion, rms over peak force")
        )
        rows.append(Row("Held-out error, rms", h.rms, force))
    rows += [
        Row("In-sample error", 100 * done.in_sample.relative, "%", "frozen weights, the motion learned from"),
        Row("In-sample error, rms", done.in_sample.rms, force),
        Row("Friction level", friction_level(done.model), force, "every interval saturated"),
    ]
    if done.model.reached is not None:
        count = int(np.count_nonzero(done.model.reached))
        rows.append(Row("Elements reached", f"{count} of {done.model.basis.size}"))
    if done.run.tick.moves is not None:
        rows.append(Row("Intervals moved", f"{done.run.tick.moves:,} times", "", "to where the curve bends"))
    rows.append(Row("Updates of the weights", f"{done.run.outcome.updates:,}"))
    return rows + timing_rows(done.run)


def identified_page(done: Identified, recording: str = "") -> Page:
    """Return the report of `rtcomp identify`; `recording` names the file where there was one."""
    judged = done.held_out or done.in_sample
    what = (
        "motion that it was not learned from"
        if done.held_out is not None
        else "the motion it was learned from"
    )
    verdict = [
        f"With its weights frozen, the model is off by {100 * judged.relative:.2g} % of the peak force "
        f"on {what}."
    ]
    return Page(
        title="Friction hysteresis, identified",
        subtitle=_subtitle(done.config, recording),
        verdict=verdict,
        summary=identified_rows(done),
        notes=done.notes,
        sections=[
            *_model_sections(done, judged),
            *_motion_sections(done.run, done.config, done),
            *_timing(done.run),
        ],
        configuration=_configuration(done.config),
        versions=versions(done.run),
        tone="good" if judged.relative < 0.1 else "poor",
    )


def simulated_rows(config: Configuration, run: Run) -> list[Row]:
    """Return the figures of a simulation, for the page and the terminal."""
    unit = for_axis("m", config.stage.axis)
    position, voltage = run.columns["position"], run.columns["voltage"]
    return [
        Row("Position, lowest", float(position.min()), unit),
        Row("Position, highest", float(position.max()), unit),
        Row("Command, largest", float(np.abs(voltage).max()), "V"),
        *timing_rows(run),
    ]


def simulated_page(config: Configuration, run: Run, *, open_loop: bool) -> Page:
    """Return the report of `rtcomp simulate`."""
    c = run.columns
    unit = for_axis("m", config.stage.axis)
    reference = None if open_loop else c["reference"]
    return Page(
        title="A stage, simulated",
        subtitle=_subtitle(config),
        summary=simulated_rows(config, run),
        sections=[
            Section("Position", "", position_figure(c["time"], c["position"], reference, unit=unit)),
            Section("Command", "", _command_figure(run)),
        ],
        configuration=_configuration(config),
        versions=versions(run),
    )


def _command_figure(run: Run) -> go.Figure:
    c = run.columns
    return force_figure(c["time"], c["voltage"], unit="V", title="Command", name="command")


def compensated_rows(done: Compensated) -> list[Row]:
    """Return the figures of a compensation, for the page and the terminal."""
    unit = for_axis("m", done.config.stage.axis)
    a, b = done.error_without, done.error_with
    return [
        Row("Tracking error without, rms", a.rms, unit, "the same controller"),
        Row("Tracking error with, rms", b.rms, unit),
        Row("Smaller by", f"{done.improvement:.1f} times"),
        Row("Tracking error without, peak", a.peak, unit),
        Row("Tracking error with, peak", b.peak, unit, "the paper's rig: 5 um" if unit == "m" else ""),
        *timing_rows(done.without, done.with_it),
    ]


def compensated_page(done: Compensated) -> Page:
    """Return the report of `rtcomp compensate`."""
    better = done.improvement
    return Page(
        title="Friction hysteresis, compensated",
        subtitle=_subtitle(done.config),
        verdict=f"With feedforward of the friction the tracking error is {better:.1f} times smaller (rms)."
        if better > 1
        else f"Feedforward of this model made the tracking error {1 / better:.2g} times larger (rms).",
        summary=compensated_rows(done),
        notes=done.notes,
        sections=[
            tracking_section(done),
            *_motion_sections(done.with_it, done.config),
            *_timing(done.with_it),
        ],
        configuration=_configuration(done.config),
        versions=versions(done.with_it),
        tone="good" if better > 2 else "poor",
    )


def demo_rows(done: Demonstrated) -> list[Row]:
    """Return the figures of the demonstration, for the page and the terminal."""
    unit = for_axis("m", done.identified.config.stage.axis)
    before, after = live_tracking(done)
    return [
        Row("Live run, before feedforward, rms", before, unit, f"until {SWITCH_AT:g} s"),
        Row("Live run, with feedforward, rms", after, unit, "the last three seconds"),
        *[row for row in identified_rows(done.identified) if row.name.startswith(("Held", "Friction"))],
        *compensated_rows(done.compensated),
    ]


def live_tracking(done: Demonstrated) -> tuple[float, float]:
    """Return the rms tracking error (m) of the live run before feedforward and at its end."""
    time, error = done.live.tracking_error()
    before = error[(time > SWITCH_AT - 3.0) & (time < SWITCH_AT)]
    after = error[time > max(time[-1] - 3.0, SWITCH_AT + FADE)]
    return float(np.sqrt(np.mean(before**2))), float(np.sqrt(np.mean(after**2)))


def demo_page(done: Demonstrated) -> Page:
    """Return the report of `rtcomp demo`."""
    i, k = done.identified, done.compensated
    judged = i.held_out or i.in_sample
    unit = for_axis("m", i.config.stage.axis)
    time, error = done.live.tracking_error()
    on = time >= SWITCH_AT
    watched = tracking_figure((time[~on], error[~on]), (time[on], error[on]), unit=unit)
    says = (
        f"One run: the model learns from the start; from {SWITCH_AT:g} s on it is fed forward, in full after "
        f"{FADE:g} s. The figures of the second part count that time too."
    )
    return Page(
        title="Friction hysteresis, identified and compensated",
        subtitle=_subtitle(i.config),
        verdict=[
            f"With its weights frozen, the model is off by {100 * judged.relative:.2g} % of the peak force "
            "on motion that it was not learned from.",
            f"Fed forward, it makes the tracking error {k.improvement:.0f} times smaller, same controller.",
        ],
        summary=demo_rows(done),
        sections=[
            Section("Identified while running, then fed forward", says, watched),
            *_model_sections(i, judged),
            tracking_section(k),
            *_motion_sections(k.with_it, i.config),
            *_timing(k.with_it),
        ],
        configuration=_configuration(i.config),
        versions=versions(k.with_it),
        tone="good" if k.improvement > 2 else "poor",
    )


def tracking_section(done: Compensated) -> Section:
    """Return the tracking error without and with feedforward."""
    settle = done.config.run.compensate.settle
    before, after = done.without.tracking_error(settle), done.with_it.tracking_error(settle)
    figure = tracking_figure(before, after, unit=for_axis("m", done.config.stage.axis))
    return Section("Tracking error without and with", "The same reference, the same controller.", figure)


def _model_sections(done: Identified, judged: Judgement) -> list[Section]:
    unit, force = for_axis("m", done.config.stage.axis), for_axis("N", done.config.stage.axis)
    counted = judged.counted > 0
    shown = slice(int(np.argmax(counted)), counted.size - int(np.argmax(counted[::-1])))
    position = judged.friction.position[shown]
    loop = loop_figure(
        position,
        # Rows that do not count break the line.
        np.where(counted[shown], judged.friction.force[shown], np.nan),
        np.where(counted[shown], judged.model[shown], np.nan),
        virgin_rows=first_reversal(position) if counted.all() else 0,
        held_out_percent=100 * judged.relative if done.held_out is not None else None,
        unit=unit,
        force_unit=force,
    )
    sections = [Section("Hysteresis loop, measured and modelled", _judged_on(done), loop)]
    basis = done.model.basis
    if isinstance(basis, IntervalBasis):
        curve = virgin_figure(
            basis.widths, done.model.weights, reached=done.model.reached, truth=_truth(done.config),
            unit=unit, force_unit=force,
        )  # fmt: skip
        sections.append(
            Section(
                "The weights as the virgin curve", "Each weight is the slope over half its interval.", curve
            )
        )
    if done.curve_time.size:
        learning = learning_figure(
            [Curve("frozen weights at that time", done.curve_time, 100 * done.curve, "model")], x_unit="s"
        )
        says = "Each point: the weights of that moment, frozen, on all of the judged motion."
        sections.append(Section("Learning curve", says, learning))
    return sections


def _judged_on(done: Identified) -> str:
    if done.held_out is None:
        return "The motion that the weights were learned from; no other was given."
    return "Motion that the weights were not learned from."


def _truth(config: Configuration) -> tuple[npt.ArrayLike, npt.ArrayLike] | None:
    """Return the virgin curve of a simulated stop bank, to draw beside the identified one."""
    friction = config.run.stage.friction
    if config.run.device.get("driver") != "simulated" or not isinstance(friction, list):
        return None
    travel = np.concatenate([[0.0], np.sort([e.reach for e in friction])])
    force = [sum(e.stiffness * min(x, e.reach) for e in friction) for x in travel]
    return travel, force


def _motion_sections(run: Run, config: Configuration, done: Identified | None = None) -> list[Section]:
    c = run.columns
    unit, force = for_axis("m", config.stage.axis), for_axis("N", config.stage.axis)
    says = (
        "As the identifier saw it while running; what it predicted at that moment beside it." if done else ""
    )
    return [
        Section("Position", "", position_figure(c["time"], c["position"], _reference(run), unit=unit)),
        Section("Friction force", says, force_figure(c["time"], c["force"], c["force_model"], unit=force)),
    ]


def _reference(run: Run) -> Floats | None:
    """Return the reference (m), None where a recording had none and its position stands in that place."""
    reference, position = run.columns["reference"], run.columns["position"]
    return None if np.count_nonzero(reference != position) < 0.5 * position.size else reference


def _timing(run: Run) -> list[Section]:
    sections = []
    period = 1e6 / run.rate_hz
    if run.columns["lateness_us"].any():
        figure = lateness_figure(run.columns["lateness_us"], period_us=period)
        sections.append(Section("Lateness of the ticks", "", figure))
    figure = execution_figure(run.columns["execution_us"][1:], period_us=period)
    sections.append(
        Section("Time spent in a tick", "From waking up to the command, the device included.", figure)
    )
    return sections


def _subtitle(config: Configuration, recording: str = "") -> str:
    source = f"recording {recording}" if recording else f"device {config.run.device.get('driver')}"
    return f"{config.path.name}, {config.stage.rate:g} Hz, {source}"


def _configuration(config: Configuration) -> str:
    text = dump_yaml(None, config.file.data)
    return text if isinstance(text, str) else ""


def versions(run: Run) -> dict[str, Any]:
    """Return what stands at the foot of a page."""
    return {
        "rtcomp": __version__,
        "Python": platform.python_version(),
        "numpy": np.__version__,
        **run.realtime,
    }
