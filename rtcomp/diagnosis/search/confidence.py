"""What a recording cannot tell apart: the model confidence set of the chosen model and its neighbours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import started
from rtcomp.diagnosis.candidates.growing import fitted_in_time
from rtcomp.diagnosis.candidates.screening import look
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.intervals import told
from rtcomp.diagnosis.fitting.other_forms import any_laws, errors_beside, in_any_form, of_position
from rtcomp.diagnosis.numerics.significance import confidence_set, log_gain, probabilities
from rtcomp.diagnosis.search.acceptance import impossible
from rtcomp.diagnosis.search.by_position import bent, goes_plainly
from rtcomp.diagnosis.search.replicates import best
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.search.separate import separate
from rtcomp.diagnosis.settings import ALIAS, LEFT, LEVEL
from rtcomp.kernels import Floats

SET_LEVEL = 0.05
"""Level of the confidence set."""
CELLS = 10
"""Parts of a block over which models are compared: each with many rows, together many."""
ANOTHER = 0.5
"""Another effect in the place of a chosen one has a gain. With more than this part of it left beside the
chosen one, it explains something else."""
NEAR = 0.5
"""Part of the best screened gain from which on a candidate is fitted in another's place."""
DIGITS = 3
"""Digits of a probability that a thousand draws tell: below them models are equally likely."""


@dataclass(frozen=True)
class Alternatives:
    """One effect of the chosen model and what could stand in its place."""

    term: Term
    names: tuple[str, ...]
    """All that cannot be told apart, likeliest first, but the chosen one before what is no better. What has
    more parameters and is no likelier by them is no other explanation."""
    probability: float
    """That the truth is among them, if it is among all that was fitted."""
    gain: float
    """Squared error that the effect takes away, over that of the chosen model without it."""
    models: tuple[Fitted, ...]
    """The models of `names` in that order."""


def alternatives(fitter: Fitter, found: Search, ends: float) -> list[Alternatives]:
    """Return the chosen effects, each with its set; stops looking at the time `ends`.

    Where a plainer model that is likelier cannot be told from the chosen one, it is chosen from then on. So
    is one as plain that is better. Where the chosen one leaves more than noise, its forms are wrong and say
    nothing: all are compared by any law of what their effects go by. What stands in the place of one may else
    make up for the form of another.
    """
    done: list[Alternatives] = []
    while len(done) < len(found.chosen.terms):
        chosen, i = found.chosen, len(done)
        rest = fitter.fit([*chosen.terms[:i], *chosen.terms[i + 1 :]], chosen)
        models = [chosen, *_others(fitter, found, i, rest, ends)]
        more = found.null is None or found.null.p_of_error(chosen.errors) < LEVEL
        errors = [
            _by_cell(fitter, in_any_form(fitter, m, any_laws(fitter, m)) if more else m) for m in models
        ]
        errors, rows = above_noise(found, errors, _independent(fitter, chosen) / errors[0].size)
        weight = probabilities(errors, rows, [m.size for m in models])
        claims = {k for k in range(1, len(models)) if _claims_more(fitter, chosen.entries[i], models[k])}
        plain = [k for k in range(len(models)) if k not in claims]
        alike = {plain[j] for j in confidence_set([errors[k] for k in plain], SET_LEVEL)}
        least = (1.0 - ALIAS) * log_gain(rest.errors, chosen.errors)
        members = alike | {0} | {k for k, m in enumerate(models) if log_gain(rest.errors, m.errors) >= least}
        members |= _not_separate(fitter, found, models, set(range(len(models))) - members, ends)
        besides = {k for k in members if k and explains_another(fitter, chosen, rest, models[k], ends)}
        members -= besides
        if 0 in alike:
            plainer = min(members - claims, key=lambda k: (models[k].size, -weight[k]))
            instead = plainer if models[plainer].size < chosen.size and weight[plainer] > weight[0] else 0
        else:
            as_plain = [k for k in plain if models[k].size <= chosen.size]
            instead = min(as_plain, key=lambda k: float(np.log(errors[k]).sum()))
        if instead:
            found.alternatives = [m for m in found.alternatives if m is not models[instead]] + [chosen]
            found.chosen, found.beside, done = models[instead], None, []
            continue
        rivals = [k for k in range(len(models)) if k not in besides]
        weight = np.zeros(len(models))
        weight[rivals] = probabilities([errors[k] for k in rivals], rows, [models[k].size for k in rivals])
        plainest = min(models[k].size for k in members)
        enough = max(weight[k] for k in members if models[k].size == plainest)
        members = {k for k in members if models[k].size == plainest or weight[k] > enough} | {0}
        if _may_be_no_wave(fitter, chosen, i, more=more):
            enough = min(least, -math.log(LEFT)) if more else least
            members |= {k for k, m in enumerate(models) if k and _gain_by_position(fitter, rest, m) >= enough}
        later = claims | ({k for k in members if k} if 0 in alike else set())  # 0 is in the stage
        order = sorted(members, key=lambda k: (k in later, -round(float(weight[k]), DIGITS), k))
        names = [_replaced(models[k], chosen, i) for k in order]
        kept = [j for j, n in enumerate(names) if n not in names[:j]]
        gain = 1.0 - float(chosen.errors.sum() / rest.errors.sum())
        done.append(
            Alternatives(
                chosen.terms[i],
                tuple(names[j] for j in kept),
                float(min(sum(weight[k] for k in order), 1.0)),
                gain,
                tuple(models[order[j]] for j in kept),
            )
        )
    return done


