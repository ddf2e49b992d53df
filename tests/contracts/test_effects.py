"""What every entry of the catalogue does, tested on each by itself, third parties' included.

An entry needs nothing here: its `example` shows it within the motion below, the rest is read from its class.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest
from every_effect import ENTRIES, every_form, example, pick, put
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from rtcomp import physics
from rtcomp.errors import ConfigError
from rtcomp.physics import Place
from rtcomp.physics.drive import DriveForce
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import (
    ACCELERATION,
    DRIVE,
    FRICTION,
    GAIN,
    GRIP,
    GRIP_LEVEL,
    GRIP_STIFFNESS,
    MASS,
    MOVED,
    NOISE,
    POSITION,
    PUSH,
    REACH,
    SCALE,
    SENSED,
    STEP,
    TIME,
    VELOCITY,
    VOLTS,
)  # fmt: skip

SIGNALS = [VOLTS, DRIVE, PUSH, FRICTION, MASS, GAIN, SENSED]


def motion(seed: int = 0) -> np.ndarray:
    """Rows of 4 s at 1 kHz: micrometres with nested reversals, then +-1 mm at up to 50 mm/s, at up to 8 V."""
    random = np.random.default_rng(seed)
    t = np.arange(1, 4001) * 1e-3
    small = 20e-6 * np.sin(2 * np.pi * 0.5 * t) * np.sin(2 * np.pi * 3 * t)
    chirp = 2 * np.pi * (0.5 * (t - 2) + 1.9 * (t - 2) ** 2)
    large = np.where(t > 2, 1e-3 * np.sin(chirp), 0.0)
    volts = 5 * np.sin(2 * np.pi * 1.7 * t + seed) + 3 * np.sin(2 * np.pi * 13 * t)
    rows = motion_rows(small + large, 1e-3, volts)
    rows[:, MASS], rows[:, GAIN], rows[:, NOISE] = 2.0, 4.0, random.standard_normal(len(t))
    return rows


MOTION = motion()


def chain_of(*effects):
    """The effects in a plain stage with friction."""
    viscous = physics.build({"name": "viscous-friction", "coefficient": 20.0})
    stage = [DriveForce(), MaxwellSlip([(8e5, 2e-6), (4e5, 7e-6)]), viscous]
    companions = [c for e in effects for c in e.companions()]
    return sorted([*effects, *companions, *stage], key=lambda e: (e.place, e.order))


def signals(*effects, rows=MOTION):
    return over_rows(chain_of(*effects), rows.copy())[:, SIGNALS]


def leaves(tree, path=()):
    """Paths of all numbers in an entry's dictionary."""
    if isinstance(tree, dict):
        return [leaf for key, value in tree.items() for leaf in leaves(value, (*path, key))]
    if isinstance(tree, list):
        return [leaf for i, value in enumerate(tree) for leaf in leaves(value, (*path, i))]
    return [path] if isinstance(tree, int | float) else []


@every_form
def test_it_changes_the_output(entry):
    with_it, without = signals(example(entry)), signals()
    assert np.all(np.isfinite(with_it))
    change = np.max(np.abs(with_it - without), axis=0)
    assert np.any(change > 1e-3 * np.max(np.abs(without), axis=0)), change


@pytest.mark.parametrize("kind", [e for e in ENTRIES if e.forms], ids=lambda kind: kind.name)
def test_each_form_does_something_else(kind):
    made = [signals(example(kind, form=form)) for form in kind.forms]
    still = signals()
    for i, one in enumerate(made):
        for other in made[:i]:
            size = np.max(np.abs(other - still), axis=0)
            assert np.any(np.max(np.abs(one - other), axis=0) > 1e-2 * size)


@every_form
def test_neutral_values_change_nothing(entry):
    if entry.neutral is None:
        pytest.skip("has no neutral values")
    np.testing.assert_allclose(signals(example(entry, **entry.neutral)), signals(), rtol=1e-12, atol=1e-15)


