"""The installed command `rtcomp`: help, usage errors, and how every kind of failure ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from rtcomp import __version__
from rtcomp.cli.main import COMMANDS
from rtcomp.errors import ConfigError

RTCOMP = str(Path(sys.executable).parent / "rtcomp")
HEAVY = ("numba", "numpy", "scipy", "h5py", "plotly", "pydantic", "yaml", "rich", "serial", "rtcomp_drivers")


def rtcomp(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [RTCOMP, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "RTCOMP_DEBUG": "", **environment},
    )


def start_python(source: str, **environment: str) -> subprocess.Popen[str]:
    """Run the function `body` that `source` defines as a command `rtcomp probe`, in a process of its own."""
    program = f"""import click, sys
from rtcomp.cli import main
from rtcomp import errors
{source}
class Module: probe = staticmethod(click.command()(body))
sys.modules["probe_module"] = Module
main.cli.table["probe"] = ("probe_module:probe", "A probe.")
sys.argv = ["rtcomp", "probe"]
main.main()
"""
    return subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "RTCOMP_DEBUG": "", **environment},
    )


def run_python(source: str, **environment: str) -> tuple[int, str, str]:
    """Return status, standard output and standard error of the command made of `source`'s function `body`."""
    process = start_python(source, **environment)
    output, errors = process.communicate(timeout=60)
    return process.returncode, output, errors


def test_help_lists_every_command_and_imports_none() -> None:
    run = subprocess.run(
        [sys.executable, "-X", "importtime", RTCOMP, "--help"], capture_output=True, text=True, timeout=60
    )
    assert run.returncode == 0
    for name, (_, says) in COMMANDS.items():
        assert re.search(rf"^  {name} +{re.escape(says)}$", run.stdout, re.MULTILINE), name
    imported = {line.rsplit("|", 1)[-1].strip() for line in run.stderr.splitlines()}
    assert "rtcomp.cli.main" in imported  # the list is what it seems to be
    assert not {module for module in imported if module.split(".")[0] in HEAVY}
    assert not imported & {target.partition(":")[0] for target, _ in COMMANDS.values()}


@pytest.mark.parametrize("arguments", [(), ("-h",), ("--help",)])
def test_without_a_command_help_is_shown(arguments: Sequence[str]) -> None:
    run = rtcomp(*arguments)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.startswith("Usage: rtcomp [OPTIONS] COMMAND")


def test_version() -> None:
    assert rtcomp("--version").stdout == f"rtcomp {__version__}\n"


def test_the_package_is_the_command() -> None:
    module = [sys.executable, "-m", "rtcomp"]
    run = subprocess.run([*module, "simlate"], capture_output=True, text=True, timeout=60, check=False)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == "error: no command 'simlate'; did you mean simulate? see rtcomp --help\n"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("simlate",), "error: no command 'simlate'; did you mean simulate? see rtcomp --help\n"),
        (("xyzzy",), f"error: no command 'xyzzy'; there are {', '.join(COMMANDS)}; see rtcomp --help\n"),
        (("--versoin",), "error: no option --versoin; did you mean --version? see rtcomp --help\n"),
        (("drivers", "--jsn"), "error: no option --jsn; did you mean --json? see rtcomp drivers --help\n"),
        (("drivers", "--zzz"), "error: no option --zzz; see rtcomp drivers --help\n"),
        (("convert",), "error: missing argument 'SOURCE'; see rtcomp convert --help\n"),
    ],
)
def test_usage_errors_are_one_line_with_the_nearest(arguments: Sequence[str], says: str) -> None:
    run = rtcomp(*arguments)
    assert (run.returncode, run.stdout, run.stderr) == (2, "", says)


