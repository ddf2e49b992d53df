"""What a learner is: the rule that moves the weights when the model's output was wrong.

When to learn is not the learner's business: the tick calls it when the axis has moved by the gate's
distance since the last call (learning is driven by displacement, not by time), and not while frozen.
"""

from __future__ import annotations

import inspect
import numbers
from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from rtcomp.errors import ConfigError, nearest
from rtcomp.hysteresis.basis import Basis
from rtcomp.hysteresis.moving.places import CHANGE_WIDTH, CHANGED
from rtcomp.kernels import (
    Floats,
    Kernel,
    call_basis,
    call_learner,
    call_placing,
    call_regroup,
    compiled,
)


class Learner:
    """Base of all learners."""

    name: ClassVar[str]
    kernel: ClassVar[Kernel]
    """``f(p, s, x, w, error)``: change the weights `w` from regressors `x` and error (7) = measured - w.x."""
    source: ClassVar[str]
    regroup: ClassVar[Kernel | None] = None
    """``f(p, s, scales, change)``: carry parameters and state over a change of the elements (`places`), whose
    amplitudes are `scales` now; None where the learner cannot, which bars it from elements that move."""

    def vector(self, scales: Floats) -> Floats:
        """Return the kernel's parameters for regressors of these amplitudes; `p[0]` is their number."""
        raise NotImplementedError

    knows_likeness: ClassVar[bool] = False
    """Whether it begins with what weights are expected to have in common (`Basis.likeness`)."""

    def initial_state(self, scales: Floats, likeness: Floats | None = None) -> Floats:
        """Return the kernel's state before it has learned anything.

        `likeness` (M, M) is the correlation of the first M weights; those after them are on their own.
        """
        raise NotImplementedError

    def information(self, state: Floats, scales: Floats) -> Floats:
        """Return what `state` knows of each combination of weights, (N, N), up to a factor.

        A learner that keeps no covariance counts every regressor by its amplitude.
        """
        return np.diag(scales**2)

    def to_dict(self) -> dict[str, Any]:
        """Return name and settings as a configuration writes them."""
        raise NotImplementedError


L = TypeVar("L", bound=type[Learner])
_LEARNERS: dict[str, type[Learner]] = {}


def register_learner(learner: L) -> L:
    """Class decorator: make a learner known under its name."""
    _LEARNERS[learner.name] = learner
    return learner


def learners() -> dict[str, type[Learner]]:
    """Return every known learner by name."""
    return dict(_LEARNERS)


def build_learner(entry: Mapping[str, Any]) -> Learner:
    """Build a learner from ``{learner: rls, forgetting: 0.9995, ...}``; raise ConfigError if it cannot be."""
    settings = dict(entry)
    name = settings.pop("learner", None)
    if not isinstance(name, str) or name not in _LEARNERS:
        wrong = "learner is missing" if name is None else f"no learner is named {name!r}"
        raise ConfigError(f"{wrong}; {nearest(name, _LEARNERS)}", key=("learner",))
    known = inspect.signature(_LEARNERS[name]).parameters
    for key, value in settings.items():
        if key not in known:
            raise ConfigError(
                f"learner {name}: unknown setting {key!r}; {nearest(key, ['learner', *known])}", key=(key,)
            )
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ConfigError(f"learner {name}: {key} is {value!r}; it must be a number", key=(key,))
    return _LEARNERS[name](**settings)


def learn(
    basis: Basis,
    learner: Learner,
    inputs: Floats,
    outputs: Floats,
    gate: float = 0.0,
    weights: Floats | None = None,
) -> Floats:
    """Learn on a recorded motion, sample by sample, as the loop does; return the weights (size,).

    inputs: (K,) m. outputs: (K,) N. gate: displacement (m) between two updates. The virgin state is
    assumed at the first sample. This is the operator and learner alone; the loop adds conditioning.
    """
    scales = basis.scales()
    w = np.zeros(basis.size) if weights is None else weights.astype(np.float64, copy=True)
    _learn(
        basis.kernel.address,
        basis.vector(),
        basis.initial_state(),
        learner.kernel.address,
        learner.vector(scales),
        learner.initial_state(scales, basis.likeness()),
        np.zeros(basis.size),
        w,
        np.ascontiguousarray(inputs, dtype=np.float64),
        np.ascontiguousarray(outputs, dtype=np.float64),
        gate,
    )
    return w