def smooth_motion() -> np.ndarray:
    """Rows of 0.4 s at 20 kHz: from rest over 1 mm, presliding loops on it, and a command that does not jump.

    They start at 2.1 s, so that a jump falls into them.
    """
    t = np.arange(1, 8001) * 5e-5
    x = 5e-4 * (1 - np.cos(2 * np.pi * 3 * t)) + 2e-6 * (1 - np.cos(2 * np.pi * 37 * t))
    rows = motion_rows(x, 5e-5, 5 * np.sin(2 * np.pi * 5 * t) + 2 * np.sin(2 * np.pi * 13 * t))
    rows[:, ACCELERATION] = np.gradient(rows[:, VELOCITY], 5e-5)
    rows[:, TIME] += 2.1
    rows[:, MASS], rows[:, GAIN] = 2.0, 4.0
    return rows


SMOOTH = smooth_motion()


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


@every_form
def test_the_kernel_in_python_is_the_compiled_one(entry):
    effect = example(entry)
    kernels = [entry.kernel] + ([entry.inverse] if entry.inverse else [])
    for kernel in kernels:
        p = effect.vector()
        plain, fast = effect.initial_state(), effect.initial_state()
        for w in MOTION[1700:2300]:
            ours, theirs = w.copy(), w.copy()
            kernel.python(p, plain, ours)
            kernel(p, fast, theirs)
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(plain, fast, rtol=1e-9, atol=1e-15)


@every_form
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 2**31), size=st.sampled_from([1e-9, 1e-6, 1e-4, 1e-2]))
def test_state_and_output_stay_bounded_under_any_motion(entry, seed, size):
    """The same motion twice: where nothing accumulates, states are no larger the second time."""
    random = np.random.default_rng(seed)
    jumps = size * random.standard_normal(1500) * (random.random(1500) > 0.3)
    x = np.cumsum(jumps)
    x -= np.clip(x, -1e-2, 1e-2) * (random.random(1500) > 0.95)
    effect = example(entry)
    p, s = effect.vector(), effect.initial_state()
    states = []
    volts = np.tile(10 * random.standard_normal(1500), 2)
    rows = motion_rows(np.tile(np.clip(x, -1e-2, 1e-2), 2), 10.0 ** random.uniform(-6, 0), volts)
    rows[:, VELOCITY] *= np.tile(random.choice([1.0, 0.3, -1.0, 0.0], 1500, p=[0.7, 0.1, 0.1, 0.1]), 2)
    rows[:, NOISE] = np.tile(random.standard_normal(1500), 2)
    rows[:, VELOCITY] = np.clip(rows[:, VELOCITY], -10.0, 10.0)
    for w in rows:
        entry.kernel(p, s, w)
        assert np.all(np.isfinite(w)) and np.all(np.isfinite(s))
        states.append(np.abs(s))
    before, after = np.max(states[:1500], axis=0), np.max(states[1500:], axis=0)
    allowed = np.max(before, initial=0.0)
    if effect.frequency() > 0.0:  # a second mass takes its time until it moves as fast as the first
        allowed = max(allowed, 2.0 * np.max(np.abs(rows[:, MOVED] / rows[:, STEP])))
    assert np.all(after <= np.maximum(20 * before, allowed))
    assert np.max(np.abs(rows[:, [DRIVE, PUSH, FRICTION]])) < 1e7


@every_form
def test_stiffness_and_damping_bound_the_forces(entry):
    """The integrator takes its step from them."""
    effect = example(entry)
    p, s = effect.vector(), effect.initial_state()
    assert effect.stiffness() >= 0.0 and effect.damping() >= 0.0 and effect.frequency() >= 0.0
    frequency = effect.frequency()
    stiffness = effect.stiffness() + MOTION[0, MASS] * frequency**2
    damping = effect.damping() + MOTION[0, MASS] * frequency

    def force(w, moved, speed):
        w, state = w.copy(), s.copy()
        w[MOVED], w[VELOCITY], w[STEP] = moved, speed, 0.0
        w[POSITION] += moved
        w[DRIVE] = w[PUSH] = w[FRICTION] = 0.0
        w[REACH] = w[SCALE] = 1.0
        entry.kernel(p, state, w)
        return w[DRIVE] + w[PUSH] - w[FRICTION]

    for k, w in enumerate(MOTION):
        entry.kernel(p, s, w.copy())
        if k % 7 == 0:
            still = force(w, 0.0, 0.0)
            for nudge in (1e-9, -1e-9):
                slope = abs(force(w, nudge, 0.0) - still) / 1e-9
                assert slope <= 1.01 * stiffness + 1e-3
            for speed in (1e-6, -1e-6):
                assert abs(force(w, 0.0, speed) - still) / 1e-6 <= 1.01 * damping + 1e-3


