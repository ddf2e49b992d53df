"""Each answer of an inspection as a sentence for a person, and as figures for a file."""

from __future__ import annotations

import math
from typing import Any

from rtcomp.inspection.chance import LEAST, SURE, Compared, Slope
from rtcomp.inspection.closure import Closure
from rtcomp.inspection.congruency import Congruency
from rtcomp.inspection.rates import APART, Rates
from rtcomp.inspection.symmetry import Symmetry

NO_LOOP = (
    "not testable: no way was travelled in both directions between the same turning points (two loops do)"
)
NO_KINDS = "not testable: all branches of one direction begin at one turning point; there are no minor loops"
NO_MINOR = "not testable: there are no minor loops"
ONE_SPEED = f"not testable: no branch was repeated at a speed {APART:g} times another"
ENOUGH = f"to within {100 * LEAST:g} %"


def percent(part: float) -> str:
    """Write a part of 1 in per cent, two digits: ``0.43 %``, ``12 %``."""
    value = 100 * part
    if not math.isfinite(value):
        return "n/a"
    digits = 1 - math.floor(math.log10(abs(value))) if abs(value) > 0.005 else 2
    return f"{round(value, digits):.{max(digits, 0)}f} %"


def said_of_symmetry(found: Symmetry | None) -> str:
    """Return the answer of the symmetry test; None where there is no loop."""
    if found is None:
        return NO_LOOP
    unit = found.half_range
    verdict, beside = found.verdict, _beside(found.compared, unit)
    if verdict == "fails":
        most = f"most after {100 * found.peak_at:.0f} % of the way"
        return f"asymmetric: {beside}; {most}, {100 * found.mean_curve_share:.0f} % of it in the mean curve"
    return _mild("symmetric", verdict, found.compared, beside, unit)


def said_of_congruency(found: Congruency | None) -> str:
    """Return the answer of the congruency test; None where there was nothing to compare."""
    if found is None or found.verdict == "not-testable":
        return NO_KINDS
    beside = _beside(found.both, found.force_range)
    if found.verdict == "fails":
        how = [
            f"stiffness {'grows' if way.value > 0 else 'falls'} by {percent(abs(way.value))} {where}"
            for way, where in (
                (found.with_force, "from no force to half of its range"),
                (found.with_position, "from the middle to the upper end of the stroke"),
            )
            if way is not None and way.sure
        ]
        return "; ".join([f"not congruent: {beside}", *how])
    return _mild("congruent", found.verdict, found.both, beside, found.force_range)


def said_of_closure(found: Closure) -> str:
    """Return whether minor loops close."""
    if found.verdict == "not-testable":
        return NO_MINOR
    unit, count = found.force_range, found.gaps.size
    loops = f"{count} minor loop{'' if count == 1 else 's'}"
    gap = f"gap {percent(found.rms / unit)} rms in {loops}"
    if found.verdict == "fails":
        means = " and ".join(
            f"{percent(mean / unit)} on {name} branches" for name, mean in found.means.items()
        )
        return f"open: {gap}, in the mean {means}"
    if found.verdict == "undecided":
        return f"undecided: {gap}, too few to tell from scatter"
    return f"closed: {gap}" + ("" if found.rms < LEAST * unit else ", no more than its scatter")


def said_of_rates(found: Rates) -> str:
    """Return whether force depends on speed."""
    if found.verdict == "not-testable":
        return ONE_SPEED
    if found.change is None:
        return "undecided: too few branches at different speeds"
    c, unit = found.change, found.half_range
    by = (
        f"{percent(c.value / unit)} ({100 * c.low / unit:.2g} to {100 * c.high / unit:.2g}) for each "
        "doubling of the speed"
    )
    times = f"speeds up to {found.speeds[1] / found.speeds[0]:.1f} times the lowest"
    return f"{'depends on the rate' if found.verdict == 'fails' else 'alike at every rate'}: {by}, {times}"


def symmetry_figures(found: Symmetry | None) -> dict[str, Any]:
    """Return the symmetry test as inspect.json has it."""
    if found is None:
        return {"verdict": "not-testable", "says": NO_LOOP}
    return {
        "verdict": found.verdict,
        "says": said_of_symmetry(found),
        **_figures(found.compared, found.half_range, "difference"),
        "peak_percent": 100 * found.peak / found.half_range,
        "peak_at": found.peak_at,
        "mean_curve_share": found.mean_curve_share,
        "repeats_rising": found.repeats[0],
        "repeats_falling": found.repeats[1],
    }


def congruency_figures(found: Congruency | None) -> dict[str, Any]:
    """Return the congruency test as inspect.json has it."""
    if found is None:
        return {"verdict": "not-testable", "says": NO_KINDS}
    unit = found.force_range
    return {
        "verdict": found.verdict,
        "says": said_of_congruency(found),
        **_figures(found.both, unit, "spread"),
        "rising": _figures(found.rising, unit, "spread"),
        "falling": _figures(found.falling, unit, "spread"),
        "across_percent": 100 * found.across / unit,
        "kinds": found.kinds,
        "stiffness_over_m": found.over,
        "stiffness_with_position": _line(found.with_position),
        "stiffness_with_force": _line(found.with_force),
    }


def closure_figures(found: Closure) -> dict[str, Any]:
    """Return the closure of minor loops as inspect.json has it."""
    unit = found.force_range
    return {
        "verdict": found.verdict,
        "says": said_of_closure(found),
        "loops": int(found.gaps.size),
        "gap_percent": 100 * found.rms / unit,
        "scatter_percent": 100 * found.scatter / unit,
        "mean_rising_percent": 100 * found.means.get("rising", math.nan) / unit,
        "mean_falling_percent": 100 * found.means.get("falling", math.nan) / unit,
    }


def rate_figures(found: Rates) -> dict[str, Any]:
    """Return the dependence on the rate as inspect.json has it."""
    unit = found.half_range
    c = found.change
    change = (
        None if c is None else Slope(c.value / unit, c.low / unit, c.high / unit, c.correlation, c.points)
    )
    return {
        "verdict": found.verdict,
        "says": said_of_rates(found),
        "change_per_doubling": _line(change),
        "slowest_m_s": found.speeds[0],
        "fastest_m_s": found.speeds[1],
    }


def _beside(compared: Compared, unit: float) -> str:
    scatter = "no repeats" if math.isnan(compared.within) else f"{percent(compared.within / unit)} scatter"
    return f"{percent(compared.between / unit)} against {scatter}"


def _mild(word: str, verdict: str, compared: Compared, beside: str, unit: float) -> str:
    if verdict == "holds":
        small = compared.systematic < LEAST * unit
        known = not math.isnan(compared.within)
        within = (
            ENOUGH
            if small and not (known and compared.between <= 1.2 * compared.within)
            else "within scatter"
        )
        return f"{word} {within}: {beside}"
    if math.isnan(compared.within):
        return (
            f"undecided: {percent(compared.between / unit)}, and no branch was repeated to tell the scatter"
        )
    return f"undecided: {beside}, too few repeats for a verdict (p below {SURE:g} is out of reach)"


def _figures(compared: Compared, unit: float, name: str) -> dict[str, Any]:
    return {
        f"{name}_percent": 100 * compared.between / unit,
        "scatter_percent": 100 * compared.within / unit,
        "systematic_percent": 100 * compared.systematic / unit,
        "p_value": compared.p_value,
    }


def _line(found: Slope | None) -> dict[str, float | int] | None:
    return None if found is None else found.to_json()
