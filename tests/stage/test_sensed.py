"""What a sensor's effects did to a reading is undone, also where rows are means of it, or smoothed."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.physics import build
from rtcomp.stage.lowpass import zero_phase
from rtcomp.stage.sensed import true_position


def moved() -> tuple[np.ndarray, np.ndarray]:
    """Return time and position of 3 s of slow motion."""
    time = np.arange(3000) / 1000.0
    return time, 2e-4 * np.sin(2.0 * time)


def test_the_sensor_is_undone_in_reverse_order_and_its_delay_by_looking_ahead():
    effects = [
        {"name": "sensor-delay", "delay": 2.3e-3},
        {"name": "sensor-scale", "scale": 1.02},
        {"name": "sensor-periodic-error", "amplitude": 1e-6, "period": 5e-5},
        {"name": "sensor-drift", "drift": 3e-5, "time_constant": 0.7},
        {"name": "sensor-jump", "size": -2e-5, "time": 0.5004},
    ]
    t = np.arange(2000) / 1000.0
    late = 3e-4 * np.sin(2 * np.pi * 2.0 * (t - 2.3e-3))
    scaled = late / 1.02
    reading = (
        scaled + 1e-6 * np.sin(2 * np.pi * scaled / 5e-5) + 3e-5 * (1 - np.exp(-t / 0.7)) - 2e-5 * (t > 0.5)
    )
    expected = 3e-4 * np.sin(2 * np.pi * 2.0 * t)
    found = true_position([build(e) for e in effects], t, reading)
    assert np.abs(found - expected)[:-5].max() < 1e-9
    assert np.all(found[-2:] == found[-2])
    assert np.array_equal(
        true_position([build({"name": "cogging", "amplitude": 1.0, "period": 1e-3})], t, reading), reading
    )


def test_means_over_rows_have_the_jump_within_them() -> None:
    time, x = moved()
    jumped = x + 3e-6 * (time >= 1.0005)
    effect = build({"name": "sensor-jump", "size": 3e-6, "time": 1.0005})
    mean = [a.reshape(-1, 3).mean(axis=1) for a in (time, jumped, x)]
    assert true_position([effect], mean[0], mean[1], 3) == pytest.approx(mean[2], abs=1e-12)


def test_smoothed_counts_have_the_jump_as_smooth_as_they_are() -> None:
    time, x = moved()
    jumped = x + 8e-5 * (time >= 1.0005)
    effect = build({"name": "sensor-jump", "size": 8e-5, "time": 1.0005})
    mean = [
        a.reshape(-1, 2).mean(axis=1)
        for a in (time, zero_phase(jumped, 120.0, 1e3), zero_phase(x, 120.0, 1e3))
    ]
    assert true_position([effect], mean[0], mean[1], 2, 120.0) == pytest.approx(mean[2], abs=1e-12)
    assert np.abs(true_position([effect], mean[0], mean[1], 2) - mean[2]).max() > 5e-6


@pytest.mark.parametrize("delay", [0.5e-3, 3.57e-3])
def test_a_late_reading_keeps_its_noise(delay):
    noise = np.random.default_rng(0).standard_normal(4000)
    found = true_position([build({"name": "sensor-delay", "delay": delay})], np.arange(4000) / 1000.0, noise)
    assert np.std(found[20:-20]) == pytest.approx(np.std(noise), rel=0.01)
