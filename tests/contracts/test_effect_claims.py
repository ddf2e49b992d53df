"""What an entry of the catalogue says of itself is what it does: linear, steady, a bias, and the like."""

from __future__ import annotations

import numpy as np
import pytest
from effect_signals import MOTION, SIGNALS, SMOOTH, chain_of, signals
from every_effect import every_form, example

from rtcomp.physics import Place
from rtcomp.physics.rows import over_rows
from rtcomp.physics.wires import (
    ACCELERATION,
    DRIVE,
    FRICTION,
    GRIP,
    GRIP_LEVEL,
    GRIP_STIFFNESS,
    MASS,
    MOVED,
    POSITION,
    PUSH,
    REACH,
    SCALE,
    VELOCITY,
    VOLTS,
)


@every_form
def test_it_is_linear_where_it_says_so(entry):
    """Twice as far from neutral, twice the change; exactly where it adds a force, else to first order."""
    for name in entry.linear:
        values = {**entry.example, **(entry.neutral or {})}
        still = values[name] if entry.neutral else 0.0
        size = entry.example.get(name, 0.0) - still or 0.1  # a parameter that the example leaves out
        unit = next(p.unit for p in entry.parameters if p.name == name)
        size = 5e-4 if unit == "s" else 0.01 * size  # ten rows: with fewer, the rows show

        def change(times, values=values, name=name, still=still, size=size):
            effect = entry.from_dict({**values, name: max(still + times * size, 1e-12)})
            return signals(effect, rows=SMOOTH)

        none = change(0.0)
        once, twice = change(1.0) - none, change(2.0) - none
        scale = np.sqrt(np.mean(once**2, axis=0))
        assert np.any(scale > 0.0), name
        rest = np.sqrt(np.mean((twice - 2.0 * once) ** 2, axis=0))
        assert np.all(rest <= 0.15 * scale + 1e-9), (name, rest, scale)


@every_form
def test_it_asks_for_the_whole_of_friction_only_where_it_says_so(entry):
    """What the friction model left changes what a modifier does: its force, its level, its stiffness."""
    if entry.place is not Place.FRICTION:
        pytest.skip("is no friction")
    effects = [example(entry), *example(entry).companions()]
    made = []
    for whole in (1.0, 1.3):
        rows = MOTION[1700:2300].copy()
        states = [e.initial_state() for e in effects]
        for w in rows:
            w[GRIP], w[GRIP_LEVEL], w[GRIP_STIFFNESS] = 0.8 * whole, 4.0 * whole**2, 1e6 * whole**3
            w[DRIVE], w[PUSH], w[FRICTION] = 3.0, 1.0, 0.0
            for effect, s in zip(effects, states, strict=True):
                effect.kernel(effect.vector(), s, w)
        made.append(rows[:, [MOVED, FRICTION, REACH, SCALE]])
    assert np.array_equal(made[0], made[1]) != any(e.whole_friction for e in effects)


@every_form
def test_a_steady_drive_keeps_its_force_while_the_command_is_held(entry):
    if entry.place is not Place.DRIVE:
        pytest.skip("is no drive")
    rows = SMOOTH.copy()
    rows[:, VOLTS] = np.repeat(SMOOTH[::400, VOLTS], 400)
    force = over_rows(chain_of(example(entry)), rows)[:, DRIVE]
    held = all(np.ptp(part) < 1e-12 for part in force.reshape(-1, 400))
    assert held == entry.steady


@every_form
def test_command_only_says_whether_a_drive_depends_on_the_motion(entry):
    if entry.place is not Place.DRIVE:
        pytest.skip("is no drive")
    still = SMOOTH.copy()
    still[:, [POSITION, VELOCITY, ACCELERATION, MOVED]] = 0.0
    moving, at_rest = (
        over_rows(chain_of(example(entry)), rows)[:, [DRIVE, PUSH]] for rows in (SMOOTH, still)
    )
    assert np.array_equal(moving, at_rest) == entry.command_only


@every_form
def test_a_bias_is_the_same_force_everywhere(entry):
    change = signals(example(entry)) - signals()
    force = (
        change[:, SIGNALS.index(DRIVE)] + change[:, SIGNALS.index(PUSH)] - change[:, SIGNALS.index(FRICTION)]
    )
    constant = np.ptp(force) < 1e-9 * np.max(np.abs(force), initial=1.0) and abs(force[0]) > 0.0
    assert constant == entry.bias


@every_form
def test_the_moving_mass_is_changed_only_where_it_says_so(entry):
    """A play takes its load away too, but not in proportion to what is left."""
    changed = not np.array_equal(signals(example(entry))[:, SIGNALS.index(MASS)], MOTION[:, MASS])
    assert changed == (entry.moving_mass or entry.name == "backlash")
