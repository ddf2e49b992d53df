"""How a whole stage does on the blocks of a recording that were left out of the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.motion import Motion
from rtcomp.kernels import Floats
from rtcomp.stage.balance import balance_along
from rtcomp.stage.sensed import true_position
from rtcomp.stage.stage import Stage


@dataclass(frozen=True)
class HeldOut:
    """What a stage leaves of them."""

    off: Floats
    """Squared error (N^2) of each block,"""
    power: float
    """and the squared force (N^2) that all of them need."""

    @classmethod
    def of(cls, stage: Stage, motion: Motion) -> HeldOut:
        """Put `stage` through its force balance along `motion`."""
        block, aside = motion.block(), motion.unseen
        off, power = np.zeros(len(aside)), 0.0
        start = 0
        for strip in motion.strips:
            # As in the fit: a jump of the sensor is no step any more where rows are smoothed or averaged.
            position = true_position(
                stage.chain, strip.time, strip.position, motion.averaged, motion.smoothed
            )
            balance = balance_along(stage, strip.time, position, strip.voltage, motion.cut)
            rows = motion.kept(strip)
            drive, needed = balance.force_drive[rows], balance.force_motion[rows]
            own = block[start : start + drive.size]
            start += drive.size
            off += [float(np.sum((drive - needed)[own == k] ** 2)) for k in aside]
            power += float(np.sum(needed[np.isin(own, aside)] ** 2))
        return cls(off, power)

    @property
    def error(self) -> float:
        """Relative force error, rms over rms."""
        return float(np.sqrt(self.off.sum() / self.power)) if self.power > 0 else 0.0

    def typically(self, other: HeldOut) -> float:
        """Return the error over that of `other` in the typical block: one bad block says little of a name."""
        some = (self.off > 0.0) & (other.off > 0.0)
        return float(np.exp(0.5 * np.mean(np.log(self.off[some] / other.off[some])))) if some.any() else 1.0
