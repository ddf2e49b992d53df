"""A trial that was stopped and goes on later: what its folder must keep for that.

Salts and seed are written only when no diagnosis runs any more. Whoever goes on writes to a folder of its
own, in which they do not lie.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rtcomp.errors import RtcompError
from rtcomp.trial.run import Outcome

FILE = "stopped.json"


@dataclass
class Stopped:
    """What a trial had done: of which cases, their salts, and how tasks ended, by step and case."""

    cases: int
    seed: int
    seconds: float = 0.0
    salts: dict[str, str] = field(default_factory=dict)
    """Hexadecimal, by case; empty where the trial was stopped before it had sealed."""
    ended: dict[str, dict[str, Outcome]] = field(default_factory=dict)

    def write(self, folder: Path) -> None:
        """Write what a later trial needs to go on; nothing where none was sealed yet."""
        if self.salts:
            (folder / FILE).write_text(json.dumps(asdict(self)) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, folder: Path) -> Stopped:
        """Return what the trial in `folder` had done; raise RtcompError where none was stopped there."""
        try:
            content: dict[str, Any] = json.loads((folder / FILE).read_text(encoding="utf-8"))
            ended = {
                step: {name: Outcome(**outcome) for name, outcome in outcomes.items()}
                for step, outcomes in content["ended"].items()
            }
            return cls(**{**content, "ended": ended})
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise RtcompError(
                f"{folder}: no trial was stopped there ({FILE} is missing or damaged); give the folder that "
                "a stopped trial said it was kept in"
            ) from error

    def bring(self, folder: Path, out: Path) -> None:
        """Copy what was answered, and the commitments, from `folder` to `out`; the rest is made anew."""
        shutil.copy(folder / "commitments.json", out / "commitments.json")
        for step, outcomes in self.ended.items():
            (out / step).mkdir(exist_ok=True)
            for name in outcomes:
                _copy(folder / step / name, out / step / name)
                _copy(folder / step / f"{name}.log", out / step / f"{name}.log")


def _copy(old: Path, new: Path) -> None:
    if old.is_dir():
        shutil.copytree(old, new)
    elif old.is_file():
        shutil.copy(old, new)
