"""The diagnosis from top to bottom: data, objective, baseline, candidates, test, search, set, judgement."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis.candidates.screening import Look, look
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.baseline import baseline, settle, with_offset
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.retuned import EXPONENT
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.noise import Noise
from rtcomp.diagnosis.forces.sticking import untold
from rtcomp.diagnosis.mismatch.locate import locate
from rtcomp.diagnosis.mismatch.where import Compared, as_force
from rtcomp.diagnosis.positions.hidden import MUCH, hides
from rtcomp.diagnosis.positions.trajectory import Trajectory
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.result import Diagnosis, Place
from rtcomp.diagnosis.search.as_believed import as_loud, null_of_belief
from rtcomp.diagnosis.search.confidence import alternatives
from rtcomp.diagnosis.search.selection import LOOKED, Search, search
from rtcomp.diagnosis.search.ways import Left, alike, doubted
from rtcomp.diagnosis.settings import BUDGET, LEFT, LEVEL
from rtcomp.diagnosis.verdict.answer import Rest, answer
from rtcomp.diagnosis.verdict.validation import Reserved
from rtcomp.errors import RtcompError
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

Progress = Callable[[float, str], None]
STICKS = (
    "the axis sticks finer than its sensor sees, which leaves {:.2g} % of the force open to friction: "
    "judged by position, simulated over {:.2g} s from points of the recording"
)
SEARCH, TELL_APART = 0.8, 0.9
"""Parts of the budget at which the search ends, and what then tells its models apart."""
FORCES = 0.5
"""Part of the time for the search after which positions may have to judge instead of forces."""
COMPILED = "compiling took {:.0f} s, which happens once on a machine and is not counted in the budget"
LONG = 1.0
"""Time (s) of compiling that is worth a note."""
BAND_LIMITED = "the command is taken as band-limited between rows, which fits better than held"
EARLY = (
    "the command acts {:.2g} ms before its row: what was read belongs to a later time than it says, or a "
    "simulation moves before it is pushed; that is no physics, and taken so"
)
COUNTED = (
    "the sensor reads in counts of {:.3g} {}, as the recording tells; the stage states no sensor.resolution, "
    "which a simulation needs"
)
LAW = (
    "friction yields by another law than believed: of exponent 0 at the reach of an element at once, of 1 as "
    "Dahl's solid, which nears its level"
)
Located = Callable[[float, Sequence[Place]], None]
"""Told, before anything is named, what part of the force the refitted stage leaves open (rms), and where."""


def diagnose(
    stage: Stage,
    recordings: Sequence[Recording],
    *,
    held: bool | None = None,
    budget: float = BUDGET,
    began: float | None = None,
    progress: Progress | None = None,
    located: Located | None = None,
    seed: int = 0,
) -> Diagnosis:
    """Say where `stage` and `recordings` (of one rate) differ, what is missing, and what it explains.

    `held` tells whether the command is held from row to row or goes on between rows as a band-limited
    signal; None where both are to be tried. `budget` (s) ends the search with the best answer so far; it is
    counted from the time `began` (time.monotonic), or from now, and does not count what compiling takes.
    `progress` hears how far each step is, `located` the places of the mismatch before anything is named.
    Raises RtcompError where the budget does not do for the baseline.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):  # the cores are shared out by `cores`
        return _diagnosed(stage, recordings, held, budget, began, progress, located, seed)


def _diagnosed(
    stage: Stage,
    recordings: Sequence[Recording],
    held: bool | None,
    budget: float,
    began: float | None,
    progress: Progress | None,
    located: Located | None,
    seed: int,
) -> Diagnosis:
    say: Progress = progress or (lambda _part, _what: None)
    ends, compiling = clock.ends_at(budget, began), clock.compiling()
    say(0.0, "balance")
    objectives = _objectives(stage, recordings, held, ends - (1.0 - SEARCH) * budget)
    if clock.now() > ends:
        raise RtcompError(f"the budget of {budget:g} s ended before the stage was refitted; give it more")
    balance, base = objectives[0].balance, objectives[0].base
    reserved = Reserved(balance)
    view = Compared(balance)
    before = as_force(balance, base.residual)
    if located is not None:
        left = (base.sse / max(balance.power, 1e-300)) ** 0.5
        located(left, locate(view, before, None, seed, stage.axis))
    say(1.0, "balance")
    finish = ends - (1.0 - SEARCH) * budget
    hidden = untold(balance) > MUCH
    fitter, found = _searched(objectives, clock.until(finish, FORCES) if hidden else finish, say, seed)
    more = Rest.of(fitter, found).significant
    if hidden and (found.denied or more):
        fitter, found = _by_position(stage, fitter, found, finish, say, seed)
    of_belief = as_loud(fitter, stage, found.chosen, found.null, seed) if fitter.by_force and more else None
    if of_belief is not None:
        found.null, found.as_believed = of_belief, True
    say(0.0, "tell apart")
    sets = alternatives(fitter, found, ends - (1.0 - TELL_APART) * budget)
    say(0.5, "judge")
    if fitter.balance is not balance:
        reserved = Reserved(fitter.balance)
    done = answer(stage, fitter, found, sets, reserved, seed, ends)
    say(1.0, "judge")
    notes = [BAND_LIMITED] if len(objectives) > 1 and not fitter.balance.data.held else []
    data = fitter.balance.data
    if data.count and not stage.sensor.resolution:
        notes.append(COUNTED.format(data.count, for_axis("m", stage.axis)))
    early = data.early * data.period
    notes += [EARLY.format(1e3 * early)] if early else []
    notes += [LAW] if any(r.parameter == EXPONENT for r in done.retuned) else []
    if done.position is not None:
        notes.append(STICKS.format(100.0 * untold(balance), done.position.seconds))
    compiling = clock.compiling() - compiling
    notes += [COMPILED.format(compiling)] if compiling > LONG else []
    notes += [f"not tried within {budget:g} s: {what}" for what in found.not_tried]
    return replace(done, notes=[*notes, *done.notes], not_tried=found.not_tried)


