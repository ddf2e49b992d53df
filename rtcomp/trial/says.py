"""What a diagnosis of a case said, read from its ``diagnosis.json``, and whether that is right."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rtcomp.trial.calibrate import Grown
from rtcomp.trial.stagefile import MOVED

LATE = frozenset({"drive-delay", "drive-lag", "sensor-delay"})
STEADY = frozenset({"drive-offset", "constant-force", "gravity"})
ALIASES: dict[str, frozenset[str]] = {
    **dict.fromkeys(LATE, LATE),
    **dict.fromkeys(STEADY, STEADY),
    "back-emf": frozenset({"back-emf", "viscous-friction", "asymmetric-viscous-friction"}),
    "viscous-friction": frozenset({"viscous-friction", "back-emf"}),
    "retuned-force-constant": frozenset({"drive-gain"}),
    "retuned-mass": frozenset({"inertia"}),
    "retuned-viscous": frozenset({"viscous-friction", "back-emf"}),
    "outside-force-bump": frozenset({"position-force", "unexplained"}),
}
"""Names that no recording of one axis tells from the truth, the truth included."""
FRICTION = frozenset({"friction", "friction_level", "friction-level", "friction_reach", "friction_shape"})
RETUNED: dict[str, frozenset[str]] = {
    # A recording sees only what moves per volt: whichever of the numbers leaves what beliefs allow.
    "drive-gain": frozenset({"force_constant", "mass", "viscous", "parallel-spring", "gravity"}) | FRICTION,
    "inertia": frozenset({"mass"}),
    "viscous-friction": frozenset({"viscous"}),
    "back-emf": frozenset({"viscous"}),
    "stribeck": frozenset({"stribeck"}),
    # Another law of a spring that is believed, another load on a joint.
    "parallel-spring": frozenset({"parallel-spring"}),
    "gravity": frozenset({"gravity"}),
}
"""Parameters of the stage whose retuning says the same as the effect's name."""
SLOTS = {"mass": "mass", "viscous": "viscous", "force_constant": "force_constant", "friction.level": "level"}
"""Retuned parameters by their names in the plant."""
NEAR = 0.05
"""Part of the truth within which a retuned parameter has arrived there, however far it was off."""
UNEXPLAINED = "unexplained"


def alike(truth: str, rotary: bool = False) -> frozenset[str]:
    """Return the names that say what `truth` is; on a rotary axis weight changes with the angle."""
    if rotary and truth in STEADY:
        return frozenset({truth}) if truth == "gravity" else STEADY - {"gravity"}
    return ALIASES.get(truth, frozenset({UNEXPLAINED if truth.startswith("outside-") else truth}))


@dataclass(frozen=True)
class Said:
    """A diagnosis, as far as it is scored."""

    verdict: str
    named: tuple[tuple[str, ...], ...]
    """Sets of names, in the order given; without "unexplained"."""
    unexplained: bool
    moved: tuple[str, ...] = ()
    """Parameters retuned by more than a belief is wrong, without element or part: ``friction``."""
    intervals: dict[str, dict[str, tuple[float, float, float]]] = field(default_factory=dict)
    """Value, low and high of the parameters of each effect's likeliest name, by that name."""
    retuned: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Value, low and high of each retuned parameter."""
    probabilities: tuple[float | None, ...] = ()
    """Stated for each set of `named`; None where none is."""

    @classmethod
    def read(cls, path: Path) -> Said:
        """Read ``diagnosis.json``; raise ValueError where it is not as docs/formats.md has it."""
        try:
            data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            effects = [(tuple(map(str, e["names"])), e.get("parameters", {})) for e in data["effects"]]
            stated = [e.get("probability") for e in data["effects"]]
            named = [
                (n, None if p is None else float(p))
                for (names, _), p in zip(effects, stated, strict=True)
                if (n := tuple(x for x in names if x != UNEXPLAINED))
            ]
            retuned = {str(r["parameter"]): r for r in data["retuned"]}
            moved = {
                name.split("[")[0].split(".")[0]
                for name, r in retuned.items()
                if (abs(r["to"] / r["from"] - 1.0) > MOVED if r["from"] else _away(name, r))
            }
            return cls(
                str(data["verdict"]),
                tuple(n for n, _ in named),
                data["verdict"] == UNEXPLAINED or any(UNEXPLAINED in names for names, _ in effects),
                tuple(sorted(moved)),
                {names[0]: _intervals(p) for names, p in effects if names and names[0] != UNEXPLAINED},
                {name: (float(r["to"]), float(r["low"]), float(r["high"])) for name, r in retuned.items()},
                tuple(p for _, p in named),
            )
        except (KeyError, TypeError, AttributeError, IndexError, OSError) as error:
            raise ValueError(f"{path.name} is not a diagnosis: {type(error).__name__} {error}") from error


def _away(name: str, retuned: dict[str, Any]) -> bool:
    """Say whether a number of a believed effect that was zero is not any more."""
    return name.count(".") == 1 and "-" in name and bool(retuned["low"] > 0.0 or retuned["high"] < 0.0)


def _intervals(parameters: dict[str, Any]) -> dict[str, tuple[float, float, float]]:
    return {k: (float(v["value"]), float(v["low"]), float(v["high"])) for k, v in parameters.items()}


@dataclass(frozen=True)
class Match:
    """How one hidden effect fared."""

    found: bool
    """A set of names holds it, and nothing that is not its alias; or its parameter was retuned."""
    first: bool
    """So, and the likeliest name is right; for an effect alone also that this comes first."""
    held: bool
    """Some set of names holds it, whatever else is in that set; or its parameter was retuned."""
    size: int
    """Names in that set; 1 for a retuning, 0 where nothing holds it."""
    choices: int
    """The same with the truth's own aliases, which nobody can tell apart, counted as one name."""
    name: str
    """The likeliest name of that set, "" where there is none."""


def match(
    said: Said, hidden: tuple[Grown, ...], rotary: bool = False
) -> tuple[list[Match], list[tuple[str, ...]]]:
    """Return how each effect fared, and the sets of names that belong to none."""
    left = list(said.named)
    matches = []
    for effect in hidden:
        names = alike(effect.name, rotary) - {UNEXPLAINED}
        fitting = next((n for n in left if set(n) & names and set(n) <= names), None)
        holding = fitting or next((n for n in left if set(n) & names), None)
        if holding is not None:
            # A set that holds it among strangers is not named right, but is not another false name either.
            left.remove(holding)
            matches.append(
                Match(
                    fitting is not None,
                    holding[0] in names,
                    True,
                    len(holding),
                    1 + len(set(holding) - names),
                    holding[0],
                )
            )
        elif retunes(said, effect):
            matches.append(Match(True, True, True, 1, 1, ""))
        elif effect.name.startswith("outside-") and said.unexplained:
            matches.append(Match(True, True, True, 1, 1, UNEXPLAINED))
        else:
            matches.append(Match(False, False, False, 0, 0, ""))
    return matches, left


def retunes(said: Said, hidden: Grown) -> bool:
    """Say whether a retuning says what is hidden: moved the right parameter, or moved it to the truth."""
    if hidden.name.startswith("retuned-"):
        return said.verdict == "retuned"
    if set(said.moved) & RETUNED.get(hidden.name, frozenset()):
        return True
    return any(
        key in said.retuned and within(said.retuned[key][0], hidden.changes[slot], NEAR)
        for key, slot in SLOTS.items()
        if slot in hidden.changes
    )


def within(value: float, truth: float, part: float) -> bool:
    """Say whether a value is within `part` of the truth."""
    return math.isfinite(value) and abs(value / truth - 1.0) <= part
