"""The figures of a trial: every score with its count, its 95 % interval and what is asked of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcomp.trial.hidden.forms import is_foreign
from rtcomp.trial.score import WORSE, Scored, right_period


@dataclass(frozen=True)
class Figure:
    """One score: a part (0 to 1) of `count`, or another number; `wanted` from and to, where asked."""

    name: str
    value: float
    count: int
    wanted: tuple[float, float] | None = None
    part: bool = True
    unit: str = ""

    @property
    def met(self) -> bool | None:
        """Whether it is as asked; None where nothing is, or nothing was measured."""
        if self.wanted is None or self.count == 0:
            return None
        return self.wanted[0] <= self.value <= self.wanted[1]

    @property
    def interval(self) -> tuple[float, float] | None:
        """Wilson's 95 % interval of a part; Wilson (1927), JASA 22(158)."""
        if not self.part or self.count == 0:
            return None
        z, n, p = 1.959964, self.count, self.value
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return max(0.0, middle - half), min(1.0, middle + half)

    def to_json(self) -> dict[str, Any]:
        """Return the figure as ``trial.json`` holds it."""
        return {
            "name": self.name,
            "value": self.value if math.isfinite(self.value) else None,
            "count": self.count,
            "interval": self.interval,
            "wanted": self.wanted and [w if math.isfinite(w) else None for w in self.wanted],
            "met": self.met,
            "unit": self.unit,
        }


def figures(rows: Sequence[Scored], *, gains: bool = True) -> list[Figure]:
    """Return the figures of a trial; without `gains` those that need an extended stage are left out."""
    one = [r for r in rows if r.case.plan.kind == "one" and r.detectable]
    two = [r for r in rows if r.case.plan.kind == "two" and r.detectable]
    clean = [r for r in rows if r.case.plan.kind == "clean"]
    retuned = [r for r in rows if r.case.plan.kind == "retuned"]
    outside = [r for r in rows if r.case.plan.kind == "outside" and r.detectable]
    singles = [r.matches[0] for r in one]
    held = [m for m in singles if m.held]
    forms = [(r.matches[0], r.case.hidden[0]) for r in one if r.case.hidden[0].form]
    foreign = [m for m, grown in forms if is_foreign(grown.name, grown.form)]
    found = [
        _part("right, all cases", rows, lambda r: r.right),
        _part("named first, one effect", singles, lambda m: m.first, (0.95, 1.0)),
        _part("set holds the truth, one effect", singles, lambda m: m.held, (0.99, 1.0)),
        _mean("mean size of that set, aliases as one", [m.choices for m in held], (0.0, 1.3)),
        _mean("mean size of that set, every name", [m.size for m in held]),
        _part("false alarm on clean", clean, lambda r: not r.quiet, (0.0, 0.01)),
        _part("false name beside one effect", one, lambda r: bool(r.wrong)),
        _part("retuned recognised", retuned, lambda r: r.right),
        _part("both of two named", two, lambda r: all(m.found for m in r.matches), (0.85, 1.0)),
        _part("outside called unexplained", outside, lambda r: r.matches[0].found, (0.85, 1.0)),
        _part("outside misnamed", outside, lambda r: bool(r.wrong), (0.0, 0.05)),
    ]
    if forms:
        found.append(_part("named first, in another form", forms, lambda f: f[0].first))
        found.append(_part("... that the catalogue has not", foreign, lambda m: m.first))
    if gains:
        found += _of_stages(rows)
    found.append(_quantile("seconds, median", [r.outcome.seconds for r in rows], 0.5, (0.0, 60.0), "s"))
    found.append(_quantile("seconds, most", [r.outcome.seconds for r in rows], 1.0, None, "s"))
    found.append(_part("diagnosis failed", rows, lambda r: r.said is None, (0.0, 0.0)))
    return found


def _of_stages(rows: Sequence[Scored]) -> list[Figure]:
    periods = [p for r in rows if (p := right_period(r)) is not None]
    ratios = [g for r in rows if r.case.hidden and r.detectable and (g := r.gain_over_oracle) is not None]
    judged = [r.errors for r in rows if r.errors is not None]
    values = [e for r in rows for e in r.estimates]
    effects = [e for e in values if e.effect != "stage"]
    return [
        _part("period within 2 %", periods, bool),
        _quantile("gain on unseen over the oracle's, median", ratios, 0.5, (0.97, math.inf)),
        _part("made worse", judged, lambda e: e.after > WORSE * e.before, (0.0, 0.005)),
        _quantile("parameter error, median", [e.error for e in effects], 0.5),
        _part("95 % intervals that cover", values, lambda e: e.covered, (0.92, 0.98)),
    ]


@dataclass(frozen=True)
class Seen:
    """How small an effect of one tier was and still seen, and how many were."""

    tier: str
    cases: int
    found: int
    smallest: float
    """Rms force over that of the motion; NaN where none was seen."""
    surely: float
    """The strength from which on all were seen; NaN where the strongest was missed."""


def seen(rows: Sequence[Scored]) -> list[Seen]:
    """Return the smallest strength seen by tier, of effects hidden alone, detectable or not."""
    result = []
    for tier in ("full", "weak"):
        mine = sorted(
            (r.case.hidden[0].shows.share, r.matches[0].found)
            for r in rows
            if r.case.plan.kind == "one" and r.case.plan.tier == tier
        )
        hits = [share for share, found in mine if found]
        missed = [share for share, found in mine if not found]
        above = [share for share in hits if not missed or share > max(missed)]
        result.append(
            Seen(tier, len(mine), len(hits), min(hits, default=math.nan), min(above, default=math.nan))
        )
    return result


def _part(
    name: str, items: Sequence[Any], holds: Callable[[Any], bool], wanted: tuple[float, float] | None = None
) -> Figure:
    value = sum(map(holds, items)) / len(items) if items else math.nan
    return Figure(name, value, len(items), wanted)


def _mean(name: str, items: Sequence[float], wanted: tuple[float, float] | None = None) -> Figure:
    return Figure(name, float(np.mean(items)) if items else math.nan, len(items), wanted, part=False)


def _quantile(
    name: str,
    items: Iterable[float],
    at: float,
    wanted: tuple[float, float] | None = None,
    unit: str = "",
) -> Figure:
    numbers = list(items)
    value = float(np.quantile(numbers, at)) if numbers else math.nan
    return Figure(name, value, len(numbers), wanted, part=False, unit=unit)
