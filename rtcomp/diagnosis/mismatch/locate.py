"""Where: the residual force against every axis a person can point to, with significance that is honest.

Autocorrelation is respected by shifting the residual against the axis in a circle (whole strokes stay whole),
the number of axes looked at by counting the best of all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rtcomp.diagnosis.mismatch.along_position import Wave, wave
from rtcomp.diagnosis.mismatch.view import View
from rtcomp.diagnosis.numerics.periodogram import peak_near
from rtcomp.diagnosis.result import Place
from rtcomp.kernels import Floats
from rtcomp.units import for_axis, prefixed

BINS = 24
SHIFTS = 199
ROWS = 8_000
"""Rows on which chance is reckoned, of more evenly spread ones."""
PIECES = 4 * BINS
"""Pieces that are put in another order where the axis is time itself."""
LEAST_SHARE = 0.05
"""Part of the mismatch below which an axis is not mentioned."""
FEW, PLAIN = 6, 0.4
"""Waves in the stroke, below which one must be this part of the mismatch to pass for one."""
AS_MUCH = 0.8
"""Part of what depends on position at all, from which on a period in it is said instead."""


@dataclass(frozen=True)
class Axis:
    """Something the residual may depend on: a value (and for `odd` a sign) for every kept row."""

    name: str
    unit: str
    values: Floats
    odd: Floats | None = None
    """Sign of the direction of motion, where the dependence is looked for that changes sign with it."""
    force: str = "N"
    """Unit of the residual."""


@dataclass(frozen=True)
class Binned:
    """An axis cut into bins: edges (B + 1,), the bin of every row, and rows in every bin (B,)."""

    axis: Axis
    edges: Floats
    at: np.ndarray
    count: Floats

    @classmethod
    def of(cls, axis: Axis) -> Binned:
        """Cut an axis into bins of equally many rows, direction into its two."""
        if axis.name == "direction":
            edges = np.array([-1.5, -0.5, 0.5, 1.5])
        else:
            edges = np.unique(np.quantile(axis.values, np.linspace(0, 1, BINS + 1)))
        if edges.size < 2:
            edges = np.array([edges[0] - 0.5, edges[0] + 0.5])
        at = np.clip(np.searchsorted(edges, axis.values, side="right") - 1, 0, edges.size - 2)
        return cls(axis, edges, at, np.bincount(at, minlength=edges.size - 1).astype(np.float64))

    def means(self, residual: Floats) -> Floats:
        """Return the mean of the residual (N, every row) in every bin."""
        signed = residual if self.axis.odd is None else residual * self.axis.odd
        total = np.bincount(self.at, weights=signed, minlength=self.count.size)
        return np.asarray(total / np.maximum(self.count, 1.0))

    def spread(self, residual: Floats) -> Floats:
        """Return the standard error of those means, twenty rows reckoned as one."""
        signed = residual if self.axis.odd is None else residual * self.axis.odd
        squares = np.bincount(self.at, weights=signed**2, minlength=self.count.size)
        variance = squares / np.maximum(self.count, 1.0) - self.means(residual) ** 2
        return np.asarray(np.sqrt(np.maximum(variance, 0.0) / np.maximum(self.count / 20.0, 1.0)))

    def share(self, residual: Floats) -> float:
        """Return the part of the residual (squared) that its means in the bins are."""
        explained = float(np.sum(self.count * self.means(residual) ** 2))
        return explained / max(float(residual @ residual), 1e-300)


def axes_of(motion: View, axis: str = "linear") -> list[Axis]:
    """Return position, speed, direction, command, acceleration, time, time and distance since reversal."""
    unit = for_axis("m", axis)
    speed, push, since, way = [], [], [], []
    for s in motion.strips:
        v, a = np.zeros_like(s.position), np.zeros_like(s.position)
        v[1:-1] = (s.position[2:] - s.position[:-2]) / (2 * motion.period)
        a[1:-1] = (s.position[2:] - 2 * s.position[1:-1] + s.position[:-2]) / motion.period**2
        smooth = np.convolve(v, np.ones(9) / 9, mode="same")
        moving = np.where(np.abs(smooth) > 0.02 * np.abs(smooth).max(), np.sign(smooth), 0.0)
        t, d = _since_reversal(moving, s.position, motion.period)
        speed.append(v)
        push.append(a)
        since.append(t)
        way.append(d)
    v, a = motion.smooth(speed), motion.smooth(push)
    x = motion.plain([s.position for s in motion.strips])
    direction = np.sign(v)
    return [
        Axis("position", unit, x),
        Axis("position", unit, x, direction),
        Axis("speed", f"{unit}/s", v),
        Axis("direction", "1", direction, force=for_axis("N", axis)),
        Axis("command", "V", motion.smooth([s.voltage for s in motion.strips])),
        Axis("acceleration", f"{unit}/s^2", a),
        Axis("time", "s", motion.plain([s.time for s in motion.strips])),
        Axis("time since reversal", "s", motion.plain(since)),
        Axis("distance since reversal", unit, motion.plain(way), direction),
        Axis("distance since reversal", unit, motion.plain(way)),
    ]


def _since_reversal(moving: Floats, position: Floats, period: float) -> tuple[Floats, Floats]:
    """Return time (s) and distance (m) since the direction of motion last changed, for every row."""
    rows = np.arange(moving.size)
    way = np.flatnonzero(moving)
    turns = way[np.flatnonzero(np.diff(moving[way], prepend=0.0))]
    starts = np.zeros(moving.size, dtype=np.int64)
    starts[turns] = turns
    starts = np.maximum.accumulate(starts)
    time = np.asarray((rows - starts) * period, dtype=np.float64)
    return time, np.asarray(np.abs(position - position[starts]))


def locate(
    motion: View, before: Floats, after: Floats | None, seed: int = 0, axis: str = "linear"
) -> list[Place]:
    """Return where the residual `before` (N, kept rows) shows, largest share first; `after` to compare.

    `axis` is ``linear`` or ``rotary``, for the units.
    """
    every = slice(None, None, -(-before.size // ROWS))
    axes = axes_of(motion, axis)
    looked = [Binned.of(_thinned(a, every)) for a in axes]
    few = before[every]
    random = np.random.default_rng(seed)
    shifts = random.integers(few.size // 20, few.size - few.size // 20, SHIFTS)
    shares = np.array([b.share(few) for b in looked])
    null = np.array([[b.share(rolled) for b in looked] for rolled in (np.roll(few, k) for k in shifts)])
    for i, b in enumerate(looked):
        if b.axis.name == "time":
            null[:, i] = [b.share(_shuffled(few, random)) for _ in shifts]
    # Axes differ in how much chance alone explains; the excess over that is compared between them.
    excess = (shares - null.mean(axis=0)) / (null.std(axis=0) + 1e-12)
    best = ((null - null.mean(axis=0)) / (null.std(axis=0) + 1e-12)).max(axis=1)
    found = []
    for one, z in zip(axes, excess, strict=True):
        p = (1.0 + float(np.count_nonzero(best >= z))) / (SHIFTS + 1.0)
        if p > 0.05:
            continue
        whole = Binned.of(one)
        share = whole.share(before)
        if share > LEAST_SHARE:
            found.append(_place(whole, share, p, before, after))
    found = _with_period(
        found, looked[1].axis, looked[2].axis.values, few, None if after is None else after[every], shifts
    )
    line = _line(motion, before, after)
    # What depends on the motion has the motion's own tones; a tone of its own depends on nothing else.
    if line is not None and line.share > max((p.share for p in found if p.axis != "time"), default=0.0):
        found.append(line)
    # Whatever has a sign sees the direction too: where that is all, direction comes first.
    return sorted(found, key=lambda place: -place.share - (0.03 if place.axis == "direction" else 0.0))


def _shuffled(residual: Floats, random: np.random.Generator) -> Floats:
    """Return the residual's pieces in another order: shifted in a circle, what drifts would drift still."""
    pieces = np.array_split(residual, PIECES)
    return np.concatenate([pieces[k] for k in random.permutation(PIECES)])


