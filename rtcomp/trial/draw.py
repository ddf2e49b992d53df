"""Draw a case: a stage, what is believed of it, what is hidden in it, how it moves."""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.calibrate import Grown, grow
from rtcomp.trial.families import FAMILIES, Family
from rtcomp.trial.hidden import SECRETS, Rig, Secret
from rtcomp.trial.hidden.forms import FORMS, Form, in_form
from rtcomp.trial.oracle import Bare
from rtcomp.trial.plant import Run, simulate
from rtcomp.trial.stagefile import stage_file

SHARES = {"clean": 0.15, "one": 0.45, "two": 0.13, "outside": 0.15, "retuned": 0.12}
"""Kinds of cases, by what is hidden, and their part of a trial."""
WEAK = 0.3
"""Strength of the weak tier, relative to the full one."""
STRENGTHS = (0.0167, 0.30)
"""Rms force of an effect over that of the motion, full tier: from, to."""
ABOVE_FLOOR = 2.5
"""Least strength of the full tier, relative to what noise and sampling leave."""
SATURATED = 0.05
"""Part of the rows with the command at its limit beyond which the stage is drawn again."""
FOLLOWS = 0.5
"""Standard deviation of the position error over that of the reference beyond which it is drawn again."""
ATTEMPTS = 12
"""Stages drawn at most for one case."""
ALIKE = (
    {"drive-offset", "constant-force", "gravity"},
    {"drive-delay", "drive-lag", "sensor-delay"},
    {"viscous-friction", "back-emf", "asymmetric-viscous-friction"},
    {"drive-gain", "inertia", "sensor-scale"},
    {"backlash", "resonance"},
)
"""Not hidden together: what one says of them, one cannot say of the other."""
PER_VOLT = {
    "drive-gain": ("mass", "viscous", "level"),
    "inertia": ("mass",),
    "viscous-friction": ("viscous",),
    "back-emf": ("viscous",),
}
"""What an effect changes of the stage, per volt: a belief that is as wrong anyway hides it."""


@dataclass(frozen=True)
class Plan:
    """What is to be drawn for one case."""

    name: str
    kind: str
    secrets: tuple[str, ...]
    tier: str
    seed: int
    family: str = "micrometre"
    forms: float = 0.0
    """Share of effects hidden in another form, of those that have one."""


def plan(
    cases: int,
    seed: int,
    only: str | None = None,
    families: Sequence[str] = ("micrometre",),
    forms: float | None = None,
) -> list[Plan]:
    """Return what each of `cases` hides: every kind where there are five or more, effects in turn.

    With `only`, one of `SHARES`, all are of that kind: what is rare takes many to see. All `families` have
    as many cases, to within one, and about as many of each kind. `forms` is the share of effects hidden in
    another form, by default that of each family.
    """
    counts = {kind: int(share * cases) for kind, share in SHARES.items()}
    if cases >= len(counts):
        counts = {kind: max(1, count) for kind, count in counts.items()}
    counts["one"] += cases - sum(counts.values())
    if only is not None:
        counts = {only: cases}
    # Dealt round: every family is given as many, and as many of each kind, to within one.
    order = [kind for kind, count in counts.items() for _ in range(count)]
    names = list(dict.fromkeys(families))
    dealt = [order[i :: len(names)] for i in range(len(names))]
    each = [
        _of_family(FAMILIES[name], {kind: kinds.count(kind) for kind in counts}, _own_seed(seed, name), forms)
        for name, kinds in zip(names, dealt, strict=True)
    ]
    mixed = [p for row in itertools.zip_longest(*each) for p in row if p is not None]
    width = len(str(cases - 1))
    return [replace(p, name=f"case{i:0{width}d}") for i, p in enumerate(mixed)]


def _own_seed(seed: int, family: str) -> int | list[int]:
    """Return the seed of a family's draws, whichever families are drawn beside it."""
    # The micrometre stage is drawn as it was when there was no other.
    return seed if family == "micrometre" else [seed, zlib.crc32(family.encode())]


