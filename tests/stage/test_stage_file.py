"""Stage files: read, written, refused; and the chain they stand for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from rtcomp import physics
from rtcomp.errors import ConfigError
from rtcomp.hysteresis import bases
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.physics import Place
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage

CONFIGS = Path(__file__).parents[2] / "configs"
FORMATS = """\
stage:
  axis: linear                  # linear (default) or rotary
  mass: 2.0                     # kg
  force_constant: 4.0           # N/V, applied force per volt of command
  voltage_limit: 10.0           # V
  viscous: 8.0                  # N s/m
  micro_damping: 250.0          # N s/m; force = micro_damping * exp(-(v / micro_damping_speed)^2) * v
  micro_damping_speed: 5.0e-3   # m/s
  friction:                     # stop (Maxwell-slip) elements: stiffness N/m, reach m
    - {stiffness: 3.2e5, reach: 1.5e-6}
    - {stiffness: 2.2e5, reach: 3.5e-6}
  effects:                      # what else is known to be there, by the names below
    - {name: cogging, amplitude: 1.2, period: 5.0e-4, phase: 0.3}
sensor: {noise: 15.0e-9, resolution: 10.0e-9}   # m rms, m
controller: {kp: 2.0e4, ki: 2.0e5, kd: 100.0}   # V/m, V/(m s), V s/m
rate: 1000.0                    # Hz
"""


def written(tmp_path, text=FORMATS):
    path = tmp_path / "stage.yaml"
    path.write_text(text)
    return path


def same_motion(one, other):
    a, b = Simulator(one, seed=4), Simulator(other, seed=4)
    for k in range(50):
        volts = 3.0 * np.sin(0.2 * k)
        a.advance(volts, 1e-3)
        b.advance(volts, 1e-3)
        if a.measure() != b.measure():
            return False
    return a.position != 0.0


def test_the_example_of_the_format_is_read_as_it_says(tmp_path):
    stage = Stage.load(written(tmp_path))
    assert (stage.axis, stage.mass, stage.force_constant, stage.voltage_limit) == ("linear", 2.0, 4.0, 10.0)
    assert stage.rate == 1000.0 and stage.sensor.noise == 15e-9 and stage.controller.kd == 100.0
    assert stage.friction.elements == [(3.2e5, 1.5e-6), (2.2e5, 3.5e-6)]
    assert "cogging" in [e.name for e in stage.chain]


@pytest.mark.parametrize("source", ["formats", "leuven.yaml", "heads_yaw.yaml"])
def test_saved_and_loaded_it_is_the_same_stage(source, tmp_path):
    path = written(tmp_path) if source == "formats" else CONFIGS / source
    stage = Stage.load(path)
    stage.save(tmp_path / "again.yaml")
    again = Stage.load(tmp_path / "again.yaml")
    assert again.to_dict() == stage.to_dict()
    assert [e.to_dict() for e in again.chain] == [e.to_dict() for e in stage.chain]
    assert same_motion(stage, again)
    assert "# kg" in (tmp_path / "again.yaml").read_text()


def test_a_saved_file_is_plain_yaml_for_others(tmp_path):
    Stage.load(written(tmp_path)).save(tmp_path / "again.yaml")
    plain = yaml.safe_load((tmp_path / "again.yaml").read_text())
    reaches = [e["reach"] for e in plain["stage"]["friction"]]
    assert reaches == [1.5e-6, 3.5e-6] and plain["sensor"]["noise"] == 15e-9


def test_a_number_without_a_point_is_a_number(tmp_path):
    text = FORMATS.replace("reach: 1.5e-6", "reach: 1e-6").replace("noise: 15.0e-9", "noise: 1e-8")
    stage = Stage.load(written(tmp_path, text))
    assert stage.friction.elements[0] == (3.2e5, 1e-6) and stage.sensor.noise == 1e-8


def line_of(text, part):
    return 1 + text[: text.index(part)].count("\n")


REFUSED = [
    # what is wrong: (replace, by, the line it is on, what the message must hold)
    ("mass: 2.0  ", "mas: 2.0  ", "mas:", ["mas", "mass"]),
    ("  mass: 2.0 ", "  # mass: 2.0 ", "stage:", ["mass"]),
    ("mass: 2.0", "mass: heavy", "mass:", ["mass", "heavy"]),
    ("mass: 2.0", "mass: 0", "mass:", ["mass", "0"]),
    ("mass: 2.0", "mass: -1e-6", "mass:", ["mass", "-1e-06"]),
    ("mass: 2.0", "mass: .nan", "mass:", ["mass", "nan"]),
    ("mass: 2.0", "mass: .inf", "mass:", ["mass", "inf"]),
    ("mass: 2.0", "mass: true", "mass:", ["mass"]),
    ("axis: linear ", "axis: lineal ", "axis:", ["axis", "linear"]),
    ("viscous: 8.0", "viscous: -8.0", "viscous:", ["viscous"]),
    ("reach: 1.5e-6", "reach: -1.5e-6", "- {stiffness: 3.2e5", ["reach"]),
    ("reach: 3.5e-6", "reach: 0", "- {stiffness: 2.2e5", ["reach"]),
    ("reach: 3.5e-6", "raech: 3.5e-6", "- {stiffness: 2.2e5", ["raech", "reach"]),
    ("{stiffness: 2.2e5, reach: 3.5e-6}", "{stiffness: 2.2e5}", "- {stiffness: 2.2e5}", ["reach"]),
    ("name: cogging", "name: coging", "- {name: coging", ["coging", "cogging"]),
    ("period: 5.0e-4", "period: 0", "- {name: cogging", ["period"]),
    ("phase: 0.3", "fase: 0.3", "- {name: cogging", ["fase"]),
    ("noise: 15.0e-9", "noise: -1", "sensor:", ["noise"]),
    ("noise: 15.0e-9", "nois: 1e-9", "sensor:", ["nois", "noise"]),
    ("kp: 2.0e4", "kp: fast", "controller:", ["kp", "fast"]),
    ("kp: 2.0e4, ", "", "controller:", ["kp"]),
    ("rate: 1000.0", "rate: 0", "rate:", ["rate"]),
    ("rate: 1000.0", "rates: 1000.0", "rates:", ["rates", "rate"]),
]


@pytest.mark.parametrize(
    ("old", "new", "at", "holds"), REFUSED, ids=[r[1].strip() or "no kp" for r in REFUSED]
)
def test_what_cannot_be_is_refused_with_file_line_and_key(old, new, at, holds, tmp_path):
    assert FORMATS.count(old) == 1
    text = FORMATS.replace(old, new)
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        Stage.load(path)
    says = str(caught.value)
    assert "\n" not in says
    assert says.startswith(f"{path}:{line_of(text, at)}: "), says
    for part in holds:
        assert part in says


@pytest.mark.parametrize(
    "friction", ["{}", "stop", "3.0", "{model: leuwen}", "{model: cogging}", "{model: [1]}"]
)
def test_friction_that_is_none_is_refused(friction, tmp_path):
    lines = FORMATS.splitlines()
    text = "\n".join([*lines[:8], f"  friction: {friction}", *lines[11:]])
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        Stage.load(path)
    says = str(caught.value)
    assert says.startswith(f"{path}:9: ") and "friction" in says and "\n" not in says


@pytest.mark.parametrize("friction", ["[]", "null"])
def test_friction_may_be_empty(friction, tmp_path):
    lines = FORMATS.splitlines()
    text = "\n".join([*lines[:8], f"  friction: {friction}", *lines[11:]])
    stage = Stage.load(written(tmp_path, text))
    assert stage.friction is None and "friction" not in stage.to_dict()["stage"]


@pytest.mark.parametrize(
    "name", [e.name for e in physics.entries() if e.place is Place.FRICTION and hasattr(e, "example")]
)
def test_friction_may_be_any_model_of_the_catalogue(name, tmp_path):
    """Those that are models; what only changes the level or depends on speed belongs under effects too."""
    effect = next(e for e in physics.entries() if e.name == name)
    stage = {"mass": 1.0, "force_constant": 4.0, "voltage_limit": 10.0}
    data = {"stage": {**stage, "friction": {"model": name, **effect.example}}}
    built = Stage.from_dict(data)
    assert built.friction == effect.from_dict(effect.example)
    built.save(tmp_path / "stage.yaml")
    assert Stage.load(tmp_path / "stage.yaml").friction == built.friction


def test_friction_may_be_a_model_that_the_program_identified(tmp_path):
    """The content of a saved model, as it is, under ``friction``."""
    model = HysteresisModel(IntervalBasis([2e-6, 4e-6, 8e-6]), np.array([5e5, 3e5, 1e5]), 0.2, np.ones(3))
    model.save(tmp_path / "model.yaml")
    entry = yaml.safe_load((tmp_path / "model.yaml").read_text())
    stage = Stage.load(written(tmp_path)).with_changes(stage={"friction": entry})
    stage.save(tmp_path / "identified.yaml")
    again = Stage.load(tmp_path / "identified.yaml")
    stops = np.array([(2e5, 1e-6), (2e5, 3e-6), (1e5, 7e-6)])
    assert np.allclose(again.friction.elements, stops, rtol=1e-12, atol=0)
    corners, force = model.virgin_curve()
    assert again.friction.level == pytest.approx(force[-1])
    assert corners[-1] == pytest.approx(7e-6)


@pytest.mark.parametrize("name", sorted(set(bases()) - {"interval"}))
def test_other_identified_bases_are_no_friction_of_a_stage(name, tmp_path):
    basis = bases()[name].over(6, 1e-5)
    entry = HysteresisModel(basis, np.ones(basis.size)).to_dict()
    with pytest.raises(ValueError, match="interval"):
        Stage.load(written(tmp_path)).with_changes(stage={"friction": entry})


def test_the_chain_runs_from_command_to_sensor(tmp_path):
    text = FORMATS.replace(
        "    - {name: cogging",
        "    - {name: stribeck, rise: 0.2, velocity: 1e-3}\n    - {name: drive-lag, time_constant: 1e-3}\n"
        "    - {name: constant-force, force: 0.1}\n    - {name: cogging",
    )
    chain = Stage.load(written(tmp_path, text)).chain
    assert [e.place for e in chain] == sorted(e.place for e in chain)
    names = [e.name for e in chain]
    for before, after in (
        ("drive-saturation", "drive-force"),
        ("drive-lag", "drive-force"),
        ("drive-force", "maxwell-slip"),
        ("stribeck", "maxwell-slip"),  # it changes the level that the model then uses
        ("maxwell-slip", "sensor-noise"),
        ("sensor-noise", "sensor-resolution"),
    ):
        assert names.index(before) < names.index(after)
    for place in Place:
        orders = [e.order for e in chain if e.place is place]
        assert orders == sorted(orders)


def test_a_run_configuration_will_do_as_a_stage():
    assert Stage.load(CONFIGS / "leuven.yaml").mass == 2.0


def test_changes_leave_the_rest(tmp_path):
    stage = Stage.load(written(tmp_path))
    heavier = stage.with_changes(stage={"mass": 2.1})
    assert heavier.mass == 2.1 and stage.mass == 2.0
    assert heavier.friction == stage.friction and heavier.sensor == stage.sensor
