"""What the sensor puts into the residual: the density of its noise, and the weight of every frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rtcomp.diagnosis.numerics.spectrum import (
    Response,
    interpolated,
    motion_spectrum,
    spectrum,
    white_noise,
)
from rtcomp.diagnosis.recordings.data import Data, Segment
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

TOP = 0.1
"""Weight, relative to the largest, below which a frequency is left out of the table of rows."""

LEAD = 2
"""Rows at the ends of a segment that second differences do not do justice to."""
ENDS, DRAWN_OUT = 0.1, 1e-3
"""Maximum part of a segment that is not compared at each end; maximum part of the power of the filter's
impulse response beyond these rows."""
RINGING = 100
"""Rows at the ends of a band-limited segment that derivatives do not do justice to."""


@dataclass(frozen=True)
class Noise:
    """Noise of the position, and the smoothing that follows from it."""

    rms: float
    """m, white, at the recording's rate."""
    wiener: Response
    """Share of the position's power that is signal, by frequency (Wiener 1949), up to where it is lost."""
    signal: Response
    """That share at all frequencies."""
    smoother: Response
    """What the position is smoothed by."""
    bandwidth: float
    """Hz, up to which signal is at least as strong as noise."""

    @classmethod
    def of(cls, stage: Stage, data: Data) -> Noise:
        """Take the noise that the stage states; the recording's where that is louder, or none is stated.

        Noise that is larger than all there is at some frequency is not there. Where a stage says nothing, all
        that stands in the weakest band, be it leaked from the motion, counts as noise: too much of it says
        less, too little makes a finding of whatever is open.
        """
        positions, stated = [s.position for s in data.segments], cls.stated(stage)
        frequency, density = (motion_spectrum if stated > 0.0 else spectrum)(positions, data.rate)
        most = float(np.sqrt(density.min() * 0.5 * data.rate))
        rms = min(max(stated, white_noise(positions), 0.1 * most), most) if stated > 0.0 else most
        floor = rms**2 / (0.5 * data.rate)
        share = np.maximum(1.0 - floor / density, 1e-6)
        signal = interpolated(frequency, share.copy())
        # Once lost in noise, higher bands say nothing of a force.
        lost = np.flatnonzero(share < 0.5)
        last = int(lost[0]) if lost.size else share.size - 1
        share[last + 1 :] = np.minimum(share[last + 1 :], 1e-3)
        wiener = interpolated(frequency, share)
        return cls(rms, wiener, signal, wiener, float(frequency[last]))

    def smoothing_for(self, part: float) -> Noise:
        """Return the same noise, the position smoothed as if only `part` of its power were there.

        For all of it what is lost in noise is left out; for less, nothing is.
        """
        if part >= 1.0:
            return replace(self, smoother=self.wiener)

        def smoother(at: Floats) -> Floats:
            share = self.signal(at)
            return np.asarray(share / (share + part * (1.0 - share)))

        return replace(self, smoother=smoother)

    @staticmethod
    def stated(stage: Stage) -> float:
        """Return what a stage says of its sensor's noise and counts (m rms), 0 where nothing."""
        return float(np.hypot(stage.sensor.noise, stage.sensor.resolution / np.sqrt(12.0)))


def _memory(response: Response, rate: float, rows: int) -> int:
    """Return within how many rows a filter has all but a part of the power of its answer to a single row."""
    frequency: Floats = np.asarray(np.fft.rfftfreq(2 * rows, 1.0 / rate), dtype=np.float64)
    power = np.fft.irfft(response(frequency), 2 * rows)[:rows] ** 2
    later = np.cumsum(power[::-1])[::-1]
    return int(np.argmax(later < DRAWN_OUT * later[0]))


@dataclass(frozen=True)
class Whitening:
    """Weight of each frequency of the residual, and every how manieth row is enough of what is left."""

    response: Response
    white: Response
    """The first of its two factors: one over the amplitude density of noise in the residual."""
    coloured: Response
    """The inverse of that."""
    thinning: int
    lead: int
    """Rows at both ends of a segment whose derivatives are not right: cut before filtering."""
    edge: int
    """Rows at both ends of a segment that are left out, those included."""

    @classmethod
    def of(cls, noise: Noise, data: Data, shaken: list[Floats]) -> Whitening:
        """Weigh by signal over noise: `shaken` (N, a segment each) is what noise does to the residual.

        Residuals are divided by the amplitude density of that, so that all frequencies are equally noisy,
        and multiplied by the share of the position that is signal.
        """
        frequency, density = spectrum(shaken, data.rate)
        coloured = interpolated(frequency, np.sqrt(density * 0.5 * data.rate))
        white = interpolated(frequency, 1.0 / np.sqrt(density * 0.5 * data.rate))

        def response(at: Floats) -> Floats:
            return white(at) * noise.wiener(at)

        above = np.flatnonzero(noise.wiener(frequency) > TOP)
        high = float(frequency[above[-1]]) if above.size else float(frequency[-1])
        thinning = max(1, int(data.rate / (2.5 * high)))
        lead = LEAD if data.held else RINGING
        sizes = [s.time.size for s in data.segments]
        reach = min(_memory(response, data.rate, max(sizes)), int(ENDS * min(sizes)))
        return cls(response, white, coloured, thinning, lead, lead + max(1, reach))

    def filtered(self, segment: Segment) -> slice:
        """Return the rows that are filtered: what run-in or ends have wrong would be drawn out."""
        return slice(max(self.lead, segment.run_in), segment.time.size - self.lead)

    def rows(self, segment: Segment) -> slice:
        """Return the rows of a segment that are compared."""
        first = self.edge + max(segment.run_in - self.lead, 0)
        return slice(first, max(segment.time.size - self.edge, first + 1), self.thinning)

    def louder(self, rows: list[Floats], noise: Noise, data: Data) -> float:
        """Return how many times louder noise may be by the weakest band of residuals, a segment each.

        Of the bands in which the motion stands above the noise. Above these a recording may have been cut off
        by a filter, noise and all.
        """
        frequency, density = spectrum(rows, data.rate / self.thinning)
        share = noise.wiener(frequency)
        inside = share > 0.5
        if not inside.any():
            return 1.0
        alone = share[inside] ** 2 / (0.5 * data.rate)
        return max(float(np.sqrt(np.min(density[inside] / alone))), 1.0)