@pytest.mark.parametrize(
    ("body", "status", "says"),
    [
        ("raise errors.ConfigError('a.yaml:3: mass\\nis wrong')", 2, "error: a.yaml:3: mass is wrong"),
        ("raise errors.DeviceTimeoutError('no answer on /dev/x')", 2, "error: no answer on /dev/x"),
        ("raise errors.DeviceError(32, 'Broken pipe')", 2, "error: [Errno 32] Broken pipe"),
        ("open('/no/such/file')", 2, "error: /no/such/file: no such file or directory"),
        ("raise KeyboardInterrupt", 130, "interrupted"),
        (
            "1 / 0",
            70,
            "error: internal error (ZeroDivisionError: division by zero); set RTCOMP_DEBUG=1 to see where",
        ),
        (
            "raise BrokenPipeError('a socket')",
            70,
            "error: internal error (BrokenPipeError: a socket); set RTCOMP_DEBUG=1 to see where",
        ),
    ],
)
def test_every_failure_is_one_line_and_a_status(body: str, status: int, says: str) -> None:
    run = run_python(f"def body(): {body}\n")
    assert run == (status, "", says + "\n")


def test_a_note_on_an_error_is_said_in_the_same_line() -> None:
    source = """def body():
        error = errors.DeviceError("the drive is gone")
        error.add_note("kept in out.failed")
        raise error
    """
    run = run_python(source)
    assert run == (2, "", "error: the drive is gone; kept in out.failed\n")


@pytest.mark.parametrize(("body", "status"), [("1 / 0", 70), ("raise errors.LimitError('too far')", 2)])
def test_debug_shows_the_traceback(body: str, status: int) -> None:
    got, _, errors = run_python(f"def body(): {body}\n", RTCOMP_DEBUG="1")
    assert got == status
    assert "Traceback (most recent call last)" in errors


def test_a_reader_that_goes_away_ends_it_quietly() -> None:
    process = start_python("def body():\n  for i in range(1_000_000): click.echo('a line')\n")
    assert process.stdout is not None and process.stderr is not None
    assert process.stdout.readline() == "a line\n"
    process.stdout.close()
    assert process.wait(timeout=60) == 141
    assert process.stderr.read() == ""
    process.stderr.close()


def test_an_interrupt_from_the_keyboard_is_one_line() -> None:
    source = "import os, signal, time\ndef body():\n  os.kill(os.getpid(), signal.SIGINT)\n  time.sleep(30)\n"
    assert run_python(source) == (128 + signal.SIGINT, "", "interrupted\n")


DROPPED = """import os, signal, time
class Late:
    def __del__(self):
        os.kill(os.getpid(), signal.{name})
        time.sleep(0.01)  # what the handler raises is raised in here, and Python drops it
def body():
    Late()
    for _ in range(3000):
        time.sleep(0.01)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_python_drops_is_not_lost(number: signal.Signals) -> None:
    assert run_python(DROPPED.format(name=number.name)) == (128 + number, "", "interrupted\n")


@pytest.mark.parametrize("name", COMMANDS)
def test_every_commands_help_shows_an_example(name: str) -> None:
    run = rtcomp(name, "--help")
    assert (run.returncode, run.stderr) == (0, "")
    assert re.search(rf"^  +rtcomp {name}\b", run.stdout, re.MULTILINE)


def test_shared_options_refuse_what_makes_no_sense() -> None:
    from rtcomp.cli.options import map_option, output_options, rate_option

    @click.command()
    @output_options()
    @map_option
    @rate_option
    def probe(out: Path, force: bool, mapping: dict[str, str], rate: float | None) -> None:
        click.echo(f"{out} {force} {mapping} {rate}")

    def said(*arguments: str) -> str:
        result = CliRunner().invoke(probe, ["--out", "x", *arguments])
        return str(result.exception) if isinstance(result.exception, ConfigError) else result.output

    assert said("--rate", "1e3") == "x False {} 1000.0\n"
    assert said("--map", "position=qm", "--map", "voltage=v i") == (
        "x False {'position': 'qm', 'voltage': 'v i'} None\n"
    )
    for bad in ("position", "=qm", "position= "):
        assert said("--map", bad).startswith(f"--map {bad!r}: ")
    assert "'position' is mapped twice" in said("--map", "position=a", "--map", "position=b")
    for bad in ("0", "-1", "nan", "inf", "fast"):
        assert "is not a rate; give a positive number of Hz" in said("--rate", bad)