def _not_separate(
    fitter: Fitter, found: Search, models: Sequence[Fitted], others: set[int], ends: float
) -> set[int]:
    """Return those of `others`, by number, that leave no more than noise and may have made this recording."""
    if found.null is None:
        return set()
    noisy = {k for k in others if found.null.p_of_error(models[k].errors) >= LEVEL}
    return {k for k in noisy if not separate(fitter, models[0], models[k], SET_LEVEL, ends)}


def _by_cell(fitter: Fitter, model: Fitted) -> Floats:
    """Return the squared error of a model in every cell that is not reserved, (C,).

    What acts now and then, as a drive's limit, shows in some of them: of ten blocks it would be by chance.
    """
    block = fitter.block
    cell = np.arange(block.size) * (fitter.blocks * CELLS) // block.size
    used = fitter.use[block]
    found = np.bincount(cell[used], model.residual[used] ** 2, fitter.blocks * CELLS)
    return np.asarray(found[np.bincount(cell[used], minlength=found.size) > 0] + 1e-300)


def above_noise(found: Search, errors: Sequence[Floats], rows: float) -> tuple[list[Floats], float]:
    """Return squared errors (C,) of models in cells plus what noise leaves, and how many rows each tells of.

    By logarithms alone a cell in which hardly anything moves would count as much as one in which a model
    fails. As replicates of the chosen model, the first, leave noise in all, less than that tells nothing. Of
    the first, errors tell as much as before: a part of them is now a smaller part of the sum.
    """
    noise = found.null.noise / errors[0].size if found.null is not None else 0.0
    return [each + noise for each in errors], rows * (1.0 + noise / float(errors[0].mean()))


def explains_another(fitter: Fitter, chosen: Fitted, rest: Fitted, other: Fitted, ends: float) -> bool:
    """Tell whether what stands in an effect's place gains much beside it too: then it is no rival.

    Two effects may gain alike without explaining the same rows. `rest` is the chosen model without this one.
    """
    return any(
        log_gain(chosen.errors, both.errors) > ANOTHER * log_gain(rest.errors, other.errors)
        for both in fitted_in_time(fitter, chosen, other.terms[-1:], ends)
    )


def _may_be_no_wave(fitter: Fitter, chosen: Fitted, at: int, *, more: bool) -> bool:
    """Tell whether a chosen wave over the stroke may be another function of the position.

    The interval of its period holds the stroke; or it does not repeat within that, and leaves `more` than
    noise: neither its repeating nor its form shows it.
    """
    low, high = fitter.balance.data.stroke
    period = told(fitter, chosen)[at].values.get(ent.PERIOD)
    if period is None or not fitter.by_force:
        return False
    return period.high >= high - low or (more and 2.0 * period.value > high - low)


