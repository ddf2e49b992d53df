"""Rows of recordings as they are compared: what locating and drawing need to know of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from rtcomp.kernels import Floats


class Stretch(Protocol):
    """One uninterrupted part of a recording: time (s), position (m), voltage (V), each (K,)."""

    @property
    def time(self) -> Floats:
        """When."""

    @property
    def position(self) -> Floats:
        """As read."""

    @property
    def voltage(self) -> Floats:
        """As commanded."""


class View(Protocol):
    """Stretches of equal rate, and how arrays along them become arrays over the compared rows."""

    @property
    def strips(self) -> Sequence[Stretch]:
        """The stretches."""

    @property
    def rate(self) -> float:
        """Rows a second (Hz)."""

    @property
    def period(self) -> float:
        """Time between rows (s)."""

    @property
    def thinning(self) -> int:
        """Every how manieth row is compared."""

    @property
    def cut(self) -> float:
        """Hz, below which it is compared."""

    @property
    def stroke(self) -> tuple[float, float]:
        """Lowest and highest position (m)."""

    def smooth(self, rows: Sequence[Floats]) -> Floats:
        """Return an array a stretch, (K,), below the cut on the compared rows, (n,)."""

    def plain(self, rows: Sequence[Floats]) -> Floats:
        """Return an array a stretch, (K,), on the compared rows, (n,), without smoothing."""
