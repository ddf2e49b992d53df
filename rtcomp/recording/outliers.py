"""Outliers: samples that their neighbours contradict. They are marked, never removed."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

WINDOW = 7
"""Samples of the running median: up to 3 wrong ones in a row are found, steps and ramps pass."""
SPREAD_WINDOW = 51
STEP_WINDOW = 15
THRESHOLD = 8.0
COMMAND_THRESHOLD = 16.0
"""For a command: a controller that differentiates a coarse sensor spikes of its own."""
COUNTS = 4.5
"""An outlier is further off than this many of the sensor's counts, however quiet the signal."""


def outliers(signal: Floats, threshold: float = THRESHOLD) -> npt.NDArray[np.bool_]:
    """Return which samples of `signal` (1-D, evenly or nearly evenly sampled) are outliers.

    A sample is one where it lies further from the running median of its neighbourhood than `threshold` times
    the robust spread: the largest of 1.4826 times the median of such distances around it, the same of the
    whole signal, and the usual step from sample to sample around it. (Hampel 1974, J. Am. Stat. Assoc.
    69:383, with a spread that neither a coarse sensor nor a fast oscillation of the signal deceives.)
    """
    from scipy.ndimage import median_filter

    if len(signal) < SPREAD_WINDOW:
        return np.zeros(len(signal), dtype=np.bool_)
    distance = np.abs(signal - median_filter(signal, WINDOW, mode="nearest"))
    nearby = median_filter(distance, SPREAD_WINDOW, mode="nearest")
    step = median_filter(np.abs(np.diff(signal, prepend=signal[0])), STEP_WINDOW, mode="nearest")
    spread = np.maximum(1.4826 * np.maximum(nearby, np.median(distance)), step)
    return np.asarray(distance > np.maximum(threshold * spread, COUNTS * _resolution(signal)))


def _resolution(signal: Floats) -> float:
    """Return the smallest usual step between different neighbours: the sensor's count, or the noise."""
    steps = np.abs(np.diff(signal))
    steps = steps[steps > 1e-12 * np.ptp(signal)]
    return float(np.quantile(steps, 0.25)) if len(steps) else 0.0
