"""Numbers in a unit that suits them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.units import prefixed


@pytest.mark.parametrize(("unit", "values", "texts", "said"), [
    ("m", (-2.36e-4, 2.41e-4), ["-236", "241"], "um"),
    ("m", (1e-3,), ["1"], "mm"),
    ("m", (3e-12,), ["0.003"], "nm"),
    ("V", (0.0, 0.0), ["0", "0"], "V"),
    ("rad/s", (2.5e3,), ["2.5"], "krad/s"),
    ("kg", (2e-3,), ["0.002"], "kg"),
    ("1", (1e-3,), ["0.001"], ""),
])  # fmt: skip
def test_prefixes(unit: str, values: tuple[float, ...], texts: list[str], said: str) -> None:
    assert prefixed(unit, *values) == (texts, said)


@given(st.floats(1e-9, 9e8))
def test_the_largest_reads_well(value: float) -> None:
    ((text,), unit) = prefixed("m", value)
    assert 1.0 <= float(text) <= 1000.0
    assert float(text) * {"n": 1e-9, "u": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}[
        unit[:-1]
    ] == pytest.approx(value, rel=0.01)
