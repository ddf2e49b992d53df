"""The examples of every command's help run as they stand; `--json` prints one valid document."""

from __future__ import annotations

import gzip
import json
import re
import shlex
import shutil
import subprocess
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import CONFIG, RTCOMP, environment, motion, rtcomp, write
from running import Plant

from rtcomp.cli.main import COMMANDS
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.recording.reader import load

PROJECT = Path(__file__).resolve().parents[2]
REAL_TIME = ("--serial", "--port", "rtcomp hil", "bench loop", "bench link")
SLOW = (*REAL_TIME, "rtcomp trial", "demo --seed", "rtcomp paper")
PATIENCE = 4
"""Times that an example in real time is tried on a machine that is busy with something else."""
LATE = ("no sample in", "no new sample for")
"""Of messages of a loop that gave up, rightly, where this machine kept a process waiting."""
ONCE = ("demo", "diagnose", "trial", "hil", "paper")
"""Commands that take long: run with `--json` only."""


def helped(*command: str) -> list[str]:
    """The example lines of a command's help."""
    run = subprocess.run([RTCOMP, *command, "--help"], capture_output=True, text=True, check=True)
    return re.findall(rf"^ +(rtcomp {' '.join(command)} .*)$", run.stdout, re.MULTILINE)


EXAMPLES = [line for name in COMMANDS for line in helped(name)]


