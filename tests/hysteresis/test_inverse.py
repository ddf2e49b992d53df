"""The inverse finds the input that gives a wanted output, for every basis."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.inverse import inputs_for
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.shaped import PARTS, ShapedIntervalBasis
from rtcomp.hysteresis.stop import StopBasis


def motion(rows=800):
    t = np.linspace(0.0, 1.0, rows)
    return 0.8 * t * np.sin(2 * np.pi * 3 * t) + 0.15 * np.sin(2 * np.pi * 11 * t)


def shaped(seed):
    basis = ShapedIntervalBasis.over(8, 2.4, 3.0, skew=0.05, parts=PARTS)
    fall = np.exp(-np.cumsum(basis.widths) / 1.2)
    added = np.random.default_rng(seed).uniform(-0.03, 0.06, basis.size - 8)
    return HysteresisModel(basis, np.append(fall, added), 0.3)


@pytest.mark.parametrize(
    "model",
    [
        HysteresisModel(IntervalBasis.over(10, 2.4), np.linspace(2.0, 0.3, 10), -0.1),
        HysteresisModel(StopBasis.over(6, 2.4), np.linspace(2.0, 0.3, 6)),
        *[shaped(seed) for seed in range(4)],
    ],
    ids=lambda m: m.basis.name,
)
def test_the_model_along_what_it_finds_gives_what_was_wanted(model):
    u = motion()
    wanted = model.response(u)
    found, rest = inputs_for(model, wanted, -2.0, 2.0)
    assert np.abs(rest).max() < 1e-12
    assert np.allclose(model.response(np.append(0.0, found))[1:], wanted, rtol=0, atol=1e-10)
    assert np.allclose(found, u, atol=1e-8)


def test_what_is_out_of_reach_is_said():
    model = HysteresisModel(IntervalBasis.over(4, 1.0), np.ones(4))
    found, rest = inputs_for(model, np.array([0.2, 9.0, -9.0]), -1.0, 1.0)
    assert found == pytest.approx([0.2, 1.0, -1.0], abs=1e-9)
    assert rest == pytest.approx([0.0, 8.5, -8.5], abs=1e-9)


@pytest.mark.parametrize("bounds", [(1.0, -1.0), (0.5, 1.0), (0.0, 0.0)])
def test_bounds_must_hold_the_start(bounds):
    model = HysteresisModel(IntervalBasis([1.0]), np.ones(1))
    with pytest.raises(ConfigError, match="must hold the start"):
        inputs_for(model, np.zeros(1), *bounds)
