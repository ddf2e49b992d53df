"""Score one case: what was said against what was hidden, and the extended stage on the unseen run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from rtcomp.trial.draw import Case
from rtcomp.trial.hidden import SECRETS
from rtcomp.trial.run import Outcome
from rtcomp.trial.says import Match, Said, match, within

PERIOD_WITHIN = 0.02
"""Part of the true period (or frequency) that counts as right."""
WORSE = 1.02
"""Factor of the relative force error from which a stage counts as made worse."""


@dataclass(frozen=True)
class Errors:
    """Relative force errors on the unseen run: the believed stage, the diagnosed, and the oracle.

    The oracle's is what is left where nothing is hidden: the plant's twin, replayed with its exact stage.
    """

    before: float
    after: float
    oracle: float


@dataclass(frozen=True)
class Estimate:
    """A parameter as estimated, in the words of the stage file."""

    effect: str
    parameter: str
    truth: float
    value: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Relative error of the estimate."""
        return abs(self.value / self.truth - 1.0)

    @property
    def covered(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.truth <= self.high


@dataclass(frozen=True)
class Scored:
    """A case with everything that the figures are made of."""

    case: Case
    outcome: Outcome
    said: Said | None
    """None where the diagnosis failed; `fault` then says how."""
    fault: str
    matches: tuple[Match, ...]
    wrong: tuple[tuple[str, ...], ...]
    errors: Errors | None
    estimates: tuple[Estimate, ...] = field(default=())

    @property
    def detectable(self) -> bool:
        """Whether everything hidden stands out of the floor (also where nothing is hidden)."""
        return all(grown.detectable for grown in self.case.hidden)

    @property
    def right(self) -> bool:
        """Whether the answer is right: all found, nothing else named, and no alarm where nothing is."""
        if self.said is None or self.wrong or not all(m.found for m in self.matches):
            return False
        return self.case.plan.kind != "clean" or self.quiet

    @property
    def quiet(self) -> bool:
        """Whether it says that no physics is missing."""
        return self.said is not None and self.said.verdict in ("consistent", "retuned") and not self.wrong

    @property
    def gain(self) -> float | None:
        """Part of the squared mismatch on the unseen run that is gone; None where it is unknown."""
        return None if self.errors is None else 1.0 - (self.errors.after / self.errors.before) ** 2

    @property
    def gain_over_oracle(self) -> float | None:
        """The gain over the oracle's; None where the oracle gains too little to compare (a fifth)."""
        if self.errors is None or self.gain is None:
            return None
        oracle = 1.0 - (self.errors.oracle / self.errors.before) ** 2
        return self.gain / oracle if oracle > 0.2 else None

    def row(self) -> dict[str, Any]:
        """Return one row of the table of cases."""
        said, errors, hidden = self.said, self.errors, self.case.hidden
        return {
            "case": self.case.plan.name,
            "kind": self.case.plan.kind,
            "tier": self.case.plan.tier,
            "hidden": "+".join(g.name for g in hidden),
            "share": "+".join(f"{g.shows.share:.4f}" for g in hidden),
            "detectability": "+".join(
                f"{g.shows.detectability(SECRETS[g.name].retuning):.2f}" for g in hidden
            ),
            "detectable": int(self.detectable),
            "right": int(self.right),
            "verdict": said.verdict if said else "",
            "named": " | ".join("/".join(n) for n in said.named) if said else "",
            "unexplained": int(said.unexplained) if said else "",
            "retuned": "/".join(said.moved) if said else "",
            "wrong": len(self.wrong),
            "before": errors.before if errors else "",
            "after": errors.after if errors else "",
            "oracle": errors.oracle if errors else "",
            "gain": "" if self.gain is None else self.gain,
            "gain_over_oracle": "" if self.gain_over_oracle is None else self.gain_over_oracle,
            "seconds": round(self.outcome.seconds, 2),
            "fault": self.fault,
            "family": self.case.plan.family,
            "form": "+".join(g.form for g in hidden),
        }


def score(case: Case, outcome: Outcome, said: Said | None, fault: str, errors: Errors | None) -> Scored:
    """Hold a diagnosis against its case."""
    if said is None:
        missed = tuple(Match(False, False, False, 0, 0, "") for _ in case.hidden)
        return Scored(case, outcome, None, fault, missed, (), errors)
    matches, wrong = match(said, case.hidden, case.rotary)
    if len(matches) == 1 and said.named and matches[0].name and matches[0].name != said.named[0][0]:
        matches = [replace(matches[0], first=False)]
    return Scored(
        case, outcome, said, fault, tuple(matches), tuple(wrong), errors, tuple(estimates(case, said))
    )


def estimates(case: Case, said: Said) -> list[Estimate]:
    """Return the estimates whose truth is known: of effects named exactly, of retuned parameters."""
    found = []
    for grown in case.hidden:
        values = said.intervals.get(grown.name, {})
        secret = SECRETS[grown.name]
        for parameter in (secret.period,) if grown.form else secret.scored:
            truth = grown.parameters.get(parameter, 0.0)
            if parameter in values and truth:
                found.append(Estimate(grown.name, parameter, truth, *values[parameter]))
    # A force constant that is another makes everything else look scaled: then nothing is known of it.
    if case.physics.force_constant == case.bare.force_constant:
        known = {"mass": case.physics.mass, "friction.level": case.physics.level}
        if case.physics.backward_viscous == 1.0 and case.physics.back_emf == 0.0:
            known["viscous"] = case.physics.viscous
        for parameter, truth in known.items():
            if parameter in said.retuned:
                found.append(Estimate("stage", parameter, truth, *said.retuned[parameter]))
    return found


def right_period(scored: Scored) -> bool | None:
    """Say whether the period (or frequency) of a lone periodic effect is right; None where it has none."""
    if len(scored.case.hidden) != 1 or not scored.matches[0].found:
        return None
    grown = scored.case.hidden[0]
    parameter = SECRETS[grown.name].period
    if parameter not in grown.parameters:
        return None
    mine = [e for e in scored.estimates if e.effect == grown.name and e.parameter == parameter]
    return bool(mine) and within(mine[0].value, mine[0].truth, PERIOD_WITHIN)