def _claims_more(fitter: Fitter, entry: Entry, model: Fitted) -> bool:
    """Tell whether the last effect of a model is bent to a function of the position, of which this is any."""
    return fitter.by_force and goes_plainly(fitter, entry) and bent(fitter, model.entries[-1])


def _gain_by_position(fitter: Fitter, rest: Fitted, model: Fitted) -> float:
    """Return the gain of a model's last effect in any form; none where it is no function of the position."""
    forms = of_position(fitter.balance, model.entries[-1])
    return log_gain(rest.errors, errors_beside(fitter, model, forms)) if forms.size else -math.inf


def _independent(fitter: Fitter, model: Fitted) -> float:
    """Return of how many independent rows the sum of squares of a model's residual tells as much.

    n / (1 + 2 sum of rho_k^2) by the autocorrelation rho, here from its spectrum (Bayley and Hammersley 1946,
    Suppl. J. R. Stat. Soc. 8(2)).
    """
    rest = model.residual[fitter.rows]
    power = np.abs(np.fft.rfft(rest)) ** 2
    return float(min(2.0 * np.sum(power) ** 2 / max(float(np.sum(power**2)), 1e-300), rest.size))


def _replaced(model: Fitted, chosen: Fitted, at: int) -> str:
    """Return the name that stands in the place of the chosen model's effect."""
    if model is chosen:
        return str(chosen.terms[at].entry["name"])
    return str(model.terms[-1].entry["name"])


def _others(fitter: Fitter, found: Search, at: int, rest: Fitted, ends: float) -> list[Fitted]:
    """Return models with another effect in the place of one of the chosen."""
    chosen = found.chosen
    name = chosen.terms[at].entry["name"]
    known = [_with_last(fitter, m, rest) for m in found.alternatives if _one_more(fitter, m, rest, name)]
    if not known and clock.now() < ends:
        known = _looked_up(fitter, found, at, rest, ends)
    same = ent.build(chosen.terms[at].entry).equivalent()
    if same is None or not fitter.by_force or any(m.terms[-1].entry["name"] == same.name for m in known):
        return known
    return [*known, *fitted_in_time(fitter, rest, [Term.of({"name": same.name, **same.values})], math.inf)]


def _one_more(fitter: Fitter, model: Fitted, rest: Fitted, but: str) -> bool:
    """Tell whether a model has the effects of `rest` and one more, other than `but`, and is possible."""
    names = list(ent.names(model.entries))
    if impossible(fitter, model, rest) or but in names or len(names) != len(rest.terms) + 1:
        return False
    return set(ent.names(rest.entries)) < set(names)


def _with_last(fitter: Fitter, model: Fitted, rest: Fitted) -> Fitted:
    """Return a model with that effect last which `rest` has not."""
    kept = ent.names(rest.entries)
    order = sorted(model.terms, key=lambda t: t.entry["name"] not in kept)
    return model if order == list(model.terms) else fitter.fit(order, model)


def _looked_up(fitter: Fitter, found: Search, at: int, rest: Fitted, ends: float) -> list[Fitted]:
    """Return models with the best of all candidates in the place of one of the chosen effects."""
    chosen, name = found.chosen, str(found.chosen.terms[at].entry["name"])
    beside = (found.beside or ()) if fitter.by_force else ()
    seen = look(fitter, rest, known=beside, without=[name])
    made, screened = seen.candidates, seen.screened
    least = NEAR * log_gain(rest.errors, chosen.errors)
    tried = [
        k for k in best([c.family for c in made], [s.gain for s in screened], 3) if screened[k].gain > least
    ]
    terms = [started(made[k], screened[k].sizes) for k in tried]
    return [m for m in fitted_in_time(fitter, rest, terms, ends) if not impossible(fitter, m, rest)]