def _of_family(
    family: Family, counts: Mapping[str, int], seed: int | list[int], forms: float | None
) -> list[Plan]:
    chance = np.random.default_rng(seed)
    effects, pairs = _in_turn(chance, family.effects), _in_turn(chance, family.effects)
    outside, retuned = _in_turn(chance, family.outside), _in_turn(chance, family.retuned)
    drawn: list[tuple[str, tuple[str, ...]]] = []
    for kind, count in counts.items():
        for _ in range(count):
            if kind == "one":
                drawn.append((kind, (next(effects).name,)))
            elif kind == "two":
                drawn.append((kind, _pair(pairs)))
            elif kind == "clean":
                drawn.append((kind, ()))
            else:
                drawn.append((kind, (next(outside if kind == "outside" else retuned).name,)))
    order = chance.permutation(len(drawn))
    seeds = chance.integers(0, 2**62, len(drawn))
    tiers = np.where(chance.random(len(drawn)) < 0.25, "weak", "full")
    share = family.forms if forms is None else forms
    return [
        Plan(
            "",
            *drawn[int(j)],
            str(tiers[i]) if drawn[int(j)][1] else "full",
            int(seeds[i]),
            family.name,
            share,
        )
        for i, j in enumerate(order)
    ]


def _in_turn(chance: np.random.Generator, secrets: Sequence[Secret]) -> Any:
    while True:
        for i in chance.permutation(len(secrets)):
            yield secrets[int(i)]


def _pair(secrets: Any) -> tuple[str, str]:
    first = next(secrets).name
    while True:
        second = next(secrets).name
        alike = any({first, second} <= group for group in ALIKE)
        if second != first and not alike:
            return first, second


@dataclass(frozen=True)
class Case:
    """A drawn case: what the diagnosis gets, and everything that it does not."""

    plan: Plan
    physics: Physics
    """With what is hidden."""
    bare: Physics
    """Without."""
    loop: Loop
    motion: dict[str, float]
    believed: dict[str, Any]
    """Content of the stage file."""
    hidden: tuple[Grown, ...]

    @property
    def rotary(self) -> bool:
        """Whether the axis turns."""
        return FAMILIES[self.plan.family].rotary

    def reference(self, which: str) -> Any:
        """Return the reference of the run ``train`` or ``unseen``; in open loop the command."""
        chance = np.random.default_rng([self.plan.seed, _WHICH[which]])
        return FAMILIES[self.plan.family].reference(chance, self.loop, self.motion)

    def run(self, which: str, *, bare: bool = False) -> Run:
        """Return the run ``train`` or ``unseen``, or its twin without what is hidden; always the same."""
        seed = int(np.random.default_rng([self.plan.seed, 10 + _WHICH[which]]).integers(0, 2**62))
        return simulate(self.bare if bare else self.physics, self.loop, self.reference(which), seed)

    def answer(self) -> dict[str, Any]:
        """Return what is sealed: all that is hidden, and all that makes the case again."""
        return {
            "name": self.plan.name,
            "family": self.plan.family,
            "forms": self.plan.forms,
            "kind": self.plan.kind,
            "tier": self.plan.tier,
            "seed": self.plan.seed,
            "effects": [grown.to_json() for grown in self.hidden],
            "physics": {k: float(v) for k, v in self.physics._asdict().items()},
            "bare": {k: float(v) for k, v in self.bare._asdict().items()},
            "loop": {k: float(v) for k, v in self.loop._asdict().items()},
            "motion": {k: float(v) for k, v in self.motion.items()},
            "stage": self.believed,
        }

    @classmethod
    def again(cls, answer: dict[str, Any]) -> Case:
        """Make the case of an opened answer."""
        chosen = tuple(e["name"] for e in answer["effects"])
        plan = Plan(
            answer["name"], answer["kind"], chosen, answer["tier"], answer["seed"], answer["family"],
            answer["forms"],
        )  # fmt: skip
        return cls(
            plan, Physics(**answer["physics"]), Physics(**answer["bare"]), Loop(**answer["loop"]),
            answer["motion"], answer["stage"], tuple(Grown.from_json(e) for e in answer["effects"]),
        )  # fmt: skip


_WHICH = {"train": 1, "unseen": 2}


