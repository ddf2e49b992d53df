"""`rtcomp bench` end to end at its shortest: the tables say what the JSON says, wrong words are one line."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
from command import RTCOMP, rtcomp

SHORT = {
    "loop": ("--rate", "500", "--seconds", "0.5"),
    "link": ("--plant", "--rate", "250", "--seconds", "0.5"),
    "tick": ("--ticks", "1000"),
}


@pytest.mark.parametrize("what", SHORT)
def test_it_runs_and_prints_a_table(what: str, tmp_path: Path) -> None:
    run = rtcomp("bench", what, *SHORT[what], at=tmp_path)
    assert (run.returncode, run.stderr) == (0, ""), run.stdout
    assert "p50" in run.stdout and "p99.9" in run.stdout
    assert list(tmp_path.iterdir()) == []  # it leaves nothing behind


def test_the_loop_in_json(tmp_path: Path) -> None:
    run = rtcomp(
        "bench", "loop", *SHORT["loop"], "--rate", "1000", "--busy", "--priority", "20", "--json", at=tmp_path
    )
    assert (run.returncode, run.stderr) == (0, "")
    told = json.loads(run.stdout)
    assert [at["rate_hz"] for at in told["rates"]] == [500.0, 1000.0] and told["busy"] is True
    for at in told["rates"]:
        assert {"loop", "plain Python"} <= set(at["runners"])
        for figures in at["runners"].values():
            assert figures["p50_us"] <= figures["p99_us"] <= figures["p999_us"] <= figures["max_us"]
            assert figures["missed"] >= 0 and figures["wake_ups"] > 0


@pytest.mark.slow
def test_the_loop_over_a_serial_link(tmp_path: Path) -> None:
    run = rtcomp("bench", "loop", *SHORT["loop"], "--serial", "--json", at=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    assert json.loads(run.stdout)["link"] == "serial"


def test_the_link_in_json(tmp_path: Path) -> None:
    run = rtcomp("bench", "link", *SHORT["link"], "--json", at=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    told = json.loads(run.stdout)
    assert told["driver"]["round_trips"] == told["raw"]["round_trips"] == 125
    assert told["ratios"]["p50"] == pytest.approx(told["driver"]["p50_us"] / told["raw"]["p50_us"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("loop", "--rate", "-5"), "-5' is not a rate"),
        (("loop", "--rate", "nan"), "not a rate"),
        (("loop", "--seconds", "0"), "0.1<=x"),
        (("loop", "--priority", "99"), "1<=x<=98"),
        (("loop", "--config", "none.yaml"), "none.yaml"),
        (("loop", "--firmware", "board"), "give --serial too"),
        (("link",), "give either --port PORT of a board or --plant"),
        (("link", "--plant", "--port", "/dev/ttyACM0"), "give either --port PORT of a board or --plant"),
        (("link", "--port", "/dev/null-modem"), "then give --armed"),
        (("link", "--port", "/dev/null-modem", "--armed"), "/dev/null-modem does not exist"),
        (("link", "--port", "x", "--armed", "--firmware", "board"), "give --plant too"),
        (("tick", "--ticks", "10"), "1000<=x"),
        (("lop",), "lop"),
    ],
)
def test_what_does_not_fit_is_one_line(words: tuple[str, ...], says: str, tmp_path: Path) -> None:
    run = rtcomp("bench", *words, at=tmp_path)
    assert run.returncode == 2 and run.stdout == ""
    assert run.stderr.count("\n") == 1 and run.stderr.startswith("error: ") and says in run.stderr


def helped(*command: str) -> str:
    return subprocess.run([RTCOMP, *command, "--help"], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("what", [pytest.param("loop", marks=pytest.mark.slow), "link", "tick"])
def test_every_example_is_accepted_as_written(what: str, tmp_path: Path) -> None:
    """Shortened, and with a plant in the place of a board."""
    examples = re.findall(rf"^ +rtcomp (bench {what}.*)$", helped("bench", what), re.MULTILINE)
    assert examples
    for example in examples:
        words = example.split()
        if "--port" in words:
            at = words.index("--port")
            words[at : at + 3] = ["--plant"]
        if "--seconds" in words:
            words[words.index("--seconds") + 1] = "0.5"
        elif what != "tick":
            words += ["--seconds", "0.5"]
        run = rtcomp(*words, at=tmp_path)
        assert (run.returncode, run.stderr) == (0, ""), example
