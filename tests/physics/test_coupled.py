"""Second masses: the resonance's frequency response, what a play loses, and that both keep momentum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from rtcomp.errors import ConfigError
from rtcomp.physics import build
from rtcomp.physics.coupled import CONTACT, LOAD_SHARE
from rtcomp.physics.rows import motion_rows, new_rows, over_rows
from rtcomp.physics.wires import MASS, POSITION, PUSH
from rtcomp.stage.simulate import Simulator, largest_step
from rtcomp.stage.stage import Stage
from rtcomp.trial.plant import Loop, Physics, simulate


def stage(*effects, friction=None, **more):
    mechanics = {"mass": 2.0, "force_constant": 1.0, "voltage_limit": 100.0, "effects": list(effects), **more}
    if friction:
        mechanics["friction"] = friction
    return Stage.from_dict({"stage": mechanics, "rate": 1000.0})


def run(simulator, volts, period=1e-3):
    out = np.empty(len(volts))
    for k, u in enumerate(volts):
        simulator.advance(float(u), period)
        out[k] = simulator.position
    return out


@pytest.mark.parametrize(("frequency", "damping", "ratio"), [(30.0, 0.05, 0.3), (150.0, 0.02, 0.6)])
def test_the_frequency_response_is_that_of_two_masses_on_a_spring(frequency, damping, ratio):
    resonance = {"name": "resonance", "frequency": frequency, "damping": damping, "mass_ratio": ratio}
    ground = {"name": "parallel-spring", "stiffness": 2e4}
    axis = stage(resonance, ground, viscous=20.0)
    m2, m1, w = 2.0 * ratio, 2.0 * (1 - ratio), 2 * np.pi * frequency
    k2, c2 = m2 * w * w, 2 * damping * m2 * w
    second = np.array([m2, c2, k2])
    first = np.array([m1, 20.0 + c2, 2e4 + k2])
    system = signal.TransferFunction(
        second, np.polysub(np.polymul(first, second), np.polymul([c2, k2], [c2, k2]))
    )
    t = 1e-3 * np.arange(1500)
    volts = np.where(t < 0.05, 5.0, 0.0) + np.sin(2 * np.pi * 0.9 * frequency * t)
    # Held commands: the discrete equivalent is exact.
    discrete = system.to_ss().to_discrete(1e-3)
    expected = discrete.output(volts, t)[1].ravel()[1:]
    out = run(Simulator(axis), volts)[:-1]
    assert np.sqrt(np.mean((out - expected) ** 2) / np.mean(expected**2)) < 5e-3
    assert largest_step(axis) <= 0.05 / w


def test_far_below_its_frequency_a_second_mass_is_just_mass():
    resonance = {"name": "resonance", "frequency": 300.0, "damping": 0.1, "mass_ratio": 0.5}
    t = 1e-3 * np.arange(2000)
    volts = np.sin(2 * np.pi * 2 * t)
    one, two = run(Simulator(stage()), volts), run(Simulator(stage(resonance)), volts)
    assert np.max(np.abs(one - two)) < 2e-3 * np.ptp(one)


def test_a_free_play_keeps_the_momentum_of_both_masses():
    simulator = Simulator(stage({"name": "backlash", "gap": 1e-4}))
    out = run(simulator, np.where(np.arange(4000) < 100, 2.0, 0.0))
    late = np.polyfit(1e-3 * np.arange(2000), out[-2000:], 1)[0]
    assert late == pytest.approx(2.0 * 0.1 / 2.0, rel=0.01)


def test_lost_motion_is_twice_the_gap():
    """Friction is behind the play: at a slow reversal nothing resists until the play is crossed."""
    gap, friction = 5e-5, [{"stiffness": 4e5, "reach": 5e-6}]
    x = np.concatenate([np.linspace(0, 1e-3, 20_000), np.linspace(1e-3, 0, 20_000)])
    effects = [build({"name": "backlash", "gap": gap}), build({"name": "maxwell-slip", "elements": friction})]
    chain = sorted([*effects, *effects[0].companions()], key=lambda e: (e.place, e.order))
    rows = motion_rows(x, 5e-5)
    rows[:, MASS] = 2.0
    out = over_rows(chain, rows)
    resisting = -out[:, PUSH]
    assert resisting[19_000:20_000].mean() == pytest.approx(2.0, rel=0.02)
    assert resisting[39_000:].mean() == pytest.approx(-2.0, rel=0.02)
    back = out[20_000:]
    smooth = np.convolve(resisting[20_000:], np.ones(100) / 100, "same")
    travel = 1e-3 - back[np.argmax(smooth < -1.0), POSITION]
    loaded = 2.0 / (LOAD_SHARE * 2.0 * (2 * np.pi * CONTACT) ** 2)  # the contact's own deflection
    assert travel == pytest.approx(2 * gap + 2 * loaded + 5e-6, abs=4e-6)
    in_the_play = (x[20_000:] < 1e-3 - 1.5e-5) & (x[20_000:] > 1e-3 - 9e-5)
    assert np.abs(smooth[in_the_play]).mean() < 0.1
    np.testing.assert_allclose(out[:, MASS], 2.0 * (1 - LOAD_SHARE))


def test_position_force_is_the_line_through_its_knots_and_level_beyond():
    knots, values = [-2e-3, 0.0, 1e-3, 4e-3], [1.0, -2.0, 0.5, 3.0]
    effect = build({"name": "position-force", "knots": knots, "values": values})
    x = np.linspace(-5e-3, 6e-3, 1001)
    rows = new_rows(x.size)
    rows[:, POSITION] = x
    np.testing.assert_allclose(over_rows([effect], rows)[:, PUSH], np.interp(x, knots, values), atol=1e-12)
    assert effect.stiffness() == pytest.approx(2500.0)
    assert repr(effect) == "PositionForce(4 knots)"


@pytest.mark.parametrize(
    ("entry", "says", "key"),
    [
        ({"knots": [0.0], "values": [1.0]}, "knots holds 1 positions", ("knots",)),
        ({"knots": [0.0, 1.0], "values": [1.0]}, "values holds 1 forces for 2 knots", ("values",)),
        ({"knots": [0.0, 1.0, 1.0], "values": [1, 2, 3]}, r"knots\[2\] is 1 m, not above", ("knots", 2)),
        ({"knots": [0.0, "x"], "values": [1, 2]}, "number 1: knots is 'x'", ("knots", 1)),
        ({"knots": 3.0, "values": [1, 2]}, "knots is 3.0; it must be a list", ("knots",)),
        ({"knot": [0.0, 1.0], "values": [1, 2]}, "unknown parameter 'knot'.*knots", ("knot",)),
    ],
)
def test_a_wrong_position_force_is_refused_with_its_place(entry, says, key):
    with pytest.raises(ConfigError, match=says) as caught:
        build({"name": "position-force", **entry})
    assert caught.value.key == key
    assert "\n" not in str(caught.value)


def test_springs_weights_and_tones_act_on_the_load_behind_a_play():
    """The trial's plant, which shares no physics with the program, moves alike, and not without the play."""
    share, contact, gap = 0.6, 60.0, 4e-5
    second = share * 2.0
    k2 = second * (2.0 * np.pi * contact) ** 2
    physics = Physics(2.0, 4.0, 10.0, 60.0, 0.0, 1.0, 1e-9, 1e-5, 1.0)._replace(
        gap=gap, second_mass=second, second_stiffness=k2, second_damping=0.2 * np.sqrt(k2 * second),
        spring=3e3, bias=0.8, tone=0.5, tone_frequency=3.1, tone_phase=0.4,
    )  # fmt: skip
    t = 1e-3 * np.arange(1500)
    volts = 0.6 * np.sin(2 * np.pi * 1.3 * t) + 0.4 * np.sin(2 * np.pi * 2.9 * t)
    other = simulate(physics, Loop(0.0, 0.0, 0.0, 1000.0, 0.0, 0.0, open=1.0), volts, 1).truth
    behind = [
        {"name": "parallel-spring", "stiffness": 3e3},
        {"name": "constant-force", "force": 0.8},
        {"name": "tonal-disturbance", "amplitude": 0.5, "frequency": 3.1, "phase": 0.4},
    ]
    play = {"name": "backlash", "gap": gap, "share": share, "contact": contact}
    force = {"force_constant": 4.0, "viscous": 60.0}
    off = {}
    for what, effects in {"behind": [play, *behind], "no play": behind}.items():
        simulator = Simulator(stage(*effects, **force), substeps=4.0)
        out = np.append(0.0, run(simulator, volts)[:-1])
        off[what] = np.sqrt(np.mean((out - other) ** 2) / np.mean(other**2))
    print(off)
    assert off["behind"] < 0.01 and off["no play"] > 0.05
