"""What a hysteresis basis is: an operator with memory that turns an input into regressors.

A model of hysteresis is ``force = offset + sum_i weight_i * regressor_i``. The basis holds the memory
and is nonlinear; the weights are learned and enter linearly. Basis and learner combine freely.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, TypeVar

import numpy as np

from rtcomp.errors import ConfigError, nearest
from rtcomp.kernels import Floats, Kernel, call_basis, compiled


class Basis:
    """Base of all bases. The kernel holds the arithmetic; an instance holds the places of its elements."""

    name: ClassVar[str]
    kernel: ClassVar[Kernel]
    """``f(p, s, x, u)``: advance the state `s` to the input `u`, write the regressors `x`.

    The first call on a fresh state only takes `u` as the starting point; `x` must then be zero and must
    be handed in unchanged from call to call (a kernel writes only what the step touched).
    """
    source: ClassVar[str]
    placing: ClassVar[Kernel | None] = None
    """What moves the elements while learning runs (`hysteresis.moving`); None where they stay."""

    @property
    def size(self) -> int:
        """Number of regressors."""
        raise NotImplementedError

    def vector(self) -> Floats:
        """Return the kernel's parameters `p`."""
        raise NotImplementedError

    def initial_state(self) -> Floats:
        """Return the kernel's state `s` in the virgin (anhysteretic) state, before any input."""
        raise NotImplementedError

    def scales(self) -> Floats:
        """Return the amplitude of each regressor when fully exercised, shape (size,); m for an input in m."""
        raise NotImplementedError

    def likeness(self) -> Floats | None:
        """Return how alike the weights are expected to be, a correlation (size, size); None if not at all."""
        return None

    def memory(self, gate: float) -> Floats:
        """Return what `placing` remembers at the start; `gate` (m) is the motion between two updates."""
        return np.zeros(0)

    def settled(self, vector: Floats) -> Basis:
        """Return the basis with its elements where the parameters `vector` of a run have them now."""
        return self

    @classmethod
    def over(cls, count: int, total: float, spacing: float = 1.0) -> Basis:
        """Spread `count` elements over the range `total` (m, from full saturation to full saturation).

        `spacing` is the width of the last over that of the first, geometric in between; 1 for equal.
        """
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Return the basis as a model file writes it, with its name under ``model``."""
        raise NotImplementedError

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> Basis:
        """Build the basis from a model file's entry (without ``model``)."""
        return cls(**entry)


def checked_keys(
    entry: Mapping[str, Any], owner: str, needed: Sequence[str], optional: Sequence[str] = ()
) -> None:
    """Raise ConfigError where a model file's `entry` has a key too many, or one of `needed` is missing."""
    known = [*needed, *optional]
    for key in entry:
        if key not in known:
            hint = nearest(key, [*known, "weights", "offset", "reached"])
            raise ConfigError(f"{owner} model: unknown key {key!r}; {hint}", key=(key,))
    for key in needed:
        if key not in entry:
            raise ConfigError(f"{owner} model: key {key!r} is missing", key=(key,))


B = TypeVar("B", bound=type[Basis])
_BASES: dict[str, type[Basis]] = {}


def register_basis(basis: B) -> B:
    """Class decorator: make a basis known under its name."""
    _BASES[basis.name] = basis
    return basis


def bases() -> dict[str, type[Basis]]:
    """Return every known basis by name."""
    return dict(_BASES)


def basis_named(name: str) -> type[Basis]:
    """Return the basis class of that name, or raise ConfigError naming the nearest."""
    if name not in _BASES:
        raise ConfigError(f"no hysteresis model is named {name!r}; {nearest(name, _BASES)}", key=("model",))
    return _BASES[name]


def regressors(
    basis: Basis, inputs: Floats, state: Floats | None = None, held: Floats | None = None
) -> Floats:
    """Run the basis over `inputs` (K,) and return the regressors of every sample, shape (K, size).

    Starts from the virgin state, or goes on from `state`, whose regressors were `held` (size,), else zero;
    both are changed in place, so that the next call goes on from there.
    """
    inputs = np.ascontiguousarray(inputs, dtype=np.float64)
    out = np.empty((inputs.size, basis.size))
    state = basis.initial_state() if state is None else state
    _run(
        basis.kernel.address,
        basis.vector(),
        state,
        np.zeros(basis.size) if held is None else held,
        inputs,
        out,
    )
    return out


@compiled
def _run(address: int, p: Floats, s: Floats, x: Floats, inputs: Floats, out: Floats) -> None:
    for k in range(inputs.size):
        call_basis(address, p.ctypes.data, s.ctypes.data, x.ctypes.data, inputs[k])
        out[k] = x
