"""The diagnosis from recording to answer, on simulated axes with a concealed effect."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import RATE, run, stage, there_and_back

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.errors import RtcompError
from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics import Effect, Parameter, Place, catalogue
from rtcomp.physics.wires import FRICTION, VELOCITY
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage
from rtcomp.trial.draw import Plan, draw
from rtcomp.trial.stagefile import write_case

THIN = {"stage": {"mass": 2.0, "force_constant": 4.0, "voltage_limit": 10.0}, "rate": RATE}


def motion(seconds: float = 12.0) -> Floats:
    """A reference (m): long strokes, short ones, and a quick small motion."""
    t = np.arange(int(seconds * RATE)) / RATE
    slow = 6e-4 * np.sin(2 * np.pi * 0.45 * t) * (1.0 + 0.3 * np.sin(2 * np.pi * 0.13 * t))
    quick = 8e-5 * np.sin(2 * np.pi * 4.1 * t) + 1e-5 * np.sin(2 * np.pi * 17.0 * t)
    return np.asarray(np.clip(t / 0.5, 0.0, 1.0) * (slow + quick))


def answer(belief: Stage, *effects: dict[str, Any]) -> Diagnosis:
    return diagnose(belief, [run(stage(effects=list(effects)), motion())], budget=300.0)


def names(found: Diagnosis) -> list[tuple[str, ...]]:
    return [tuple(e.names) for e in found.effects]


def test_nothing_missing_is_said_so() -> None:
    found = answer(stage())
    assert found.verdict == "consistent" and not found.effects
    assert found.fit.after < 2.0 * found.fit.floor
    assert {s.name for s in found.sights if s.seen} >= {"cogging", "drive-offset", "drive-deadband"}


def test_a_recording_that_leaves_less_than_its_replicates_hides_nothing(tmp_path: Path) -> None:
    """A clean axis with a coarse encoder, whose counts replicates meet at other places."""
    case = draw(Plan("case", "clean", (), "full", 3545313852817896335, "geared-joint"))
    write_case(tmp_path / "case", case.believed, case.run("train"), case.loop)
    recording = read(tmp_path / "case" / "train.csv.gz", {})
    found = diagnose(Stage.load(tmp_path / "case" / "stage.yaml"), [recording], budget=300.0)
    assert found.verdict in ("consistent", "retuned") and not found.effects


@pytest.mark.parametrize("belief", [stage(), Stage.from_dict(THIN)], ids=["full", "without friction"])
def test_a_dead_zone_is_named_with_its_width(belief: Stage) -> None:
    found = answer(belief, {"name": "drive-deadband", "width": 0.3})
    assert names(found) == [("drive-deadband",)]
    width = found.effects[0].parameters["width"]
    assert width.low <= 0.3 <= width.high and width.high - width.low < 0.03
    assert found.fit.after < 0.1 * found.fit.before


def test_a_slow_lag_of_friction_is_found_far_from_nothing() -> None:
    hidden = stage(viscous=400.0, effects=[{"name": "frictional-lag", "time_constant": 0.15}])
    found = diagnose(stage(viscous=400.0), [run(hidden, motion())], budget=300.0)
    assert names(found)[0] == ("frictional-lag",)
    assert found.effects[0].parameters["time_constant"].value == pytest.approx(0.15, rel=0.1)


def test_two_effects_are_both_named() -> None:
    cogging = {"name": "cogging", "amplitude": 0.6, "period": 3e-4, "phase": 0.4}
    spring = {"name": "parallel-spring", "stiffness": 2000.0}
    found = answer(stage(), cogging, spring)
    assert sorted(n[0] for n in names(found)) == ["cogging", "parallel-spring"]
    assert found.stage.to_dict()["stage"]["effects"]


def test_a_constant_force_that_a_stronger_effect_outshines_is_named_beside_it() -> None:
    ripple = {"name": "torque-ripple", "amplitude": 0.3, "period": 5e-5, "phase": 1.0}
    found = answer(stage(), ripple, {"name": "constant-force", "force": 0.08})
    first, second = names(found)
    assert first == ("torque-ripple",) and "constant-force" in second


@pytest.mark.parametrize("name", ["drive-lag", "drive-delay"])
def test_a_time_shorter_than_a_row_is_found(name: str) -> None:
    time = "delay" if name == "drive-delay" else "time_constant"
    found = answer(stage(), {"name": name, time: 0.4 / RATE})
    (named,) = found.effects
    assert name in named.names
    if named.names[0] == name:
        assert named.parameters[time].value == pytest.approx(0.4 / RATE, rel=0.1)


def test_what_no_entry_explains_is_not_given_a_name() -> None:
    """A bump of force at one place of the stroke, as a foreign body on a guide makes it."""
    bump = {
        "name": "position-force",
        "knots": [-1e-3, 1e-4, 1.3e-4, 1.6e-4, 1e-3],
        "values": [0.0, 0.0, 1.5, 0.0, 0.0],
    }
    assert names(answer(stage(), bump)) == [("unexplained",)]


def test_another_form_of_an_effect_is_no_second_effect() -> None:
    """A wave of two harmonics: the catalogue has one, and two other effects together come near as well.

    What its own harmonics explain is not left open either.
    """
    wave = {"name": "cogging", "amplitude": 0.4, "period": 3e-4, "phase": 0.4}
    second = {"name": "cogging", "amplitude": 0.15, "period": 1.5e-4, "phase": 1.4}
    recording = run(stage(effects=[wave, second]), there_and_back(12.0))
    found = diagnose(stage(), [recording], budget=300.0)
    assert names(found) == [("cogging",)]


def test_damping_that_nobody_believes_is_no_second_effect() -> None:
    """Its speed is found beside the effect, whose numbers the former speed had bent."""
    swings = {"name": "resonance", "mass_ratio": 0.35, "frequency": 15.3, "damping": 0.036}
    truth = stage(effects=[swings], micro_damping=465.0, micro_damping_speed=1.9e-3)
    belief = Stage.from_dict(THIN | {"sensor": {"noise": 1.5e-8, "resolution": 1e-8}})
    found = diagnose(belief, [run(truth, there_and_back(12.0))], budget=300.0)
    assert names(found) == [("resonance",)]
    assert found.fit.after < found.fit.floor


def test_an_effect_of_somebodys_own_is_found_like_any_other(monkeypatch: pytest.MonkeyPatch) -> None:
    @effect_kernel
    def seal(p: Floats, s: Floats, w: Floats) -> None:
        w[FRICTION] += p[0] * math.tanh(w[VELOCITY] / p[1])

    class Seal(Effect):
        name, place, kernel = "seal", Place.FRICTION, seal
        parameters = (
            Parameter("force", "N", 0.0, 1e3, "its level"),
            Parameter("speed", "m/s", 1e-4, 1e3, "at which three quarters of it are reached"),
        )
        says, equation, source = "a seal", "F = f tanh(v / v0)", "regularised Coulomb friction"
        signature, experiment = "residual force odd in speed", "constant speeds"
        example, neutral = {"force": 1.0, "speed": 0.01}, {"force": 0.0}
        linear = ("force",)

        def damping(self) -> float:
            return self.values["force"] / self.values["speed"]

    monkeypatch.setitem(catalogue._ENTRIES, "seal", Seal)
    found = answer(stage(), {"name": "seal", "force": 2.0, "speed": 2e-3})
    assert names(found)[0] == ("seal",)
    force = found.effects[0].parameters["force"].value
    assert force == pytest.approx(2.0, rel=0.15)
    assert any(e["name"] == "seal" for e in found.stage.to_dict()["stage"]["effects"])


def multisine(seconds: float, rate: float) -> Floats:
    t = np.arange(int(seconds * rate)) / rate
    random = np.random.default_rng(4)
    lines = np.arange(2.0, 90.0, 0.5)
    phases = random.uniform(0.0, 2.0 * np.pi, lines.size)
    made = sum(np.cos(2.0 * np.pi * f * t + p) for f, p in zip(lines, phases, strict=True))
    return np.asarray(made / np.std(made))


def test_a_band_limited_excitation_is_no_delay() -> None:
    """A hardening spring without friction, driven open loop by a signal that goes on between its rows."""
    linear: dict[str, Any] = {"mass": 0.005, "force_constant": 1.0, "voltage_limit": 10.0, "viscous": 0.2}
    linear["effects"] = [{"name": "parallel-spring", "stiffness": 1000.0}]
    true = {**linear, "effects": [{"name": "parallel-spring", "stiffness": 1000.0, "cubic": 4e9}]}
    fine, rows = 16, 600.0
    axis = Stage.from_dict({"stage": true, "rate": rows})
    simulator = Simulator(axis, seed=1)
    drive = 0.03 * multisine(20.0, rows * fine)
    position = np.empty(drive.size)
    for k, volts in enumerate(drive.tolist()):
        position[k] = simulator.measure()
        simulator.advance(volts, 1.0 / (rows * fine))
    shifted = 0.5 * (drive + np.append(drive[:1], drive[:-1]))
    read = position[::fine] + 1e-8 * np.random.default_rng(6).standard_normal(position[::fine].size)
    columns = {"time": np.arange(read.size) / rows, "position": read, "voltage": shifted[::fine]}
    recording = Recording(columns, rows, {}, Path("open.csv"))
    found = diagnose(Stage.from_dict({"stage": linear, "rate": rows}), [recording], budget=300.0)
    assert names(found) == [("parallel-spring",)]
    assert found.effects[0].parameters["cubic"].value == pytest.approx(4e9, rel=0.05)
    assert any("band-limited" in note for note in found.notes)


def test_a_held_command_in_open_loop_is_no_delay() -> None:
    """Whatever is missing beside it: half a row of delay is what the wrong way between rows looks like."""
    linear: dict[str, Any] = {"mass": 0.5, "force_constant": 1.0, "voltage_limit": 10.0, "viscous": 9.0}
    linear["effects"] = [{"name": "parallel-spring", "stiffness": 2000.0}]
    hidden = {"name": "resonance", "mass_ratio": 0.3, "frequency": 50.0, "damping": 0.03}
    sensor = {"noise": 5e-9, "resolution": 1e-9}
    axis = Stage.from_dict(
        {"stage": {**linear, "effects": [*linear["effects"], hidden]}, "sensor": sensor, "rate": 1000.0}
    )
    simulator, drive = Simulator(axis, seed=1), 0.8 * multisine(20.0, 1000.0)
    position = np.empty(drive.size)
    for k, volts in enumerate(drive.tolist()):
        position[k] = simulator.measure()
        simulator.advance(volts, 1e-3)
    columns = {"time": np.arange(drive.size) / 1000.0, "position": position, "voltage": drive}
    belief = Stage.from_dict({"stage": linear, "sensor": sensor, "rate": 1000.0})
    found = diagnose(belief, [Recording(columns, 1000.0, {}, Path("open.csv"))], budget=300.0)
    assert names(found) == [("resonance",)]
    assert found.effects[0].parameters["frequency"].value == pytest.approx(50.0, rel=0.03)
    assert not any("band-limited" in note for note in found.notes)


def test_a_budget_that_does_not_do_for_the_baseline_is_refused() -> None:
    with pytest.raises(RtcompError, match=r"budget of 0\.001 s .* give it more"):
        diagnose(stage(), [run(stage(), motion(4.0))], budget=0.001)


def test_a_budget_is_counted_from_where_it_began() -> None:
    """Reading took as long as there was."""
    with pytest.raises(RtcompError, match=r"budget of 60 s .* give it more"):
        diagnose(stage(), [run(stage(), motion(4.0))], budget=60.0, began=time.monotonic() - 60.0)


def test_a_short_budget_gives_the_best_answer_so_far_and_says_what_was_not_tried() -> None:
    effects = [{"name": "drive-deadband", "width": 0.3}, {"name": "parallel-spring", "stiffness": 2000.0}]
    found = diagnose(stage(), [run(stage(effects=effects), motion())], budget=2.0)
    assert any(note.startswith("not tried within 2 s") for note in found.notes)
    told = found.to_json()
    assert told["stopped_early"] and told["not_tried"]


@pytest.mark.parametrize("time", [4.3002, 6.0407, 7.1])
def test_a_jump_of_the_reading_is_found_wherever_it_happens(time: float) -> None:
    """Also where a part of the recording would otherwise be kept for the judgement."""
    found = answer(stage(), {"name": "sensor-jump", "size": 2e-5, "time": time})
    assert names(found) == [("sensor-jump",)]
    told = found.effects[0].parameters
    assert told["time"].value == pytest.approx(time, abs=1.0 / RATE)
    assert told["size"].low <= 2e-5 <= told["size"].high
    assert not found.to_json()["stopped_early"]


def test_another_force_constant_is_one_number_beside_a_believed_spring_too() -> None:
    spring = {"name": "parallel-spring", "stiffness": 2000.0}
    found = answer(stage(force_constant=4.4, effects=[spring]), spring)
    assert found.verdict == "retuned" and [m.parameter for m in found.retuned] == ["force_constant"]
    assert found.retuned[0].after.low <= 4.0 <= found.retuned[0].after.high
    told = found.stage.to_dict()["stage"]
    assert told["effects"][0]["stiffness"] == pytest.approx(2000.0, rel=0.01)
    assert told["mass"] == pytest.approx(2.0, rel=0.01)
