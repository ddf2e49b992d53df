"""The double of an explanation: its stage simulated along the recorded references, and analysed alike.

What its analysis leaves is noise, method, and what the kernels of its entries miss of them; what a further
entry gains there, it gains where there is nothing of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rtcomp.diagnosis.base import Fitted, bounds_of
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.extend import extended_stage
from rtcomp.diagnosis.ledger import Ledger
from rtcomp.diagnosis.motion import Motion, Strip, averaged, unstepped
from rtcomp.diagnosis.refine import Refined, believed_power, refine
from rtcomp.diagnosis.scene import Entry
from rtcomp.errors import ConfigError, RtcompError
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.simulate import on_reference
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import YamlFile

FEW = 3
"""Steps of refinement on a double: its entries begin where they are."""


@dataclass(frozen=True)
class Double:
    """A double with the same entries refined on it."""

    motion: Motion
    refined: Refined
    scale: float
    """Factor that brings its squared errors to those of the recording."""
    floor: Floats
    """Squared error (N^2) of every seen block that noise and method leave without any entry."""

    @classmethod
    def of(
        cls, stage: Stage, refined: Refined, motion: Motion, floor: Floats, seed: int = 1
    ) -> Double | None:
        """Make the double of `stage` with `refined`; None where it cannot be simulated or analysed."""
        ledger = refined.fitted.ledger
        twin = resimulated(extended_stage(stage, refined.fitted, refined.entries), motion, seed)
        if twin is None:
            return None
        plain = extended_stage(stage, refined.fitted, [])
        other = Ledger(plain, twin, ledger.reaches, ledger.known, carried=ledger.carried)
        system = other.system([effect_of(e) for e in refined.entries])
        bounds = bounds_of(plain, system.columns.shape[1], names=[str(e["name"]) for e in refined.entries])
        errors = system.blocks.left_out(other.seen, bounds)
        around = Fitted(other, system, bounds, errors, refined.fitted.scale)
        try:
            again = refine(around, twin, refined.entries, tries=FEW, searching=True)
        except (ConfigError, np.linalg.LinAlgError):
            return None
        return cls(twin, again, believed_power(ledger) / believed_power(other), floor)

    @property
    def errors(self) -> Floats:
        """Squared error (N^2) of every seen block that is left where the entries are all there is."""
        return np.asarray(np.maximum(self.floor, self.refined.errors * self.scale))

    def gain(self, entry: Entry) -> float:
        """Return what `entry` gains (N^2) of that."""
        found = self.refined
        try:
            further = refine(found.fitted, self.motion, [*found.entries, entry], tries=FEW, searching=True)
        except (ConfigError, np.linalg.LinAlgError):
            return 0.0
        return max(float(found.errors.sum() - further.errors.sum()) * self.scale, 0.0)


def resimulated(stage: Stage, motion: Motion, seed: int) -> Motion | None:
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
