"""Compiled kernels behind plain C pointers.

A kernel is a pure function on arrays, compiled once and called by address. Calling by address is what
lets one compiled loop run any chain of effects, any basis and any learner, third parties' included,
without compiling the loop anew for each combination, which takes seconds; a call takes about 10 ns.

Inside a kernel the arguments are C pointers to float64: index them, use `math`, call other `compiled`
functions. The same source also runs as plain Python on numpy arrays (`Kernel.python`), for tests.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import cfunc, njit, types
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., Any])
Floats = npt.NDArray[np.float64]

_POINTER = types.CPointer(types.float64)
_EFFECT = types.void(_POINTER, _POINTER, _POINTER)
_BASIS = types.void(_POINTER, _POINTER, _POINTER, types.float64)
_LEARNER = types.void(_POINTER, _POINTER, _POINTER, _POINTER, types.float64)
_PLACING = types.void(*[_POINTER] * 10, types.float64, types.float64)
_REGROUP = types.void(_POINTER, _POINTER, _POINTER, _POINTER)


_COMPILING = threading.RLock()


def compiled(function: F) -> F:
    """Compile a pure function on arrays and numbers (numba, no Python objects, cached on disk)."""
    return cast(F, njit(cache=True, nogil=True, error_model="numpy")(function))


def summing(function: F) -> F:
    """Compile as `compiled`, with terms of a sum added in any order: several at a time, where there are many.

    A sum in the order written waits for each addition before the next.
    """
    return cast(F, njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc"})(function))


class Kernel:
    """A compiled function with a C address; compiled when the address is first asked for."""

    def __init__(self, function: Callable[..., None], signature: Any, pointers: int) -> None:
        self.python = function
        self.__doc__ = function.__doc__
        self.name = function.__name__
        self._signature = signature
        self._pointers = pointers
        self._compiled: Any = None
        self._address = 0

    @property
    def address(self) -> int:
        """The address to hand to `call_effect`, `call_basis` or `call_learner`."""
        if self._address == 0:
            with _COMPILING:  # two threads that ask at once must get the same code
                if self._compiled is None:
                    self._compiled = cfunc(self._signature, cache=True)(self.python)
                self._address = int(self._compiled.address)
        return self._address

    def __call__(self, *arguments: Any) -> None:
        """Call the compiled kernel from Python: float64 arrays first, then numbers."""
        address = self.address
        arrays = [_checked(a) for a in arguments[: self._pointers]]
        numbers = [float(a) for a in arguments[self._pointers :]]
        kinds = [ctypes.c_void_p] * len(arrays) + [ctypes.c_double] * len(numbers)
        ctypes.CFUNCTYPE(None, *kinds)(address)(*[a.ctypes.data for a in arrays], *numbers)


def _checked(array: Floats) -> Floats:
    if array.dtype != np.float64 or not array.flags.c_contiguous:
        raise TypeError("a kernel takes contiguous float64 arrays")
    return array


def effect_kernel(function: Callable[..., None]) -> Kernel:
    """Make a physics kernel ``f(p, s, w)``: parameters, own state, the stage's wires."""
    return Kernel(function, _EFFECT, 3)


def basis_kernel(function: Callable[..., None]) -> Kernel:
    """Make a hysteresis basis kernel ``f(p, s, x, u)``: parameters, own state, regressors out, input."""
    return Kernel(function, _BASIS, 3)


def learner_kernel(function: Callable[..., None]) -> Kernel:
    """Make a learner kernel ``f(p, s, x, w, error)``: parameters, own state, regressors, weights."""
    return Kernel(function, _LEARNER, 4)


def placing_kernel(function: Callable[..., None]) -> Kernel:
    """Make a kernel that moves a basis's elements while it runs (`hysteresis.moving.placing.place`)."""
    return Kernel(function, _PLACING, 10)


def regroup_kernel(function: Callable[..., None]) -> Kernel:
    """Make a learner's kernel ``f(p, s, scales, change)``: carry its state over a change of the elements."""
    return Kernel(function, _REGROUP, 4)


@intrinsic  # type: ignore[untyped-decorator, unused-ignore]
def floats_at(typingctx: Any, address: Any) -> Any:
    """Return the pointer to float64 at an address, for `numba.carray`; the array's owner must outlive it."""
    return _pointer_to(_POINTER)


@intrinsic  # type: ignore[untyped-decorator, unused-ignore]
def integers_at(typingctx: Any, address: Any) -> Any:
    """Return the pointer to int64 at an address, as `floats_at`."""
    return _pointer_to(types.CPointer(types.int64))


def _pointer_to(kind: Any) -> Any:
    def codegen(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(kind))

    return kind(types.int64), codegen


def _call(pointers: int, numbers: int) -> Any:
    """Build the intrinsic that calls a kernel of `pointers` arrays and `numbers` float64 by address."""
    # The integer arguments are addresses of float64 data (``array.ctypes.data`` inside compiled code).
    kinds = [types.int64] + [types.intp] * pointers + [types.float64] * numbers

    def codegen(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        pointer, number = ir.DoubleType().as_pointer(), ir.DoubleType()
        kind = ir.FunctionType(ir.VoidType(), [pointer] * pointers + [number] * numbers)
        function = builder.inttoptr(values[0], kind.as_pointer())
        arrays = [builder.inttoptr(v, pointer) for v in values[1 : 1 + pointers]]
        builder.call(function, arrays + list(values[1 + pointers :]))
        return context.get_dummy_value()

    return types.void(*kinds), codegen


@intrinsic  # type: ignore[untyped-decorator, unused-ignore]
def call_effect(typingctx: Any, address: Any, p: Any, s: Any, w: Any) -> Any:
    """Call an effect kernel by address; the arrays are given as ``array.ctypes.data``."""
    return _call(3, 0)


@intrinsic  # type: ignore[untyped-decorator, unused-ignore]
def call_basis(typingctx: Any, address: Any, p: Any, s: Any, x: Any, u: Any) -> Any:
    """Call a basis kernel by address; the arrays are given as ``array.ctypes.data``."""
    return _call(3, 1)


@intrinsic  # type: ignore[untyped-decorator, unused-ignore]
def call_learner(typingctx: Any, address: Any, p: Any, s: Any, x: Any, w: Any, error: Any) -> Any:
    """Call a learner kernel by address; the arrays are given as ``array.ctypes.data``."""
    return _call(4, 1)


@intrinsic  # type: ignore[untyped-decorator, unused-ignore]
def call_placing(typingctx: Any, address: Any, p: Any, s: Any, x: Any, lead_s: Any, lead_x: Any, w: Any,
                 begun: Any, scales: Any, m: Any, change: Any, force: Any, error: Any) -> Any:  # fmt: skip
    """Call a placing kernel by address; the arrays are given as ``array.ctypes.data``."""
    return _call(10, 2)


@intrinsic  # type: ignore[untyped-decorator, unused-ignore]
def call_regroup(typingctx: Any, address: Any, p: Any, s: Any, scales: Any, change: Any) -> Any:
    """Call a learner's regroup kernel by address; the arrays are given as ``array.ctypes.data``."""
    return _call(4, 0)
