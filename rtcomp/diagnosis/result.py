"""What a diagnosis says, as data; `to_json` is the contract of docs/formats.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

Verdict = Literal["consistent", "retuned", "missing-physics", "unexplained"]


@dataclass(frozen=True)
class Value:
    """An estimate with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str

    def to_json(self) -> dict[str, Any]:
        """Return the estimate as the contract writes it."""
        return {"value": self.value, "low": self.low, "high": self.high, "unit": self.unit}


@dataclass(frozen=True)
class Retuned:
    """A parameter of the believed stage that the recording moves: ``mass``, ``friction.level`` ..."""

    parameter: str
    before: float
    after: Value

    def to_json(self) -> dict[str, Any]:
        """Return the change as the contract writes it."""
        return {
            "parameter": self.parameter,
            "from": self.before,
            "to": self.after.value,
            "low": self.after.low,
            "high": self.after.high,
            "unit": self.after.unit,
        }


@dataclass(frozen=True)
class Place:
    """Where the mismatch shows: the residual force along one axis (position, speed, time, frequency ...)."""

    axis: str
    unit: str
    region: tuple[float, float]
    share: float
    """Part of the mismatch (squared) that depends on this axis, 0 to 1."""
    p_value: float
    """Of no dependence at all, all axes looked at together."""
    says: str
    """One line for a person."""
    x: Floats
    """Centres of the bins along the axis, (B,)."""
    before: Floats
    """Mean residual force (N) in each bin: what the believed stage, refitted, leaves."""
    after: Floats | None = None
    """The same with the extended stage."""
    spread: Floats | None = None
    """Standard error of `before` (N)."""
    signed: bool = False
    """Whether forces are given the sign of the motion."""

    def to_json(self) -> dict[str, Any]:
        """Return the place as the contract writes it."""
        return {
            "axis": self.axis,
            "region": [float(self.region[0]), float(self.region[1])],
            "share": self.share,
            "p_value": self.p_value,
            "says": self.says,
        }


@dataclass(frozen=True)
class Named:
    """Physics that is missing: one name, or all that this recording cannot tell apart, likeliest first."""

    names: tuple[str, ...]
    probability: float
    parameters: dict[str, Value]
    """Of the likeliest name."""
    share: float
    """Part of the mismatch (squared, above the floor) explained by it, 0 to 1."""
    separate_by: str = ""
    curve: tuple[str, str, Floats, Floats, Floats, bool] | None = None
    """To draw: axis, unit, x (B,), mean residual without it (N), the named curve (N), and whether both are
    given the sign of the motion."""

    def to_json(self) -> dict[str, Any]:
        """Return the effect as the contract writes it."""
        data: dict[str, Any] = {
            "names": list(self.names),
            "probability": self.probability,
            "parameters": {k: v.to_json() for k, v in self.parameters.items()},
            "share": self.share,
        }
        if self.separate_by:
            data["separate_by"] = self.separate_by
        return data


@dataclass(frozen=True)
class Fit:
    """Relative force errors (rms over rms) on reserved parts, which judge once.

    They take part neither in the fit nor in the choice between explanations.
    """

    before: float
    retuned: float
    after: float
    floor: float
    """What sensor noise and resolution alone would leave."""


@dataclass(frozen=True)
class PositionFit:
    """Mean absolute errors of position (m) of a stage let go at points of the recording, driven as it was.

    On windows of `seconds` that took part neither in the fit nor in the choice between explanations.
    """

    before: float
    retuned: float
    after: float
    floor: float
    """What the sensor alone would leave of any stage."""
    seconds: float

    def to_json(self) -> dict[str, float]:
        """Return the errors as the contract writes them."""
        return {
            "before": self.before,
            "retuned": self.retuned,
            "after": self.after,
            "floor": self.floor,
            "seconds": self.seconds,
        }


@dataclass(frozen=True)
class Candidate:
    """What one entry of the catalogue would have gained."""

    name: str
    gain: float
    """Part of the left-out mismatch (squared) that it explains, alone beside the refitted stage."""
    z: float
    """That gain over its standard error."""
    observable: bool
    """Whether this recording's motion could show it at all."""
    smallest: float = math.nan
    """Size from which on it would have been seen (catalogue unit); NaN where not known."""
    note: str = ""
    parameter: str = ""
    """Which of its parameters that size is; the first where nothing is said."""


