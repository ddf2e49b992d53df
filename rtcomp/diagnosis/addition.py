"""The entry that explains most beside those at work: screened, short-listed, refined on its own grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.alike import ONE_THING, PLAINER, SHAPELESS, bounded, last, least_far, plainest
from rtcomp.diagnosis.base import FIXED, SCALES, Fitted, fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.ledger import WHOLE
from rtcomp.diagnosis.lengths import beside, takes_along
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.renamed import other_side
from rtcomp.diagnosis.scene import Entry, Scene
from rtcomp.diagnosis.screen import Screened, screen
from rtcomp.errors import ConfigError
from rtcomp.physics.coupled import CONTACT, LOAD_SHARE
from rtcomp.stage.stage import Stage

SHORTLIST = 7
LEAST_SHARE = 0.008
"""Part of the squared error that a search must explain to be short-listed."""
QUICK, CONTENDERS = 2, 3
"""Steps of refinement for the whole short list, and how many of it are refined to the end."""
FAR, FURTHER, NOTHING = 3.0, 100.0, 0.01
"""Times the error of the first after those few steps, from which on another is refined to the end only if the
first leaves more than this part of what there was: if it is a name, if it is a free curve."""
SURPASSED = 25.0
"""Times a known error, above which none but the nearest are refined to the end."""
NEARLY = 0.93
"""Part of what a shapeless entry explains, from which on a name with a shape of its own is preferred."""
BESIDE = {
    "backlash": "resonance", "resonance": "backlash",
    "asymmetric-viscous-friction": "viscous-friction", "viscous-friction": "asymmetric-viscous-friction",
}  # fmt: skip
"""Entries not looked for beside each other: a play has a contact that rings, a second mass goes loose; what
differs by direction lets the viscous friction go, which then takes up whatever the other one is."""

NOT_IN_PROPORTION = ("drive-deadband", "drive-saturation", "torque-ripple")
"""Entries beside which a force added to the command is not the same as one added to the axis."""
UNDECIDED = {
    "asymmetric-friction": "closing", "cogging": "harmonics", "load-dependent-friction": "following",
}  # fmt: skip
"""Entries whose forms, by this parameter, only a settled fit tells apart: one asks for the whole of friction,
of which the base that has bent to the effect gives a wrong picture."""
AGAIN, GAINS = 2, 0.05
"""Times that entries beside each other are settled once more, and the part of the error that this must gain
for another time."""
AGREE, AGREED = 2, 0.02
"""Times that friction is found anew where an effect asks for the whole of it, and the part of its level up to
which that which was asked for and that which was found are the same."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Addition:
    """The best entry beside those at work (the last of its entries), the other contenders, the first look."""

    best: Refined | None
    others: list[Refined]
    looked: list[Screened]
    gains: dict[str, float]
    """Part of the squared error that each short-listed name explains."""


