"""A chain of effects made ready to run: kernels by address, parameters in one array, states in another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats, call_effect, compiled
from rtcomp.physics.effect import Effect, Place
from rtcomp.physics.wires import DRIVE, FRICTION, GAIN, MASS, PUSH, REACH, SCALE

COUNT, DRIVES, LINKS = 0, 1, 2
"""Places in a program: number of effects, how many of them (the first) are the drive's, then for each
effect its kernel's address and where its parameters and state begin."""


class Program:
    """Part of a chain ready to run, from its virgin state, in the order given."""

    def __init__(self, chain: Sequence[Effect]) -> None:
        drives = sum(1 for e in chain if e.place is Place.DRIVE)
        vectors = [e.vector() for e in chain]
        states = [e.initial_state() for e in chain]
        links: list[int] = []
        at_p = at_s = 0
        for effect, p, s in zip(chain, vectors, states, strict=True):
            links += [effect.kernel.address, at_p, at_s]
            at_p, at_s = at_p + p.size, at_s + s.size
        self.steps = np.array([len(chain), drives, *links], dtype=np.int64)
        # One spare number each, so that an effect without parameters or state still has an address.
        self.p: Floats = np.concatenate([*vectors, np.zeros(1)])
        self.s: Floats = np.concatenate([*states, np.zeros(1)])


@compiled
def renew(w: Floats, mass: float, gain: float) -> None:
    """Put the wires that a whole chain writes anew to where they begin: nothing acts yet."""
    w[MASS], w[GAIN] = mass, gain
    w[DRIVE] = w[PUSH] = w[FRICTION] = 0.0
    w[REACH] = w[SCALE] = 1.0


@compiled
def run_chain(steps: np.ndarray, p: Floats, s: Floats, w: Floats, first: int, last: int) -> None:
    """Run effects `first` to `last` (not included) of a program on the wires."""
    for j in range(first, last):
        at = LINKS + 3 * j
        call_effect(
            steps[at], p.ctypes.data + 8 * steps[at + 1], s.ctypes.data + 8 * steps[at + 2], w.ctypes.data
        )