@dataclass(frozen=True)
class Sight:
    """From which size on an entry of the catalogue would have been seen in these recordings."""

    name: str
    parameter: str
    """Which of its parameters is its size."""
    unit: str
    smallest: float
    """How far that parameter must be from doing nothing; infinite where the refitted base makes up for it."""
    most: float
    """Up to which that is plausible."""
    beside: dict[str, float]
    """Its other parameters, at which this holds."""

    @property
    def seen(self) -> bool:
        """Whether a plausible size would have been seen."""
        return self.smallest <= self.most

    def to_json(self) -> dict[str, Any]:
        """Return it as the contract writes it."""
        return {
            "name": self.name,
            "parameter": self.parameter,
            "value": self.smallest,
            "unit": self.unit,
            "at": self.beside,
        }


@dataclass(frozen=True)
class Experiment:
    """The next experiment: a reference section, what it tells apart, and how long it takes."""

    reference: dict[str, Any]
    tells_apart: tuple[str, ...]
    seconds: float
    says: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer."""

    verdict: Verdict
    where: Sequence[Place]
    retuned: Sequence[Retuned]
    effects: Sequence[Named]
    """By share, largest first; names ``("unexplained",)`` for what no entry explains."""
    fit: Fit
    not_observable: Sequence[str]
    stage: Stage
    """The extended stage."""
    next_experiment: Experiment | None = None
    sights: Sequence[Sight] = ()
    """From which size on each entry would have been seen; those of `not_observable` among them."""
    candidates: Sequence[Candidate] = ()
    """Every entry looked at, by gain, largest first."""
    notes: Sequence[str] = field(default_factory=list)
    time: Floats = field(default_factory=lambda: np.zeros(0))
    """s, (K,), of the residuals below."""
    residual_before: Floats = field(default_factory=lambda: np.zeros(0))
    """N, (K,): force that the believed stage, refitted, does not account for."""
    residual_after: Floats = field(default_factory=lambda: np.zeros(0))
    """N, (K,): the same with the extended stage."""
    unseen: Floats = field(default_factory=lambda: np.zeros(0))
    """(K,), 1 where a row took no part in fitting or selection."""
    position: PositionFit | None = None
    """Where the balance of forces decides nothing: what was decided by instead."""
    retuned_stage: Stage | None = None
    """The believed physics with the values that fit best."""
    not_tried: Sequence[str] = ()
    """What the budget left no time for; empty where the search came to its end."""

    def sentence(self) -> str:
        """Return the verdict in one sentence."""
        named = [" or ".join(e.names) for e in self.effects if e.names != ("unexplained",)]
        if self.verdict == "consistent":
            after, noise = self.fit.after, self.fit.floor
            how = "within the noise" if after <= noise else f"to {100.0 * after:.2g} % of the force"
            return f"Nothing is missing: simulation and recording agree {how}."
        if self.verdict == "retuned":
            moved = ", ".join(r.parameter for r in self.retuned) or "numbers that this motion does not part"
            return f"No physics is missing; other values of {moved} explain the recording."
        if named:
            rest = " A part remains that no entry of the catalogue explains." if self._remains else ""
            return f"Missing: {', and '.join(named)}.{rest}"
        if self.not_tried:
            return "Something is missing; there was no time to try all that it may be."
        return "Something is missing that no entry of the catalogue explains."

    @property
    def _remains(self) -> bool:
        return any(e.names == ("unexplained",) for e in self.effects)

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis as ``diagnosis.json`` holds it."""
        data: dict[str, Any] = {
            "verdict": self.verdict,
            "where": [p.to_json() for p in self.where],
            "retuned": [r.to_json() for r in self.retuned],
            "effects": [e.to_json() for e in self.effects],
            "fit": {
                "relative_force_error": {
                    "before": self.fit.before,
                    "retuned": self.fit.retuned,
                    "after": self.fit.after,
                    "floor": self.fit.floor,
                }
            },
            "not_observable": list(self.not_observable),
            "smallest_seen": [s.to_json() for s in self.sights if s.seen],
            "notes": list(self.notes),
            "stopped_early": bool(self.not_tried),
        }
        if self.not_tried:
            data["not_tried"] = list(self.not_tried)
        if self.position is not None:
            data["fit"]["position_error"] = self.position.to_json()
        if self.next_experiment is not None:
            data["next_experiment"] = {
                "reference": "reference.yaml",
                "tells_apart": list(self.next_experiment.tells_apart),
                "seconds": self.next_experiment.seconds,
            }
        return data
