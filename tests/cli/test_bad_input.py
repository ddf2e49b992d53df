"""Configurations, models and options that cannot be used: one line that says where and what, nothing lost.

Each case is tried on one command by default and on every other command that reads the file when slow tests
run.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from command import (
    CONFIG,
    arguments,
    motion,
    refused,
    rtcomp,
    with_earlier_results,
    write,
)

LOOPS = ("identify", "compensate", "simulate")
ALL = (*LOOPS, "replay", "plant")
LEARNING = ("identify", "compensate")

# What is written instead of what, what is said besides the line, and by which commands.
OTHER_LINES = {
    "model: stop\n  prior: non-increasing": 29, "seed: 3\nseed: 4": 43, "seed: {3": 43,
    "  spacing: 2.0\n": 27,
}  # fmt: skip
WRONG_KEYS = [
    ("mass: 2.0", "maas: 2.0", ["unknown key stage.maas; did you mean stage.mass?"], ALL),
    ("mass: 2.0", "mass: heavy", ["stage.mass is 'heavy'", "a number", "kg"], ALL),
    ("mass: 2.0", "mass: 0", ["stage.mass is 0", "(0, 1e+06]", "kg"], ALL),
    ("mass: 2.0", "mass: .nan", ["stage.mass is nan", "finite"], ALL),
    ("mass: 2.0", "mass: [2.0]", ["stage.mass is a list of 1", "a number"], ALL),
    ("mass: 2.0", 'mass: "2.0"', ["stage.mass is '2.0'", "a number"], ALL),
    ("mass: 2.0", "mass: true", ["stage.mass is true", "a number"], ALL),
    ("mass: 2.0", "mass:", ["stage.mass is empty", "a number"], ALL),
    ("force_constant: 4.0", "axis: liner\n  force_constant: 4.0", ["'liner'", "'linear' or 'rotary'"], ALL),
    ("stage:\n", "stge:\n", ["unknown key stge; did you mean stage?"], ALL),
    ("reach: 1.2e-5", "reach: -1.2e-5", ["stage.friction[1].reach is -1.2e-05", "(0, 1000]", "m, "], ALL),
    ("reach: 3.0e-5", "raech: 3.0e-5", ["stage.friction[2].raech; did you mean", "reach?"], ALL),
    ("reach: 3.0e-5", "reach: far", ["stage.friction[2].reach is 'far'", "a number"], ALL),
    ("{stiffness: 6.0e4, reach", "{reach", ["stage.friction[1].stiffness is missing", "N/m"], ALL),
    ("name: constant-force", "name: constant-fore", ["effects[0].name", "'constant-force'?"], ALL),
    ("name: constant-force, ", "", ["stage.effects[0].name", "needs a name"], ALL),
    ("period: 1.0e-3}", "peroid: 1.0e-3}", ["effects[1].peroid", "did you mean 'period'?"], ALL),
    ("period: 1.0e-3}", "period: 0}", ["effects[1].period", "0 m", "(0, "], ALL),
    ("      period: 2.0e-3", "      period: wide", ["effects[2].period", "'wide'", "a number"], ALL),
    ("      amplitude: 0.1", "      amplitud: 0.1", ["effects[2].amplitud", "'amplitude'"], ALL),
    ("order: 3, amplitude", "order: 3, ampiltude", ["harmonics[1].ampiltude", "'amplitude'"], ALL),
    ("order: 3", "order: -3", ["effects[2].harmonics[1].order", "-3"], ALL),
    ("noise: 1.0e-9", "noise: -1.0e-9", ["sensor.noise is -1e-09", "[0, 1]", "m rms"], ALL),
    ("resolution:", "resoluton:", ["sensor.resoluton; did you mean sensor.resolution?"], ALL),
    ("kp: 2.0e4", "kP: 2.0e4", ["controller.kP; did you mean controller.kp?"], ALL),
    ("ki: 2.0e5", "ki: -1", ["controller.ki is -1", "[0, 1e+12]", "V/(m s)"], ALL),
    ("kp: 2.0e4, ", "", ["controller.kp is missing", "V/m"], ALL),
    ("rate: 1000.0\nref", "rate: 0\nref", ["rate is 0", "[1, 1e+06]", "Hz"], ALL),
    ("rate: 1000.0\nref", "raet: 1000.0\nref", ["unknown key raet; did you mean rate?"], ALL),
    ("kind: triangle", "kind: triangel", ["reference.kind", "did you mean 'triangle'?"], LOOPS),
    ("kind: triangle, ", "", ["reference.kind is missing"], LOOPS),
    ("frequency: 2.0, duration: 1.5}\nlim", "frequncy: 2.0}\nlim", ["frequncy; did you mean"], LOOPS),
    ("amplitude: 6.0e-5", "amplitude: -6.0e-5", ["reference.amplitude is -6e-05", "(0, 1000]", "m"], LOOPS),
    ("count: 4", "count: 1.5", ["judge.reference.band.count is 1.5", "a whole number"], LOOPS),
    ("travel: [-1.0e-3, 1.0e-3]", "travl: 1", ["limits.travl; did you mean limits.travel?"], LOOPS),
    ("travel: [-1.0e-3, 1.0e-3]", "travel: [1e-3, -1e-3]", ["limits.travel", "lowest must come"], LOOPS),
    ("travel: [-1.0e-3, 1.0e-3]", "travel: [1e-3]", ["limits.travel has 1 entries", "at least 2"], LOOPS),
    ("speed: 0.05", "speed: 0", ["limits.speed is 0", "more than 0", "m/s"], LOOPS),
    ("speed: 0.05", "voltage: 12", ["limits.voltage", "12 V", "at most 10 V"], LOOPS),
    ("speed: 0.05", "moves_at: 12", ["limits.moves_at", "12 V", "(10 V) ever lets out"], LOOPS),
    ("speed: 0.05", "voltage: 3, moves_at: 4", ["moves_at", "4 V", "limits.voltage (3 V)"], LOOPS),
    ("speed: 0.05", "invalid: 20", ["limits.invalid", "20 s", "limits.age (10 s)"], LOOPS),
    ("age: 10.0", "age: 1.0e-4", ["limits.age", "0.0001 s", "less than a tick (0.001 s"], LOOPS),
    ("speed: 0.05", "jump: 1.0e-9", ["limits.jump", "1e-09 m", "flickers by (1.6e-08 m"], LOOPS),
    ("speed: 0.05", "stuck: 1.0e-6", ["limits.stuck", "1e-06 s", "less than a tick"], LOOPS),
    ("driver: simulated", "driver: serail", ["device.driver", "did you mean 'serial'?"], LEARNING),
    ("delay_ticks: 0", "delay_tick: 0", ["device.delay_tick; did you mean device.delay_ticks?"], LOOPS),
    ("delay_ticks: 0", "delay_ticks: 5", ["device.delay_ticks is 5", "0 or 1"], LOOPS),
    ("intervals: 6", "intervls: 6", ["identify.intervls; did you mean identify.intervals?"], LOOPS),
    ("intervals: 6", "intervals: 0", ["identify.intervals is 0", "[1, 100000]"], LOOPS),
    ("intervals: 6", "intervals: 2.5", ["identify.intervals is 2.5", "a whole number"], LOOPS),
    ("  range: 6.0e-5\n", "  spacing: 2.0\n", ["identify", "give range (m"], LOOPS),
    ("range: 6.0e-5", "range: -6.0e-5", ["identify.range is -6e-05", "more than 0", "m, "], LOOPS),
    ("range: 6.0e-5", "widths: [1e-6, 0]", ["identify.widths[1] is 0", "more than 0", "m, "], LOOPS),
    ("range: 6.0e-5", "widths: [1e-6, -1e-6]", ["identify.widths[1] is -1e-06", "more than 0"], LOOPS),
    ("range: 6.0e-5", "widths: [1e-6, 1e-99]", ["identify.widths", "widths[1] is 1e-99 m"], LEARNING),
    ("range: 6.0e-5", "range: 1.0e-18", ["identify.range", "1e-15 m"], LEARNING),
    ("range: 6.0e-5", "widths: []", ["identify.widths has 0 entries", "at least 1"], LOOPS),
    ("intervals: 6", "model: intervall", ["identify.model", "did you mean 'interval'?"], LOOPS),
    ("intervals: 6", "model: stop\n  prior: non-increasing", ["identify.prior", "'stop'"], LOOPS),
    ("learner: rls", "learner: rsl", ["identify.learner.learner", "did you mean 'rls'?"], LOOPS),
    ("forgetting: 0.9995", "forgeting: 0.9", ["learner.forgeting", "did you mean 'forgetting'?"], LOOPS),
    ("forgetting: 0.9995", "forgetting: 1.5", ["learner.forgetting", "1.5", "0.9 to 1"], LOOPS),
    ("forgetting: 0.9995", "forgetting: slow", ["learner.forgetting", "'slow'", "a number"], LOOPS),
    ("smoothing: 100.0", "smoothing: 600.0", ["identify.smoothing", "600 Hz", "400 Hz"], LEARNING),
    ("gate: 5.0e-8", "learn: [3, 2]", ["identify.learn", "[3, 2] s", "start must come first"], LOOPS),
    ("gate: 5.0e-8", "learn: [30, 40]", ["identify.learn", "30 s", "ends at 1.5 s"], LEARNING),
    ("settle: 0.1", "setle: 0.1", ["judge.setle; did you mean judge.settle?"], LOOPS),
    ("settle: 0.1", "settle: -1", ["judge.settle is -1", "at least 0", "s "], LOOPS),
    ("settle: 0.1", "settle: 9", ["judge.settle", "9 s", "ends at 1.5 s"], LEARNING),
    ("settle: 0.5", "settel: 0.5", ["compensate.settel; did you mean compensate.settle?"], LOOPS),
    ("settle: 0.5", "settle: 9", ["compensate.settle", "9 s", "ends at 1.5 s"], ("compensate",)),
    ("settle: 0.5", "learn: 1", ["compensate.learn is 1", "true or false"], LOOPS),
    ("  rate: 1000.0\n  map", "  raet: 1.0\n  map", ["recording.raet; did you mean recording.rate?"], LOOPS),
    ("  rate: 1000.0\n  map", "  rate: -5\n  map", ["recording.rate is -5", "more than 0", "Hz"], LOOPS),
    ("position: qm", "position: 7", ["recording.map.position is 7", "text"], LOOPS),
    ("seed: 3", "seed: -3", ["seed is -3", "at least 0"], LOOPS),
    ("seed: 3", "sead: 3", ["unknown key sead; did you mean seed?"], ALL),
    ("seed: 3", "seed: 3\nseed: 4", ["seed is given twice", "remove one"], ALL),
    ("seed: 3", "seed: {3", ["is not YAML"], ALL),
]  # fmt: skip

REFERENCES = [
    ("amplitude: 6.0e-5", "amplitude: 2.0e-3", ["reference", "-0.002", "-0.001 to 0.001 m"], LOOPS),
    ("frequency: 2.0, duration: 1.5}\nlim", "frequency: 400.0}\nlim", ["speed reaches", "0.05 m/s"], LOOPS),
    ("speed: 0.05", "acceleration: 1.0e-4", ["acceleration reaches", "0.0001 m/s^2"], LOOPS),
    ("speed: 0.05}", "voltage: 2.0e-3}", ["acceleration reaches", "allowed is 0.004 m/s^2"], LOOPS),
    ("viscous: 8.0", "viscous: 1.0e5", ["speed reaches", "allowed is 0.0004 m/s"], LOOPS),
    ("amplitude: 5.0e-5", "amplitude: 5.0e-3", ["judge.reference", "-0.001 to 0.001 m"], LEARNING),
    ("amplitude: 1.0e-4", "amplitude: 1.0e-2", ["compensate.reference", "0.001 m"], ("compensate",)),
]  # fmt: skip


def each(cases: list[tuple[str, str, list[str], tuple[str, ...]]]) -> list[object]:
    """Each case with each command that it is for; all but one of them slow, a different one each time."""
    return [
        pytest.param(
            command, old, new, says, id=f"{command}-{' '.join(new.split()) or 'without ' + old.strip()}",
            marks=() if i == n % len(commands) else pytest.mark.slow,
        )
        for n, (old, new, says, commands) in enumerate(cases)
        for i, command in enumerate(commands)
    ]  # fmt: skip


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    return with_earlier_results(tmp_path)


@pytest.mark.parametrize(("command", "old", "new", "says"), each(WRONG_KEYS))
def test_a_wrong_key_is_one_line_with_its_line(
    folder: Path, command: str, old: str, new: str, says: list[str]
) -> None:
    assert CONFIG.count(old) == 1
    (folder / "run.yaml").write_text(CONFIG.replace(old, new))
    line = refused(*arguments(command), at=folder, says=says)
    number = int(line.removeprefix("error: run.yaml:").split(":")[0])
    assert number == (OTHER_LINES.get(new) or first_difference(CONFIG, CONFIG.replace(old, new)))


def first_difference(one: str, other: str) -> int:
    """The line, from 1, in which two texts begin to differ."""
    pairs = zip(one.splitlines(), other.splitlines(), strict=False)
    return next(n for n, (a, b) in enumerate(pairs, 1) if a != b)


@pytest.mark.parametrize(("command", "old", "new", "says"), each(REFERENCES))
def test_a_reference_beyond_stage_or_limits_does_not_start(
    folder: Path, command: str, old: str, new: str, says: list[str]
) -> None:
    assert CONFIG.count(old) == 1
    (folder / "run.yaml").write_text(CONFIG.replace(old, new))
    refused(*arguments(command), at=folder, says=["run.yaml:", *says])


@pytest.mark.parametrize("command", LOOPS)
@pytest.mark.parametrize("section", ["reference", "controller", "identify", "stage"])
def test_a_section_that_is_not_there_is_named(folder: Path, command: str, section: str) -> None:
    if (command, section) == ("simulate", "identify"):
        pytest.skip("a simulation needs no model")
    lines = CONFIG.splitlines(keepends=True)
    inside = False
    kept = []
    for line in lines:
        if not line.startswith(" "):
            inside = line.startswith(f"{section}:")
        if not inside:
            kept.append(line)
    text = "".join(kept)
    if section == "reference":
        text = text.replace("compensate:\n", "other:\n").split("other:")[0]
    (folder / "run.yaml").write_text(text)
    refused(*arguments(command), at=folder, says=[section, "is missing"])


@pytest.mark.parametrize("command", LOOPS)
def test_files_that_are_no_configuration(folder: Path, command: str) -> None:
    refused(*arguments(command, "none.yaml"), at=folder, says=["none.yaml: no such file"])
    write(folder / "run.h5", motion(100))
    refused(*arguments(command, "run.h5"), at=folder, says=["run.h5:1: is an HDF5 file"])
    (folder / "empty.yaml").write_text("")
    refused(*arguments(command, "empty.yaml"), at=folder, says=["empty.yaml:1: is empty"])
    refused(*arguments(command, "results"), at=folder, says=["results: cannot be read (is a directory)"])


def test_numbers_without_a_dot_are_numbers(folder: Path) -> None:
    text = CONFIG.replace("resolution: 1.0e-8", "resolution: 1e-8").replace("noise: 1.0e-9", "noise: 1.e-9")
    text = text.replace("reach: 4.0e-6", "reach: 4e-6").replace("range: 6.0e-5", "range: +6e-5")
    (folder / "run.yaml").write_text(text)
    run = rtcomp("simulate", "run.yaml", "--out", "new", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    assert "reach: 4.0e-06" in (folder / "new" / "configuration.yaml").read_text()


MODELS = [
    ("model: interval\nwidths: [1e-6, 0]\nweights: [1, 2]", ":2: ", ["widths[1] is 0 m", "above 0"]),
    ("model: interval\nwidths: [1e-6, -1e-6]\nweights: [1, 2]", ":2: ", ["widths[1] is -1e-06 m", "above 0"]),
    ("model: interval\nwidths: []\nweights: []", ":2: ", ["widths are empty", "at least one"]),
    ("model: interval\nwidhts: [1e-6]\nweights: [1]", ":2: ", ["'widhts'", "did you mean 'widths'?"]),
    ("model: interval\nwidths: [1e-6]\nweigths: [1]", ":3: ", ["'weigths'", "did you mean 'weights'?"]),
    ("model: interval\nwidths: [1e-6]", ":1: ", ["'weights' is missing"]),
    ("model: interval\nwidths: [1e-6]\nweights: [1, 2]", ":3: ", ["1 elements but 2 weights"]),
    ("model: interval\nwidths: [1e-6]\nweights: [stiff]", ":3: ", ["weights[0] is 'stiff'", "a number"]),
    ("model: interval\nwidths: [1e-6]\nweights: [.nan]", ":3: ", ["finite"]),
    ("model: interval\nwidths: 1e-6\nweights: [1]", ":2: ", ["widths is 1e-06", "a list of numbers"]),
    ("model: intervall\nwidths: [1e-6]\nweights: [1]", ":1: ", ["'intervall'", "did you mean 'interval'?"]),
    ("widths: [1e-6]\nweights: [1]", ":1: ", ["model is missing"]),
    ("model: stop\nreaches: [1e-6, -2e-6]\nweights: [1, 1]", ":2: ", ["reaches[1] is -2e-06 m"]),
    ("model: interval\nwidths: [1e-6]\nweights: [1]\nversion: 9", ":4: ", ["version is 9", "version 1"]),
    (
        "model: interval\nwidths: [1e-6]\nweights: [1]\nversion: 0",
        ":4: ",
        ["version is 0", "identify it anew"],
    ),
    (
        "model: interval\nwidths: [1e-6, 1e-99]\nweights: [1, 1]",
        ":2: ",
        ["widths[1] is 1e-99 m", "leave it out"],
    ),
]


@pytest.mark.parametrize(("text", "line", "says"), MODELS)
def test_a_model_that_cannot_be_is_one_line(folder: Path, text: str, line: str, says: list[str]) -> None:
    (folder / "run.yaml").write_text(CONFIG)
    (folder / "model.yaml").write_text(text + "\n")
    refused(*arguments("compensate"), "--model", "model.yaml", at=folder, says=[f"model.yaml{line}", *says])
    indented = "".join(f"    {row}\n" for row in text.splitlines())
    before, rest = CONFIG.split("  friction:\n")
    after = rest[rest.index("  effects:") :]
    (folder / "run.yaml").write_text(f"{before}  friction:\n{indented}{after}")
    refused(*arguments("simulate"), at=folder, says=["run.yaml:", "stage.friction", *says])


@pytest.mark.parametrize("text", ["{model: maxwell-slip, elements: []}", "{model: interval, widths: []}"])
def test_a_friction_model_without_elements_is_refused(folder: Path, text: str) -> None:
    before, rest = CONFIG.split("  friction:\n")
    (folder / "run.yaml").write_text(f"{before}  friction: {text}\n{rest[rest.index('  effects:') :]}")
    line = refused(*arguments("simulate"), at=folder, says=["run.yaml:7: stage.friction"])
    assert any(words in line for words in ("is empty", "0 entries", "are empty"))


def test_every_case_is_tried_on_every_command() -> None:
    counted = [c for _, _, _, commands in itertools.chain(WRONG_KEYS, REFERENCES) for c in commands]
    assert set(counted) == set(ALL)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind: sine\namplitude: 1e-5\nfreqency: 1", ["other.yaml:3: unknown key", "reference.frequency?"]),
        (
            "reference:\n  kind: sine\n  amplitude: 0\n  frequency: 1",
            ["other.yaml:3: reference.amplitude is 0"],
        ),
        (
            "reference: {kind: sine, amplitude: 1, frequency: 1}",
            ["other.yaml:1: reference", "-0.001 to 0.001"],
        ),
    ],
)
def test_a_reference_from_another_file_is_wrong_there(folder: Path, text: str, says: list[str]) -> None:
    (folder / "run.yaml").write_text(CONFIG)
    (folder / "other.yaml").write_text(text + "\n")
    refused(*arguments("simulate"), "--reference", "other.yaml", at=folder, says=says)


@pytest.mark.parametrize(
    ("command", "option", "says"),
    [
        ("identify", ["--seconds", "0"], ["--seconds", "range 0.1<=x"]),
        ("simulate", ["--seconds", "nan"], ["--seconds", "'nan' is not a finite number"]),
        ("simulate", ["--substeps", "0.1"], ["--substeps", "range 1<=x<=1000"]),
        ("compensate", ["--seconds", "0.2"], ["compensate.settle", "0.5 s", "ends at 0.2 s"]),
        ("identify", ["--clock", "vitual"], ["--clock", "'vitual'", "'virtual', 'wall'"]),
        ("identify", ["--map", "position"], ["--map 'position'", "NAME=COLUMN"]),
        ("replay", ["--rate", "inf"], ["'inf' is not a rate", "positive number of Hz"]),
        ("replay", ["--bandwidth", "-1"], ["--bandwidth", "range x>0"]),
    ],
)
def test_options_out_of_range(folder: Path, command: str, option: list[str], says: list[str]) -> None:
    (folder / "run.yaml").write_text(CONFIG)
    refused(*arguments(command), *option, at=folder, says=says)
