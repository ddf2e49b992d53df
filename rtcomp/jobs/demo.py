"""The demonstration: one stage identified and compensated, live first, then step by step."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtcomp.errors import ConfigError, Interrupted
from rtcomp.jobs.compensate import Compensated, compensate, live
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import Identified, identify
from rtcomp.jobs.session import Run, Watch, check

SWITCH_AT, FADE = 6.0, 0.5
"""s: when the live run begins to feed forward, and how long that takes to its full share."""


@dataclass(frozen=True)
class Demonstrated:
    """A live run (learning from the start, feedforward from `SWITCH_AT` on), then both jobs in order."""

    live: Run
    identified: Identified
    compensated: Compensated

    def summary(self) -> dict[str, Any]:
        """Return the figures of both jobs, for `--json` and the result file."""
        return {"identify": self.identified.summary(), "compensate": self.compensated.summary()}


def demo(config: Configuration, *, out: Path | None = None, watch: Watch | None = None) -> Demonstrated:
    """Run the demonstration; with `out`, every run is recorded there."""
    check(config, "", "judge", "compensate")
    path = None if out is None else out / "live.h5"
    first = live(config, SWITCH_AT, FADE, path=path, watch=watch)
    identified = identify(config, out=out, watch=watch)
    if identified.signal is not None:
        raise Interrupted(identified.signal, "stopped before compensating")
    return Demonstrated(first, identified, compensate(config, identified.model, out=out, watch=watch))


def shipped(name: str) -> Path:
    """Return the path of a configuration that comes with the program, or raise ConfigError."""
    package = Path(__file__).parents[1]
    for folder in (package / "configs", package.parent / "configs"):
        if (folder / name).is_file():
            return folder / name
    raise ConfigError(f"{name}: does not come with this installation; see configs/ of the project")
