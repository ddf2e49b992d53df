"""The low-pass of the force balance against the library's, which it replaces for its import time."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt_zi, sosfiltfilt

from rtcomp.stage.lowpass import resting, section, zero_phase


@given(st.floats(1.0, 49_000.0), st.integers(0, 2**32 - 1), st.integers(10, 400))
def test_it_is_the_librarys_filter(cut: float, seed: int, rows: int) -> None:
    rate = 1e5
    signal = np.cumsum(np.random.default_rng(seed).standard_normal(rows))
    sections = butter(2, cut, fs=rate, output="sos")
    assert section(cut, rate) == pytest.approx(sections[0], rel=1e-9, abs=1e-15)
    assert resting(section(cut, rate)) == pytest.approx(sosfilt_zi(sections)[0], rel=1e-6, abs=1e-9)
    expected = sosfiltfilt(sections, signal)
    assert zero_phase(signal, cut, rate) == pytest.approx(expected, rel=1e-7, abs=1e-7 * np.ptp(signal))


def test_columns_are_smoothed_one_by_one() -> None:
    table = np.cumsum(np.random.default_rng(5).standard_normal((300, 4)), axis=0)
    expected = np.column_stack([zero_phase(column, 40.0, 1000.0) for column in table.T])
    assert np.array_equal(zero_phase(table, 40.0, 1000.0), expected)


@pytest.mark.parametrize("cut", [0.0, -1.0, 500.0, 700.0])
def test_a_cutoff_that_makes_no_sense_is_refused(cut: float) -> None:
    with pytest.raises(ValueError, match="cutoff"):
        section(cut, 1000.0)


def test_too_few_rows_are_refused() -> None:
    with pytest.raises(ValueError, match="9 rows"):
        zero_phase(np.arange(9.0), 10.0, 1000.0)


def test_the_balance_does_without_the_librarys_import() -> None:
    script = (
        "import sys, numpy as np\n"
        "from rtcomp.stage.balance import zero_phase\n"
        "zero_phase(np.arange(100.0), 10.0, 1000.0)\n"
        "assert 'scipy.signal' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)
