"""A signal before an effect from the signal after it: the catalogue's inverse kernels run over rows."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats, call_effect, compiled
from rtcomp.physics import Effect
from rtcomp.physics.wires import COUNT, STEP, TIME


def undone(effect: Effect, time: Floats, signal: Floats, wire: int) -> Floats:
    """Return what `effect` made `signal` (K,) of, at the rows `time` (s, (K,)), from its virgin state.

    `wire` says which signal it is: physics.wires.VOLTS or SENSED. `effect` must have an `inverse`.
    """
    if effect.inverse is None:
        raise TypeError(f"{effect.name} has no inverse")
    before = np.array(signal, dtype=np.float64)
    # One spare number each, so that an effect without parameters or state still has an address.
    p, s = np.append(effect.vector(), 0.0), np.append(effect.initial_state(), 0.0)
    _undo(effect.inverse.address, p, s, time, before, wire)
    return before


@compiled
def _undo(address: int, p: Floats, s: Floats, time: Floats, signal: Floats, wire: int) -> None:
    w = np.zeros(COUNT)
    for k in range(signal.size):
        w[STEP] = time[k] - w[TIME] if k > 0 else 0.0
        w[TIME] = time[k]
        w[wire] = signal[k]
        call_effect(address, p.ctypes.data, s.ctypes.data, w.ctypes.data)
        signal[k] = w[wire]
