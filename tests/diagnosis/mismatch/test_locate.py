"""Where a known residual shows: the axis it was made from, its period, its sign; and no place for noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import STAGE

from rtcomp.diagnosis.mismatch.locate import _since_reversal, axes_of, locate
from rtcomp.diagnosis.result import Place
from rtcomp.kernels import Floats
from rtcomp.stage.lowpass import zero_phase

RATE = STAGE["rate"]


@dataclass(frozen=True)
class Strip:
    """Time, position and voltage of a stretch."""

    time: Floats
    position: Floats
    voltage: Floats


@dataclass(frozen=True)
class Motion:
    """Stretches of a recording of which every sixth row is compared."""

    strips: list[Strip]
    rate: float
    cut: float
    thinning: int = 6

    @property
    def period(self) -> float:
        return 1.0 / self.rate

    @property
    def stroke(self) -> tuple[float, float]:
        everywhere = np.concatenate([s.position for s in self.strips])
        return float(everywhere.min()), float(everywhere.max())

    def smooth(self, rows: Sequence[Floats]) -> Floats:
        return self.plain([zero_phase(r, self.cut, self.rate) for r in rows])

    def plain(self, rows: Sequence[Floats]) -> Floats:
        return np.concatenate([r[100 : -100 : self.thinning] for r in rows])


@pytest.fixture(scope="module")
def motion() -> Motion:
    """Thirty seconds of many sines over 0.7 mm, two strips, and a command that has little to do with them."""
    t = np.arange(int(30 * RATE)) / RATE
    x = sum(a * np.sin(2 * np.pi * f * t + f) for a, f in ((3e-4, 0.31), (1e-4, 0.83), (4e-5, 2.3)))
    v = sum(a * np.sin(2 * np.pi * f * t + f) for a, f in ((1.0, 0.47), (0.6, 1.13), (0.4, 1.9)))
    half = t.size // 2
    return Motion([Strip(t[i], x[i], v[i]) for i in (slice(0, half), slice(half, None))], RATE, 60.0)


def kept(motion: Motion, name: str) -> Floats:
    return next(a.values for a in axes_of(motion) if a.name == name)


def noisy(residual: Floats, seed: int = 1) -> Floats:
    chance = np.random.default_rng(seed).standard_normal(residual.size)
    return residual + 0.2 * np.std(residual) * chance


def first(motion: Motion, residual: Floats) -> Place:
    return locate(motion, noisy(residual), None)[0]


@pytest.mark.parametrize("period", [8e-5, 2.4e-5, 7e-6])
@pytest.mark.parametrize("odd", [False, True])
def test_a_wave_along_the_stroke_is_said_with_its_period(motion: Motion, period: float, odd: bool) -> None:
    residual = 0.4 * np.sin(2 * np.pi * kept(motion, "position") / period + 0.5)
    place = first(motion, residual * kept(motion, "direction") if odd else residual)
    assert place.axis == "position" and place.unit == "m" and place.share > 0.9 and place.p_value <= 0.005
    said = float(place.says.split("period ")[1].split(" um")[0])
    assert said == pytest.approx(1e6 * period, rel=0.01)
    assert ("with the sign of the motion" in place.says) == odd
    assert "all speeds" in place.says
    assert np.abs(place.before).max() == pytest.approx(0.4, rel=0.25)


def test_a_wave_that_shows_in_fast_motion_only_is_said_so(motion: Motion) -> None:
    speed = kept(motion, "speed")
    wave = np.sin(2 * np.pi * kept(motion, "position") / 5e-5)
    place = first(motion, wave * (np.abs(speed) > np.median(np.abs(speed))))
    assert "period 50 um" in place.says and "mostly fast motion" in place.says


@pytest.mark.parametrize("name", ["speed", "direction", "command", "time"])
def test_what_depends_on_one_axis_is_found_there(motion: Motion, name: str) -> None:
    values = kept(motion, name)
    place = first(motion, np.tanh(3 * values / np.abs(values).max()) if name != "time" else values - 15.0)
    assert place.axis == name and place.share > 0.8 and place.p_value <= 0.01


def test_a_slope_along_the_stroke_is_no_wave(motion: Motion) -> None:
    place = first(motion, 1e3 * kept(motion, "position"))
    assert place.axis == "position" and "period" not in place.says


def test_a_bump_on_one_side_is_no_wave(motion: Motion) -> None:
    x = kept(motion, "position")
    high = np.quantile(x, 0.8)
    place = first(motion, np.where(x > high, np.sin(2 * np.pi * (x - high) / 1e-4), 0.0))
    assert place.axis == "position" and "period" not in place.says


def test_a_tone_is_found_whatever_the_motion(motion: Motion) -> None:
    """It goes on between two stretches, whose rows are put one behind the other: there its line is cut up."""
    place = first(motion, np.sin(2 * np.pi * 17.0 * kept(motion, "time")))
    said = float(place.says.split("tone at ")[1].split(" Hz")[0])
    assert place.axis == "frequency" and said == pytest.approx(17.0, rel=2e-3)
    assert place.share > 0.9


def test_noise_has_no_place(motion: Motion) -> None:
    count = kept(motion, "time").size
    found = [locate(motion, np.random.default_rng(k).standard_normal(count), None) for k in range(20)]
    assert sum(map(len, found)) == 0


def test_noise_that_hangs_together_has_hardly_ever_a_place(motion: Motion) -> None:
    count = kept(motion, "time").size
    width = int(1.0 * motion.rate / motion.thinning)
    false = 0
    for k in range(40):
        white = np.random.default_rng(k).standard_normal(count + width - 1)
        false += any(
            p.axis != "time" for p in locate(motion, np.convolve(white, np.ones(width), "valid"), None)
        )
    assert false <= 8


def test_the_other_residual_is_binned_alike(motion: Motion) -> None:
    residual = noisy(np.sin(2 * np.pi * kept(motion, "position") / 8e-5))
    place = locate(motion, residual, 0.1 * residual)[0]
    assert place.after is not None
    assert place.after == pytest.approx(0.1 * place.before)


def test_a_rotary_axis_has_its_own_units(motion: Motion) -> None:
    places = locate(motion, noisy(kept(motion, "speed")), None, axis="rotary")
    assert next(p.unit for p in places if p.axis == "speed") == "rad/s"


@given(st.lists(st.sampled_from([-1.0, 0.0, 1.0]), min_size=1, max_size=60), st.integers(0, 99))
def test_since_the_last_reversal(moving: list[float], seed: int) -> None:
    position = np.random.default_rng(seed).standard_normal(len(moving))
    time, way = _since_reversal(np.array(moving), position, 0.5)
    last, at = 0.0, 0
    for k, now in enumerate(moving):
        if now not in (0.0, last):
            last, at = now, k
        assert time[k] == 0.5 * (k - at)
        assert way[k] == abs(position[k] - position[at])
