"""How a diagnosis is put into words, for the page and the terminal alike."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rtcomp import physics
from rtcomp.diagnosis.result import Candidate, Diagnosis, Named, Sight, Value
from rtcomp.errors import ConfigError
from rtcomp.report.quantities import scale, typeset, written
from rtcomp.units import for_axis

UNEXPLAINED = ("unexplained",)
OFF_BY = ("drive-gain", "drive-saturation", "inertia", "sensor-scale")
"""Effects whose parameter does nothing at a value of its own, not at zero."""


def share_explained(found: Diagnosis) -> float:
    """Return how much of the mismatch (squared, above the noise) the extended stage explains, or NaN."""
    excess = found.fit.before**2 - found.fit.floor**2
    if found.verdict == "consistent" or excess <= 0.1 * found.fit.floor**2:
        return math.nan
    return (found.fit.before**2 - found.fit.after**2) / excess


def next_command(out: str) -> str:
    """Return how the next experiment is run, in one sentence."""
    return (
        f"To run it, put the section of {out}/reference.yaml into the configuration of the axis and record; "
        f"simulated: rtcomp simulate {out}/stage.yaml --reference {out}/reference.yaml --out NEXT. Then give "
        "both recordings to rtcomp diagnose."
    )


def entry(name: str) -> type[physics.Effect] | None:
    """Return the catalogue's entry of that name, None where it has none."""
    try:
        return physics.entry(name)
    except ConfigError:  # `unexplained`, or a name of a stage's parameter
        return None


def about(name: str) -> str:
    """Return what the effect is and how it looks in a recording."""
    known = entry(name)
    if known is None:
        return ""
    signature = known.signature
    return " ".join(filter(None, [sentence(known.says), sentence(signature)]))


def title(effect: Named) -> str:
    """Return the names of an effect as a heading."""
    return " or ".join(effect.names) if effect.names != UNEXPLAINED else "Unexplained"


def cells(value: Value) -> tuple[str, str]:
    """Return value and 95 % interval as the page has them."""
    return written(value.value, value.unit, _digits(value), printed=True), within(value, printed=True)


def within(value: Value, *, printed: bool) -> str:
    """Return the 95 % interval, ``2.09 to 2.13 kg``; nothing where it is not known."""
    if not (math.isfinite(value.low) and math.isfinite(value.high)):
        return ""
    shown = scale(value.unit, value.value, value.low, value.high)
    low, high = (f"{edge * shown.factor:.{_digits(value)}g}" for edge in (value.low, value.high))
    return f"{low} to {high} {typeset(shown.unit) if printed else shown.unit}".rstrip()


def _digits(value: Value) -> int:
    """Return the significant digits that show the width of the interval, 3 to 6."""
    width = value.high - value.low
    if not (math.isfinite(width) and width > 0.0 and value.value):
        return 4
    return min(max(3, math.ceil(math.log10(abs(value.value) / width)) + 2), 6)


def smallest(candidate: Candidate) -> str:
    """Return the smallest size that would have been seen: ``amplitude 12 mN``."""
    known = entry(candidate.name)
    if known is None or not known.parameters or not math.isfinite(candidate.smallest):
        return ""
    name = candidate.parameter or known.parameters[0].name
    unit = next((p.unit for p in known.parameters if p.name == name), "")
    how = "by " if candidate.name in OFF_BY else ""
    return f"{name} {how}{written(candidate.smallest, unit, 2, printed=True)}"


def from_size(sight: Sight, axis: str, *, printed: bool) -> str:
    """Return from which size on an effect would have been seen: ``amplitude 39 mN``."""
    how = "by " if sight.name in OFF_BY else ""
    return f"{sight.parameter} {how}{written(sight.smallest, for_axis(sight.unit, axis), 2, printed=printed)}"


def holding(sight: Sight, axis: str) -> str:
    """Return at which other parameters that holds, as the page has it: ``period 0.5 mm``."""
    known = entry(sight.name)
    units = {p.name: for_axis(p.unit, axis) for p in known.parameters} if known is not None else {}
    return ", ".join(f"{k} {written(v, units.get(k, ''), 2, printed=True)}" for k, v in sight.beside.items())


def percent(share: float) -> str:
    """Return a share in %."""
    return f"{100 * share:.3g} %"


def probability(p: float) -> str:
    """Return a probability; nothing is certain."""
    return "above 0.99" if p > 0.995 else f"{p:.2f}"


def joined(names: Sequence[str], last: str) -> str:
    """Return ``a, b and c``, with `last` before the last."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} {last} {names[-1]}"


def sentence(text: str) -> str:
    """Return text as a sentence: a capital at its beginning, a stop at its end."""
    text = text.strip()
    if not text:
        return ""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?')) else '.'}"
