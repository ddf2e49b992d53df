"""What a person should know of the motion that a model was learned from."""

from __future__ import annotations

import numpy as np

from rtcomp.hysteresis.basis import Basis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.kernels import Floats

FAR = 20.0
"""Spans of the motion over the operator's range from which on hardly any of it is presliding."""
TURNED = 0.02
"""Way back that counts as a reversal, as a share of the motion's span, or of the range where that is less."""


def motion_notes(model: HysteresisModel, position: Floats) -> list[str]:
    """Say what the motion (m, (K,)) leaves open of the model that was learned from it."""
    return [*never_reached(model), *one_way(model.basis, position), *too_fine(model.basis, position),
            *too_far(model.basis, position)]  # fmt: skip


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
    back = TURNED * min(float(np.ptp(position)), range_of(basis))
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