def _thinned(axis: Axis, every: slice) -> Axis:
    return replace(axis, values=axis.values[every], odd=None if axis.odd is None else axis.odd[every])


def _with_period(
    found: list[Place],
    position: Axis,
    speed: Floats,
    before: Floats,
    after: Floats | None,
    shifts: np.ndarray,
) -> list[Place]:
    """Say the period where what depends on position, or more than that, is one."""
    x, direction = position.values, position.odd
    assert direction is not None
    at = wave(x, direction, speed, before, shifts)
    if at is None or at.share < LEAST_SHARE or at.p_value > 0.05:
        return found
    if at.share < PLAIN and np.ptp(x) < FEW * at.period:
        return found  # the turning points of the motion make as much
    plain = max((p.share for p in found if p.axis == "position"), default=0.0)
    if at.share < AS_MUCH * plain:
        return found
    kept = [p for p in found if p.axis != "position"]
    return [*kept, _periodic(at, position, before, after)]


def _periodic(at: Wave, position: Axis, before: Floats, after: Floats | None) -> Place:
    """Draw a wave along the stroke, eight periods of it at the most, those where most rows are."""
    x, direction = position.values, position.odd
    assert direction is not None
    low, high = float(x.min()), float(x.max())
    middle = float(np.median(x))
    begin = max(low, min(middle - 4 * at.period, high - 8 * at.period))
    end = min(high, begin + 8 * at.period)
    edges = np.linspace(begin, end, max(BINS, int(16 * (end - begin) / at.period)) + 1)
    inside = (x >= begin) & (x <= end)
    axis = Axis("position", position.unit, x[inside], direction[inside] if at.odd else None)
    bins = np.clip(np.searchsorted(edges, axis.values, side="right") - 1, 0, edges.size - 2)
    shown = Binned(axis, edges, bins, np.bincount(bins, minlength=edges.size - 1).astype(np.float64))
    kept = shown.count > 0
    residual = before[inside]
    return Place(
        "position", position.unit, (low, high), at.share, at.p_value, at.says(position.unit),
        (0.5 * (edges[1:] + edges[:-1]))[kept], shown.means(residual)[kept],
        None if after is None else shown.means(after[inside])[kept], shown.spread(residual)[kept],
        signed=at.odd,
    )  # fmt: skip


