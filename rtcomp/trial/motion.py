"""References that excite presliding and sliding: multisines, strokes, nested reversals, rests."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats


def draw_reference(
    chance: np.random.Generator, rate: float, seconds: float, stroke: float, reach: float, fastest: float
) -> Floats:
    """Return a reference (m, (K,)) from zero to zero within about +-`stroke` (m).

    Each manoeuvre comes at least once, in another order and size each time. `reach` (m) is the scale of the
    nested reversals, `fastest` (Hz) the highest frequency at which nearly the whole stroke is asked for.
    """
    makers = [_multisine, _strokes, _nested, _rests]
    pieces: list[Floats] = []
    count = max(4, round(seconds / 7.0))
    order = [*chance.permutation(4), *chance.integers(0, 4, count)][:count]
    for kind in order:
        pieces.append(makers[int(kind)](chance, rate, seconds / count, stroke, reach, fastest))
    return _smooth(np.concatenate(pieces), rate, fastest)


def _time(rate: float, seconds: float) -> Floats:
    return np.asarray(np.arange(round(seconds * rate)) / rate)


def _fade(time: Floats) -> Floats:
    """Return a window (K,) that rises from and falls to zero within a twelfth of the time."""
    edge = time[-1] / 12.0
    rise = np.clip(np.minimum(time, time[-1] - time) / edge, 0.0, 1.0)
    return np.asarray(np.sin(0.5 * np.pi * rise) ** 2)


def _multisine(
    chance: np.random.Generator, rate: float, seconds: float, stroke: float, reach: float, fastest: float
) -> Floats:
    """Eight sines of random frequency and phase."""
    time = _time(rate, seconds)
    frequencies = np.exp(chance.uniform(np.log(0.1 * fastest), np.log(fastest), 8))
    phases = chance.uniform(0.0, 2.0 * np.pi, 8)
    weights = frequencies**-0.5
    wave = np.sin(2.0 * np.pi * np.outer(time, frequencies) + phases) @ weights
    return np.asarray(stroke * chance.uniform(0.5, 0.9) * _fade(time) * wave / np.max(np.abs(wave)))


def _strokes(
    chance: np.random.Generator, rate: float, seconds: float, stroke: float, reach: float, fastest: float
) -> Floats:
    """Back and forth at constant speeds spaced logarithmically, the faster ones more often."""
    times = np.exp(np.linspace(np.log(0.4 / fastest), np.log(2.5), 6))
    often = np.maximum(1, np.round(0.5 / times)).astype(int)
    order = [int(i) for i in chance.permutation(6)]
    parts = np.concatenate([np.repeat(times[i], 2 * often[i]) for i in order])
    size = stroke * chance.uniform(0.6, 0.95)
    places = size * np.where(np.arange(parts.size) % 2, -1.0, 1.0)
    places[-1] = 0.0
    stops = np.concatenate([[0.0], np.cumsum(parts)])
    return np.asarray(
        np.interp(_time(rate, seconds), stops / stops[-1] * seconds, np.concatenate([[0.0], places]))
    )


def _nested(
    chance: np.random.Generator, rate: float, seconds: float, stroke: float, reach: float, fastest: float
) -> Floats:
    """Reversals inside reversals: a slow stroke with smaller and smaller returns, down to presliding."""
    sizes = np.exp(np.linspace(np.log(min(8.0 * reach, stroke)), np.log(0.3 * reach), 14))
    turns = np.concatenate([[0.0], sizes * np.where(np.arange(14) % 2, -1.0, 1.0), [0.0]])
    turns += np.interp(
        np.arange(turns.size), [0, 7, turns.size - 1], [0.0, 0.3 * stroke, 0.0]
    ) * chance.choice([-1.0, 1.0])
    lengths = np.abs(np.diff(turns)) ** 0.5 + 0.3 * reach**0.5
    stops = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum() * seconds
    return np.asarray(np.interp(_time(rate, seconds), stops, turns))


def _rests(
    chance: np.random.Generator, rate: float, seconds: float, stroke: float, reach: float, fastest: float
) -> Floats:
    """Moves with rests of different lengths between them."""
    time = _time(rate, seconds)
    rests = chance.permutation(np.array([0.05, 0.15, 0.4, 1.0, 2.0]))
    rests *= 0.6 * seconds / rests.sum()
    move = 0.4 * seconds / 6.0
    stops, places = [0.0], [0.0]
    for i, rest in enumerate(rests):
        place = stroke * chance.uniform(0.2, 0.9) * (1.0 if i % 2 else -1.0)
        stops += [stops[-1] + move, stops[-1] + move + rest]
        places += [place, place]
    return np.asarray(np.interp(time, [*stops, stops[-1] + move], [*places, 0.0]))


def _smooth(raw: Floats, rate: float, fastest: float) -> Floats:
    """Take the corners off (zero phase) and end at rest."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, min(2.0 * fastest, 0.05 * rate), fs=rate, output="sos")
    slow = sosfiltfilt(sections, raw)
    time = np.arange(raw.size) / rate
    edge = np.clip(np.minimum(time, time[-1] - time) / 0.2, 0.0, 1.0)
    return np.asarray(slow * np.sin(0.5 * np.pi * edge) ** 2)
