"""The trial's plant: known truths of its mechanics, and that every effect does something of its own."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.trial.draw import look
from rtcomp.trial.families.micrometre import draw_stage
from rtcomp.trial.hidden import SECRETS, Rig
from rtcomp.trial.motion import draw_reference
from rtcomp.trial.oracle import Bare
from rtcomp.trial.plant import Loop, Physics, Run, simulate

PHYSICS = Physics(2.0, 4.0, 10.0, 8.0, 250.0, 5e-3, 4.0, 4e-5, 4.0)
LOOP = Loop(2e4, 2e5, 100.0, 1000.0, 1.5e-8, 1e-8)
MOTION = {"seconds": 20.0, "stroke": 7e-4, "reach": 4e-5, "fastest": 8.0}


@pytest.fixture(scope="module")
def moved() -> tuple[Rig, Run]:
    reference = draw_reference(np.random.default_rng(3), LOOP.rate, **MOTION)
    run = simulate(PHYSICS, LOOP, reference, 1)
    return look(PHYSICS, LOOP, MOTION, run), run


def test_same_seed_same_run_and_other_noise_otherwise(moved: tuple[Rig, Run]) -> None:
    _, run = moved
    again = simulate(PHYSICS, LOOP, run.reference, 1)
    assert np.array_equal(again.position, run.position) and np.array_equal(again.voltage, run.voltage)
    assert not np.array_equal(simulate(PHYSICS, LOOP, run.reference, 2).position, run.position)


def test_a_free_mass_in_a_pulled_loop_obeys_newton() -> None:
    """Nothing but mass and controller: the known second-order response, of which the plant knows nothing."""
    free = PHYSICS._replace(level=1e-9, viscous=0.0, micro_damping=0.0)
    loop = LOOP._replace(kp=100.0, ki=0.0, kd=0.0, noise=0.0, resolution=0.0)
    run = simulate(free, loop, np.full(2000, 1e-3), 1)
    omega = np.sqrt(4.0 * 100.0 / 2.0)
    expected = 1e-3 * (1.0 - np.cos(omega * run.time))
    # Holding the command for a tick takes a little damping away.
    assert np.max(np.abs(run.truth - expected)[:400]) < 0.02e-3


def test_a_command_acts_from_its_row_to_the_next() -> None:
    """A free mass under a held force: the second difference of its positions is the mean of both commands."""
    free = PHYSICS._replace(level=1e-12, viscous=0.0, micro_damping=0.0)
    loop = LOOP._replace(noise=0.0, resolution=0.0, open=1.0)
    run = simulate(free, loop, np.random.default_rng(5).uniform(-1.0, 1.0, 400), 1)
    given = 4.0 / 2.0 * 0.5 * (run.voltage[1:-1] + run.voltage[:-2])
    bent = run.truth[2:] - 2.0 * run.truth[1:-1] + run.truth[:-2]
    assert bent * 1e6 == pytest.approx(given, abs=1e-6)


@pytest.mark.parametrize("lag", [0.0, 0.03])
@pytest.mark.parametrize(("viscous", "back_emf"), [(40.0, 0.0), (0.0, 40.0), (25.0, 15.0)])
def test_damping_and_a_lag_are_those_of_their_equations(lag: float, viscous: float, back_emf: float) -> None:
    """A voltage switched on, against the closed form: far closer than any sensor reads."""
    damped = PHYSICS._replace(level=1e-12, viscous=viscous, back_emf=back_emf, micro_damping=0.0, lag=lag)
    run = simulate(damped, LOOP._replace(noise=0.0, resolution=0.0, open=1.0), np.ones(400), 1)
    t, time_constant, speed = run.time, 2.0 / 40.0, 4.0 / 40.0
    late, slow = (each * (1.0 - np.exp(-t / each)) for each in (lag or 1.0, time_constant))
    share = lag / (time_constant - lag)
    expected = speed * (t - (1.0 + share) * slow + (share * late if lag else 0.0))
    assert run.truth == pytest.approx(expected, abs=1e-6 * np.ptp(expected))


def test_in_steady_sliding_the_drive_carries_coulomb_and_viscous_friction() -> None:
    loop = LOOP._replace(noise=0.0, resolution=0.0)
    slow = PHYSICS._replace(micro_damping=0.0)
    run = simulate(slow, loop, 0.01 * np.arange(3000) / 1000.0, 1)
    force = 4.0 * np.mean(run.voltage[-500:])
    assert force == pytest.approx(4.0 + 8.0 * 0.01, rel=1e-3)


def test_the_axis_follows_and_the_noise_is_as_told(moved: tuple[Rig, Run]) -> None:
    rig, run = moved
    assert np.std(run.reference - run.truth) < 0.2 * np.std(run.reference)
    assert np.std(run.position - run.truth) == pytest.approx(np.hypot(1.5e-8, 1e-8 / np.sqrt(12)), rel=0.1)
    assert rig.stroke == pytest.approx(7e-4, rel=0.5)


@pytest.mark.parametrize("delay", [1.0e-3, 1.53e-3])
def test_a_late_reading_is_late_by_just_that_much(delay: float) -> None:
    """Under a controller too weak to matter: the same motion, only later."""
    loop = LOOP._replace(kp=1.0, ki=0.0, kd=0.0, noise=0.0, resolution=0.0)
    free = PHYSICS._replace(level=1e-9, viscous=40.0, micro_damping=0.0)
    reference = np.where(np.arange(3000) < 2, 1e-3, 0.0)  # one kick, then coasting under a weak controller
    late = simulate(free._replace(delay=delay), loop, reference, 1)
    prompt = simulate(free, loop, reference, 1)
    there = np.interp(late.time - delay, prompt.time, prompt.truth)
    assert np.max(np.abs(late.truth - there)[10:200]) < 2e-3 * np.max(np.abs(prompt.truth))
    blind = simulate(free._replace(sensor_delay=delay), loop, reference, 1)
    there = np.interp(blind.time - delay, prompt.time, prompt.truth)
    assert np.max(np.abs(blind.truth - there)[10:200]) < 2e-3 * np.max(np.abs(prompt.truth))


@pytest.mark.parametrize("name", sorted(SECRETS))
def test_everything_that_can_be_hidden_changes_the_balance_and_grows_with_its_strength(
    name: str, moved: tuple[Rig, Run]
) -> None:
    rig, clean = moved
    chance = np.random.default_rng(5)
    secret, base = SECRETS[name], rig.physics
    if secret.known is not None:
        base = base._replace(**secret.known(chance, rig)[0])
        clean = simulate(base, LOOP, clean.reference, 1)
    sized = secret.draw(chance, rig)
    bare = Bare.of(base, LOOP, clean)
    shares = []
    for part in (0.3, 0.9):
        changes, _ = sized.at(max(part, sized.least) * min(1.0, sized.most))
        assert set(changes) <= set(Physics._fields)
        run = simulate(base._replace(**changes), LOOP, clean.reference, 1)
        shows = bare.strength(run)
        shares.append(shows.share if secret.retuning else shows.beyond)
    assert shares[1] > shares[0] * 1.001 or sized.least >= 0.3
    own = bare.share if secret.retuning else bare.beyond
    assert shares[1] * bare.needed > 0.2 * own


def test_scored_parameters_are_among_those_that_are_told() -> None:
    chance = np.random.default_rng(0)
    rig = Rig(PHYSICS, LOOP, 7e-4, 5e-3, 4.0, 2.0, 30.0)
    for secret in SECRETS.values():
        told: set[str] = set()
        for _ in range(40):  # some are drawn in more than one shape
            told |= set(secret.draw(chance, rig).at(1.0)[1])
        assert set(secret.scored) <= told and (not secret.period or secret.period in secret.scored)


@pytest.mark.parametrize("seed", range(8))
def test_drawn_stages_are_within_what_was_promised(seed: int) -> None:
    loop, physics, motion = draw_stage(np.random.default_rng(seed))
    assert 0.5 <= physics.mass <= 5.0 and 1.0 <= physics.level <= 10.0
    assert 1e-6 <= physics.reach <= 1e-4 and 500.0 <= loop.rate <= 4000.0
    assert 20.0 <= motion["seconds"] <= 60.0 or loop.rate > 2000.0
    assert physics.level < 0.5 * physics.force_constant * physics.voltage_limit * 3.0