def draw(plan: Plan) -> Case:
    """Draw the case of a plan; the same plan gives the same case.

    A stage that the controller loses, alone or with an effect at any strength, is drawn again.
    """
    failed: Exception | None = None
    for attempt in range(ATTEMPTS):
        chance = np.random.default_rng([plan.seed, 0, attempt] if attempt else [plan.seed, 0])
        try:
            return _drawn(plan, chance)
        except (RuntimeError, FloatingPointError) as error:
            failed = error
    raise RuntimeError(f"{plan.family}: no stage in {ATTEMPTS} that stays controlled ({failed})") from failed


def _drawn(plan: Plan, chance: np.random.Generator) -> Case:
    family = FAMILIES[plan.family]
    loop, physics, motion = family.stage(chance)
    believed = family.belief(physics, chance)
    case = Case(plan, physics, physics, loop, motion, {}, ())
    clean = _sound(case, "train")
    rig = look(physics, loop, motion, clean, family.rotary)
    known: list[dict[str, Any]] = []
    secrets = [SECRETS[name] for name in plan.secrets]
    for secret in secrets:
        if secret.known is not None:
            changes, entry = secret.known(chance, rig)
            physics = physics._replace(**changes)
            known.append(entry)
    if known:
        case = Case(plan, physics, physics, loop, motion, {}, ())
        clean = _sound(case, "train")
        rig = look(physics, loop, motion, clean, family.rotary)
    forms = np.random.default_rng([plan.seed, 3])
    least = _least(plan, Bare.of(physics, loop, clean))
    hidden = []
    for secret in secrets:
        target = math.exp(chance.uniform(*np.log(STRENGTHS))) * (WEAK if plan.tier == "weak" else 1.0)
        target = max(target, least)
        form = _form(plan, secret, forms)
        sized = secret.draw(chance, rig) if form is None else in_form(form, secret, chance, rig)
        one = grow(secret, sized, rig, case.reference("train"), clean, target)
        hidden.append(replace(one, form="" if form is None else form.name))
    full = physics
    for grown in hidden:
        full = full._replace(**grown.changes)
    hidden = [replace(g, beyond_belief=believed.off(full, PER_VOLT.get(g.name, ()))) for g in hidden]
    stage = stage_file(believed, loop, known, rotary=family.rotary)
    whole = Case(plan, full, physics, loop, motion, stage, tuple(hidden))
    for which in _WHICH:
        _sound(whole, which)
    return whole


def _least(plan: Plan, bare: Bare) -> float:
    """Return the least strength aimed at: a coarse sensor hides small effects, which would tell nothing."""
    if plan.family == "micrometre":  # drawn as it was before this was asked
        return 0.0
    return ABOVE_FLOOR * (WEAK if plan.tier == "weak" else 1.0) * bare.floor / bare.needed


def _form(plan: Plan, secret: Secret, chance: np.random.Generator) -> Form | None:
    """Choose another form of an effect, None for the one that it has anyway."""
    forms = FORMS.get(secret.name)
    if not forms or chance.random() >= plan.forms:
        return None
    return forms[int(chance.integers(len(forms)))]


def _sound(case: Case, which: str) -> Run:
    """Return a run; raise FloatingPointError where the controller loses the axis or cannot follow."""
    run = case.run(which)
    if case.plan.family == "micrometre":  # drawn as it was before this was asked
        return run
    at_limit = np.mean(np.abs(run.voltage) >= 0.999 * case.physics.voltage_limit)
    if at_limit > SATURATED:
        raise FloatingPointError(f"{100.0 * at_limit:.0f} % of the command is at its limit")
    if not case.loop.open and not np.std(run.reference - run.truth) < FOLLOWS * np.std(run.reference):
        raise FloatingPointError("the axis does not follow its reference")
    return run


def look(physics: Physics, loop: Loop, motion: dict[str, float], run: Run, rotary: bool = False) -> Rig:
    """Return the stage with the figures of its motion without anything hidden."""
    velocity = np.gradient(run.truth) * loop.rate
    return Rig(
        physics, loop, float(np.max(np.abs(run.truth))), float(np.sqrt(np.mean(velocity**2))),
        physics.force_constant * float(np.sqrt(np.mean(run.voltage**2))),
        float(np.quantile(np.abs(run.voltage), 0.99)), motion["seconds"], rotary,
    )  # fmt: skip
