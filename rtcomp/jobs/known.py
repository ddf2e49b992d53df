"""What is known of friction besides what was learned, put into weights that were: `prior` and `beyond`."""

from __future__ import annotations

from collections.abc import Callable

from rtcomp.hysteresis.basis import Basis, regressors
from rtcomp.hysteresis.beyond import continued, passes
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.prior import non_increasing
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.configuration import Identify
from rtcomp.jobs.judge import reached
from rtcomp.kernels import Floats
from rtcomp.stage.balance import zero_phase


def completed(
    section: Identify,
    basis: Basis,
    weights: Floats,
    offset_scale: float,
    positions: Floats,
    period: float,
    information: Callable[[], Floats],
) -> HysteresisModel:
    """Return a model of learned `weights` (size + 1,), the last the offset's (of `offset_scale`, m).

    positions: (K,) m, every `period` (s), what was learned from. `information`: what the data say of each
    combination of weights (`Learner.information`), asked for where a prior needs it.
    """
    weights = weights.copy()
    if section.prior == "non-increasing" and isinstance(basis, IntervalBasis):
        weights = non_increasing(weights, information(), free=1)
    part = reached(basis, positions)
    weights[:-1][part == 0.0] = 0.0
    if section.beyond == "continue" and isinstance(basis, IntervalBasis | ShapedIntervalBasis):
        n, cut = basis.widths.size, section.smoothing
        slow = zero_phase(positions, cut, 1.0 / period) if cut > 0.0 else positions
        passed = passes(regressors(basis, slow)[:, :n], basis.widths)
        weights[:n] = continued(weights[:n], basis.widths, passed)[0]
    return HysteresisModel(basis, weights[:-1], weights[-1] * offset_scale, part)
