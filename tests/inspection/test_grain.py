"""What a sensor sees is told from the recording; the low-pass and the least reversal follow from it."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.inspection.branches import turning_points
from rtcomp.inspection.grain import grain_of, sight_of
from rtcomp.stage.lowpass import zero_phase

RATE = 1000.0
TIME = np.arange(20_000) / RATE
SINE = 1e-4 * np.sin(2 * np.pi * 1.0 * TIME)


@pytest.mark.parametrize("noise", [2e-8, 2e-7, 1e-6])
def test_noise_is_measured(noise: float) -> None:
    noisy = SINE + noise * np.random.default_rng(1).standard_normal(TIME.size)
    assert grain_of(noisy).noise == pytest.approx(noise, rel=0.05)
    assert grain_of(noisy).count == 0.0
    assert grain_of(SINE).noise < 1e-11


@pytest.mark.parametrize("count", [1e-6, 1e-5])
def test_a_count_is_measured(count: float) -> None:
    assert grain_of(np.round(SINE / count) * count).count == pytest.approx(count, rel=1e-6)


@pytest.mark.parametrize(
    ("noise", "count"), [(0.0, 0.0), (5e-8, 1e-8), (2e-6, 0.0), (1e-5, 0.0), (0.0, 1e-5), (5e-6, 1e-5)]
)
def test_the_reversals_of_the_motion_are_found_and_no_others(noise: float, count: float) -> None:
    reading = SINE + noise * np.random.default_rng(2).standard_normal(TIME.size)
    if count:
        reading = np.round(reading / count) * count
    sight = sight_of(reading, RATE, 100.0)
    assert 5.0 <= sight.smoothing_hz <= 100.0
    assert turning_points(zero_phase(reading, sight.smoothing_hz, RATE), sight.reversal).size == 40


def test_a_good_sensor_is_not_smoothed_more_than_it_must() -> None:
    assert sight_of(SINE, RATE, 100.0).smoothing_hz == 100.0
    noisy = SINE + 5e-6 * np.random.default_rng(3).standard_normal(TIME.size)
    assert sight_of(noisy, RATE, 100.0).smoothing_hz < 50.0


def test_what_is_given_stays() -> None:
    sight = sight_of(SINE, RATE, 100.0, smoothing_hz=20.0, reversal=3e-5)
    assert (sight.smoothing_hz, sight.reversal) == (20.0, 3e-5)
    assert sight_of(SINE, RATE, 100.0, smoothing_hz=0.0).smoothing_hz == 0.0
