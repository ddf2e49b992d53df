"""What a stage does in simulation is what its force balance makes of the recording, for every entry.

An entry needs nothing here: a stage with its `example` is simulated in closed loop and balanced by itself and
without the entry.
"""

from __future__ import annotations

import numpy as np
import pytest
from every_effect import every_form

from rtcomp import physics
from rtcomp.physics import Place
from rtcomp.stage.balance import force_balance
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage

MODELS = {"maxwell-slip", "dahl", "lugre", "gms", "leuven", "modified-leuven"}
UNSEEN = {
    "sensor-noise": "noise of a reading is not undone: there is nothing to balance without it",
    "sensor-resolution": "rounding is not undone: there is nothing to balance without it",
}
"""Entries that no balance shows, and why."""
FRICTION = [
    {"stiffness": 3.2e5, "reach": 1.5e-6},
    {"stiffness": 1.3e5, "reach": 7e-6},
    {"stiffness": 6e4, "reach": 2.4e-5},
]
PLAIN = Stage.from_dict(
    {
        "stage": {
            "mass": 2.0,
            "force_constant": 4.0,
            "voltage_limit": 10.0,
            "viscous": 40.0,
            "micro_damping": 250.0,
            "friction": FRICTION,
        },
        "rate": 1000.0,
    }
)
FREE = PLAIN.with_changes(stage={"friction": [], "micro_damping": 0.0})
"""Without friction nothing is stiff: a step of its simulation is as long as a row."""
FAST = [
    {**entry.example, "name": entry.name, p.name: value}
    for entry in physics.entries()
    for p in entry.parameters
    for value in {"s": (3e-4, 1e-3, 3e-3), "Hz": (30.0, 100.0, 200.0)}.get(p.unit, ())
    if entry.searchable and not entry.behind and entry.place in (Place.DRIVE, Place.MECHANICS)
]
"""Effects of the drive and of the mass that change within a few rows, or within one."""


def stage_with(entry: type[physics.Effect]) -> Stage:
    """The plain stage with the example of `entry`; a friction model in the place of its own."""
    if entry.name in MODELS:
        return PLAIN.with_changes(stage={"friction": {"model": entry.name, **entry.example}})
    return PLAIN.with_changes(stage={"effects": [{"name": entry.name, **entry.example}]})


def recorded(stage: Stage, seconds: float = 6.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Closed loop: strokes of a millimetre and of micrometres, a rest at the end. Time, position, voltage."""
    rate, simulator = stage.rate, Simulator(stage)
    t = np.arange(round(seconds * rate)) / rate
    fade = np.clip(t / 0.5, 0.0, 1.0) * np.clip((5.0 - t) / 0.2, 0.0, 1.0)
    reference = 8e-4 * fade * np.sin(2 * np.pi * 1.1 * t) * np.sin(2 * np.pi * 0.23 * t)
    reference += fade * (2e-5 * np.sin(2 * np.pi * 7 * t) + 8e-5 * np.sin(2 * np.pi * 3.3 * t))
    position, voltage = np.empty(t.size), np.empty(t.size)
    integral = slow = last = volts = 0.0
    for k in range(t.size):
        if k:
            simulator.advance(volts, 1.0 / rate)
        x = position[k] = simulator.measure()
        slow += 0.3 * ((x - last) * rate - slow)
        integral = np.clip(integral + 1e5 * (reference[k] - x) / rate, -10.0, 10.0)
        volts = float(np.clip(8e3 * (reference[k] - x) + integral - 60.0 * slow, -10, 10))
        voltage[k], last = volts, x
    return t, position, voltage


@every_form
def test_the_balance_is_that_of_the_simulation(entry: type[physics.Effect]) -> None:
    if entry.name in UNSEEN:
        pytest.skip(UNSEEN[entry.name])
    stage = stage_with(entry)
    t, position, voltage = recorded(stage)
    with_it = force_balance(stage, t, position, voltage).relative_error
    without = force_balance(PLAIN, t, position, voltage).relative_error
    print(entry.name, with_it, without)
    assert with_it < 0.03
    if entry.name != "maxwell-slip" or stage.friction != PLAIN.friction:
        assert without > 2 * with_it


@pytest.mark.parametrize("entry", FAST, ids=lambda e: " ".join(map(str, e.values())))
def test_the_balance_is_that_of_the_simulation_within_a_row(entry: dict[str, float | str]) -> None:
    stage = FREE.with_changes(stage={"effects": [entry]})
    least = force_balance(FREE, *recorded(FREE)).relative_error
    t, position, voltage = recorded(stage)
    with_it = force_balance(stage, t, position, voltage).relative_error
    without = force_balance(FREE, t, position, voltage).relative_error
    print(entry, least, with_it, without)
    assert with_it < 2.0 * least + 0.15 * without


@pytest.mark.parametrize("name", sorted(MODELS))
def test_noise_of_the_reading_does_not_wear_friction_down(name: str) -> None:
    """A solid forgets a part of its force in every small loop, and noise is nothing but small loops."""
    friction = {"model": name, **physics.entry(name).example}
    if name == "maxwell-slip":
        friction["exponent"] = 1.0
    stage = PLAIN.with_changes(stage={"friction": friction}, sensor={"noise": 1.5e-8, "resolution": 1e-8})
    t, position, voltage = recorded(stage)
    error = force_balance(stage, t, position, voltage).relative_error
    print(name, error)
    assert error < 0.05


def test_only_sensors_that_cannot_be_undone_are_left_out() -> None:
    for name in UNSEEN:
        entry = physics.entry(name)
        assert entry.place is Place.SENSOR and entry.inverse is None