@every_form
def test_its_inverse_cancels_it(entry):
    if entry.inverse is None:
        pytest.skip("has no inverse")
    effect = example(entry)
    p = effect.vector()
    forward, backward = effect.initial_state(), effect.initial_state()
    wire = VOLTS if entry.place is Place.DRIVE else SENSED
    changed = 0.0
    for w in MOTION:
        there = w.copy()
        entry.inverse(p, backward, there)
        changed = max(changed, abs(there[wire] - w[wire]))
        entry.kernel(p, forward, there)
        np.testing.assert_allclose(there, w, rtol=1e-9, atol=1e-12)
    assert changed > 0.0


def test_only_signals_on_their_way_have_an_inverse():
    for entry in ENTRIES:
        assert entry.inverse is None or entry.place in (Place.DRIVE, Place.SENSOR)


@every_form
def test_its_parameters_come_back_from_data_made_with_it(entry):
    """Least squares on what the kernel gives with 0.1 % noise, from a start 3 % off."""
    text = {**copy.deepcopy(dict(entry.example)), "name": entry.name}
    paths = []
    held = {p.name for p in entry.parameters if p.held}
    for path in leaves(text):
        if path[-1] in held:
            continue
        try:
            moved = [signals(physics.build(put(text, path, pick(text, path) * f))) for f in (1.03, 0.97)]
        except ConfigError:
            assert path[-1] == "weight", f"{path}: only weights, which sum to 1, cannot be moved alone"
            continue
        if all(np.array_equal(m, signals(physics.build(text))) for m in moved):
            assert path[-1] == "reach", f"{path}: only a reach beyond the level may be without effect"
            continue
        paths.append(path)
    truth = np.array([pick(text, path) for path in paths])
    assert len(paths) > 0 and np.all(truth != 0.0)
    without, clean = signals(), signals(physics.build(text))
    spread = np.std(clean - without, axis=0)
    largest = np.max(np.abs(clean - without), axis=0)
    spread = np.where(spread > 1e-9 * largest, spread, largest)  # a constant's spread is rounding
    used = spread > 0
    random = np.random.default_rng(7)
    data = clean[:, used] + 1e-3 * spread[used] * random.standard_normal((len(clean), int(used.sum())))

    def residual(ratios):
        guess = text
        for path, value in zip(paths, truth * ratios, strict=True):
            guess = put(guess, path, float(value))
        return ((signals(physics.build(guess))[:, used] - data) / (1e-3 * spread[used])).ravel()

    noise = np.mean(residual(np.ones(len(truth))) ** 2)
    start = 1.0 + 0.03 * np.where(np.arange(len(truth)) % 2, -1.0, 1.0)

    def polish(at):
        low, high = np.full(len(at), 0.9), np.full(len(at), 1.1)
        return least_squares(residual, at, bounds=(low, high), diff_step=1e-4, loss="soft_l1", max_nfev=60).x

    found = polish(start)
    if np.mean(residual(found) ** 2) > 1.2 * noise:  # a cost with steps in it: scan, finer each time
        found = start.copy()
        for width in (0.05, 0.005, 0.0005):
            for i in range(len(found)):
                offsets = width * np.linspace(-1, 1, 52)
                trials = [np.where(np.arange(len(found)) == i, found + d, found) for d in offsets]
                found = min(trials, key=lambda r: float(np.mean(residual(r) ** 2)))
        found = polish(found)
    assert np.max(np.abs(found - 1.0)) < 0.01, dict(zip(map(str, paths), found, strict=True))