def best_addition(
    stage: Stage,
    motion: Motion,
    current: Fitted,
    entries: list[Entry],
    progress: Progress,
    without: frozenset[str] = frozenset(),
    known: float = 0.0,
) -> Addition:
    """Return what explains most of what `current`, with `entries` at work, leaves; no name of `without`.

    Where a squared error (N^2) is `known` to be reached, what is far behind that is not refined to the end.
    """
    looked = screen(Scene.of(motion, current), entries, lambda part: progress(0.6 * part, "screen"))
    named = {str(e["name"]) for e in entries} - {"cogging"} | without
    named |= {BESIDE[n] for n in named if n in BESIDE}
    named |= {other for group in ONE_THING if named & set(group) for other in group}
    hopeful = [s for s in looked if s.name not in named]
    hopeful = [s for s in hopeful if s.gain(current.errors) > LEAST_SHARE][:SHORTLIST]
    tried: list[Refined] = []
    gains: dict[str, float] = {}
    also: dict[str, list[Refined]] = {}
    quick = shared(
        lambda s: _quickly(current, motion, entries, s),
        hopeful,
        lambda part: progress(0.6 + 0.4 * part, "refine"),
    )
    for s, forms in zip(hopeful, quick, strict=True):
        if not forms:
            continue
        also[s.name] = forms[1:]
        gains[last(forms[0])] = 1.0 - float(forms[0].errors.sum() / current.errors.sum())
        tried.append(forms[0])
    tried.sort(key=lambda r: float(r.errors.sum()))
    if not tried:
        return Addition(None, [], looked, gains)
    _settle_contenders(stage, motion, current, tried, also, known)
    gains |= {last(r): 1.0 - float(r.errors.sum() / current.errors.sum()) for r in tried}
    tried = plainest(tried)
    best = least_far(tried, current)
    if last(best) in SHAPELESS:
        reduction = float(current.errors.sum() - best.errors.sum())
        for other in tried[1:]:
            if float(current.errors.sum() - other.errors.sum()) > NEARLY * reduction:
                best = other
                break
    best = bounded(best, tried, current)
    return Addition(best, [r for r in tried if r is not best], looked, gains)


def _variants(entry: Entry, stage: Stage) -> list[Entry]:
    """Return the forms that an entry comes in, of which a search knows only one; that one first."""
    name = str(entry["name"])
    if name == "position-dependent-friction":
        return [entry, {**entry, "stiffening": 1.0}]
    if name == "backlash" and "contact" not in entry:
        return [entry, {**entry, "share": LOAD_SHARE, "contact": CONTACT}]
    if name == "drive-offset":
        # The same force, but beside what changes the drive it is not the same physics.
        return [entry, other_side(entry, stage)]
    return [entry]


def _biases(entries: list[Entry], added: Entry, stage: Stage) -> list[list[Entry]]:
    """Return `entries`, and where `added` tells the two apart also with a bias on the drive's other side."""
    if added["name"] not in NOT_IN_PROPORTION:
        return [entries]
    other = [other_side(e, stage) for e in entries]
    return [entries, other] if other != entries else [entries]


def _quickly(current: Fitted, motion: Motion, entries: list[Entry], screened: Screened) -> list[Refined]:
    """Return the best form of an entry after a few steps of refinement, and another if they leave that open.

    Empty where none can be evaluated.
    """
    found = []
    variants = [(v, screened.ground) for v in _variants(screened.entry, current.ledger.stage)]
    for variant, ground in [*variants, *((form.entry, form.ground) for form in screened.forms)]:
        for at_work in _biases(entries, variant, current.ledger.stage):
            made = beside(at_work, variant)
            # On another ground than the one that they were found on, those at work are others too;
            # and where the sensor reads otherwise, they are elsewhere.
            which = None if ground is not None or takes_along(variant, entries) else [len(entries)]
            try:
                tried = refine(ground or current, motion, made, which, QUICK)
            except (ConfigError, np.linalg.LinAlgError):
                continue
            if not _below_a_count(tried.entries[-1], current.ledger.stage):
                found.append(tried)
    found.sort(key=_weighed)
    kind = UNDECIDED.get(screened.name)
    others = [r for r in found if kind and r.entries[-1].get(kind) != found[0].entries[-1].get(kind)]
    return [*found[:1], *others[:1]]


