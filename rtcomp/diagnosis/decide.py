"""Deciding: which entries are named, by what they explain of motion left out of the fit.

Forward with a full refit, backward deletion, one swap pass. An entry is accepted where it explains a part of
the excess over the floor that is no accident of one stretch; the set of names is all that explain it as well
on this recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rtcomp.diagnosis.base import Fitted, fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.scene import Entry, Scene
from rtcomp.diagnosis.screen import Screened, screen
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

MOST = 4
"""Entries named at the most: beyond, a recording does not carry the decision."""
SHORTLIST = 7
QUICK, CONTENDERS = 2, 3
"""Steps of refinement for the whole short list, and how many of it are refined to the end."""
LEAST_SHARE = 0.04
SETTLED = 0.01
"""Part of the first excess over the floor, below which what is left is how the kernels model, not physics."""
BESIDE = 0.15
"""Part of what the entries before it explain, from which on a further entry counts beside them."""
ENOUGH, ENOUGH_SHAPELESS = 0.8, 0.6
"""Part of the excess over the floor that names must explain together, else none is given."""
REST = 0.5
"""Part of what is left that a second or third entry must explain."""
"""Part of the present squared error that an entry must explain to be worth naming."""
STEADY = 0.8
"""Part of the blocks in which it must do no harm."""
ABOVE_FLOOR = 2.0
"""Squared error over the floor's, below which nothing is missing."""
ALIKE = 0.06
"""Names are not told apart where they differ by less than this part of what the best explains."""
SHAPELESS = ("position-force",)
"""Entries that take any shape: a name with a shape of its own is preferred where it explains as much."""
ONE_THING = (
    ("drive-offset", "constant-force", "gravity"),
    ("viscous-friction", "back-emf"),
)
"""Entries that are the same force on any recording of this kind: only what is tried is listed first."""


@dataclass
class Choice:
    """One accepted entry: the names that explain it alike, and what it explains."""

    names: list[str]
    probability: float
    gain: float


@dataclass
class Decision:
    """All accepted entries with the fit that has them, and every candidate's gain at the first look."""

    refined: Refined
    choices: list[Choice]
    base: Fitted
    first_look: list[Screened] = field(default_factory=list)
    first_refined: dict[str, float] = field(default_factory=dict)

    def abstain_if_poor(self, floor: Floats, still_structured: bool) -> None:
        """Take the names back where together they leave too much: the nearest name would be the wrong one."""
        before, after = float(self.base.errors.sum()), float(self.refined.errors.sum())
        excess = max(before - float(floor.sum()), 1e-300)
        explained = (before - after) / excess
        shapeless = all(c.names[0] in SHAPELESS for c in self.choices)
        enough = ENOUGH_SHAPELESS if shapeless else ENOUGH
        if explained < enough and after > 4.0 * ABOVE_FLOOR * float(floor.sum()) and still_structured:
            self.choices = []


Progress = Callable[[float, str], None]


def decide(
    stage: Stage, motion: Motion, base: Fitted, floor: Floats, progress: Progress | None = None
) -> Decision:
    """Name what is missing; `floor` is the squared error of every seen block if nothing were."""
    entries: list[Entry] = []
    choices: list[Choice] = []
    current = base
    refined = refine(base, motion, [])
    decision = Decision(refined, choices, base)
    for step in range(MOST):
        if current.errors.sum() < ABOVE_FLOOR * floor.sum():
            break
        if entries and current.errors.sum() - floor.sum() < SETTLED * (base.errors.sum() - floor.sum()):
            break
        best, rest, looked, gains = _best_addition(stage, motion, current, entries, progress, step)
        if step == 0:
            decision.first_look, decision.first_refined = looked, gains
        if best is None or not _worth_it(current.errors, best.errors, floor):
            break
        if entries and not _settles_the_rest(base.errors, current.errors, best.errors, floor):
            break
        explained = float(current.errors.sum() - best.errors.sum())
        names, probability = _alike(best, rest, current)
        choices.append(Choice(names, probability, explained))
        entries = best.entries
        refined = _settle(stage, motion, best)
        entries, current = refined.entries, refined.fitted
    refined, choices = _prune(stage, motion, base, refined, choices, floor)
    decision.refined, decision.choices = refined, choices
    return decision


