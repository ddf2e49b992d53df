"""Numbers with units as people read them: 12.3 nm, 4.5 mN, 250 us."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_EXPONENTS = {prefix: exponent for exponent, prefix in _PREFIXES.items() if prefix}
# Largest exponent in use: nobody reads kiloseconds, kiloradians or megagrams.
_BASES = {
    "m": 3,
    "s": 0,
    "N": 12,
    "V": 12,
    "A": 12,
    "W": 12,
    "J": 12,
    "Hz": 12,
    "Pa": 12,
    "rad": 0,
    "g": 3,
    "Ohm": 12,
}
_SMALLEST = min(_PREFIXES)


class Scale(NamedTuple):
    """How an axis is drawn: values times `factor` are in `unit`."""

    factor: float
    unit: str


def _split(unit: str) -> tuple[int, str, str] | None:
    """Return (exponent, base, rest) of a unit whose first symbol takes prefixes, else None.

    A first symbol with a power takes none (a prefix would be raised with it), nor do compounds of kg.
    """
    match = re.fullmatch(r"([A-Za-z]+)((?:[ /].*)?)", unit)
    if match is None:
        return None
    symbol, rest = match.groups()
    if symbol == "kg" and rest:
        return None
    if symbol in _BASES:
        return 0, symbol, rest
    if symbol[0] in _EXPONENTS and symbol[1:] in _BASES:
        return _EXPONENTS[symbol[0]], symbol[1:], rest
    return None


def _exponent_for(magnitude: float, exponent: int, base: str) -> int:
    """Return the prefix exponent that brings `magnitude` (in base units times 10^exponent) to 1 ... 1000."""
    # Decimal counts exactly; log10 of 1000 may fall short of 3.
    total = Decimal(repr(magnitude)).adjusted() + exponent
    return min(max(total // 3 * 3, _SMALLEST), _BASES[base])


def _plain(value: float, digits: int) -> str:
    """Write `value` with `digits` significant digits, without an exponent where that stays readable."""
    rounded = Decimal(f"{value:.{digits - 1}e}")
    if rounded == 0:
        return "0"
    if -5 <= rounded.adjusted() <= 8:
        text = f"{rounded:f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa}e{int(exponent)}"


def _number_and_unit(value: float, unit: str, digits: int) -> tuple[str, str]:
    unit = "" if unit == "1" else unit
    if math.isnan(value):
        return "n/a", ""
    if math.isinf(value):
        return str(value), unit
    parts = _split(unit)
    if parts is None or value == 0.0:
        return _plain(value, digits), unit
    exponent, base, rest = parts
    # Rounding first: 999.96 nm with three digits is 1 um, not 1000 nm.
    rounded = Decimal(f"{value:.{digits - 1}e}")
    chosen = _exponent_for(abs(float(rounded)), exponent, base)
    return _plain(float(rounded.scaleb(exponent - chosen)), digits), f"{_PREFIXES[chosen]}{base}{rest}"


def si(value: float, unit: str = "", digits: int = 3) -> str:
    """Return `value` (in `unit`) with `digits` significant digits and a fitting prefix: ``12.3 nm``.

    `unit` may carry a prefix already (``us``). Units that take none (``%``, ``cycles``, ``m^2``) and
    dimensionless numbers (``""`` or ``"1"``) are written as they are. Text is ASCII; see `typeset`.
    What is not a number reads ``n/a``.
    """
    return " ".join(_number_and_unit(float(value), unit, digits)).rstrip()


def scale(unit: str, *values: npt.ArrayLike) -> Scale:
    """Return the factor and the unit in which the largest finite magnitude in `values` reads 1 to 1000."""
    parts = _split(unit)
    if parts is None:
        return Scale(1.0, "" if unit == "1" else unit)
    exponent, base, rest = parts
    largest = 0.0
    for one in values:
        array = np.asarray(one, dtype=np.float64)
        if array.size and not np.isfinite([array.min(), array.max()]).all():
            array = array[np.isfinite(array)]
        if array.size:
            largest = max(largest, float(array.max()), -float(array.min()))
    if largest == 0.0:
        return Scale(1.0, unit)
    chosen = _exponent_for(largest, exponent, base)
    return Scale(10.0 ** (exponent - chosen), f"{_PREFIXES[chosen]}{base}{rest}")


def typeset(unit: str) -> str:
    """Return an ASCII unit as print has it: ``um`` becomes µm, ``N s/m`` N·s/m, ``m^2`` m²."""
    parts = _split(unit)
    if parts is not None and unit.startswith("u"):
        unit = "µ" + unit[1:]
    unit = unit.replace("Ohm", "Ω").replace("^2", "²").replace("^3", "³")
    return unit.strip().replace(" ", "·")


def printed(says: str) -> str:
    """Return a sentence for the terminal as a page has it: units typeset."""
    return re.sub(r"(?<=\d )([numkM]?(?:m|rad|N|V|Hz|s)\b(?:/\w+(?:\^2)?)?)", lambda m: typeset(m[1]), says)


def written(value: Any, unit: str = "", digits: int = 3, *, printed: bool = False) -> str:
    """Return a table's cell: numbers by `si`, everything else as text with the unit behind it.

    Whole numbers without a unit keep all their digits. `printed` typesets the unit (µm, not um).
    """
    unit = "" if unit == "1" else unit
    if isinstance(value, bool | np.bool_):
        number, unit = "yes" if value else "no", ""
    elif isinstance(value, int | np.integer) and not unit:
        number = str(int(value))
    elif isinstance(value, int | float | np.integer | np.floating):
        number, unit = _number_and_unit(float(value), unit, digits)
    else:
        number = str(value)
    return f"{number} {typeset(unit) if printed else unit}".rstrip()
