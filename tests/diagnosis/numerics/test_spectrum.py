"""Filters and spectra of the diagnosis: closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.diagnosis.numerics.spectrum import filtered, motion_spectrum, spectrum, white_noise
from rtcomp.kernels import Floats


def one(frequency: Floats) -> Floats:
    return np.ones_like(frequency)


@given(st.floats(0.5, 20.0), st.floats(-3.0, 3.0), st.floats(-50.0, 50.0))
@settings(max_examples=25, deadline=None)
def test_a_derivative_is_that_of_the_closed_form(frequency: float, level: float, slope: float) -> None:
    t = np.arange(4000) / 1000.0
    omega = 2.0 * math.pi * frequency
    made = filtered(level + slope * t + np.sin(omega * t), 1000.0, one, derivative=True)
    inside = slice(600, -600)
    assert np.allclose(made[inside], (slope + omega * np.cos(omega * t))[inside], atol=0.02 * omega)


def test_a_spectrum_has_the_power_of_the_signal() -> None:
    random = np.random.default_rng(3)
    noise = 0.3 * random.standard_normal(60_000)
    frequency, density = spectrum([noise], 500.0)
    assert np.median(density[frequency > 10.0]) == pytest.approx(0.09 / 250.0, rel=0.05)


@pytest.mark.parametrize("stroke", [1e-4, 1e-2, 1.0])
def test_a_long_stroke_does_not_leak_into_what_is_noise(stroke: float) -> None:
    """Moves at constant acceleration: of 1e8 times the noise a window leaks more than the noise."""
    period = np.concatenate([np.full(500, 1.0), np.full(1000, -1.0), np.full(500, 1.0)])
    moves = np.cumsum(np.cumsum(np.tile(period, 15)))
    noise = 1e-8 * np.random.default_rng(4).standard_normal(moves.size)
    frequency, density = motion_spectrum([stroke * moves / np.ptp(moves) + noise], 1000.0)
    assert np.median(density[frequency > 350.0]) == pytest.approx(1e-16 / 500.0, rel=0.1)


@given(stroke=st.floats(1e-6, 1.0), noise=st.floats(1e-9, 1e-6), jumps=st.integers(0, 5))
@settings(max_examples=25, deadline=None)
def test_white_noise_is_told_beside_motion_and_jumps(stroke: float, noise: float, jumps: int) -> None:
    """Of moves up to 1e9 times as large, with jumps of a tenth of the stroke."""
    random = np.random.default_rng(6)
    t = np.arange(20_000) / 1000.0
    moves = 0.5 * stroke * np.sin(2.0 * math.pi * 0.7 * t)
    jumped = 0.1 * stroke * np.sum(t[:, None] > random.uniform(0.0, 20.0, jumps), axis=1)
    told = white_noise([moves + jumped + noise * random.standard_normal(t.size)])
    assert told == pytest.approx(noise, rel=0.15)


def test_what_falls_with_frequency_is_no_white_noise() -> None:
    walk = np.cumsum(np.random.default_rng(7).standard_normal(20_000))
    assert white_noise([walk]) < 0.25
    assert white_noise([walk[:200]]) == 0.0


def test_noise_at_an_end_is_no_step() -> None:
    """A filter that is strong at low frequencies must not draw the last point out over the recording."""
    random = np.random.default_rng(5)
    noise = random.standard_normal(8000)
    noise[-1] = 30.0

    def low(frequency: Floats) -> Floats:
        return 1.0 / (1.0 + (frequency / 2.0) ** 2)

    quiet = filtered(noise, 1000.0, low, noisy=True)[-500:-100]
    loud = filtered(noise, 1000.0, low)[-500:-100]
    assert np.abs(quiet).max() < 0.2 * np.abs(loud).max()