def test_every_command_has_examples() -> None:
    assert {line.split()[1] for line in EXAMPLES} == set(COMMANDS)
    assert helped("plant", "serve") == [line for line in EXAMPLES if line.split()[1] == "plant"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all that the examples name."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(PROJECT / "configs", folder / "configs")
    with (folder / "configs" / "leuven.yaml").open("a") as file:
        file.write("\nloop: {slots_lost: 1000000}\n")  # a machine that tests may be busy with anything
    (folder / "stage.yaml").write_text(CONFIG)
    run = rtcomp("simulate", "stage.yaml", "--out", "first", at=folder)
    assert run.returncode == 0, run.stderr
    (folder / "first" / "recording.h5").rename(folder / "run.h5")
    for config, seconds in (("stage.yaml", 6), ("configs/leuven.yaml", 10)):  # long enough for a diagnosis
        name = Path(config).stem
        run = rtcomp("simulate", config, "--seconds", seconds, "--out", name, at=folder)
        assert run.returncode == 0, run.stderr
    whole = load(folder / "stage" / "recording.h5").columns
    for part, rows in (("a.csv", slice(0, 3000)), ("b.csv", slice(3000, None))):
        text = {"time": whole["time"], "qm": whole["position"], "vir": whole["voltage"]}
        write(folder / part, {key: value[rows] for key, value in text.items()})
    columns = motion()
    named = {"time": columns["time"], "qm": columns["position"], "vir": columns["voltage"]}
    write(folder / "log.mat", named)
    time = np.arange(0.0, 312.5, 1 / 333.0)
    position = 2e-4 * (0.5 + time / 625.0) * np.sin(2 * np.pi * 0.1 * time)
    model = HysteresisModel(IntervalBasis([1e-4, 2e-4, 4e-4]), np.array([900.0, 400.0, 200.0]))
    yaw = {"t_s": time, "position_rad": position, "effort_commanded_Nm": model.response(position)}
    text = write(folder / "yaw.csv", yaw).read_bytes()
    (folder / "yaw.csv.gz").write_bytes(gzip.compress(text, 1))
    for out in ("demo", "leuven", "board"):  # what earlier examples leave for later ones
        (folder / "out" / out).mkdir(parents=True)
    run = rtcomp("identify", "configs/leuven.yaml", "--seconds", "5", "--out", "second", at=folder)
    assert run.returncode == 0, run.stderr
    (folder / "second" / "model.yaml").rename(folder / "model.yaml")
    return folder


def only_finite(text: str) -> Any:
    """The one JSON document that `text` is, without NaN and infinity."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


def ready(folder: Path, example: str) -> list[str]:
    """The words of an example, after what earlier examples were to have left is put in place."""
    words = shlex.split(example)[1:]
    if "out/demo/recording.h5" in words:
        (folder / "out" / "demo" / "recording.h5").write_bytes((folder / "run.h5").read_bytes())
    if words[0] == "diagnose" and "configs/leuven.yaml" in words:  # a recording of that stage
        words[words.index("run.h5")] = "leuven/recording.h5"
    if words[0] == "trial":
        words[words.index("--cases") + 1] = "1"
    if words[0] == "hil":  # every link and fault in full in test_hil.py
        words = [word if word != "all" else "kill" for word in words]
        words += ["--seconds", "3", "--at-least", "5", *([] if "--fault" in words else ["--fault", "kill"])]
    if words[0] == "demo" and "--serial" in words:  # in real time, four runs one after the other
        words += ["--seconds", "12"]
    if words[0] == "paper" and "--quick" not in words:  # in full in bench_paper
        words += ["--quick"]
    for word in words:
        if word.endswith("model.yaml"):
            (folder / word).write_bytes((folder / "model.yaml").read_bytes())
    if "--force" not in words and "--out" in words:
        words.append("--force")
    return words


def marks(line: str) -> list[pytest.MarkDecorator]:
    slow, real_time = (any(w in line for w in words) for words in (SLOW, REAL_TIME))
    return [pytest.mark.slow] * slow + [pytest.mark.realtime] * real_time


@pytest.mark.parametrize(
    "example",
    [pytest.param(line, id=line, marks=marks(line)) for line in EXAMPLES if "plant serve" not in line],
)
def test_an_example_runs_as_it_stands(folder: Path, example: str) -> None:
    words = ready(folder, example)
    for as_json in (False, True) if "--port" not in words and words[0] not in ONCE else (True,):
        given = [*words, "--json"] if as_json and "--json" not in words else words
        if words[0] == "convert":
            (folder / words[2]).unlink(missing_ok=True)
        for _ in range(PATIENCE):
            if "/dev/ttyACM0" in given:
                (folder / "board").mkdir(exist_ok=True)
                with Plant(folder / "board", folder / "configs" / "leuven.yaml") as plant:
                    on_port = [plant.port if word == "/dev/ttyACM0" else word for word in given]
                    run = rtcomp(*on_port, at=folder)
                    plant.stop()
            else:
                run = rtcomp(*given, at=folder, timeout=900.0)
            if not any(message in run.stderr for message in LATE):
                break
        assert (run.returncode, run.stderr) == (0, ""), run.stdout
        if "--json" in given:
            assert only_finite(run.stdout)
        else:
            assert run.stdout.strip()


@pytest.mark.parametrize("example", helped("plant", "serve"))
def test_the_plants_example_serves(folder: Path, example: str) -> None:
    process = subprocess.Popen(
        [RTCOMP, *shlex.split(example)[1:]], cwd=folder, env=environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    late = threading.Timer(60.0, process.kill)
    late.start()
    assert process.stdout is not None
    assert re.fullmatch(r"port: /dev/pts/\d+\n", process.stdout.readline())
    process.terminate()
    output, errors = process.communicate(timeout=30)
    late.cancel()
    assert (process.returncode, output) == (0, "")
    assert only_finite(errors)["zeroings"] == []


def test_figures_that_do_not_exist_are_null(folder: Path) -> None:
    run = rtcomp("identify", "stage.yaml", "run.h5", "--map", "position=position", "--json", at=folder)
    assert run.returncode == 0, run.stderr
    assert only_finite(run.stdout)["held_out_error"] is None
    run = rtcomp("simulate", "stage.yaml", "--voltage", "run.h5", "--out", "open", "--json", at=folder)
    assert only_finite(run.stdout)["tracking_rms_m"] is None
