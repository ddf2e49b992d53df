"""Hardware in the loop without the hardware: identify, compensate and faults, over each link in real time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rtcomp.errors import ConfigError, Interrupted
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.compensate import Compensated, compensate
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.hil_device import device_on, patient, plant_on
from rtcomp.jobs.hil_faults import Seen, provoke
from rtcomp.jobs.identify import Identified, identify
from rtcomp.jobs.session import Run, Watch, check, make_device
from rtcomp.loop.states import State
from rtcomp.stage.stage import Stage

SAME_MODEL = 0.02
"""Share of the largest force by which the virgin curves of two links may differ."""

RECOVERY_S = 0.3
"""s after a lost slot or DEGRADED until feedforward has faded back and feedback has made up for it."""
LEAST_KEPT = 0.2
"""Share of a run, with deadlines kept for so long, from which it is judged."""
ATTEMPTS = 3
"""Times that compensating is tried on a machine that leaves less than that."""


@dataclass(frozen=True)
class Verdict:
    """One line of the table."""

    link: str
    what: str
    required: str
    seen: str
    good: bool


@dataclass(frozen=True)
class Tracked:
    """Identify and compensate over one link."""

    link: str
    identified: Identified
    compensated: Compensated
    attempts: int = 1
    """Times that it was compensated; what counts is the last."""

    @property
    def kept(self) -> tuple[float, float]:
        """Rms tracking error without over with, and the share of the rows that it is of: the same in both.

        Left out is what follows missed deadlines in the run with feedforward, which judges the machine; of
        the run without also what follows them there, which would flatter.
        """
        without, with_it = self.compensated.without, self.compensated.with_it
        counts = with_it.columns["time"] >= self.compensated.config.run.compensate.settle
        good = counts & undisturbed(with_it)
        rms = []
        for run in (without, with_it):
            rows = good & undisturbed(run) & run.measured
            error = (run.columns["reference"] - run.columns["position"])[rows]
            rms.append(float(np.sqrt(np.mean(error**2))) if error.size else np.nan)
        return rms[0] / rms[1], int(good.sum()) / max(1, int(counts.sum()))

    def missed(self) -> dict[str, int]:
        """Return ticks, and how many of them came late, were lost, or had no new sample."""
        runs = [self.identified.run, self.compensated.without, self.compensated.with_it]
        return {
            "ticks": sum(len(run.columns["time"]) for run in runs),
            "late": sum(run.outcome.late for run in runs),
            "slots_lost": sum(run.outcome.lost for run in runs),
            "samples_missed": sum(int(np.count_nonzero(run.columns["status"])) for run in runs),
            "degraded": sum(run.outcome.degraded for run in runs),
        }


@dataclass
class Hil:
    """Everything that was seen, and the verdicts on it."""

    tracked: list[Tracked] = field(default_factory=list)
    faults: list[Seen] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)

    @property
    def holds(self) -> bool:
        """Whether every verdict is good."""
        return all(verdict.good for verdict in self.verdicts)

    def summary(self) -> dict[str, Any]:
        """Return it as a document."""
        return {
            "holds": self.holds,
            "links": {
                one.link: {
                    "improvement": one.kept[0],
                    "improvement_over": one.kept[1],
                    "attempts": one.attempts,
                    "improvement_with_missed_slots": one.compensated.improvement,
                    "tracking_rms_without_m": one.compensated.error_without.rms,
                    "tracking_rms_with_m": one.compensated.error_with.rms,
                    **one.missed(),
                }
                for one in self.tracked
            },
            "verdicts": [vars(verdict) for verdict in self.verdicts],
        }


def hil(
    config: Configuration,
    stage: Path,
    links: Sequence[str],
    faults: Sequence[str],
    *,
    watchdog: float,
    patience: float,
    at_least: float,
    seed: int = 0,
    out: Path | None = None,
    watch: Watch | None = None,
    tell: Callable[[Verdict], None] = lambda _: None,
) -> Hil:
    """Run `config` over each of `links` against plant servers with the stage in the file `stage`.

    Identify and compensate have `patience` (s) with a busy machine, as watchdog and as age of a sample; the
    faults are provoked with `watchdog` (s). The tracking error must fall by `at_least`. With `out`, the
    recordings of each link are written to a folder there. Raises what the jobs raise.
    """
    needed(config)
    friction_in(stage)
    for link in links:  # a package that is missing is missed before the first link has run
        make_device(config.changed(device=device_on(link, "/dev/null", patience, config.stage.axis)))
    found = Hil()

    def verdict(link: str, what: str, required: str, seen: str, good: bool) -> None:
        found.verdicts.append(Verdict(link, what, required, seen, bool(good)))
        tell(found.verdicts[-1])

    for link in links:
        folder = None if out is None else out / link
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        one = track(config, stage, link, patience, seed, folder, watch)
        found.tracked.append(one)
        verdict(link, *_smaller(one, at_least))
        verdict(link, "slots and samples missed", "told", _told(one.missed()), True)
        if link != links[0]:
            apart = difference(found.tracked[0].identified.model, one.identified.model)
            verdict(
                link, f"model as over {links[0]}", f"<= {100 * SAME_MODEL:g} %", f"{100 * apart:.2f} %",
                apart <= SAME_MODEL,
            )  # fmt: skip
        for fault in faults:
            seen = provoke(config, stage, link, fault, watchdog, one.identified.model, seed)
            found.faults.append(seen)
            for what, required, was, good in seen.verdicts:
                verdict(link, f"{fault}: {what}", required, was, good)
    return found


def needed(config: Configuration) -> None:
    """Raise ConfigError or LimitError for a configuration that this cannot be done with."""
    config.identify  # noqa: B018 -- raises where the section is missing
    check(config.changed(device={"driver": "simulated", "delay_ticks": 1}), "", "compensate")


def track(
    config: Configuration,
    stage: Path,
    link: str,
    patience: float,
    seed: int = 0,
    out: Path | None = None,
    watch: Watch | None = None,
) -> Tracked:
    """Identify over `link`, then compensate, against a plant server of its own. Raises what these raise."""
    with plant_on(link, stage, patience, seed=seed) as plant:
        device = device_on(link, plant.port, patience, config.stage.axis, prove=False)
        here = patient(config, device, patience)
        learned = identify(here.changed(judge={}), out=out, watch=watch)
        if learned.signal is not None:
            raise Interrupted(learned.signal, f"stopped while identifying over {link}")
        for attempt in range(1, ATTEMPTS + 1):
            if out is not None:
                for name in ("without.h5", "with.h5"):
                    (out / name).unlink(missing_ok=True)
            one = Tracked(link, learned, compensate(here, learned.model, out=out, watch=watch), attempt)
            if one.kept[1] >= LEAST_KEPT:
                break
    return one


def difference(one: HysteresisModel, other: HysteresisModel) -> float:
    """Return how far the virgin curve of `other` is from that of `one`, of its largest force."""
    basis = one.basis
    if isinstance(basis, IntervalBasis):
        travel, ours = one.virgin_curve()
        theirs = other.virgin_curve()[1]
    else:
        travel = np.linspace(0.0, float(np.max(basis.scales())), 101)
        ours, theirs = one.response(travel) - one.offset, other.response(travel) - other.offset
    return float(np.max(np.abs(theirs - ours)) / np.max(np.abs(ours)))


def undisturbed(run: Run) -> npt.NDArray[np.bool_]:
    """Return the rows (K,) of a run in which deadlines were kept, and had been for `RECOVERY_S`."""
    bad = (run.columns["overrun"] == 2) | (run.columns["state"] == State.DEGRADED)
    reach = round(RECOVERY_S * run.rate_hz)
    return np.asarray(np.convolve(bad, np.ones(reach + 1))[: len(bad)] < 0.5)


def _smaller(one: Tracked, at_least: float) -> tuple[str, str, str, bool]:
    improvement, share = one.kept
    seen = f"{improvement:.1f}"
    if share < 1.0:
        overall = one.compensated.improvement
        seen += f" in the {100 * share:.0f} % with deadlines kept ({overall:.1f} in all)"
    required = f">= {at_least:g}"
    return "tracking error smaller by", required, seen, improvement >= at_least and share >= LEAST_KEPT


def _told(missed: dict[str, int]) -> str:
    return (
        f"{missed['slots_lost']} slots, {missed['samples_missed']} samples of {missed['ticks']}; "
        f"{missed['late']} late"
    )


def friction_in(stage: Path) -> None:
    """Raise ConfigError where nothing rubs in the stage of the file `stage`: nothing is to be learned."""
    mechanics = Stage.load(stage).file.stage
    if mechanics.friction is None and not mechanics.effects:
        raise ConfigError(
            f"{stage}: stage.friction is missing, so there is nothing to identify; --plant names the file of "
            "a stage that rubs"
        )
