"""The firmware, built by the system's compiler: a test talks to the process, not to a copy of its rules."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[3] / "drivers" / "firmware"


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with `rtcomp-board` and `rtcomp-board-sanitized`."""
    if shutil.which("make") is None or shutil.which("cc") is None:
        pytest.skip("needs make and a C compiler (cc)")
    folder = tmp_path_factory.mktemp("firmware")
    made = subprocess.run(
        ["make", "-C", str(FIRMWARE), f"BUILD={folder}"], capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
    return folder
