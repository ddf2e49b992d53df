"""Refinement: parameters of named entries by nonlinear least squares, the base refitted with each try."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rtcomp.diagnosis.base import FIXED, Fitted, bounds_of
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.departure import off
from rtcomp.diagnosis.ledger import Ledger, System
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.scene import Entry
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Parameter, catalogue
from rtcomp.physics.drive import Cogging
from rtcomp.physics.growing import GROWTH

SCALING = ("drive-gain", "sensor-scale", "inertia")
"""Entries that do what other believed numbers would do together."""
HARMONICS = Cogging.list_name
SEARCHED = ("time",)
"""Parameters that the search settles, beside choices: a jump is between two rows."""
BETWEEN = (0.02, 0.98)
"""Range of a stiffening that is refined."""
BELIEF = 3e-4
"""Weight of a believed number's usual error, in squared errors of the whole recording."""
HEAVY = 0.5
"""Part of the drive's force that friction takes by load, at the most."""
SETTLED = 1e-4
"""Gain of a step, relative, from which on a step of less than the derivative's own ends the search."""
NEARLY = 1e-3
"""Gain of a step, relative, from which on it does not matter which of two entries is the better."""
TRIES = 12
"""Steps of Levenberg and Marquardt at the most."""


@dataclass(frozen=True)
class Knob:
    """One free parameter: which entry, its name, the step that derivatives are taken with, its range."""

    entry: int
    parameter: Parameter
    step: float
    most: float | None = None
    """Largest value that this recording can tell of; None where the parameter's own range is all."""
    item: int | None = None
    """Which of the entry's harmonics it is a parameter of, if of one."""

    def of(self, entries: Sequence[Entry]) -> float:
        """Return its value in `entries`."""
        return float(self._holder(entries)[self.parameter.name])  # type: ignore[arg-type]

    def put(self, entries: Sequence[Entry], value: float) -> None:
        """Give it a value in `entries`."""
        self._holder(entries)[self.parameter.name] = value

    def _holder(self, entries: Sequence[Entry]) -> Entry:
        entry = entries[self.entry]
        return entry if self.item is None else entry[HARMONICS][self.item]  # type: ignore[index]


@dataclass(frozen=True)
class Refined:
    """Entries with refined parameters, the system they make, and what is left in blocks left out."""

    entries: list[Entry]
    fitted: Fitted
    knobs: list[Knob]
    jacobian: Floats
    """(n_seen, q): change of the residual (N) with each knob, the base refitted."""
    residual: Floats
    """(n_seen,) N."""
    away: Floats
    """(5, q): change of `departure.off` with each knob."""

    @property
    def errors(self) -> Floats:
        """Squared error of every block left out, in units of the drive side as first believed."""
        return self.fitted.errors


def knobs_of(entries: Sequence[Entry], motion: Motion, which: Sequence[int] | None = None) -> list[Knob]:
    """Return the free parameters of `entries` (of those numbered in `which`): all numbers that they state."""
    low, high = motion.stroke
    total = max(motion.seconds, 1.0)
    found = []
    for i, entry in enumerate(entries):
        if which is not None and i not in which:
            continue
        for parameter in catalogue.entry(str(entry["name"])).parameters:
            value = entry.get(parameter.name)
            if not isinstance(value, int | float):
                continue
            size = abs(float(value))
            step = 0.01 * size
            if parameter.name in SEARCHED or parameter.choice:
                continue
            if parameter in GROWTH:
                step = 0.05 if 0.0 < float(value) < 1.0 else 0.0  # else the search has settled it
            elif parameter.name == "period":
                step = min(0.02 * size, 0.05 * size**2 / (high - low))
            elif parameter.name == "phase":
                step = 0.05
            elif parameter.name == "frequency" and entry["name"] == "tonal-disturbance":
                step = 0.03 / total
            elif parameter.name == "position":
                step = 0.002 * (high - low)
            if step == 0.0:
                continue
            # A wave longer than the stroke is a slope or an offset by another name.
            most = 1.2 * (high - low) if parameter.name == "period" else None
            if entry["name"] == "load-dependent-friction":
                most = HEAVY  # more would be a drive that locks itself
            found.append(Knob(i, parameter, step, most))
        for item, harmonic in enumerate(entry.get(HARMONICS, ())):  # type: ignore[arg-type, var-annotated]
            size = abs(float(harmonic["amplitude"]))
            steps = {"amplitude": 0.01 * size, "phase": 0.05 if size else 0.0}
            found += [Knob(i, p, steps[p.name], None, item) for p in Cogging.element if steps.get(p.name)]
    return found


def at(entries: Sequence[Entry], knobs: Sequence[Knob], moved: Floats) -> list[Entry]:
    """Return the entries with every knob moved by so many of its steps, kept in range."""
    out = deepcopy(list(entries))
    for knob, steps in zip(knobs, moved, strict=True):
        p = knob.parameter
        before = knob.of(out)
        value = before + steps * knob.step
        if p.low >= 0.0 and p.name not in ("amplitude",):
            value = max(value, 0.2 * before)  # sizes and times do not change sign
        high = min(p.high, 1e300 if knob.most is None else knob.most)
        low = max(p.low, -1e300)
        if p in GROWTH:
            low, high = BETWEEN  # its ends are the search's, not refined any more
        knob.put(out, float(np.clip(value, low, high)))
    return out


