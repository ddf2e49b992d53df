"""The null distribution of the one test: replicates of a model through the same screening."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import Candidate, candidates, on_other, started
from rtcomp.diagnosis.candidates.screening import Screen, Screened
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting import starting
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.unbiased import numbers_of
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.diagnosis.numerics.significance import Null, log_gain
from rtcomp.diagnosis.search.as_believed import no_more_than_its_own
from rtcomp.diagnosis.search.matched import matched
from rtcomp.diagnosis.settings import LEVEL, REPLICATES
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

FEW, MORE = 6, 4
"""Replicates after which what is plain is settled; so many more at a time where it is not."""
IN_FULL = 3
"""One of so many replicates drawn at a time is fitted with its best candidate: those with the largest."""


@dataclass(frozen=True)
class Drawn:
    """A replicate: its largest gain to first order, what that is in a full fit, its errors and numbers."""

    gain: float
    errors: Floats
    """(B,)."""
    numbers: Floats
    """(p + q,)."""
    fit: Callable[[], float] | None = None
    """Makes the full fit; None once that is done, or will not be."""
    in_full: float | None = None


def null_of(
    fitter: Fitter,
    fitted: Fitted,
    screen: Screen,
    gain: float,
    seed: int,
    full: float = math.inf,
    ends: float = math.inf,
) -> Null:
    """Return the null distribution beside a fitted model.

    Replicates are drawn until it is plain whether `gain` and the error of the fit are beyond them: sequential
    Monte Carlo (Besag and Clifford 1991, Biometrika 78(2)). A model that cannot be kept on the recorded
    motion is judged by surrogates of its residual instead. The largest gains are those of full fits, the
    others in proportion; after the time `full` (clock.now) all are those of first order, and after
    `ends` a few replicates must do.

    Where the bias of the fit may be why it leaves more than they do, those of a model count that would be
    fitted as this one is (`matched`). Where the belief as it is may have made the recording too, its own
    count if they gain as much: that nothing is missing is denied only if it is by both.
    """

    def of(stage: Callable[[], Stage]) -> Null:
        return _of_model(fitter, fitted, stage, screen, gain, seed, full, ends)

    null = of(partial(fitter.stage, fitted, between=True))
    if _may_be_believed(fitter, fitted, null, gain, seed, ends):
        believed = of(lambda: fitter.balance.stage)
        if believed.numbers is not None and believed.p_value(gain) > null.p_value(gain):
            null = replace(believed, numbers=null.numbers)
    if not _may_be_bent(fitter, fitted, null):
        return null
    for true, more in matched(fitter, fitted, 1000 * seed, ends):
        again = of(partial(fitter.stage, true, between=True))
        if again.p_of_error(fitted.errors) > null.p_of_error(fitted.errors):
            null = replace(again, numbers=(fitted.whole - more)[None, :])
        if null.p_of_error(fitted.errors) >= LEVEL:
            break
    return null


def _may_be_bent(fitter: Fitter, fitted: Fitted, null: Null) -> bool:
    """Tell whether a fit leaves more than its replicates, perhaps only because its mass is biased.

    By what theirs is less than its own the truth is more, about; noise of a reading goes by the mass squared.
    """
    if not fitter.by_force or null.numbers is None or null.p_of_error(fitted.errors) >= LEVEL:
        return False
    less = float(null.numbers[:, 0].mean() / fitted.coefficients[0])
    return null.p_of_error(fitted.errors * min(max(less, 0.0), 1.0) ** 2) >= LEVEL


def _may_be_believed(fitter: Fitter, fitted: Fitted, null: Null, gain: float, seed: int, ends: float) -> bool:
    """Tell whether a gain is more than fits of a fit have, though the belief needs none to leave so little.

    Fits of a belief are bent where a sensor is coarse, and chance gains more beside it than beside the fit.
    """
    if fitted.terms or not fitter.by_force or null.p_value(gain) >= LEVEL or clock.now() > ends:
        return False
    return no_more_than_its_own(fitter, fitter.balance.stage, seed)


def _of_model(
    fitter: Fitter,
    fitted: Fitted,
    made_by: Callable[[], Stage],
    screen: Screen,
    gain: float,
    seed: int,
    full: float,
    ends: float,
) -> Null:
    """Return the null distribution beside a fitted model by replicates of a stage (`null_of`)."""
    try:
        stage = made_by()
    except ConfigError:
        return _surrogates(fitter, fitted, screen, seed)
    names = ent.names(fitted.entries)
    events = any(ent.happens_once(ent.kind_of(c.term.entry)) for c in screen.candidates)

    def one(number: int) -> Drawn | None:
        data = left_by(stage, fitter.balance, 1000 * seed + number)
        if data is None:
            return None
        other = fitter.on(data)
        again = other.fit(list(fitted.terms), fitted, steps=0)
        gains = list(zip(screen.candidates, screen.beside(again), strict=True))
        # Its own size is all that a single event has: the largest of these residuals, not of the recorded.
        made = candidates(other, again, names, events=True) if events else []
        if made:
            gains += zip(made, Screen(made, other, screen.variants).beside(again), strict=True)
        errors, numbers = again.errors * fitter.power / max(other.power, 1e-300), numbers_of(other, again)
        candidate, screened = _largest(other, again, gains, screen.variants)
        if candidate is None or screened is None:
            return Drawn(0.0, errors, numbers)
        return Drawn(
            screened.gain, errors, numbers, lambda: gain_in_full(other, again, candidate, screened, full)
        )

    found: list[Drawn] = []
    chance = np.zeros(0)
    first, last = 0, FEW
    while first < last:
        drawn = [d for d in shared(one, range(first, last)) if d is not None]
        if len(found) + len(drawn) < FEW // 2:
            return _surrogates(fitter, fitted, screen, seed)
        chance = np.append(chance, _by_chance(fitted, screen, 1000 * seed + first, len(drawn)))
        null = _null(fitted, [*found, *drawn], chance)
        # Full fits gain more: where first order makes chance plain, none is needed.
        if null.p_value(gain) < LEVEL or not null.plain(gain, fitted.errors, LEVEL):
            drawn = _largest_in_full(drawn)
            null = _null(fitted, [*found, *drawn], chance)
        if null.plain(gain, fitted.errors, LEVEL) or clock.now() > ends:
            break
        found += drawn
        first, last = last, min(last + MORE, REPLICATES)
    return replace(null, in_full=partial(_gains_of, fitter, fitted, stage, 1000 * seed))


def _gains_of(fitter: Fitter, fitted: Fitted, stage: Stage, seed: int, more: Sequence[Term]) -> Floats:
    """Return what `more` terms, as they were found, gain in short fits of a few replicates, (r,)."""

    def one(number: int) -> float:
        data = left_by(stage, fitter.balance, number)
        if data is None:
            return 0.0
        other = fitter.on(data)
        again = other.fit(list(fitted.terms), fitted, steps=0)
        try:
            larger = other.fit([*again.terms, *more], again, starting.FEW)
        except (ConfigError, np.linalg.LinAlgError):
            return 0.0
        return log_gain(again.errors, larger.errors)

    return np.array(shared(one, range(seed, seed + FEW // 2)))


def _largest(
    fitter: Fitter, model: Fitted, gains: Sequence[tuple[Candidate, Screened]], variants: Floats
) -> tuple[Candidate, Screened] | tuple[None, None]:
    """Return the candidate that gains most beside a model of a replicate, by the columns it has there.

    Columns of the recording see the same motion with other noise, which tells more of a replicate than its
    own columns do. So the candidates that seem to gain most are computed on the replicate, one by one, until
    no other seems to gain more than the best of these.
    """
    order = sorted((each for each in gains if each[1].gain > 0.0), key=lambda each: -each[1].gain)
    best: tuple[Candidate, Screened] | tuple[None, None] = (None, None)
    for candidate, seeming in order:
        if best[1] is not None and best[1].gain >= seeming.gain:
            break
        own = on_other(candidate, fitter, model)
        if own is not None:
            (screened,) = Screen([own], fitter, variants).beside(model)
            if screened.gain > (0.0 if best[1] is None else best[1].gain):
                best = own, screened
    return best


def _null(fitted: Fitted, found: Sequence[Drawn], chance: Floats) -> Null:
    """Return the null distribution of replicates `found` and of first-order gains by `chance`, (R,).

    What full fits add to the gains that have one, they add to the others, and to those by chance.
    """
    told = [d.in_full / d.gain for d in found if d.in_full is not None and d.gain > 0.0]
    more = float(np.median(told)) if told else 1.0
    fully = np.array([more * d.gain if d.in_full is None else d.in_full for d in found])
    errors = np.array([d.errors for d in found])
    numbers = np.array([d.numbers for d in found])
    return Null(_mixed(fitted, fully, errors.sum(axis=1), more * chance), errors, numbers)


def _largest_in_full(drawn: Sequence[Drawn]) -> list[Drawn]:
    """Return replicates, the full fits of those that gain most done."""
    order = sorted(drawn, key=lambda d: -d.gain)
    fits = [d.fit for d in order[: len(order) // IN_FULL] if d.fit is not None]
    done = shared(lambda fit: fit(), fits) + [None] * (len(order) - len(fits))
    return [replace(d, fit=None, in_full=each) for d, each in zip(order, done, strict=True)]


def gain_in_full(
    fitter: Fitter, model: Fitted, candidate: Candidate, screened: Screened, ends: float = math.inf
) -> float:
    """Return the gain of a candidate beside a model in a short fit, or, after `ends`, to first order."""
    if clock.now() > ends:
        return screened.gain
    try:
        larger = fitter.fit([*model.terms, started(candidate, screened.sizes)], model, starting.FEW)
    except (ConfigError, np.linalg.LinAlgError):
        return screened.gain
    return max(screened.gain, log_gain(model.errors, larger.errors))


def _mixed(fitted: Fitted, gains: Floats, errors: Floats, by_chance: Floats) -> Floats:
    """Return the largest gains (R,) on the residual of a model if no candidate is part of the truth.

    The residual has two parts. One is as large as the `errors` of the replicates: noise, and the errors of
    the method; its gains are theirs. The cause of the rest is unknown; its gains are those `by_chance`.
    """
    whole = float(fitted.errors.sum())
    known = np.minimum(errors, whole)
    left = known * np.exp(-gains) + (whole - known) * np.exp(-by_chance)
    return np.asarray(-np.log(left / whole))


def _by_chance(fitted: Fitted, screen: Screen, seed: int, count: int) -> Floats:
    """Return the largest gains (R,) on phase-randomised surrogates of the residual.

    A surrogate has the spectrum of the residual and random phases, so it is independent of the motion
    (Theiler and others 1992, Physica D 58). It has no mean: a constant is nothing that chance makes.
    """
    random = np.random.default_rng(seed)
    columns = screen.columns_beside(fitted)
    size = np.abs(np.fft.rfft(fitted.residual))
    size[0] = 0.0
    phases = random.random((count, size.size))

    def one(phase: Floats) -> float:
        other = np.fft.irfft(size * np.exp(2j * np.pi * phase), fitted.residual.size)
        return max((s.gain for s in screen.gains(columns, other)), default=0.0)

    return np.array(shared(one, phases))


def _surrogates(fitter: Fitter, fitted: Fitted, screen: Screen, seed: int) -> Null:
    """Return the null distribution of phase-randomised surrogates of the residual.

    The squared error of noise alone is that of the whitened residual: 1 in each row.
    """
    rows = np.bincount(fitter.block, minlength=fitter.blocks)[fitter.use]
    noise = np.random.default_rng(seed).chisquare(np.maximum(rows, 1), (FEW, rows.size))
    return Null(_by_chance(fitted, screen, seed, FEW), noise)


def best(names: Sequence[str], gains: Sequence[float], count: int) -> list[int]:
    """Return the numbers of the best `count` by gain, one of each name."""
    found: list[int] = []
    for i in np.argsort(-np.asarray(gains)).tolist():
        if all(names[i] != names[j] for j in found):
            found.append(i)
        if len(found) == count:
            break
    return found