def _place(binned: Binned, share: float, p: float, before: Floats, after: Floats | None) -> Place:
    axis, edges = binned.axis, binned.edges
    mean, kept = binned.means(before), binned.count > 0
    centres = 0.5 * (edges[1:] + edges[:-1])
    if axis.name == "direction":
        centres = np.array([-1.0, 0.0, 1.0])
        kept &= centres != 0.0
    strong = np.flatnonzero(kept & (np.abs(mean) > 0.5 * np.abs(mean[kept]).max()))
    region = (float(edges[strong[0]]), float(edges[strong[-1] + 1]))
    later = None if after is None else binned.means(after)[kept]
    return Place(
        axis.name, axis.unit, region, share, p, _says(axis, region, share, mean, strong),
        centres[kept], mean[kept], later, binned.spread(before)[kept],
        signed=axis.odd is not None,
    )  # fmt: skip


def _says(axis: Axis, region: tuple[float, float], share: float, mean: Floats, strong: np.ndarray) -> str:
    part = f"{100 * share:.0f} % of the mismatch depends on {axis.name}"
    if axis.odd is not None:
        part += ", with the sign of the motion"
    if axis.name == "direction":
        (back, forth), unit = prefixed(axis.force, mean[0], mean[-1])
        return f"{part}: {back} {unit} backward, {forth} {unit} forward"
    if strong.size > 0.6 * mean.size:
        return f"{part}, all along"
    (low, high), unit = prefixed(axis.unit, *region)
    return f"{part}, most of it between {low} and {high} {unit}".rstrip()


def _line(motion: View, before: Floats, after: Floats | None) -> Place | None:
    """Return a line in the residual's spectrum, where one stands out."""
    rate = motion.rate / motion.thinning
    size = before.size
    window = np.hanning(size)
    power = np.abs(np.fft.rfft(before * window)) ** 2
    frequency = np.asarray(np.fft.rfftfreq(size, 1 / rate), dtype=np.float64)
    usable = (frequency > max(10 * rate / size, 1.0)) & (frequency < motion.cut)
    if not usable.any():
        return None
    around = np.convolve(power, np.ones(101) / 101, mode="same") + 1e-300
    at = int(np.argmax(np.where(usable, power / around, 0.0)))
    if power[at] < 30 * np.median(power[max(at - 50, 0) : at + 51]):
        return None
    # Rows of several segments do not follow each other: a tone goes on between them, its line is cut up.
    time = motion.plain([s.time for s in motion.strips])
    f = peak_near(float(frequency[at]), rate / size, time, before)
    share = float(2.0 * abs(np.mean(np.exp(-2j * np.pi * f * time) * before)) ** 2 / np.mean(before**2))
    if share < LEAST_SHARE:
        return None
    around_it = slice(max(at - 40, 0), at + 41)
    scale = 2.0 / window.sum()

    def part(residual: Floats) -> Floats:
        return np.asarray(scale * np.abs(np.fft.rfft(residual * window))[around_it], dtype=np.float64)

    return Place(
        "frequency", "Hz", (f * 0.99, f * 1.01), share, 0.005,
        f"{100 * share:.0f} % of the mismatch is a tone at {f:.4g} Hz, whatever the motion",
        frequency[around_it], part(before), None if after is None else part(after),
    )  # fmt: skip
