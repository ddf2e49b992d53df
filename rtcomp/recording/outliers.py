"""Outliers: samples that their neighbours contradict. They are marked, never removed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rtcomp.recording.pieces import Floats, pieces, sample

WINDOW = 7
"""Samples of the running median: up to 3 wrong ones in a row are found, steps and ramps pass."""
SPREAD_WINDOW = 51
STEP_WINDOW = 15
REACH = 64
"""Samples to either side that decide about one: half of all windows together, and some."""
THRESHOLD = 8.0
COMMAND_THRESHOLD = 16.0
"""For a command: a controller that differentiates a coarse sensor spikes of its own."""
BACK = 0.5
"""Part of an outlier's distance within which the signal must be back after it."""
ANSWERED = 12.0
ANSWER = 4
"""Rows for which a controller is taken to answer a step."""
LAW = 5
"""Newest values of each input that a command is taken to answer at once, in proportion."""
USUALLY = 0.999
"""Quantile of what is sudden in a command, beyond which wrong samples may bend the answer."""
LAWFUL = 0.25
"""Part of what is sudden in a command that such an answer may leave."""
COUNTS = 4.5
"""An outlier is further off than this many of the sensor's counts, however quiet the signal."""


def outliers(signal: Floats, threshold: float = THRESHOLD) -> npt.NDArray[np.bool_]:
    """Return which samples of `signal` (1-D, evenly or nearly evenly sampled) are outliers.

    A sample is one where it lies further from the running median of its neighbourhood than `threshold` times
    the robust spread: the largest of 1.4826 times the median of such distances around it, the same of the
    whole signal (of a long one, of stretches of it), and the usual step from sample to sample around it.
    (Hampel 1974, J. Am. Stat. Assoc. 69:383, with a spread that neither a coarse sensor nor a fast
    oscillation of the signal deceives.)
    """
    if len(signal) < SPREAD_WINDOW:
        return np.zeros(len(signal), dtype=np.bool_)
    parts = sample(signal)
    usual = float(np.median(np.concatenate([_distance(part) for part in parts])))
    least = COUNTS * _resolution(parts)
    found = np.empty(len(signal), dtype=np.bool_)
    for piece in pieces(len(signal)):
        begin = max(piece.start - REACH, 0)
        near = signal[begin : piece.stop + REACH]
        inside = slice(piece.start - begin, piece.stop - begin)
        found[piece] = _far(near, threshold, usual, least)[inside]
    return _returned(signal, found)


