"""What every entry of the catalogue does, tested on each by itself, third parties' included.

An entry needs nothing here: its `example` shows it within the motion of `effect_signals`, the rest is read
from its class.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest
from effect_signals import MOTION, signals
from every_effect import ENTRIES, every_form, example, pick, put
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from rtcomp import physics
from rtcomp.errors import ConfigError
from rtcomp.physics import Place
from rtcomp.physics.rows import motion_rows
from rtcomp.physics.wires import (
    DRIVE,
    FRICTION,
    MASS,
    MOVED,
    NOISE,
    POSITION,
    PUSH,
    REACH,
    SCALE,
    SENSED,
    STEP,
    VELOCITY,
    VOLTS,
)


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
        if entry.averages:  # cancelled is what acts at the end of the step
            entry.kernel(p, forward, there.copy())
            there[STEP] = 0.0
        entry.kernel(p, forward, there)
        there[STEP] = w[STEP]
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
