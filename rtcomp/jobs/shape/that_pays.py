"""The model of an identification: the shape that pays, or as much of one asked for as the motion tells."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import Learner
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.configuration import AUTO, Configuration
from rtcomp.jobs.judge import Friction
from rtcomp.jobs.known import completed
from rtcomp.jobs.limit_settings import flicker
from rtcomp.jobs.shape.choice import Motion, choose, gated, learned_with_state, left_off, needed, with_offset
from rtcomp.kernels import Floats


def that_pays(
    config: Configuration, model: HysteresisModel, friction: Friction, window: tuple[float, float]
) -> tuple[HysteresisModel, list[str]]:
    """Return the model that is made of what was learned from, with notes.

    With ``identify: {model: auto}`` that is `model`, the symmetric one that the loop has learned, unless a
    shape or other places of its intervals pay. Where ``identify.model`` names a shape, parts of it are left
    off which the motion says too little about. Any other model is left as it is. `window` (s) is when the
    weights might change.
    """
    basis, section = config.basis(), config.identify
    auto = section.model == AUTO and isinstance(basis, IntervalBasis)
    if not auto and not isinstance(basis, ShapedIntervalBasis):
        return model, []
    rows = friction.time <= window[1]
    good = friction.good & (friction.time >= window[0])
    grain = 0.5 * flicker(config.stage)  # to either side
    motion = Motion(friction.position[rows], friction.force[rows], good[rows], section.gate, grain)
    if isinstance(basis, ShapedIntervalBasis):
        less = _supported(basis, config.learner(), motion)
        if less is None:
            return model, []
        found, information, notes = less
    else:
        assert isinstance(basis, IntervalBasis)
        choice = choose(basis, config.learner(), motion)
        found, information, notes = choice.model, choice.information, choice.notes
        if isinstance(found.basis, IntervalBasis) and not choice.chosen.places:
            return model, notes
    scale = float(found.basis.scales().mean())
    weights = np.append(found.weights, found.offset / scale)
    known = completed(section, found.basis, weights, scale, motion.position, config.period, information)
    return known, notes


def _supported(
    basis: ShapedIntervalBasis, learner: Learner, motion: Motion
) -> tuple[HysteresisModel, Callable[[], Floats], list[str]] | None:
    """Return the shape without those of its parts that the motion says too little about, learned anew.

    With what the data say of its weights (see `known`), and a note of what was left off; None where the
    motion says enough about all of them.
    """
    rows = gated(motion)
    if not basis.parts or rows.size >= needed(basis.size):
        return None

    kept: tuple[str, ...] = ()
    for size in range(len(basis.parts) - 1, 0, -1):
        fits = [
            p for p in combinations(basis.parts, size) if rows.size >= needed(basis.changed(parts=p).size)
        ]
        if fits:
            kept = fits[0]
            break
    less = basis.changed(parts=kept) if kept or basis.skew else IntervalBasis(basis.widths)
    w, state = learned_with_state(less, learner, with_offset(less, motion.position), motion.force, rows)
    left = [
        f"{part} ({needed(basis.changed(parts=(*kept, part)).size)})"
        for part in basis.parts
        if part not in kept
    ]
    scales = np.append(less.scales(), less.scales().mean())
    found = HysteresisModel(less, w[:-1], float(w[-1] * scales[-1]))
    return found, lambda: learner.information(state, scales), [left_off(rows.size, left)]