def consistent(refined: Refined) -> Refined:
    """Return `refined` in terms of the friction that it ends with.

    The load's coefficient multiplies over the level of the friction that the columns were made with: at
    another level the same growth takes another coefficient.
    """
    if not any(e["name"] == "load-dependent-friction" for e in refined.entries):
        return refined
    ledger, reaches = refined.fitted.ledger, refined.fitted.ledger.reaches
    now = refined.fitted.coefficients[FIXED : FIXED + reaches.size]
    ratio = float(now @ reaches) / max(float(ledger.weights @ reaches), 1e-300)
    ledger.weigh(now)
    entries = [dict(e) for e in refined.entries]
    for entry in entries:
        if entry["name"] == "load-dependent-friction":
            entry["coefficient"] = ratio * float(entry["coefficient"])  # type: ignore[arg-type]
    return replace(refined, entries=entries)


def evaluate(base: Fitted, entries: Sequence[Entry]) -> tuple[Fitted, Floats]:
    """Return the base refitted with `entries` at work, and the residual (N) of the seen rows.

    Errors are scaled to the drive side as believed, so that an entry which merely shrinks both sides gains
    nothing.
    """
    ledger = base.ledger
    system = ledger.system([effect_of(e) for e in entries])
    return fitted_with(base, ledger, system, [str(e["name"]) for e in entries])


def fitted_with(
    base: Fitted, ledger: Ledger, system: System, names: Sequence[str] = ()
) -> tuple[Fitted, Floats]:
    """Fit `system` and return it with the residual (N) of the rows that may be seen, scaled alike."""
    size = system.columns.shape[1]
    bounds = bounds_of(ledger.stage, size, names=names, freed=base.freed)
    scale = believed_power(ledger) / max(float(system.blocks.power[ledger.seen].sum()), 1e-300)
    errors = system.blocks.left_out(ledger.seen, bounds) * scale
    fitted = Fitted(ledger, system, bounds, errors, base.scale, base.freed)
    rows = ledger.seen[ledger.block]
    residual = (system.y - system.columns @ fitted.coefficients)[rows] * np.sqrt(scale)
    return fitted, residual


def believed_power(ledger: Ledger) -> float:
    """Return the squared drive force of the seen blocks as the stage believes it."""
    return float(ledger.system().blocks.power[ledger.seen].sum())


def refine(
    base: Fitted,
    motion: Motion,
    entries: Sequence[Entry],
    which: Sequence[int] | None = None,
    tries: int = TRIES,
    searching: bool = False,
) -> Refined:
    """Move the parameters of `entries` to where the residual is smallest, or near it while `searching`.

    Raises ConfigError where the entries as given cannot be evaluated.
    """
    current = [dict(e) for e in entries]
    knobs = knobs_of(current, motion, which)
    fitted, residual = evaluate(base, current)
    damping = 1e-3
    belief = off(fitted)
    jacobian, away = np.zeros((residual.size, len(knobs))), np.zeros((belief.size, len(knobs)))
    if not knobs:
        return Refined(current, fitted, knobs, jacobian, residual, away)
    for _ in range(tries):
        # Just enough to hold what the recording does not tell.
        weight = BELIEF * float(residual @ residual)
        turns = [(j, way) for j, knob in enumerate(knobs) for way in _ways(current[knob.entry])]
        turned = shared(partial(_turned, base, current, knobs), turns)
        jacobian[:] = away[:] = 0.0
        for (j, way), other in zip(turns, turned, strict=True):
            if other is None:
                continue
            slope = way * (other[1] - residual)
            # Where a believed number is at its bound, only one way is told by the recording.
            if way > 0 or slope @ slope < 0.25 * float(jacobian[:, j] @ jacobian[:, j]):
                jacobian[:, j], away[:, j] = slope, way * (off(other[0]) - belief)
        gram = jacobian.T @ jacobian + weight * away.T @ away
        slope = jacobian.T @ residual + weight * away.T @ belief
        before = float(residual @ residual + weight * belief @ belief)
        improved = False
        for _ in range(5):
            diagonal = np.diag(gram) + 1e-12 * np.trace(gram) / len(knobs) + 1e-300
            move = -np.linalg.solve(gram + damping * np.diag(diagonal), slope)
            move = np.clip(move, -30.0, 30.0)
            trial = at(current, knobs, move)
            try:
                tried, left = evaluate(base, trial)
            except ConfigError:
                damping *= 10.0
                continue
            further = off(tried)
            after = float(left @ left + weight * further @ further)
            if after < before:
                improved = True
                break
            damping *= 10.0
        if not improved:
            break
        gained = 1.0 - after / before
        current, fitted, residual, belief = trial, tried, left, further
        knobs = knobs_of(current, motion, which)
        damping = max(damping * 0.2, 1e-6)
        if searching and gained < NEARLY:
            break
        if gained < SETTLED and float(np.max(np.abs(move))) < 1.0:
            break
    return Refined(current, fitted, knobs, jacobian, residual, away)


def _ways(entry: Entry) -> tuple[float, ...]:
    """Return the directions in which derivatives with respect to an entry's knobs are taken."""
    return (1.0, -1.0) if entry["name"] in SCALING else (1.0,)


def _turned(
    base: Fitted, entries: Sequence[Entry], knobs: Sequence[Knob], turn: tuple[int, float]
) -> tuple[Fitted, Floats] | None:
    """Evaluate with one knob a step up or down (`turn`: which, and the way); None where that cannot be."""
    one = np.zeros(len(knobs))
    one[turn[0]] = turn[1]
    try:
        return evaluate(base, at(entries, knobs, one))
    except ConfigError:
        return None
