"""Candidates: every effect of the catalogue, at starting values that the units of its parameters give.

A parameter's unit gives its scale on this recording (`scales`). An effect needs to say nothing more; where a
parameter has no unit, it states start values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.scales import Scales
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term, first_order
from rtcomp.diagnosis.fitting.starting import within
from rtcomp.diagnosis.forces.balance import BASE, NOTHING, ForceBalance
from rtcomp.diagnosis.numerics.grids import Point, chessboard
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Parameter, catalogue

NOT_IN_PROPORTION = ("s", "V")
"""Units of what shifts or cuts a signal: far from neutral it does not act in proportion; tried there too."""
LIKELY = 2
"""Start values at which the further forms of an effect are looked at."""
FORCES, MOMENTS = "N", "N m"
"""Units of an effect that is a force on a linear axis and a moment on a rotary one."""


@dataclass(frozen=True)
class Candidate:
    """An entry at a point of its parameters, and what the model changes by with its sizes, (q, n)."""

    term: Term
    parts: tuple[Entry, ...]
    """Entries whose changes are the columns: unit sizes, quarter periods, or the entry itself."""
    columns: Floats
    low: Floats
    high: Floats
    """Bounds of the sizes, (q,) each."""
    solved: bool = False
    """Whether a fit solves for its sizes, wherever they begin."""
    looked: str = ""
    """The linear parameter that is looked at, where that is one of several."""

    @property
    def point(self) -> Hashable:
        """What tells it from others, whatever it stands beside."""
        return _key((self.term.entry, self.looked))

    @property
    def name(self) -> str:
        """Its name."""
        return str(self.term.entry["name"])

    @property
    def family(self) -> str:
        """Its name and form."""
        return f"{self.name} {self.term.entry.get('form', '')}"


def searchable(balance: ForceBalance) -> Iterator[type[Effect]]:
    """Go through what may be missing; not what stands for a number of the belief, which is refitted."""
    for kind in catalogue.entries():
        if kind.searchable and (not kind.stands_for or _denied(balance, kind.stands_for)):
            yield kind


def _own(kind: type[Effect], balance: ForceBalance) -> list[Parameter]:
    """Return the parameters that an effect has on this axis: a force or a moment, not both."""
    turns = any(p.unit == MOMENTS for p in kind.parameters)
    others = FORCES if turns and balance.stage.axis == "rotary" else MOMENTS
    return [p for p in kind.parameters if p.unit != others]


def _only_bias(kind: type[Effect], balance: ForceBalance) -> bool:
    """Tell whether a constant force is all that an effect can be on this axis."""
    return kind.bias and all(p.unit != MOMENTS for p in _own(kind, balance))


def _denied(balance: ForceBalance, number: str) -> bool:
    return number in BASE and balance.without(number)


def candidates(
    fitter: Fitter,
    fitted: Fitted,
    taken: Sequence[str] = (),
    *,
    events: bool = False,
    ends: float = math.inf,
    known: Sequence[Candidate] = (),
    explained: Callable[[Sequence[Candidate]], Floats] | None = None,
) -> list[Candidate]:
    """Return every candidate beside a fitted model, with the columns it would add to it.

    In further forms where `explained` tells how much candidates take away.

    With `events`, those only that happen once, at a moment that the residual shows. Those not made until the
    time `ends` (clock.now) are left out; every effect's first start comes before the others. What is
    `known` beside a smaller model is taken from there: much the same to first order, where a fit only begins.
    """
    balance = fitter.balance
    scales = Scales.of(fitter, fitted)
    offset = fitter.has_offset(fitted) or any(ent.kind_of(e).bias for e in fitted.entries)
    kinds = [
        k
        for k in searchable(balance)
        if k.name not in taken and not (offset and _only_bias(k, balance)) and ent.happens_once(k) >= events
    ]
    points = {k: list(_points(k, scales, fitter)) for k in kinds}
    made = {c.point: c for c in known}

    def make(item: tuple[type[Effect], tuple[Entry, str]]) -> Candidate | None:
        before = made.get(_key(item[1]))
        if before is not None or clock.now() > ends:
            return before
        return _candidate(fitter, fitted, *item)

    # What changes nothing at its first and last point (friction, where there is none) is tried at no other.
    own = {kind: [p for p in found if _first_form(kind, p)] for kind, found in points.items()}
    outer = [(kind, found.pop(at)) for at in (0, -1) for kind, found in own.items() if found]
    shown = [c for c in shared(make, outer) if c is not None]
    names = {c.name for c in shown}
    more = [(kind, point) for kind, found in own.items() for point in found if kind.name in names]
    shown += [c for c in shared(make, more) if c is not None]
    # A form differs in shape, not in where it is: the others are looked at where the first does most. Courses
    # in time differ in when they are.
    forms = {kind: [p for p in found if not _first_form(kind, p)] for kind, found in points.items()}
    if explained is None or not shown or not any(forms.values()):
        return shown
    likely = _likely(shown, explained(shown))
    others = [
        (kind, point)
        for kind, found in forms.items()
        for point in found
        if kind.name in likely
        and (ent.goes_by_time(kind) or any(_alike(kind, point[0], e) for e in likely[kind.name]))
    ]
    return [*shown, *(c for c in shared(make, others) if c is not None)]


def _key(point: tuple[Entry, str]) -> Hashable:
    return frozenset(point[0].items()), point[1]


def _first_form(kind: type[Effect], point: tuple[Entry, str]) -> bool:
    return point[0].get("form", "") in ("", *list(kind.forms)[:1])


def _likely(shown: Sequence[Candidate], explained: Floats) -> dict[str, list[Entry]]:
    """Return the start values of each effect that explain most."""
    found: dict[str, list[Entry]] = {}
    for i in np.argsort(-explained, kind="stable").tolist():
        found.setdefault(shown[i].name, []).append(shown[i].term.entry)
    return {name: entries[:LIKELY] for name, entries in found.items()}


def _alike(kind: type[Effect], entry: Entry, other: Entry) -> bool:
    """Tell whether two entries have equal values of all parameters that both have, but for phases."""
    both = [p.name for p in kind.parameters if p.unit != ent.PHASE and p.name in entry and p.name in other]
    return all(entry[name] == other[name] for name in both)


def _points(kind: type[Effect], scales: Scales, fitter: Fitter) -> Iterator[tuple[Entry, str]]:
    """Go through entries at start values, and the linear parameter looked at ("" for the entry as is)."""
    own = _own(kind, fitter.balance)
    for form in list(kind.forms) or [""]:
        base: Entry = {"name": kind.name, **({"form": form} if form else {})}
        base.update({p.name: ent.neutral(kind, p.name) for p in own if p.name in kind.linear})
        nonlinear = [p for p in own if p.name not in kind.linear and _searched(kind, p)]
        looked = [""] if fitter.linear(kind) else [n for n in kind.linear if n in base] or [""]
        for linear in looked:
            # What only a wave has stays out of a slope.
            moved = [p for p in nonlinear if _of_linear(kind, p, linear)]
            still = {p.name: (scales.of_parameter(p, kind) or [0.0])[0] for p in nonlinear if p not in moved}
            ranges = [
                _phases(kind, base, fitter) if p.unit == ent.PHASE else scales.of_parameter(p, kind)
                for p in moved
            ]
            for values in _grid(kind, moved, ranges):
                yield {**base, **still, **dict(zip([p.name for p in moved], values, strict=True))}, linear
        for name in [] if fitter.linear(kind) else kind.linear:
            p = ent.parameter(kind, name)
            if name in base and p.unit in NOT_IN_PROPORTION:
                still = {q.name: (scales.of_parameter(q, kind) or [0.0])[0] for q in nonlinear}
                yield from (({**base, **still, name: value}, "") for value in scales.of_parameter(p, kind))
            elif name in base and p.unit == "m" and ent.happens_once(kind):  # further than friction yields
                jumps = fitter.balance.data.jumps
                yield from (({**base, ent.MOMENT: j.time, name: j.size}, "") for j in jumps)


def _grid(kind: type[Effect], moved: Sequence[Parameter], ranges: Sequence[Sequence[float]]) -> list[Point]:
    """Return values of all parameters that are `moved`: every form with every second point of the others.

    Of one with several values all are taken: a fit begins from the nearest.
    """
    measured = [i for i, p in enumerate(moved) if len(ranges[i]) > 1 and not ent.is_form(kind, p)]
    return chessboard(ranges, thinned=measured if len(measured) > 1 else [])


def _searched(kind: type[Effect], p: Parameter) -> bool:
    return p.default is None or p.unit == ent.PHASE or p.name in kind.search_grid


def _of_linear(kind: type[Effect], p: Parameter, linear: str) -> bool:
    """Tell whether a nonlinear parameter matters to the force of a linear one."""
    waves = any(q.unit == ent.PHASE for q in kind.parameters)
    only = p.unit == ent.PHASE or p.name == ent.PERIOD
    return not (waves and only) or not linear or _waves_of(kind, linear)


def _phases(kind: type[Effect], entry: Entry, fitter: Fitter) -> list[float]:
    """Return the phases to start from: one where quarter periods do for the rest."""
    if not fitter.linear(kind) or ent.waves(kind, {**entry, **{p.name: 0.0 for p in kind.parameters}}):
        return [0.0]
    return [float(a) for a in np.linspace(0.0, np.pi, 4, endpoint=False)]


def _waves_of(kind: type[Effect], linear: str) -> bool:
    return linear == ent.AMPLITUDE and any(p.unit == ent.PHASE for p in kind.parameters)


def _candidate(
    fitter: Fitter, fitted: Fitted, kind: type[Effect], point: tuple[Entry, str]
) -> Candidate | None:
    """Make a candidate: columns of free size, or what the model changes by with the entry at work."""
    entry, linear = point
    try:
        if fitter.linear(kind):
            parts = ent.basis(entry)
            columns = fitter.units([*fitted.entries, entry])
            low, high = ent.bounds_of(entry)
            return _shown(fitter, Candidate(Term.of(entry), tuple(parts), columns, low, high, True, linear))
        if not linear:
            change = fitter.change(fitted, entry)[None, :]
            found = Candidate(Term.of(entry), (entry,), change, np.zeros(1), np.full(1, np.inf))
            return _shown(fitter, found)
        p = ent.parameter(kind, linear)
        step, most = first_order(p, fitter.balance), ent.highest(entry, p)
        phases = [p.name for p in kind.parameters if p.unit == ent.PHASE]
        if _waves_of(kind, linear):
            parts = [{**entry, linear: step, phases[0]: angle} for angle in (0.0, 0.5 * np.pi)]
            free = frozenset(q.name for q in kind.parameters if q.name in entry and q.name not in kind.linear)
            term = Term(entry, free | {linear})
            low, high = np.full(2, -most / step), np.full(2, most / step)
        else:
            parts = [{**entry, linear: entry[linear] + step}]
            dead = {p.name for p in kind.parameters if p.unit == ent.PHASE or p.name == ent.PERIOD}
            own = {p.name for p in kind.parameters if p.name in entry}
            others = set(kind.linear) if phases or not ent.adds_force(kind) else set()
            term = Term(entry, frozenset(own - others - (dead if phases else set())) | {linear})
            low, high = (
                np.array([(p.lowest - entry[linear]) / step]),
                np.array([(most - entry[linear]) / step]),
            )
        columns = np.array([fitter.change(fitted, part) for part in parts])
        return _shown(fitter, Candidate(term, tuple(parts), columns, low, high, looked=linear))
    except ConfigError:
        return None


def on_other(candidate: Candidate, fitter: Fitter, fitted: Fitted) -> Candidate | None:
    """Return a candidate with the columns that it has beside a model of other data; None without."""
    entry = candidate.term.entry
    return _candidate(fitter, fitted, ent.kind_of(entry), (entry, candidate.looked))


def _shown(fitter: Fitter, candidate: Candidate) -> Candidate | None:
    """Return the candidate where its columns are finite, and more than rounding makes of nothing."""
    with np.errstate(over="ignore"):  # what runs away is no candidate
        power = float(np.sum(candidate.columns**2))
    return candidate if np.isfinite(power) and power > NOTHING * fitter.power else None


def started(candidate: Candidate, sizes: Floats) -> Term:
    """Return the term to fit from: the candidate with the sizes that the screening found."""
    entry = candidate.term.entry
    kind = ent.kind_of(entry)
    if candidate.solved:
        return candidate.term
    moved = {n for part in candidate.parts for n in part if part[n] != entry[n]}
    if not moved:
        return candidate.term
    out = dict(entry)
    phases = [p.name for p in kind.parameters if p.unit == ent.PHASE]
    if len(candidate.parts) == 2:
        name = next(n for n in moved if n not in phases)
        step = float(candidate.parts[0][name])
        out[name] = within(ent.parameter(kind, name), float(np.hypot(*sizes)) * step, entry)
        out[phases[0]] = float(np.arctan2(sizes[1], sizes[0]))
    else:
        name = next(iter(moved))
        p = ent.parameter(kind, name)
        neutral = float(entry[name])
        value = neutral + float(sizes[0]) * (float(candidate.parts[0][name]) - neutral)
        out[name] = within(p, value, entry)
    return candidate.term.with_entry(out)
