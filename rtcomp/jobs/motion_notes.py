"""What a person should know of the motion that a model was learned from."""

from __future__ import annotations

import numpy as np

from rtcomp.hysteresis.basis import Basis, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.judge import Friction
from rtcomp.kernels import Floats

FAR = 20.0
"""Spans of the motion over the operator's range from which on hardly any of it is presliding."""
TURNED = 0.02
"""Way back that counts as a reversal, as a share of the motion's span, or of the range where that is less."""
NOISES = 8.0
"""And at least so many times the sensor's rms noise (m), which turns back all the time."""
RISES = 0.1
"""Share of the force by which it may rise where all elements have yielded: the range is too small beyond."""
LEAST_ROWS = 50
"""Rows right behind the range, and further on, from which that is said."""


def motion_notes(model: HysteresisModel, position: Floats) -> list[str]:
    """Say what the motion (m, (K,)) leaves open of the model that was learned from it."""
    of_model = [*learned_nothing(model), *never_reached(model)]
    basis = model.basis
    return [*of_model, *one_way(basis, position), *too_fine(basis, position), *too_far(basis, position)]


def learned_nothing(model: HysteresisModel) -> list[str]:
    """Say that the model is empty."""
    if model.weights.any():
        return []
    return [
        "nothing was learned: all weights are 0, and with them the model's friction; the other notes and the "
        "events say whether the axis moved too little or the identifier was put aside"
    ]


def range_of(basis: Basis) -> float:
    """Return the motion (m) from full saturation to full saturation."""
    widths = getattr(basis, "widths", None)
    return float(widths.sum() if widths is not None else 2.0 * basis.scales().sum())


def never_reached(model: HysteresisModel) -> list[str]:
    """Say which elements the motion never exercised."""
    if model.reached is None or bool((model.reached > 0).all()):
        return []
    missing, size = np.flatnonzero(model.reached == 0) + 1, model.basis.size
    which = f"elements {missing[0]} to {missing[-1]} of {size} were never reached; their weights"
    if missing[-1] - missing[0] >= missing.size:
        which = f"{missing.size} of {size} elements, {missing[0]} first, were never reached; their weights"
    zero, on = "are 0", "go on as those before them fall, where they are intervals"
    if missing.size == 1:
        which, zero = f"element {missing[0]} of {size} was never reached; its weight", "is 0"
        on = "goes on as those before it fall, where it is an interval"
    if model.weights[missing - 1].any():
        return [f"{which} {on}"]
    return [f"{which} {zero}: move further, or make identify.range smaller"]


def one_way(basis: Basis, position: Floats) -> list[str]:
    """Say that the motion never turned back: one branch is all that the model rests on."""
    span = float(np.ptp(position))
    noise = float(np.median(np.abs(np.diff(position, 2)))) / (0.6745 * np.sqrt(6.0))
    back = min(max(TURNED * min(span, range_of(basis)), NOISES * noise), 0.5 * span)
    down = float(np.max(np.maximum.accumulate(position) - position))
    up = float(np.max(position - np.minimum.accumulate(position)))
    if min(down, up) > back:
        return []
    return [
        "the motion goes one way only: the model rests on one branch, and nothing says that the way back is "
        "like it; move to and fro"
    ]


def too_fine(basis: Basis, position: Floats) -> list[str]:
    """Say that there are more elements than places at which the axis was seen."""
    places = np.unique(position).size
    if places >= basis.size:
        return []
    return [
        f"{basis.size} elements, but only {places} distinct positions: the sensor does not tell them apart; "
        f"make identify.intervals at most {max(1, places // 2)}"
    ]


def too_far(basis: Basis, position: Floats) -> list[str]:
    """Say that the motion is so much larger than the range that hardly any of it is presliding."""
    span, total = float(np.ptp(position)), range_of(basis)
    if not span > FAR * total:
        return []
    return [
        f"the motion spans {span:.3g}, {span / total:.3g} times identify.range ({total:.3g}): nearly all of "
        "it is sliding, from which the weights are not learned; move less, or make identify.range larger"
    ]


def still_rising(model: HysteresisModel, friction: Friction) -> list[str]:
    """Say that the force measured goes on rising behind the range, where the model has all slide."""
    basis, position = model.basis, friction.position
    total = range_of(basis)
    far = float(np.ptp(position)) > FAR * total  # `too_far` says it
    if far or not isinstance(basis, IntervalBasis | ShapedIntervalBasis):
        return []
    # How far the motion went on in the same direction since the last interval was full.
    z = regressors(IntervalBasis(basis.widths), position).sum(axis=1)
    full = np.abs(z) >= (0.5 - 1e-6) * total
    step = np.where(full, np.abs(np.diff(position, prepend=position[0])), 0.0)
    way = np.cumsum(step)
    behind = way - np.maximum.accumulate(np.where(full, 0.0, way))
    force = np.sign(z) * (friction.force - model.offset)
    counts = full & friction.good
    early, late = counts & (behind < 0.25 * total), counts & (behind > 0.5 * total)
    if min(np.count_nonzero(early), np.count_nonzero(late)) < LEAST_ROWS:
        return []
    # By the way alone, not by the speed, which on a sine goes with it.
    speed = np.abs(np.gradient(position, friction.time))[counts]
    columns = np.column_stack([np.ones(speed.size), behind[counts] / total, speed / max(speed.max(), 1e-300)])
    along = float(np.linalg.lstsq(columns, force[counts], rcond=None)[0][1])
    rises = along * float(behind[late].mean() - behind[early].mean()) / total
    level = abs(float(force[late].mean()))
    if not rises > RISES * level:
        return []
    return [
        f"where all elements have yielded the force still rises, by {100 * rises / level:.0f} %: make "
        f"identify.range ({total:.3g}) larger, or name in the stage what rises, such as a spring"
    ]
