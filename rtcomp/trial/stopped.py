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
    only: str | None = None
    """The kind that all cases are of; None for all kinds."""
    families: list[str] = field(default_factory=lambda: ["micrometre"])
    forms: float | None = None
    not_drawn: dict[str, str] = field(default_factory=dict)
    """Why cases could not be drawn, by case."""
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
            found = cls(**{**content, "ended": ended})
            commitments = json.loads((folder / "commitments.json").read_text(encoding="utf-8"))["commitments"]
            if commitments.keys() != found.salts.keys() or (
                len(found.salts) + len(found.not_drawn) != found.cases
            ):
                raise ValueError("other cases were sealed")
            return found
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise RtcompError(
                f"{folder}: no trial was stopped there ({FILE} or commitments.json is missing or "
                "damaged); give the folder that a stopped trial said it was kept in"
            ) from error

    def bring(self, folder: Path, out: Path) -> None:
        """Copy what was answered, and the commitments, from `folder` to `out`; the rest is made anew.

        A case whose answer is not there any more counts as not diagnosed, and not as one that failed.
        """
        shutil.copy(folder / "commitments.json", out / "commitments.json")
        for step, outcomes in self.ended.items():
            (out / step).mkdir(exist_ok=True)
            for name in list(outcomes):
                log, answer = folder / step / f"{name}.log", folder / step / name
                if not log.is_file() or (outcomes[name].well and not answer.is_dir()):
                    del outcomes[name]
                    continue
                if answer.is_dir():
                    shutil.copytree(answer, out / step / name)
                # Last: without it an answer counts as lost, were this stopped in the middle of one.
                shutil.copy(log, out / step / log.name)
