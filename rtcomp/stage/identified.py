"""An identified interval model as the friction of a stage.

The interval operator with widths a_i and weights w_i is, exactly, a bank of stop elements: element k
yields after the travel r_k = sum of a_j / 2 up to k and has the stiffness w_k - w_{k+1} (the last w_k).
Both have the virgin curve whose slope is w_k between r_{k-1} and r_k.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import bases
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.physics import Effect
from rtcomp.physics.maxwell_slip import MaxwellSlip


def is_identified(name: object) -> bool:
    """Tell whether `name` is a hysteresis basis rather than a friction model of the catalogue."""
    return isinstance(name, str) and name in bases()


def stop_bank(entry: Mapping[str, Any]) -> Effect:
    """Return the stop elements of ``{model: interval, widths: [...], weights: [...]}``.

    The model's constant offset is no friction and is left out here.
    """
    model = HysteresisModel.from_dict(entry)
    if not isinstance(model.basis, IntervalBasis):
        raise ConfigError(
            f"friction: a model of basis {model.basis.name!r} cannot be simulated as a stage's friction; "
            "identify with basis 'interval'"
        )
    reaches = np.cumsum(model.basis.widths) / 2
    stiffness = model.weights - np.append(model.weights[1:], 0.0)
    elements = [(float(k), float(r)) for k, r in zip(stiffness, reaches, strict=True) if k != 0.0]
    if not elements:
        raise ConfigError("friction: the identified model has no weight other than zero")
    return MaxwellSlip(elements)
