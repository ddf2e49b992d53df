"""The floor: what sensor noise, resolution and the method itself leave when nothing is missing.

The explanation at hand is simulated in closed loop along the recorded reference, with the believed sensor,
and put through the identical analysis. Where that cannot be done the recorded motion is read once more, with
fresh noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.base import Fitted, bounds_of
from rtcomp.diagnosis.blocks import Blocks
from rtcomp.diagnosis.double import resimulated
from rtcomp.diagnosis.ledger import Ledger
from rtcomp.diagnosis.motion import Motion, Strip, unstepped
from rtcomp.stage.stage import Stage

METHOD = 0.0015
"""Relative error that the method leaves by itself: friction by a grid of reaches, forces by rows."""


def floor_errors(stage: Stage, fitted: Fitted, motion: Motion, seed: int = 1) -> np.ndarray:
    """Return the squared error (N^2) expected in every seen block if `stage` were the whole truth."""
    twin = resimulated(stage, motion, seed)
    ledger, seen = fitted.ledger, fitted.ledger.seen
    power = fitted.system.blocks.power[seen]
    method = METHOD**2 * power
    if twin is None:
        return np.asarray(method + _shaken(fitted, motion, seed))
    other = Ledger(stage, twin, ledger.reaches, ledger.known)
    system = other.system()
    bounds = bounds_of(stage, system.columns.shape[1], slack=0.3)
    errors = system.blocks.left_out(seen, bounds)
    scale = power.sum() / max(float(system.blocks.power[seen].sum()), 1e-300)
    return np.asarray(np.maximum(errors * scale, method))


def _shaken(fitted: Fitted, motion: Motion, seed: int) -> np.ndarray:
    """Return the squared error (N^2) of every seen block that noise makes along the recorded motion.

    The force that the fit needs along the motion as recorded is fitted anew along the same motion read once
    more: with fresh noise and rounding.
    """
    ledger = fitted.ledger
    sensor = ledger.stage.sensor
    random = np.random.default_rng(seed)
    fewer = 1.0 / np.sqrt(motion.averaged)
    strips: list[Strip] = []
    for strip in motion.strips:
        rows = strip.position.size
        read = sensor.noise * random.standard_normal(rows) + sensor.resolution * random.uniform(
            -0.5, 0.5, rows
        )
        position = strip.position + fewer * read
        if motion.smoothed:
            position = unstepped(position, motion.smoothed, motion.rate)
        strips.append(replace(strip, position=position))
    other = Ledger(ledger.stage, replace(motion, strips=strips), ledger.reaches, ledger.known)
    columns = other.system().columns
    needed = fitted.system.columns @ fitted.coefficients
    blocks = Blocks.of(columns, needed, ledger.block, ledger.seen.size)
    return blocks.left_out(ledger.seen, fitted.bounds)