def _returned(signal: Floats, found: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Unmark runs after which the signal is not back where it was: steps, which the sensor did make."""
    edges = np.flatnonzero(np.diff(found.astype(np.int8), prepend=0, append=0))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if first > 0 and last < len(signal):
            before, after = signal[first - 1], signal[last]
            if abs(after - before) > BACK * np.max(np.abs(signal[first:last] - before)):
                found[first:last] = False
    return found


def answers(signal: Floats) -> npt.NDArray[np.bool_]:
    """Return the rows at which a controller answers a step of a `signal`: a reading, which is no outlier.

    A step is a difference of readings that is unlike the median of its neighbours by more than ANSWERED
    robust standard deviations: by their mean, the two rows before a step would be steps as well.
    """
    step = np.diff(signal, prepend=signal[0])
    off = np.zeros_like(step)
    near = step[:-4], step[1:-3], step[3:-1], step[4:]
    low, high = np.minimum.reduce(near), np.maximum.reduce(near)
    off[2:-2] = np.abs(step[2:-2] - 0.5 * (sum(near) - low - high))
    parts = sample(off)
    usual = 1.4826 * float(np.median(np.concatenate(parts)))
    stepped = off > ANSWERED * max(usual, _resolution(sample(signal)))
    found = stepped.copy()
    for late in range(1, ANSWER + 1):
        found[late:] |= stepped[:-late]
    return found


def lawful(command: Floats, inputs: Sequence[Floats], marked: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return those of the `marked` rows whose `command` is what a linear controller made of its `inputs`.

    A controller that differentiates kicks at every count of a coarse encoder, and at every step of its
    reference: these commands were really given. What is sudden in the command is regressed on what is sudden
    in the last LAW values of each input, over the whole recording; a row that this explains is no outlier.
    """
    if len(command) < SPREAD_WINDOW:
        return np.zeros_like(marked)
    # A few wrong samples may bend the law until it explains nothing: once with the largest cut off, then
    # once more without what the better law does not explain.
    nothing = np.zeros_like(marked)
    laws = [_law(command, inputs, nothing, most) for most in (1.0, USUALLY)]
    found = max((_explained(command, inputs, marked, law) for law in laws), key=np.count_nonzero)
    if (found == marked).all():
        return found
    beside = np.zeros_like(marked)
    for away in range(-LAW, LAW + 1):
        beside[np.clip(np.flatnonzero(marked & ~found) + away, 0, len(marked) - 1)] = True
    again = _explained(command, inputs, marked, _law(command, inputs, beside))
    return max(found, again, key=np.count_nonzero)


def _law(
    command: Floats, inputs: Sequence[Floats], without: npt.NDArray[np.bool_], most: float = 1.0
) -> Floats:
    """Return how a command answers the newest LAW values of inputs, fitted to all rows but those `without`.

    What is sudden in the command is cut off at its quantile `most`.
    """
    count = LAW * len(inputs)
    gram, with_command = np.zeros((count, count)), np.zeros(count)
    sudden = [_sudden(volts) for volts in sample(command)]
    limit = float(np.quantile(np.abs(np.concatenate(sudden)), most))
    rows = zip(*(sample(one) for one in inputs), strict=True)
    for read, volts, left_out in zip(rows, sudden, sample(without), strict=True):
        at = np.flatnonzero(~left_out[LAW : len(volts) - LAW]) + LAW
        newest = _newest([_sudden(one) for one in read], at)
        gram += newest.T @ newest
        with_command += newest.T @ np.clip(volts[at], -limit, limit)
    return np.asarray(np.linalg.lstsq(gram, with_command, rcond=1e-12)[0])


def _explained(
    command: Floats, inputs: Sequence[Floats], marked: npt.NDArray[np.bool_], law: Floats
) -> npt.NDArray[np.bool_]:
    """Return those of the `marked` rows of which `law` leaves little."""
    found = np.zeros_like(marked)
    for piece in pieces(len(command)):
        at = np.flatnonzero(marked[piece])
        if not len(at):
            continue
        begin = max(piece.start - REACH, 0)
        near = slice(begin, piece.stop + REACH)
        at += piece.start - begin
        sudden = _sudden(command[near])[at]
        left = np.abs(sudden - _newest([_sudden(one[near]) for one in inputs], at) @ law)
        found[at + begin] = left < LAWFUL * np.abs(sudden)
    return found


def _newest(inputs: Sequence[Floats], at: npt.NDArray[np.intp]) -> Floats:
    """Return of the rows `at` the newest LAW values of each input, (rows, LAW inputs)."""
    rows = np.maximum(at[:, np.newaxis] - np.arange(LAW), 0)
    return np.hstack([one[rows] for one in inputs])


def _sudden(signal: Floats) -> Floats:
    """Return what no cubic through two neighbours on either side explains of each row; 0 at the ends."""
    found = np.zeros_like(signal)
    beside, beyond = signal[1:-3] + signal[3:-1], signal[:-4] + signal[4:]
    found[2:-2] = signal[2:-2] - (4.0 * beside - beyond) / 6.0
    return found


def _distance(signal: Floats) -> Floats:
    """Return how far each sample is from the running median of its neighbourhood."""
    from scipy.ndimage import median_filter

    return np.asarray(np.abs(signal - median_filter(signal, WINDOW, mode="nearest")))


def _far(signal: Floats, threshold: float, usual: float, least: float) -> npt.NDArray[np.bool_]:
    from scipy.ndimage import median_filter

    distance = _distance(signal)
    nearby = median_filter(distance, SPREAD_WINDOW, mode="nearest")
    step = median_filter(np.abs(np.diff(signal, prepend=signal[0])), STEP_WINDOW, mode="nearest")
    spread = np.maximum(1.4826 * np.maximum(nearby, usual), step)
    return np.asarray(distance > np.maximum(threshold * spread, least))


def _resolution(parts: list[Floats]) -> float:
    """Return the smallest usual step between different neighbours: the sensor's count, or the noise."""
    span = max(float(part.max()) for part in parts) - min(float(part.min()) for part in parts)
    steps = np.concatenate([np.abs(np.diff(part)) for part in parts])
    steps = steps[steps > 1e-12 * span]
    return float(np.quantile(steps, 0.25)) if len(steps) else 0.0
