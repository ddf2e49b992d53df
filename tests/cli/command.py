"""The installed `rtcomp` run as a user runs it, and what unusable input must and must not do."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from on_terminal import on_terminal
from warm_command import Warm

_WARM = Warm()
RTCOMP = str(Path(sys.executable).parent / "rtcomp")

CONFIG = """\
stage:
  mass: 2.0
  force_constant: 4.0
  voltage_limit: 10.0
  viscous: 8.0
  micro_damping: 250.0
  friction:
    - {stiffness: 1.0e5, reach: 4.0e-6}
    - {stiffness: 6.0e4, reach: 1.2e-5}
    - {stiffness: 3.0e4, reach: 3.0e-5}
  effects:
    - {name: constant-force, force: 0.1}
    - {name: cogging, amplitude: 0.1, period: 1.0e-3}
    - name: cogging
      amplitude: 0.1
      period: 2.0e-3
      harmonics:
        - {order: 2, amplitude: 0.01}
        - {order: 3, amplitude: 0.02}
sensor: {noise: 1.0e-9, resolution: 1.0e-8}
controller: {kp: 2.0e4, ki: 2.0e5, kd: 100.0}
rate: 1000.0
reference: {kind: triangle, amplitude: 6.0e-5, frequency: 2.0, duration: 1.5}
limits: {age: 10.0, travel: [-1.0e-3, 1.0e-3], speed: 0.05}
loop: {slots_lost: 1000000}
device: {driver: simulated, delay_ticks: 0}
identify:
  intervals: 6
  range: 6.0e-5
  learner: {learner: rls, forgetting: 0.9995}
  smoothing: 100.0
  gate: 5.0e-8
judge:
  settle: 0.1
  reference: {kind: multisine, amplitude: 5.0e-5, band: {low: 1.0, high: 4.0, count: 4}, duration: 1.5}
compensate:
  settle: 0.5
  reference: {kind: sine, amplitude: 1.0e-4, frequency: 2.0, duration: 1.5}
recording:
  rate: 1000.0
  map: {position: qm}
seed: 3
"""
"""A run configuration with every section in it."""


def rtcomp(*arguments: object, at: Path, timeout: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Run `rtcomp` in the folder `at`."""
    return _WARM.run([str(a) for a in arguments], at, environment(), timeout)


def environment() -> dict[str, str]:
    """The environment of every command here: no debugging."""
    return {**os.environ, "RTCOMP_DEBUG": ""}


def listing(folder: Path) -> dict[str, bytes | None]:
    """Every file below `folder` with its content, and every folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


def one_error_line(run: subprocess.CompletedProcess[str], says: Iterable[str] = ()) -> str:
    """Check that a command ended as unusable input must; return its line."""
    assert run.returncode == 2, (run.returncode, run.stdout, run.stderr)
    assert run.stdout == ""
    assert run.stderr.startswith("error: ") and run.stderr.endswith("\n")
    assert run.stderr.count("\n") == 1 and "Traceback" not in run.stderr
    for words in says:
        assert words in run.stderr, f"{words!r} is not in {run.stderr!r}"
    return run.stderr


def refused(*arguments: object, at: Path, says: Iterable[str] = ()) -> str:
    """Check that a command ends in one line and leaves the folder exactly as it was; return the line."""
    before = listing(at)
    line = one_error_line(rtcomp(*arguments, at=at), says)
    assert listing(at) == before
    return line


def motion(rows: int = 600, rate: float = 1000.0) -> dict[str, np.ndarray]:
    """A recording of an axis that follows a sine."""
    time = np.arange(rows) / rate
    chance = np.random.default_rng(1)
    reference = 1e-4 * np.sin(2 * np.pi * 3.0 * time)
    return {
        "time": time,
        "reference": reference,
        "position": reference + 2e-8 * chance.standard_normal(rows),
        "voltage": 2.0 * np.cos(2 * np.pi * 3.0 * time) + 1e-3 * chance.standard_normal(rows),
    }


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Write a recording in the format that `path` names; ``.73.mat`` is MATLAB 7.3."""
    if path.name.endswith((".h5", ".73.mat")):
        import h5py

        matlab = path.suffix == ".mat"
        with h5py.File(path, "w", userblock_size=512 if matlab else 0) as file:
            for name, column in columns.items():
                file[name] = column[None, :] if matlab else column
                if matlab:
                    file[name].attrs["MATLAB_class"] = np.bytes_("double")
        if matlab:
            with path.open("r+b") as raw:
                raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    elif path.suffix == ".mat":
        from scipy.io import savemat

        savemat(path, columns, oned_as="column")
    else:
        np.savetxt(
            path, np.column_stack([*columns.values()]), "%.17g", ",", header=",".join(columns), comments=""
        )
    return path


def in_a_terminal(*arguments: object, at: Path) -> str:
    """Run `rtcomp` in the folder `at` on a terminal 100 columns wide; return all that it showed."""
    command = [RTCOMP, *map(str, arguments)]
    return on_terminal(command, at=at, environment={**environment(), "TERM": "xterm"}, columns=100).text


def arguments(command: str, config: str = "run.yaml") -> list[str]:
    """What is given to `command` so that it reads `config`."""
    if command == "replay":
        return ["replay", "recording.csv", "--stage", config, "--out", "replay.csv", "--json"]
    if command == "plant":
        return ["plant", "serve", "--config", config, "--json"]
    return [command, config, "--out", "results", "--force", "--json"]


def with_earlier_results(path: Path) -> Path:
    """Fill a folder with a recording and the results of earlier runs, which must survive; return it."""
    (path / "results").mkdir()
    (path / "results" / "recording.h5").write_bytes(b"of an earlier run")
    (path / "results" / "model.yaml").write_text("of an earlier run\n")
    write(path / "recording.csv", motion(100))
    return path