def _settle_contenders(
    stage: Stage,
    motion: Motion,
    current: Fitted,
    tried: list[Refined],
    also: dict[str, list[Refined]],
    known: float = 0.0,
) -> None:
    """Replace the best of `tried`, best first, by what they are on reaches of their own, in the best form.

    A base that has bent to an effect is no fair ground for its name. `also` has other forms by name, and
    `known` is a squared error (N^2) known to be reached, 0 where none is.
    """
    whole, first = float(current.errors.sum()), float(tried[0].errors.sum())
    left = [float(r.errors.sum()) for r in tried]
    hopeful = [at for at, errors in enumerate(left) if whole - errors > 0.5 * (whole - first)]
    plainer = {PLAINER.get(last(tried[at])) for at in hopeful[:CONTENDERS]}
    # One number's other value is no less a name than what has that and more, once both are settled.
    contend = [at for at in hopeful if at < CONTENDERS or last(tried[at]) in plainer]
    near = [at for at in contend if left[at] < FAR * first]
    shapeless = last(tried[0]) in SHAPELESS
    for far in False, True:
        group = [at for at in contend if (at in near) != far]
        other = {} if far and shapeless else also
        forms = [(at, form) for at in group for form in (tried[at], *other.get(last(tried[at]), []))]
        settled = shared(lambda form: _well_settled(stage, motion, form[1]), forms)
        for at in group:
            own = [found for (of, _), found in zip(forms, settled, strict=True) if of == at]
            tried[at] = min(own, key=_weighed)
        contend = [at for at in contend if not known or left[at] < SURPASSED * known]
        # A free curve that leaves nothing says nothing against a name, unless that is far behind.
        if float(tried[0].errors.sum()) < NOTHING * whole:
            contend = [at for at in contend if shapeless and left[at] < FURTHER * first]


def _below_a_count(entry: Entry, stage: Stage) -> bool:
    """Tell whether an entry is a jump of less than a count of the sensor: what is lost are whole counts."""
    if entry["name"] != "sensor-jump":
        return False
    return abs(float(entry["size"])) < stage.sensor.resolution  # type: ignore[arg-type]


def _weighed(form: Refined) -> float:
    """Return the error by which forms are compared: what has more to it must do a tenth better."""
    return float(form.errors.sum()) * (1.1 if "harmonics" in form.entries[-1] else 1.0)


def _well_settled(stage: Stage, motion: Motion, refined: Refined) -> Refined:
    """Settle an entry on its own grid; beside others until that gains no more: they had done for it too."""
    found = settle(stage, motion, refined, SCALES)
    for _ in range(AGAIN if len(refined.entries) > 1 else 0):
        further = settle(stage, motion, found)
        gained = 1.0 - float(further.errors.sum() / found.errors.sum())
        if gained > 0.0:
            found = further
        if gained < GAINS:
            break
    return found


def settle(
    stage: Stage, motion: Motion, refined: Refined, scales: tuple[float, ...] | None = None
) -> Refined:
    """Find the reaches anew with the entries at work, then refine all entries together."""
    effects = [effect_of(e) for e in refined.entries]
    around = refined.fitted.scale
    beside = (around * f for f in (0.8, 0.9, 1.0, 1.12, 1.25))
    # Where a recording says nothing of reaches, they would go further every time.
    near = tuple(sorted({1.0, *(min(max(scale, SCALES[0]), SCALES[-1]) for scale in beside)}))
    memory, freed = refined.fitted.ledger.memory, refined.fitted.freed
    base = fit_base(stage, motion, effects, tuple(sorted({around, *(scales or near)})), memory, freed)
    found = refine(base, motion, refined.entries, searching=True)
    for _ in range(AGREE):
        if _agrees(found):
            break
        # Sizes refined on friction that is not the one found beside them hold for neither.
        effects = [effect_of(e) for e in found.entries]
        base = fit_base(stage, motion, effects, (found.fitted.scale,), memory, freed)
        found = refine(base, motion, found.entries, tries=4, searching=True)
    return found


def _agrees(refined: Refined) -> bool:
    """Tell whether the friction that entries were given is the one found with them at work."""
    if not any(e.name in WHOLE for e in map(effect_of, refined.entries)):
        return True
    ledger = refined.fitted.ledger
    now = refined.fitted.coefficients[FIXED : FIXED + ledger.reaches.size]
    apart = np.abs(np.cumsum((now - ledger.weights) * ledger.reaches))
    return bool(apart.max() <= AGREED * float(now @ ledger.reaches))