def _best_addition(
    stage: Stage,
    motion: Motion,
    current: Fitted,
    entries: list[Entry],
    progress: Progress | None,
    step: int,
) -> tuple[Refined | None, list[Refined], list[Screened], dict[str, float]]:
    def shown(part: float) -> None:
        if progress is not None:
            progress((step + 0.6 * part) / MOST, "screen")

    looked = screen(Scene.of(motion, current), entries, shown)
    named = {str(e["name"]) for e in entries}
    hopeful = [s for s in looked if s.name not in named or s.name in ("cogging",)]
    hopeful = [s for s in hopeful if s.gain(current.errors) > 0.2 * LEAST_SHARE][:SHORTLIST]
    new = len(entries)
    tried: list[Refined] = []
    gains: dict[str, float] = {}
    for i, s in enumerate(hopeful):
        try:
            done = refine(current, motion, [*entries, s.entry], which=[new], tries=QUICK)
        except (ConfigError, np.linalg.LinAlgError):
            continue
        gains[s.name] = 1.0 - float(done.errors.sum() / current.errors.sum())
        tried.append(done)
        if progress is not None:
            progress((step + 0.6 + 0.3 * (i + 1) / len(hopeful)) / MOST, "refine")
    tried.sort(key=lambda r: float(r.errors.sum()))
    if not tried:
        return None, [], looked, gains
    for i, r in enumerate(tried[:CONTENDERS]):
        if gains[_last(r)] > 0.5 * gains[_last(tried[0])]:
            tried[i] = refine(current, motion, r.entries, which=[new])
            gains[_last(r)] = 1.0 - float(tried[i].errors.sum() / current.errors.sum())
    tried.sort(key=lambda r: float(r.errors.sum()))
    best = tried[0]
    if _last(best) in SHAPELESS:
        reduction = float(current.errors.sum() - best.errors.sum())
        for other in tried[1:]:
            if float(current.errors.sum() - other.errors.sum()) > 0.93 * reduction:
                best = other
                break
    return best, [r for r in tried if r is not best], looked, gains


def _last(refined: Refined) -> str:
    return str(refined.entries[-1]["name"])


def _worth_it(before: Floats, after: Floats, floor: Floats) -> bool:
    """Tell whether the step from `before` to `after` (squared errors of blocks) is no accident."""
    gained = before - after
    share = float(gained.sum() / before.sum())
    # An effect may show in a few stretches only; what matters is that it does no harm in the others.
    harmless = float(np.mean(gained > -0.05 * before - floor))
    helped = int(np.count_nonzero(gained > 0.05 * before))
    scatter = float(gained.std(ddof=1) / np.sqrt(gained.size))
    excess = float(before.sum() - floor.sum())
    broad = helped >= 3 and float(gained.mean()) > 1.2 * scatter
    plain = share > 0.5 and float(gained.sum()) > 5.0 * float(floor.sum())
    return (
        share > LEAST_SHARE
        and harmless >= STEADY
        and (broad or plain)
        and float(gained.sum()) > 0.05 * excess
        and float(gained.sum()) > 0.7 * float(floor.sum())
    )


def _settles_the_rest(first: Floats, before: Floats, after: Floats, floor: Floats) -> bool:
    """Tell whether a further entry has a weight of its own, not one that trims how the first is modelled."""
    gained = float(before.sum() - after.sum())
    left = float(max(before.sum() - floor.sum(), 0.0))
    return gained > REST * left or gained > BESIDE * float(first.sum() - before.sum())


def _alike(best: Refined, rest: Sequence[Refined], current: Fitted) -> tuple[list[str], float]:
    """Return all names that explain as much as the best one, likeliest first, and the best one's share."""
    reduction = current.errors - best.errors
    names, weights = [_last(best)], [1.0]
    for other in rest:
        name = _last(other)
        if name in SHAPELESS or name in names:
            continue
        worse = other.errors - best.errors
        scatter = float(worse.std(ddof=1) * np.sqrt(worse.size))
        lost = float(worse.sum() / max(reduction.sum(), 1e-300))
        if lost < ALIKE and float(worse.sum()) < 2.0 * scatter + 0.02 * float(reduction.sum()):
            names.append(name)
            weights.append(float(np.exp(-max(lost, 0.0) / (0.3 * ALIKE))))
    for group in ONE_THING:
        if names[0] == group[0]:
            names += [g for g in group[1:] if g not in names]
            weights += [0.5] * (len(names) - len(weights))
    return names, float(weights[0] / sum(weights))


def _settle(stage: Stage, motion: Motion, refined: Refined) -> Refined:
    """Find the reaches anew with the entries at work, then refine all entries together."""
    effects = [effect_of(e) for e in refined.entries]
    around = refined.fitted.scale
    scales = tuple(sorted({*(around * f for f in (0.8, 0.9, 1.0, 1.12, 1.25)), 1.0}))
    base = fit_base(stage, motion, scales=scales, effects=effects)
    return refine(base, motion, refined.entries)


def _prune(
    stage: Stage,
    motion: Motion,
    base: Fitted,
    refined: Refined,
    choices: list[Choice],
    floor: Floats,
) -> tuple[Refined, list[Choice]]:
    """Delete every entry that the others make needless."""
    kept, chosen = refined, list(choices)
    at = 0
    while len(kept.entries) > 1 and at < len(kept.entries):
        without = [e for i, e in enumerate(kept.entries) if i != at]
        fewer = _settle(stage, motion, refine(kept.fitted, motion, without, tries=3))
        if _worth_it(fewer.errors, kept.errors, floor):
            at += 1
        else:
            kept = fewer
            del chosen[at]
    return kept, chosen
