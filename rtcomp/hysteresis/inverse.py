"""The inverse of a hysteresis: the input with which a frozen model gives a wanted output, step by step.

Force in and position out needs none (the feedforward is the model along the reference). Where the input makes
the hysteresis, as a piezo's voltage does, the input of each step is found by bisection on a copy of the
operator's state, then taken. This needs no formula for the inverse, so that any basis has one; it is exact
where the output rises with the input, which positive weights see to. Where the output falls somewhere (a
butterfly's wing) the step stops at what bisection finds, and what is missing is returned.
"""

from __future__ import annotations

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.kernels import Floats, call_basis, compiled

_HALVINGS = 60


def inputs_for(
    model: HysteresisModel, outputs: Floats, low: float, high: float, start: float = 0.0
) -> tuple[Floats, Floats]:
    """Return inputs (m or V, (K,)) within `low` to `high` that make `model` give `outputs` (K,), and a rest.

    It goes from the virgin state at the input `start`. The rest is wanted less given, (K,), in the output's
    unit: not 0 where a bound was met. Raises ConfigError where the bounds do not hold the start.
    """
    if not low <= start <= high or not low < high:
        raise ConfigError(f"inverse: the bounds are {low:g} to {high:g}; they must hold the start, {start:g}")
    wanted = np.ascontiguousarray(outputs, dtype=np.float64) - model.offset
    basis = model.basis
    inputs, rest = np.empty(wanted.size), np.empty(wanted.size)
    _invert(
        basis.kernel.address, basis.vector(), basis.initial_state(), np.zeros(basis.size), model.weights,
        wanted, low, high, start, inputs, rest,
    )  # fmt: skip
    return inputs, rest


@compiled
def _tried(address: int, p: Floats, s: Floats, x: Floats, w: Floats, u: float) -> float:
    call_basis(address, p.ctypes.data, s.ctypes.data, x.ctypes.data, u)
    return float(np.dot(w, x))


@compiled
def _invert(
    address: int, p: Floats, s: Floats, x: Floats, w: Floats, wanted: Floats, low: float, high: float,
    start: float, inputs: Floats, rest: Floats,
) -> None:  # fmt: skip
    trial_s, trial_x = s.copy(), x.copy()
    now = _tried(address, p, s, x, w, start)
    u = start
    for k in range(wanted.size):
        near = u
        far = high if wanted[k] > now else (low if wanted[k] < now else u)
        for _ in range(_HALVINGS if far != near else 0):
            middle = 0.5 * (near + far)
            trial_s[:] = s
            trial_x[:] = x
            if (_tried(address, p, trial_s, trial_x, w, middle) < wanted[k]) == (wanted[k] > now):
                near = middle
            else:
                far = middle
        u = 0.5 * (near + far)
        now = _tried(address, p, s, x, w, u)
        inputs[k] = u
        rest[k] = wanted[k] - now
