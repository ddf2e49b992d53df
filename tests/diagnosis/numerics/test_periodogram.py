"""The periodogram along position against the projection written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.diagnosis.numerics.periodogram import FINE, peak_near, periodogram


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(2.0, 60.0))
def test_it_is_the_projection_on_each_wave(seed: int, waves: float) -> None:
    random = np.random.default_rng(seed)
    x = 3e-4 * np.cumsum(random.standard_normal(3000)) / 50.0
    span = float(np.ptp(x))
    weight = 1.0 + 0.3 * random.standard_normal(x.size)
    residual = weight * np.sin(2 * np.pi * waves * x / span + 0.4) + 0.2 * random.standard_normal(x.size)
    number, power = periodogram(x, span, weight, residual, 80.0)
    for n in (3.0, 17.4, 60.2):
        found = 0.0
        for wave in (np.sin, np.cos):
            one = weight * wave(2 * np.pi * n * (x - x.min()) / span)
            found += float((one @ residual) ** 2 / (one @ one))
        at = int(np.argmin(np.abs(number - n)))
        assert power[at] == pytest.approx(found, rel=0.02, abs=0.02 * float(residual @ residual) / 100)


def test_the_wave_that_is_there_stands_out() -> None:
    x = 1e-3 * np.sin(np.arange(20_000) * 0.003)
    number, power = periodogram(x, 2e-3, np.ones_like(x), np.cos(2 * np.pi * x / 1.3e-4), 100.0)
    assert number[np.argmax(power)] == pytest.approx(2e-3 / 1.3e-4, abs=1.0 / FINE)


@given(st.floats(1.0, 20.0), st.floats(-1.0, 1.0), st.integers(0, 1000))
def test_a_tone_is_found_between_the_lines_of_a_transform(tone: float, off: float, seed: int) -> None:
    """In short windows with long gaps between them its neighbours are nearly as strong."""
    time = np.concatenate([first + np.arange(0.0, 2.2, 0.01) for first in (0.0, 6.7, 13.4, 20.1)])
    values = np.cos(2 * np.pi * tone * time + 0.1 * seed)
    step = 0.5 / (time[-1] - time[0])
    assert peak_near(tone + off * step, step, time, values) == pytest.approx(tone, abs=0.15 * step)
