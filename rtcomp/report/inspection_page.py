"""What is shown of an inspection: the rows of the table, and the page with the paper's two figures."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rtcomp import __version__
from rtcomp.inspection.branches import FREE, Branch
from rtcomp.inspection.chance import Slope
from rtcomp.inspection.congruency import Congruency
from rtcomp.inspection.symmetry import Symmetry
from rtcomp.inspection.words import said_of_closure, said_of_congruency, said_of_rates, said_of_symmetry
from rtcomp.jobs.inspect import Inspected
from rtcomp.kernels import Floats
from rtcomp.report.figures.branches import branches_figure, difference_figure, mirrored_figure
from rtcomp.report.page import Page, Row, Section
from rtcomp.report.quantities import si


class Units(NamedTuple):
    """Units of position and force, empty where nobody knows them."""

    position: str
    force: str


def inspected_rows(done: Inspected, units: Units) -> list[Row]:
    """Return the figures of an inspection, for the page and the terminal."""
    low, high = done.force_range
    cut = done.sight.smoothing_hz
    rows = [
        Row("Branches", len(done.branches), "", _kinds(done)),
        Row("Force range", high - low, units.force),
        Row("Smallest reversal", done.sight.reversal, units.position, _grain(done, units)),
        Row("Low-pass", cut or "none", "Hz" if cut else "", "of position and force"),
    ]
    if done.symmetry is not None:
        s, unit = done.symmetry, done.symmetry.half_range
        rows += [
            Row(
                "Mirrored branch over branch", 100 * s.compared.between / unit, "%", "of half the force range"
            ),
            _share("... repeat over repeat", s.compared.within / unit, "the scatter"),
            Row("... largest", 100 * s.peak / unit, "%", f"after {100 * s.peak_at:.0f} % of the way"),
        ]
    if done.congruency is not None and done.congruency.verdict != "not-testable":
        k, unit = done.congruency, done.congruency.force_range
        rows += [
            _share("Rising over rising", k.rising.between / unit, _scatter(k.rising.within / unit)),
            _share("Falling over falling", k.falling.between / unit, _scatter(k.falling.within / unit)),
            _share("Rising over mirrored falling", k.across / unit, "of the force range"),
        ]
        for name, slope in (("force", k.with_force), ("position", k.with_position)):
            if slope is not None:
                rows.append(Row(f"Stiffness with {name}", 100 * slope.value, "%", _within(slope, 1.0)))
    if done.closure.gaps.size:
        gap, count = 100 * done.closure.rms / done.closure.force_range, done.closure.gaps.size
        rows.append(Row("Gap of minor loops", gap, "%", f"rms of {count}, of the force range"))
    if done.rates.change is not None:
        r, unit = done.rates.change, done.rates.half_range
        rows.append(Row("Each doubling of the speed", 100 * r.value / unit, "%", _within(r, unit)))
    return rows


def answers(done: Inspected) -> list[str]:
    """Return the four answers, a sentence each."""
    says = {
        "Symmetry": said_of_symmetry(done.symmetry),
        "Congruency": said_of_congruency(done.congruency),
        "Closure": said_of_closure(done.closure),
        "Rate": said_of_rates(done.rates),
    }
    return [f"{name}: {text}." for name, text in says.items()]


def inspected_page(done: Inspected, units: Units, stage: str = "") -> Page:
    """Return the report of `rtcomp inspect`; `stage` names the file where there was one."""
    verdicts = [v for v in (done.symmetry, done.congruency, done.closure, done.rates) if v is not None]
    fails = any(v.verdict == "fails" for v in verdicts)
    settled = all(v.verdict == "holds" for v in verdicts) and len(verdicts) == 4
    return Page(
        title="Friction hysteresis, inspected",
        subtitle=f"recording {done.name}, {'force by ' + stage if stage else 'voltage as force'}",
        verdict=answers(done),
        summary=inspected_rows(done, units),
        notes=done.notes,
        sections=[_loop(done, units), *_mirrored(done.symmetry, units), *_origin(done.congruency, units)],
        versions={"rtcomp": __version__, "Python": platform.python_version(), "numpy": np.__version__},
        tone="poor" if fails else "good" if settled else "plain",
    )


def _loop(done: Inspected, units: Units) -> Section:
    def paths(some: Sequence[Branch]) -> list[tuple[Floats, Floats]]:
        rows = [slice(b.rows[0], b.rows[1] + 1) for b in some]
        return [(done.position[r], done.force[r]) for r in rows]

    figure = branches_figure(
        paths([b for b in done.branches if b.rising]), paths([b for b in done.branches if not b.rising]),
        paths(done.left_out), unit=units.position, force_unit=units.force,
    )  # fmt: skip
    return Section("The loop and its branches", "A branch is the way from one reversal to the next.", figure)


def _mirrored(found: Symmetry | None, units: Units) -> list[Section]:
    if found is None:
        return []
    u = found.travel - 0.5 * found.travel[-1]
    up, down = found.level + found.rising, found.level + found.falling
    figure = mirrored_figure(
        [(u, up), (-u, -down)], [(u, down), (-u, -up)], unit=units.position, force_unit=units.force
    )
    unit = found.half_range
    scatter = 100 * found.compared.within / unit
    says = (
        "The largest loop, mean of its repeats, and the same turned by half a turn about its centre, which "
        "lies half way between its turning points and where the two are nearest. Where the loop is symmetric "
        "they lie on one another; a constant force moves the centre, no more."
    )
    parts = (
        "Their difference, in % of half of the loop's force range, and its two parts. A force that goes with "
        "the position, whatever the direction, lies wholly in the mean curve of the loop; friction that "
        "differs by direction or along the stroke has a part in its opening too."
    )
    return [
        Section("Symmetry: the loop and its mirror image", says, figure),
        Section(
            "Where it is not symmetric", parts,
            difference_figure(u, 100 * found.difference / unit, scatter, unit=units.position),
        ),
    ]  # fmt: skip


def _origin(found: Congruency | None, units: Units) -> list[Section]:
    if found is None or not found.branches:
        return []
    travel = np.linspace(0.0, max(b.free for b in found.branches), 200)

    def until(part: float) -> list[tuple[Branch, Floats]]:
        ways = [(b, travel[travel <= part * b.free * (1 + 1e-9)]) for b in found.branches]
        return [(b, s) for b, s in ways if s.size > 1]

    both = [[(s, b.at(s)) for b, s in until(1.0) if b.rising == side] for side in (True, False)]
    # The differences as far as they are compared: beyond, branches end one by one and the mean jumps.
    compared = until(FREE)
    total, count = np.zeros(travel.size), np.zeros(travel.size)
    for b, s in compared:
        total[: s.size] += b.at(s)
        count[: s.size] += 1
    mean = total / np.maximum(count, 1)
    unit = 100 / found.force_range
    apart = [
        [(s, unit * (b.at(s) - mean[: s.size])) for b, s in compared if b.rising == side]
        for side in (True, False)
    ]
    says = (
        "Every branch from its turning point, falling ones mirrored, as far as nothing from before can show. "
        "Congruent branches of one direction are one line; two lines are a hysteresis that is congruent but "
        "not symmetric."
    )
    emphasis = (
        "The same, as far as it is compared, less the mean of all branches at equal travel, in % of the "
        "force range."
    )
    return [
        Section(
            "Congruency: all branches from a common origin", says,
            branches_figure(*both, unit=units.position, force_unit=units.force,
                            x="Travel from the turning point", y="Force gained"),
        ),
        Section(
            "The differences alone", emphasis,
            branches_figure(*apart, unit=units.position, force_unit="%",
                            x="Travel from the turning point", y="Force less the mean branch"),
        ),
    ]  # fmt: skip


def _kinds(done: Inspected) -> str:
    rising = sum(b.rising for b in done.branches)
    left = f"; {len(done.left_out)} left out" if done.left_out else ""
    kinds = f"{len(done.kinds)} kind{'' if len(done.kinds) == 1 else 's'}"
    return f"{rising} rising, {len(done.branches) - rising} falling, {kinds}{left}"


def _within(slope: Slope, unit: float) -> str:
    return (
        f"{100 * slope.low / unit:.2g} to {100 * slope.high / unit:.2g}; correlation {slope.correlation:.2f}"
    )


def _grain(done: Inspected, units: Units) -> str:
    count = f", count {si(done.sight.grain.count, units.position)}" if done.sight.grain.count else ""
    return f"noise {si(done.sight.grain.noise, units.position)} rms{count}"


def _share(name: str, part: float, note: str) -> Row:
    if math.isnan(part):
        return Row(name, "n/a", "", "nothing to compare")
    return Row(name, 100 * part, "%", note)


def _scatter(part: float) -> str:
    return "no repeats" if math.isnan(part) else f"repeats {si(100 * part, '%')}"
