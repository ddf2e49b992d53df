"""Run configurations: what is refused, in one line with file, line and key; what the rest stands for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from rtcomp.errors import ConfigError, LimitError, RtcompError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.lms import Lms
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.session import make_tick

SHIPPED = Path(__file__).parents[2] / "configs"
TEXT = (SHIPPED / "leuven.yaml").read_text()


def load(tmp_path, *changes):
    text = TEXT
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = tmp_path / "run.yaml"
    path.write_text(text)
    return path, text


def line_of(text, part):
    assert part in text
    return 1 + text[: text.index(part)].count("\n")


LIMITS = "limits: {travel: [-1.0e-3, 1.0e-3], speed: 0.05}"
LEARNER = "learner: {learner: rls, forgetting: 0.9995}"
REFUSED = {
    "limits that are no section": (LIMITS, "limits: 3", "limits:", "limits"),
    "unknown limit": (LIMITS, "limits: {sped: 0.05}", "limits:", "speed"),
    "travel the wrong way round": (LIMITS, "limits: {travel: [1e-3, -1e-3]}", "limits:", "travel"),
    "travel of one number": (LIMITS, "limits: {travel: [1e-3]}", "limits:", "travel"),
    "travel of nan": (LIMITS, "limits: {travel: [.nan, 1e-3]}", "limits:", "travel"),
    "no speed": (LIMITS, "limits: {speed: 0}", "limits:", "speed"),
    "negative slew": (LIMITS, "limits: {slew: -1}", "limits:", "slew"),
    "voltage above the stage's": (LIMITS, "limits: {voltage: 10.5}", "limits:", "voltage_limit"),
    "range and widths": ("range: 1.0e-4 ", "widths: [1e-6]\n  range: 1.0e-4 ", "  range:", "widths"),
    "neither range nor widths": ("range: 1.0e-4 ", "# range ", "identify:", "range"),
    "no range": ("range: 1.0e-4 ", "range: 0 ", "  range:", "range"),
    "a negative width": ("range: 1.0e-4 ", "widths: [1e-6, -2e-6] # ", "  widths:", "widths"),
    "no widths": ("range: 1.0e-4 ", "widths: [] # ", "  widths:", "widths"),
    "no intervals": ("intervals: 20", "intervals: 0", "  intervals:", "intervals"),
    "half an interval": ("intervals: 20", "intervals: 20.5", "  intervals:", "intervals"),
    "unknown basis": ("identify:\n", "identify:\n  model: intervall\n", "  model:", "interval"),
    "unknown learner": (LEARNER, "learner: {learner: rsl}", "  learner:", "rls"),
    "unknown setting": (LEARNER, "learner: {learner: rls, forget: 1.0}", "  learner:", "forgetting"),
    "forgetting beyond one": (
        LEARNER,
        "learner: {learner: rls, forgetting: 1.5}",
        "  learner:",
        "forgetting",
    ),
    "prior that is none": ("prior: non-increasing", "prior: increasing", "  prior:", "non-increasing"),
    "prior of another basis": ("identify:\n", "identify:\n  model: stop\n", "  prior:", "interval"),
    "negative gate": ("gate: 5.0e-8", "gate: -5.0e-8", "  gate:", "gate"),
    "learning that ends first": ("gate: 5.0e-8 ", "learn: [5.0, 2.0]\n  gate: 5.0e-8 ", "  learn:", "learn"),
    "learning for no time": ("gate: 5.0e-8 ", "learn: [5.0, 5.0]\n  gate: 5.0e-8 ", "  learn:", "learn"),
    "judging that ends first": ("judge: ", "judge: {window: [9.0, 2.0]} # ", "judge:", "window"),
    "an unknown section": ("identify:\n", "identfy:\n", "identfy:", "identify"),
    "an unknown clock": ("seed", "clock: sundial\nseed", "clock:", "clock"),
    "an unknown driver": ("seed", "device: {driver: simulatd}\nseed", "device:", "simulated"),
    "a reference of an unknown kind": ("kind: triangle", "kind: triangel", "reference:", "triangle"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_refused_with_file_line_and_key(what, tmp_path):
    old, new, at, holds = REFUSED[what]
    if what == "judging that ends first":
        start = TEXT.index("judge:")
        old = TEXT[start : TEXT.index("compensate:")]
        new = "judge: {window: [9.0, 2.0]}\n"
    if old == "seed":
        old, new = "limits: {travel", new.replace("seed", "limits: {travel")
    path, text = load(tmp_path, (old, new))
    with pytest.raises(RtcompError) as caught:
        config = Configuration.load(path)
        config.reference()
        from rtcomp.jobs.session import make_device

        make_device(config)
    says = str(caught.value)
    assert "\n" not in says and holds in says, says
    assert says.startswith(f"{path}:{line_of(text, at)}: "), says


@pytest.mark.parametrize(
    ("what", "change", "holds"),
    [
        ("reference", ("amplitude: 6.0e-5", "amplitude: 2.0e-3"), "stroke"),
        ("reference", ("speed: 0.05", "speed: 1e-4"), "speed"),
        ("reference", ("speed: 0.05", "acceleration: 1e-9"), "acceleration"),
        ("compensate", ("[2.0e-4, 6.0e-5, 1.5e-5]", "[9.0e-4, 2.0e-4, 1.5e-5]"), "stroke"),
        ("compensate", ("[0.3, 0.8, 2.1]", "[30, 80, 210]"), "speed|acceleration"),
        ("judge", ("amplitude: 5.0e-5", "amplitude: 5.0e-3"), "stroke"),
    ],
)
def test_a_motion_beyond_the_limits_does_not_start(what, change, holds, tmp_path):
    path, text = load(tmp_path, change)
    config = Configuration.load(path)
    with pytest.raises(LimitError, match=holds) as caught:
        config.reference("" if what == "reference" else what)
    says = str(caught.value)
    assert "\n" not in says and says.startswith(f"{path}:")
    line = int(says[len(f"{path}:") :].split(":")[0])
    assert line in (line_of(text, f"{what}:"), line_of(text, f"{what}:") + 1)


def test_settling_for_longer_than_the_run_is_refused(tmp_path):
    path, _ = load(tmp_path, ("compensate:                  ", "compensate:\n  settle: 20.0 #"))
    with pytest.raises(ConfigError, match="settle"):
        Configuration.load(path).reference("compensate")


def test_missing_sections_are_named_where_they_are_needed(tmp_path):
    data = yaml.safe_load(TEXT)
    only_stage = {key: data[key] for key in ("stage", "sensor", "rate")}
    path = tmp_path / "run.yaml"
    path.write_text(yaml.safe_dump(only_stage))
    config = Configuration.load(path)
    for ask, says in (
        (config.reference, "reference is missing"),
        (lambda: config.identify, "identify is missing"),
        (lambda: make_tick(config, 0), "controller is missing"),
    ):
        with pytest.raises(ConfigError, match=says):
            ask()


@pytest.mark.parametrize("name", [p.name for p in sorted(SHIPPED.glob("*.yaml"))])
def test_shipped_configurations_are_good(name):
    config = Configuration.load(SHIPPED / name)
    assert config.stage.mass > 0
    if config.run.identify is not None:
        assert config.basis().size >= 1 and config.learner() is not None
    for section in ("", "judge", "compensate"):
        if (getattr(config.run, section) if section else config.run).reference is not None:
            assert config.reference(section).duration > 0


def test_what_it_stands_for(leuven):
    assert leuven.period == 1e-3 and leuven.voltage_limit == 10.0 and not leuven.wall_clock
    basis = leuven.basis()
    assert isinstance(basis, IntervalBasis) and basis.size == 20
    assert basis.widths.sum() == pytest.approx(1e-4)
    assert basis.widths[-1] / basis.widths[0] == pytest.approx(4.0)
    widths = [1e-6, 3e-6]
    given = leuven.changed(identify={"widths": widths, "learner": {"learner": "lms", "step": 0.1}})
    assert np.array_equal(given.basis().widths, widths) and isinstance(given.learner(), Lms)
    assert leuven.changed(limits={"voltage": 5.0}).voltage_limit == 5.0


def test_the_clock_follows_the_device_unless_told(leuven):
    serial = {"driver": "serial", "port": "/dev/null"}
    assert leuven.changed(device=serial).wall_clock
    assert not leuven.changed(device=serial, clock="virtual").wall_clock
    assert leuven.changed(clock="wall").wall_clock
