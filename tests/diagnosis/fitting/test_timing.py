"""A command that acts before its row is found out of step, and no physics is named for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.kernels import Floats
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage

RATE, MASS, STIFFNESS, VISCOUS = 1000.0, 1.2, 5e4, 11.0
BELIEF = {
    "stage": {
        "mass": 1.1, "force_constant": 8.0, "voltage_limit": 10.0, "viscous": 12.0,
        "effects": [{"name": "parallel-spring", "stiffness": 5.3e4}],
    },
    "sensor": {"noise": 1e-8, "resolution": 0.0},
    "rate": RATE,
}  # fmt: skip


def multisine(seed: int) -> Floats:
    lines = np.zeros(6001, np.complex128)
    lines[12:960] = np.exp(2j * np.pi * np.random.default_rng(seed).random(948))
    volts = np.fft.irfft(lines, 12_000)
    return np.asarray(volts / np.std(volts))


def stepped(volts: Floats, steps: int) -> Floats:
    """The axis on its spring, `steps` a row, each moved on by the speed at its end."""
    x, v, step, found = 0.0, 0.0, 1.0 / (steps * RATE), np.empty(volts.size)
    for k, held in enumerate((8.0 * volts).tolist()):
        found[k] = x
        for _ in range(steps):
            v += step * (held - VISCOUS * v - STIFFNESS * x) / MASS
            x += step * v
    return found


def exactly(volts: Floats) -> Floats:
    """The same axis in closed form."""
    from scipy.linalg import expm

    a = np.array([[0.0, 1.0, 0.0], [-STIFFNESS / MASS, -VISCOUS / MASS, 8.0 / MASS], [0.0, 0.0, 0.0]])
    row = expm(a / RATE)
    state, found = np.zeros(3), np.empty(volts.size)
    for k, held in enumerate(volts.tolist()):
        found[k], state[2] = state[0], held
        state = row @ state
    return found


@pytest.mark.parametrize("steps", [2, 4, None])
def test_a_step_by_the_speed_at_its_end_is_half_a_step_early(steps: int | None) -> None:
    volts = multisine(3)
    position = exactly(volts) if steps is None else stepped(volts, steps)
    position += 1e-8 * np.random.default_rng(5).standard_normal(position.size)
    columns = {"time": np.arange(volts.size) / RATE, "position": position, "voltage": volts}
    found = diagnose(Stage.from_dict(BELIEF), [Recording(columns, RATE, {}, Path("run.csv"))], held=True)
    said = [note for note in found.notes if "before its row" in note]
    assert found.verdict == "retuned" and not found.effects
    if steps is None:
        assert not said
    else:
        early = float(said[0].split(" ms")[0].split()[-1])
        assert early == pytest.approx(0.5 / steps, rel=0.06)
    moved = {r.parameter: r.after.value for r in found.retuned}
    assert moved["mass"] == pytest.approx(MASS, rel=1e-2)