def learn_places(
    basis: Basis,
    learner: Learner,
    inputs: Floats,
    outputs: Floats,
    gate: float = 0.0,
    counted: npt.NDArray[np.bool_] | None = None,
    offset: bool = False,
) -> tuple[Basis, Floats]:
    """Learn as `learn` does with a basis whose elements move; return it as it ends, and the weights (size,).

    Samples that are not `counted` (K,) are moved through, and nothing is learned of them, neither weights nor
    places. With `offset` a constant is learned too, as the loop does; its weight (of the mean scale, m) is
    then the last of size + 1. Raises ConfigError where the learner cannot follow.
    """
    scales, x = basis.scales().copy(), np.zeros(basis.size + offset)
    if offset:
        x[-1] = scales.mean()
        scales = np.append(scales, x[-1])
    vector, params = basis.vector(), learner.vector(scales)
    state = learner.initial_state(scales, basis.likeness())
    moving, follow = followed(basis, learner)
    w = np.zeros(x.size)
    _learn_places(
        basis.kernel.address, vector, basis.initial_state(), learner.kernel.address, params, state,
        x, w, np.ascontiguousarray(inputs, dtype=np.float64),
        np.ascontiguousarray(outputs, dtype=np.float64), gate, moving, follow, scales, basis.memory(gate),
        np.zeros(CHANGE_WIDTH), np.ones(inputs.size, dtype=np.bool_) if counted is None else counted,
    )  # fmt: skip
    return basis.settled(vector), w


def followed(basis: Basis, learner: Learner) -> tuple[int, int]:
    """Return the addresses of what moves the basis's elements and of what the learner does then; 0 for none.

    Raises ConfigError where they move and the learner cannot follow.
    """
    if basis.placing is None:
        return 0, 0
    if learner.regroup is None:
        raise ConfigError(
            f"learner {learner.name} cannot follow the elements of model {basis.name}, which move; take "
            "another learner, or model interval",
            key=("learner",),
        )
    return basis.placing.address, learner.regroup.address


@compiled
def _learn_places(
    basis: int, bp: Floats, bs: Floats, learner: int, lp: Floats, ls: Floats, x: Floats, w: Floats,
    inputs: Floats, outputs: Floats, gate: float, moving: int, follow: int, scales: Floats, memory: Floats,
    change: Floats, counted: npt.NDArray[np.bool_],
) -> None:  # fmt: skip
    last, begun = inputs[0], w.copy()
    for k in range(inputs.size):
        call_basis(basis, bp.ctypes.data, bs.ctypes.data, x.ctypes.data, inputs[k])
        error, force = np.nan, outputs[k] if counted[k] else np.nan
        if counted[k] and abs(inputs[k] - last) >= gate:
            last = inputs[k]
            error = force - np.dot(w, x)
            call_learner(learner, lp.ctypes.data, ls.ctypes.data, x.ctypes.data, w.ctypes.data, error)
        if moving == 0:
            continue
        call_placing(
            moving, bp.ctypes.data, bs.ctypes.data, x.ctypes.data, bs.ctypes.data, x.ctypes.data,
            w.ctypes.data, begun.ctypes.data, scales.ctypes.data, memory.ctypes.data, change.ctypes.data,
            force, error,
        )  # fmt: skip
        if change[CHANGED] > 0.0:
            call_regroup(follow, lp.ctypes.data, ls.ctypes.data, scales.ctypes.data, change.ctypes.data)


@compiled
def _learn(
    basis: int, bp: Floats, bs: Floats, learner: int, lp: Floats, ls: Floats, x: Floats, w: Floats,
    inputs: Floats, outputs: Floats, gate: float,
) -> None:  # fmt: skip
    last = inputs[0]
    for k in range(inputs.size):
        call_basis(basis, bp.ctypes.data, bs.ctypes.data, x.ctypes.data, inputs[k])
        if abs(inputs[k] - last) >= gate:
            last = inputs[k]
            error = outputs[k] - np.dot(w, x)
            call_learner(learner, lp.ctypes.data, ls.ctypes.data, x.ctypes.data, w.ctypes.data, error)
