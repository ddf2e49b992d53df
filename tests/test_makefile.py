"""The targets that the README names, and what setting up says when it cannot."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")


def run(*command: str, at: Path = TOP, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=at,
        capture_output=True,
        text=True,
        timeout=60,
        env={"PATH": "/usr/bin:/bin", **environment},
    )


def test_make_alone_lists_every_target() -> None:
    listed = [line.split()[1] for line in run("make").stdout.splitlines()]
    assert listed == ["help", "demo", "test", "prove", "check", "bench", "picture", "firmware", "clean"]


@pytest.mark.parametrize(
    "target", ["demo", "test", "prove", "check", "bench", "picture", "firmware", "clean"]
)
def test_every_target_knows_what_to_do(target: str) -> None:
    wanted = run("make", "-n", target)
    assert wanted.returncode == 0, wanted.stderr
    assert wanted.stdout


@pytest.fixture()
def copy(tmp_path: Path) -> Path:
    """A place with what setting up needs, and no environment."""
    (tmp_path / "tools").mkdir()
    for name in ("Makefile", "pyproject.toml", "tools/setup.sh"):
        shutil.copy(TOP / name, tmp_path / name)
    return tmp_path


def test_an_unfit_python_is_refused_in_one_line(copy: Path) -> None:
    refused = run("make", "test", at=copy, PYTHON="/bin/false")
    assert refused.returncode != 0
    assert refused.stderr.splitlines()[0] == (
        "setup: PYTHON=/bin/false is not a Python 3.11 or newer that can make environments"
    )
    assert not (copy / ".venv").exists()


def test_no_python_at_all_is_said(copy: Path, tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("sh", "dirname"):
        (tools / name).symlink_to(str(shutil.which(name)))
    refused = run("/bin/sh", "tools/setup.sh", "dev", at=copy, PATH=str(tools))
    assert refused.returncode != 0
    assert refused.stderr.startswith("setup: no Python 3.11 or newer (python3: none)")
