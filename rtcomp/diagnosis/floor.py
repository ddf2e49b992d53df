"""The floor: what sensor noise, resolution and the method itself leave when nothing is missing.

The explanation at hand is simulated in closed loop along the recorded reference, with the believed sensor,
and put through the identical analysis. Where that cannot be done the recorded motion is read once more, with
fresh noise.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rtcomp.diagnosis.base import Fitted, bounds_of
from rtcomp.diagnosis.blocks import Blocks
from rtcomp.diagnosis.ledger import Ledger
from rtcomp.diagnosis.motion import Motion, Strip, averaged, unstepped
from rtcomp.errors import RtcompError
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.simulate import on_reference
from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import YamlFile

METHOD = 0.0015
"""Relative error that the method leaves by itself: friction by a grid of reaches, forces by rows."""


def floor_errors(stage: Stage, fitted: Fitted, motion: Motion, seed: int = 1) -> np.ndarray:
    """Return the squared error (N^2) expected in every seen block if `stage` were the whole truth."""
    twin = _twin(stage, motion, seed)
    ledger, seen = fitted.ledger, fitted.ledger.seen
    power = fitted.system.blocks.power[seen]
    method = METHOD**2 * power
    if twin is None:
        return np.asarray(method + _shaken(fitted, motion, seed))
    other = Ledger(stage, twin, ledger.reaches, ledger.known)
    system = other.system(stage_effects(stage, ledger))
    bounds = bounds_of(stage, system.columns.shape[1], slack=0.3)
    errors = system.blocks.left_out(seen, bounds)
    scale = power.sum() / max(float(system.blocks.power[seen].sum()), 1e-300)
    return np.asarray(np.maximum(errors * scale, method))


def stage_effects(stage: Stage, ledger: Ledger) -> list:  # type: ignore[type-arg]
    """Return the effects of `stage` that the ledger does not already know."""
    from rtcomp.diagnosis.candidates import effect_of

    effects = [effect_of(e) for e in stage.mechanics.effects]
    return [e for e in effects if e not in ledger.known]


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


def _twin(stage: Stage, motion: Motion, seed: int) -> Motion | None:
    """Simulate `stage` along the recorded references; None where there is no reference or controller.

    At the rate of the recording, and averaged as it was: noise that is averaged is less, and a controller
    that reads every fifth row moves the axis otherwise.
    """
    if stage.controller is None or any(s.reference is None for s in motion.strips):
        return None
    times = motion.averaged
    rate = motion.rate * times
    strips: list[Strip] = []
    for strip in motion.strips:
        assert strip.reference is not None
        rows = strip.reference.size * times
        middle = np.arange(strip.reference.size) * times + 0.5 * (times - 1)
        reference = np.interp(np.arange(rows), middle, strip.reference)
        data = {**stage.to_dict(), "rate": rate, "seed": seed}
        try:
            config = Configuration.of(YamlFile(data, Path("stage")))
            run = on_reference(config, reference, float(strip.position[0]))
        except RtcompError:
            return None
        if run.outcome.ticks < rows:
            return None
        position = run.columns["position"]
        if motion.smoothed:
            position = unstepped(position, motion.smoothed, rate)
        found = averaged(Strip(np.arange(rows) / rate, position, run.columns["voltage"], reference), times)
        off = float(np.sqrt(np.mean((found.position - strip.position) ** 2)))
        if not off < 0.5 * np.ptp(strip.position):
            return None
        strips.append(replace(strip, position=found.position, voltage=found.voltage))
    return replace(motion, strips=strips)
