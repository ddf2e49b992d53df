"""Draw a case: a stage, what is believed of it, what is hidden in it, how it moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rtcomp.trial.calibrate import Grown, grow
from rtcomp.trial.hidden import EFFECTS, OUTSIDE, RETUNED, SECRETS, Rig, Secret
from rtcomp.trial.motion import draw_reference
from rtcomp.trial.plant import Loop, Physics, Run, simulate
from rtcomp.trial.stagefile import Believed, stage_file

SHARES = {"clean": 0.15, "one": 0.45, "two": 0.13, "outside": 0.15, "retuned": 0.12}
"""Kinds of cases, by what is hidden, and their part of a trial."""
WEAK = 0.3
"""Strength of the weak tier, relative to the full one."""
STRENGTHS = (0.0167, 0.30)
"""Rms force of an effect over that of the motion, full tier: from, to."""
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


def plan(cases: int, seed: int, only: str | None = None) -> list[Plan]:
    """Return what each of `cases` hides: every kind where there are five or more, effects in turn.

    With `only`, one of `SHARES`, all are of that kind: what is rare takes many to see.
    """
    chance = np.random.default_rng(seed)
    counts = {kind: int(share * cases) for kind, share in SHARES.items()}
    if cases >= len(counts):
        counts = {kind: max(1, count) for kind, count in counts.items()}
    counts["one"] += cases - sum(counts.values())
    if only is not None:
        counts = {only: cases}
    effects, pairs = _in_turn(chance, EFFECTS), _in_turn(chance, EFFECTS)
    outside, retuned = _in_turn(chance, OUTSIDE), _in_turn(chance, RETUNED)
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
    width = len(str(cases - 1))
    return [
        Plan(
            f"case{i:0{width}d}", *drawn[int(j)], str(tiers[i]) if drawn[int(j)][1] else "full", int(seeds[i])
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

    def reference(self, which: str) -> Any:
        """Return the reference of the run ``train`` or ``unseen``."""
        chance = np.random.default_rng([self.plan.seed, _WHICH[which]])
        return draw_reference(chance, self.loop.rate, **self.motion)

    def run(self, which: str, *, bare: bool = False) -> Run:
        """Return the run ``train`` or ``unseen``, or its twin without what is hidden; always the same."""
        seed = int(np.random.default_rng([self.plan.seed, 10 + _WHICH[which]]).integers(0, 2**62))
        return simulate(self.bare if bare else self.physics, self.loop, self.reference(which), seed)

    def answer(self) -> dict[str, Any]:
        """Return what is sealed: all that is hidden, and all that makes the case again."""
        return {
            "name": self.plan.name,
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
        plan = Plan(answer["name"], answer["kind"], chosen, answer["tier"], answer["seed"])
        return cls(
            plan, Physics(**answer["physics"]), Physics(**answer["bare"]), Loop(**answer["loop"]),
            answer["motion"], answer["stage"], tuple(Grown.from_json(e) for e in answer["effects"]),
        )  # fmt: skip


_WHICH = {"train": 1, "unseen": 2}


def draw(plan: Plan) -> Case:
    """Draw the case of a plan; the same plan gives the same case."""
    chance = np.random.default_rng([plan.seed, 0])
    loop, physics, motion = draw_stage(chance)
    believed = Believed.of(physics, chance)
    case = Case(plan, physics, physics, loop, motion, {}, ())
    clean = case.run("train")
    rig = look(physics, loop, motion, clean)
    known: list[dict[str, Any]] = []
    secrets = [SECRETS[name] for name in plan.secrets]
    for secret in secrets:
        if secret.known is not None:
            changes, entry = secret.known(chance, rig)
            physics = physics._replace(**changes)
            known.append(entry)
    if known:
        case = Case(plan, physics, physics, loop, motion, {}, ())
        clean = case.run("train")
        rig = look(physics, loop, motion, clean)
    hidden = []
    for secret in secrets:
        target = math.exp(chance.uniform(*np.log(STRENGTHS))) * (WEAK if plan.tier == "weak" else 1.0)
        hidden.append(grow(secret, secret.draw(chance, rig), rig, case.reference("train"), clean, target))
    full = physics
    for grown in hidden:
        full = full._replace(**grown.changes)
    hidden = [replace(g, beyond_belief=believed.off(full, PER_VOLT.get(g.name, ()))) for g in hidden]
    stage = stage_file(believed, loop, known)
    return Case(plan, full, physics, loop, motion, stage, tuple(hidden))


def draw_stage(chance: np.random.Generator) -> tuple[Loop, Physics, dict[str, float]]:
    """Draw a stage, its loop and how it is to move: what a laboratory might have on its table."""
    kind = chance.choice(["interferometer", "encoder", "worse"], p=[0.5, 0.4, 0.1])
    rate = float(chance.choice([500.0, 1000.0, 2000.0, 4000.0], p=[0.15, 0.55, 0.2, 0.1]))
    if kind == "interferometer":
        noise, resolution = _log(chance, 8e-9, 2.5e-8), float(chance.choice([1e-9, 5e-9, 1e-8]))
    elif kind == "encoder":
        noise, resolution = _log(chance, 1e-8, 4e-8), 1e-7
    else:
        resolution = _log(chance, 2e-7, 8e-7)
        noise, rate = 0.3 * resolution, min(rate, 1000.0)
    while True:
        mass, level = _log(chance, 0.5, 5.0), _log(chance, 1.0, 10.0)
        # How fast friction alone could stop the mass within the stroke sets the pace of everything.
        pace = _log(chance, 25.0, min(80.0, rate / 16.0 + 1.0))
        stroke = level / (mass * pace**2)
        reach = stroke / _log(chance, 8.0, 40.0)
        if max(2e-6, 60.0 * max(noise, resolution)) <= reach <= 1e-4:
            break
    shape = chance.uniform(2.5, 5.0)
    # Inertia asks for half to twice the friction at the fastest.
    fastest = pace * math.sqrt(chance.uniform(0.5, 2.0)) / (2.0 * math.pi)
    seconds = min(chance.uniform(20.0, 60.0), 120_000.0 / rate)
    motion = {"seconds": seconds, "stroke": stroke, "reach": reach, "fastest": fastest}
    speed = 0.3 * stroke * 2.0 * math.pi * 0.5 * fastest
    force_constant = level / chance.uniform(0.4, 1.5)
    stiffness = level * shape / reach
    micro = 2.0 * chance.uniform(0.05, 0.2) * math.sqrt(stiffness * mass)
    # The damping of presliding fades before it would be a friction of its own.
    micro_speed = min(speed * chance.uniform(0.2, 0.6), 0.3 * level / micro)
    physics = Physics(
        mass, force_constant, 10.0, level * chance.uniform(0.03, 0.2) / speed, micro, micro_speed,
        level, reach, shape,
    )  # fmt: skip
    omega = min(pace * math.sqrt(chance.uniform(6.0, 15.0)), rate / 5.0)
    kp = mass * omega**2 / force_constant
    kd = 2.0 * chance.uniform(0.4, 0.7) * mass * omega / force_constant
    return Loop(kp, kp * chance.uniform(5.0, 12.0), kd, rate, noise, resolution), physics, motion


def look(physics: Physics, loop: Loop, motion: dict[str, float], run: Run) -> Rig:
    """Return the stage with the figures of its motion without anything hidden."""
    velocity = np.gradient(run.truth) * loop.rate
    return Rig(
        physics, loop, float(np.max(np.abs(run.truth))), float(np.sqrt(np.mean(velocity**2))),
        physics.force_constant * float(np.sqrt(np.mean(run.voltage**2))),
        float(np.quantile(np.abs(run.voltage), 0.99)), motion["seconds"],
    )  # fmt: skip


def _log(chance: np.random.Generator, low: float, high: float) -> float:
    return math.exp(chance.uniform(math.log(low), math.log(high)))
