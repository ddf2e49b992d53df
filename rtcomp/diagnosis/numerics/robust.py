"""How much of what was expected do errors show: a robust fit of one factor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats

TURNS = 30
"""Turns of the robust fit."""
NOTHING = 1e-12
"""Part of the squared errors below which what an effect does is lost in rounding."""


def shows(having: Sequence[Floats], without: Sequence[Floats]) -> tuple[float, float]:
    """Return the part of what a model does beyond another one that their errors show, and its standard error.

    Errors are one array (rows,) for each window or block. 1 where all of it is there, 0 where nothing is. The
    factor of a robust fit: windows that went further off than half of them count by their size, not by its
    square (Huber 1964, Ann. Math. Stat. 35(1)).
    """
    done = [other - own for own, other in zip(having, without, strict=True)]
    square = np.array([float(np.sum(d**2)) for d in done])
    along = np.array([float(np.sum(e * d)) for e, d in zip(without, done, strict=True)])
    whole = np.array([float(np.sum(e**2)) for e in without])
    if square.sum() <= NOTHING * whole.sum():
        return 0.0, math.inf
    part, weight, least = 1.0, np.ones(square.size), math.sqrt(NOTHING * (whole + square).mean())
    for _ in range(TURNS):
        off = np.sqrt(np.maximum(whole - 2.0 * part * along + part**2 * square, 0.0))
        usual = max(float(np.median(off)), least)
        weight = 1.0 / np.maximum(off, usual)
        part = float(np.sum(weight * along) / max(np.sum(weight * square), 1e-300))
    scatter = np.sum((weight * (along - part * square)) ** 2) * square.size / max(square.size - 1, 1)
    return part, float(np.sqrt(scatter) / max(np.sum(weight * square), 1e-300))
