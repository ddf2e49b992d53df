"""Numbers with units: what is written reads back, in a prefix that a person would choose."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.report.quantities import printed, scale, si, typeset, written

POWER = {"f": -15, "p": -12, "n": -9, "u": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9, "T": 12}
UNITS = ["m", "N", "V", "s", "rad", "Hz", "m/s", "N/m", "N s/m", "N m"]


def read(text: str, unit: str) -> float:
    number, shown = text.split(" ", 1)
    assert shown.endswith(unit)
    return float(number) * 10.0 ** POWER[shown[: len(shown) - len(unit)]]


@given(st.floats(1e-14, 1e8), st.sampled_from(UNITS), st.booleans(), st.integers(2, 6))
def test_what_is_written_reads_back_to_its_digits(
    value: float, unit: str, negative: bool, digits: int
) -> None:
    signed = -value if negative else value
    assert read(si(signed, unit, digits), unit) == pytest.approx(signed, rel=0.51 * 10.0 ** (1 - digits))


@given(st.floats(1e-14, 9e11))
def test_the_number_before_a_prefix_lies_between_1_and_1000(value: float) -> None:
    assert 1.0 <= float(si(value, "N").split()[0]) < 1000.0


@given(st.floats(1e-14, 1e6), st.sampled_from(["m", "N", "V", "s"]))
def test_a_prefix_in_the_unit_changes_nothing_but_the_input(value: float, unit: str) -> None:
    assert read(si(value * 1e6, f"u{unit}", 6), unit) == pytest.approx(
        read(si(value, unit, 6), unit), rel=2e-5
    )


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (12.3e-9, "m", "12.3 nm"),
        (12e-9, "m", "12 nm"),
        (999.96e-9, "m", "1 um"),
        (0.001, "N", "1 mN"),
        (1000.0, "Hz", "1 kHz"),
        (250.0, "us", "250 us"),
        (1900.0, "us", "1.9 ms"),
        (3600.0, "s", "3600 s"),
        (720.0, "rad", "720 rad"),
        (0.02, "N m", "20 mN m"),
        (2.0, "kg", "2 kg"),
        (0.002, "kg", "2 g"),
        (2e4, "kg", "20000 kg"),
        (0.5, "kg m^2", "0.5 kg m^2"),
        (1e-12, "m^2", "1e-12 m^2"),
        (1.3, "%", "1.3 %"),
        (60.0, "cycles", "60 cycles"),
        (60000.0, "1", "60000"),
        (0.0, "m", "0 m"),
        (-0.0, "N", "0 N"),
        (float("nan"), "m", "n/a"),
        (float("-inf"), "m", "-inf m"),
        (1e-20, "m", "0.00001 fm"),
    ],
)
def test_known_texts(value: float, unit: str, text: str) -> None:
    assert si(value, unit) == text


@given(st.lists(st.floats(-1e6, 1e6), min_size=1), st.sampled_from(["m", "N", "s", "V", "us"]))
def test_an_axis_is_scaled_so_that_its_largest_reads_1_to_1000(values: list[float], unit: str) -> None:
    factor, shown = scale(unit, values)
    largest = max(abs(v) for v in values) * factor
    assert read(f"1 {shown}", unit[-1]) * factor == pytest.approx(read(f"1 {unit}", unit[-1]), rel=1e-12)
    if largest and max(abs(v) for v in values) > 1e-12:
        assert largest >= 1.0 - 1e-9
        assert largest < 1000.0 * (1 + 1e-9) or shown == "s"


def test_an_axis_ignores_what_is_not_finite_and_survives_nothing() -> None:
    assert scale("m", [math.nan, math.inf, 3e-6]).unit == "um"
    assert scale("m", [], [math.nan]) == (1.0, "m")
    assert scale("1", [5.0]) == (1.0, "")


@pytest.mark.parametrize(
    ("unit", "shown"),
    [("um", "µm"), ("N s/m", "N·s/m"), ("kg m^2", "kg·m²"), ("units", "units"), ("us", "µs"), ("", "")],
)
def test_units_are_typeset(unit: str, shown: str) -> None:
    assert typeset(unit) == shown


@pytest.mark.parametrize(("said", "shown"), [
    ("period 99.7 um, both directions", "period 99.7 µm, both directions"),
    ("between -47.2 and 57.3 mm/s^2", "between -47.2 and 57.3 mm/s²"),
    ("a tone at 17 Hz", "a tone at 17 Hz"),
    ("from -279 to 270 um, and not beyond; 3.2 N of 5", "from -279 to 270 µm, and not beyond; 3.2 N of 5"),
    ("58 % of the mismatch", "58 % of the mismatch"),
])  # fmt: skip
def test_sentences_are_typeset_on_a_page(said: str, shown: str) -> None:
    assert printed(said) == shown


def test_cells_of_a_table() -> None:
    assert written(True) == "yes"
    assert written(60_000_000) == "60000000"
    assert written(1000, "Hz") == "1 kHz"
    assert written("SCHED_FIFO 80") == "SCHED_FIFO 80"
    assert written(3e-6, "m", printed=True) == "3 µm"
    assert written("about 3", "N s/m", printed=True) == "about 3 N·s/m"
