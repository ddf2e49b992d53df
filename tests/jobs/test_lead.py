"""Feedforward of a stage's whole chain: what is hidden in the plant and known in the stage is followed."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp import physics
from rtcomp.control.references import Reference
from rtcomp.errors import ConfigError
from rtcomp.jobs.compensate import Tracking, compensate
from rtcomp.jobs.follow import follow
from rtcomp.jobs.lead import BY_CLOCK, held, lead_volts
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.loop.tick import LEAD_FORCE
from rtcomp.stage.stage import Stage

MODELS = {"maxwell-slip", "dahl", "lugre", "gms", "leuven", "modified-leuven"}
NOT_LED = {
    "drive-saturation": "what the drive cannot give, no command gives",
    "sensor-jump": "no motion follows a reading that jumps",
    "sensor-noise": "noise is not known beforehand",
    "sensor-resolution": "rounding is not undone",
}
"""Entries that no feedforward makes up for, and why."""
MILDER = {
    "drive-delay": {"delay": 1.2e-3},
    "sensor-delay": {"delay": 1.2e-3},
    "drive-lag": {"time_constant": 1e-3},
    "resonance": {"frequency": 12.0},
    "stribeck": {"velocity": 4e-3},
}
"""Examples under which the feedback of this stage would itself swing, or that hardly show at its speeds."""
FIVEFOLD = {"cogging", "asymmetric-friction", "drive-deadband", "position-dependent-friction"}
FAST = {
    "kind": "multisine",
    "frequencies": [1.0, 2.3, 5.1],
    "amplitudes": [6e-4, 1e-4, 3e-5],
    "duration": 3.0,
}
ENTRIES = [e for e in physics.entries() if e.name not in MODELS]


@pytest.fixture(scope="module")
def ideal(leuven):
    return leuven.changed(
        sensor={"noise": 0.0, "resolution": 0.0}, compensate={"reference": FAST, "settle": 0.0}
    )


def hiding(config, name, **values):
    effect = {"name": name, **next(e for e in ENTRIES if e.name == name).example, **values}
    return config.simulating(config.stage.with_changes(stage={"effects": [effect]}))


def error(config, stage, **more):
    run = follow(config, "compensate", stage=stage, feedforward_from=0.0, **more)
    return Tracking.of(run, 0.0).rms


@pytest.mark.parametrize("entry", ENTRIES, ids=[e.name for e in ENTRIES])
def test_a_hidden_effect_that_the_stage_knows_is_followed(ideal, entry):
    if entry.name in NOT_LED:
        pytest.skip(NOT_LED[entry.name])
    config = hiding(ideal, entry.name, **MILDER.get(entry.name, {}))
    without, with_it = error(config, config.stage), error(config, config.plant)
    print(entry.name, without, with_it)
    assert with_it < without / (20 if entry.name in FIVEFOLD else 3)
    assert with_it < 1e-6


@pytest.mark.parametrize("name", sorted(FIVEFOLD))
def test_a_link_of_one_tick_and_noise_leave_the_gain(leuven, name):
    config = hiding(leuven, name).changed(
        device={"driver": "simulated", "delay_ticks": 1}, compensate={"reference": FAST, "settle": 0.5}
    )
    assert error(config, config.plant) < error(config, config.stage) / 10


def test_the_stage_alone_is_as_good_as_the_identified_model(leuven, identified):
    model = compensate(leuven, identified.model)
    stage = compensate(leuven, stage=leuven.stage)
    assert stage.model is None and stage.stage is leuven.stage
    assert stage.error_with.rms <= 1.05 * model.error_with.rms
    assert stage.error_without.rms == pytest.approx(model.error_without.rms, rel=1e-3)


def test_the_plan_gives_any_rows_of_the_one_piece(leuven):
    """Friction remembers: rows asked in blocks are those of the whole."""
    reference = leuven.reference("compensate")
    volts = lead_volts(leuven.stage, reference, 1e-3, 3000, 1)
    plan = ReferencePlan(reference, leuven.stage, 1e-3, 3000, 1, feedforward_from=0.0, lead=volts)
    blocks = np.concatenate([plan.rows(a, 700)[:, LEAD_FORCE] for a in range(0, 2800, 700)])
    assert np.array_equal(blocks, 4.0 * volts[:2800])
    longer = lead_volts(leuven.stage, reference, 1e-3, 5000, 1)
    assert np.array_equal(longer[:3000], volts)


def test_a_delay_moves_the_whole_command_earlier(leuven):
    reference = leuven.reference("compensate")
    late = leuven.stage.with_changes(stage={"effects": [{"name": "drive-delay", "delay": 2e-3}]})
    by_link = lead_volts(leuven.stage, reference, 1e-3, 2000, 2)
    assert np.allclose(lead_volts(late, reference, 1e-3, 2000), by_link, rtol=0, atol=1e-9)
    assert np.allclose(lead_volts(leuven.stage, reference, 1e-3, 2002)[2:], by_link, rtol=0, atol=1e-9)


def test_no_more_is_asked_than_the_drive_gives(leuven):
    reference = Reference.from_dict({"kind": "sine", "amplitude": 4e-4, "frequency": 20.0, "duration": 2.0})
    effects = [{"name": "drive-saturation", "limit": 0.9}, {"name": "drive-deadband", "width": 0.3}]
    weak = leuven.stage.with_changes(stage={"effects": effects})
    assert np.abs(lead_volts(leuven.stage, reference, 1e-3, 2000)).max() > 2.0
    assert np.abs(lead_volts(weak, reference, 1e-3, 2000)).max() == pytest.approx(1.2)
    weaker = leuven.stage.with_changes(stage={"voltage_limit": 1.0})
    assert np.abs(lead_volts(weaker, reference, 1e-3, 2000)).max() == 1.0


@pytest.mark.parametrize("name", sorted(BY_CLOCK))
def test_a_stage_with_another_clock_leaves_out_what_goes_by_it(leuven, name):
    stage = hiding(leuven, name).plant
    reference = leuven.reference("compensate")
    plain = lead_volts(leuven.stage, reference, 1e-3, 2000)
    assert np.array_equal(lead_volts(stage, reference, 1e-3, 2000, clock=False), plain)


def test_the_moment_of_a_lagged_command_lies_between_middle_and_end_of_its_tick():
    def stage(constant):
        effects = [{"name": "drive-lag", "time_constant": constant}]
        return Stage.from_dict({"stage": {"mass": 1.0, "force_constant": 1.0, "voltage_limit": 1.0,
                                          "effects": effects}})  # fmt: skip

    moments = [held(stage(c).chain, 1e-3) for c in (0.0, 1e-5, 1e-3, 1e-1, 1e2)]
    assert moments[0] == 5e-4 and np.all(np.diff(moments) > 0)
    assert moments[-1] == pytest.approx(1e-3, rel=1e-4)


def test_what_cannot_be_fed_forward_is_refused_in_one_line(leuven):
    rotary = leuven.stage.with_changes(stage={"axis": "rotary"})
    with pytest.raises(ConfigError, match=r"is rotary, the axis of .*leuven.yaml is linear"):
        compensate(leuven, stage=rotary)
    learning = leuven.changed(compensate={"learn": True})
    with pytest.raises(ConfigError, match=r"compensate.learn.*is true"):
        compensate(learning, stage=leuven.stage)