def _by_position(
    stage: Stage, by_force: Fitter, found: Search, ends: float, say: Progress, seed: int
) -> tuple[Fitter, Search]:
    """Return the search by simulated positions where forces are no judge, or name nothing that it names.

    Else what was `found` by forces. Windows are short: that positions miss nothing does not say that nothing
    is missing where forces leave more than noise.
    """
    blind = hides(by_force, found.chosen)
    if found.chosen.terms and not blind:
        return by_force, found
    if clock.now() > ends:
        found.not_tried.append("simulated positions in the place of forces")
        return by_force, found
    fitter, other = _by_trajectory(stage, by_force, ends, say, seed)
    return (fitter, other) if blind or other.chosen.terms else (by_force, found)


def _by_trajectory(
    stage: Stage, by_force: Fitter, ends: float, say: Progress, seed: int
) -> tuple[Fitter, Search]:
    """Return the search on the objective that judges by simulated position, on the same blocks.

    A belief that leaves no more than on recordings of its own has nothing missing: a fit of it moves numbers
    until what is unsure of each window's beginning is made up for.
    """
    believed = stage if stage.friction is not None else by_force.stage(by_force.fit([]))
    fitter = Trajectory.of(by_force.balance, believed)
    null = null_of_belief(fitter.balance, believed, lambda data: fitter.on(data).left_as_believed(), seed)
    if null is not None and null.p_of_error(fitter.left_as_believed()) > LEVEL:
        belief = fitter.as_believed()
        return fitter, Search(belief, belief, null, belief)
    return fitter, search(fitter, fitter.fit([]), ends, say, seed)


@dataclass(frozen=True)
class Objective:
    """One way to take the command: its force balance, the refitted stage, a look at all candidates."""

    fitter: Fitter
    base: Fitted
    first: Look | None = None

    @property
    def balance(self) -> ForceBalance:
        """Its force balance."""
        return self.fitter.balance


def _objectives(
    stage: Stage, recordings: Sequence[Recording], held: bool | None, ends: float
) -> list[Objective]:
    """Return the objective of each way to take the command, the better first.

    A loop holds its command from row to row. Where there is no reference the command may be a measured signal
    that goes on between rows: both ways are looked at, each with the best candidate beside it.
    """
    looped = all(r.reference is not None for r in recordings)
    ways = ([True] if looped else [True, False]) if held is None else [held]

    def objective(way: bool) -> Objective:
        bandwidth = Noise.of(stage, load_data(recordings, held=way)).bandwidth
        balance = ForceBalance(stage, load_data(recordings, held=way, bandwidth=bandwidth))
        base = baseline(balance)
        fitter = Fitter(balance)
        return Objective(fitter, with_offset(fitter, base))

    made = shared(objective, ways)
    if len(made) == 1:
        return made
    shares = (0.5 * LOOKED, LOOKED / (2.0 - LOOKED))  # of what is left each time: as long for both
    pairs = zip(made, shares, strict=True)
    seen = [look(one.fitter, one.base, clock.until(ends, share)) for one, share in pairs]
    sets = zip(made, seen, alike(*(one.balance for one in made)), strict=True)
    left = [Left.by(one.fitter, one.base, some).weighed - first.gain for one, first, some in sets]
    return [replace(made[i], first=seen[i]) for i in np.argsort(left)]


def _searched(
    objectives: Sequence[Objective], ends: float, say: Progress, seed: int
) -> tuple[Fitter, Search]:
    """Return the search on the first objective, or on the second where that explains more.

    What is missing may hide which way the command goes between rows, and the wrong way looks like a delay.
    The other is searched where a model found fits better there, or where the first leaves more than noise.
    Where both do, the second must leave as little of what the first leaves as an effect of what there is
    without it. Where each only makes up for the other way, what was found before that counts.
    """
    best = objectives[0]
    if len(objectives) == 1:
        return best.fitter, search(best.fitter, best.base, ends, say, seed)
    blocks = alike(*(one.balance for one in objectives))
    fitter = Fitter(objectives[1].balance)
    doubt = partial(doubted, best.fitter, best.base, fitter, blocks, ends)
    found = search(best.fitter, best.base, ends, say, seed, doubt, best.first)
    told = not Rest.of(best.fitter, found).significant
    if not found.doubted and (told or clock.now() > ends):
        return best.fitter, found
    settle(fitter)
    base = with_offset(fitter, fitter.fit([]))
    doubt = partial(doubted, fitter, base, best.fitter, blocks[::-1], ends)
    other = search(fitter, base, ends, say, seed, doubt)
    if found.doubted != other.doubted:
        return (best.fitter, found) if other.doubted else (fitter, other)
    if not found.doubted and not Rest.of(fitter, other).significant:
        return fitter, other
    both = zip((best.fitter, fitter), (found, other), blocks, strict=True)
    left, left_there = (Left.by(one, by.chosen, some).weighed for one, by, some in both)
    most = left if found.doubted else left + math.log(LEFT)
    return (fitter, other) if left_there < most else (best.fitter, found)
