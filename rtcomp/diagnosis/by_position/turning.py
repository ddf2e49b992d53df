"""The knobs of a stage, and how they are turned until its windows end where the recording does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rtcomp.diagnosis.by_position.windows import Windows
from rtcomp.diagnosis.extend import _shift_bias
from rtcomp.diagnosis.ledger import BIASES
from rtcomp.diagnosis.scene import Entry
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Parameter, catalogue
from rtcomp.stage.stage import Stage

RANGE = {
    "mass": (0.5, 2.0),
    "force_constant": (0.5, 2.0),
    "viscous": (0.05, 4.0),
    "friction.level": (0.02, 6.0),
    "friction.reach": (0.02, 6.0),
}
"""Smallest and largest factor on a believed number; beyond, it is not that number any more."""
OF_EFFECTS = (0.2, 5.0)
"""The same for numbers of the effects that the stage is believed to have."""
MOST = 2.5
"""Logarithm of the largest factor that a number of an entry is turned by."""
STEP = 2e-3
"""With which derivatives are taken, in logarithms."""
FIXED = ("period", "phase", "position", "time", "frequency")
"""Parameters of believed effects that are not turned."""
ANCHORS = ("gravity", "parallel-spring", "cogging", "position-force", "end-stop")
"""Believed forces whose size a recording of position and voltage can be measured by."""


@dataclass(frozen=True)
class Knob:
    """One number that is turned: of the stage (`entry` -1) or of an entry; how a turn changes it."""

    entry: int
    name: str
    kind: str
    """``log``: by a factor; ``add``: by so many of `size`."""
    size: float
    low: float
    high: float

    def bounds(self, value: float) -> tuple[float, float]:
        """Return the lowest and highest turn from `value`."""
        if self.kind == "log":
            return float(np.log(self.low / value)), float(np.log(self.high / value))
        return (self.low - value) / self.size - 1e-12, (self.high - value) / self.size + 1e-12


@dataclass(frozen=True)
class Setting:
    """A stage as believed with its numbers turned, and entries beside it."""

    believed: Stage
    factors: dict[str, float]
    entries: tuple[Entry, ...]
    longest: float = np.inf
    """Period (m) beyond which a wave along the stroke is a slope or an offset by another name."""

    def having(self, entries: Sequence[Entry], factors: dict[str, float] | None = None) -> Setting:
        """Return a setting of the same belief with other entries (and other factors)."""
        return replace(
            self, entries=tuple(entries), factors=dict(self.factors if factors is None else factors)
        )

    def stage(self) -> Stage:
        """Return the stage; raise ConfigError where an entry is out of range."""
        data = self.believed.to_dict()
        m: dict[str, Any] = data["stage"]
        for key in ("mass", "force_constant", "viscous"):
            m[key] = m[key] * self.factors.get(key, 1.0)
        level, reach = self.factors.get("friction.level", 1.0), self.factors.get("friction.reach", 1.0)
        if isinstance(m.get("friction"), list):
            m["friction"] = [
                {"stiffness": e["stiffness"] * level / reach, "reach": e["reach"] * reach}
                for e in m["friction"]
            ]
        for key, factor in self.factors.items():
            name, _, parameter = key.partition(".")
            for effect in m.get("effects", []):
                if effect["name"] == name and parameter in effect:
                    effect[parameter] = effect[parameter] * factor
        if "bias" in self.factors:
            _shift_bias(m["effects"], self.factors["bias"], m["force_constant"])
        if self.entries:
            m["effects"] = [*m.get("effects", []), *[dict(e) for e in self.entries]]
        return Stage.from_dict(data)

    def knobs(self) -> list[Knob]:
        """Return what can be turned: the believed numbers that are there, and all of the entries."""
        m = self.believed.mechanics
        found = [_of_stage("mass")]
        if any(e.get("name") in ANCHORS for e in m.effects):
            found.append(_of_stage("force_constant"))
        if m.viscous:
            found.append(_of_stage("viscous"))
        if isinstance(m.friction, list):
            found += [_of_stage("friction.level"), _of_stage("friction.reach")]
        if any(e.get("name") in BIASES for e in m.effects):
            size = 0.1 * self.believed.force_constant * self.believed.voltage_limit
            found.append(Knob(-1, "bias", "add", size, -1e6, 1e6))
        for effect in m.effects:
            name = str(effect["name"])
            if name not in (*ANCHORS, *BIASES):
                known = catalogue.entry(name).parameters
                found += [
                    Knob(-1, f"{name}.{p.name}", "log", 1.0, *OF_EFFECTS)
                    for p in known
                    if isinstance(effect.get(p.name), int | float)
                    and effect[p.name]
                    and not (p.choice or p.name in FIXED)
                ]
        for i, entry in enumerate(self.entries):
            for p in catalogue.entry(str(entry["name"])).parameters:
                value = entry.get(p.name)
                if isinstance(value, int | float) and value != 0 and not p.choice:
                    found.append(_knob(i, p, float(value), self.longest))
        return found

    def turned(self, knobs: Sequence[Knob], turns: Floats) -> Setting:
        """Return the setting with every knob turned by so much."""
        factors, entries = dict(self.factors), [dict(e) for e in self.entries]
        for knob, turn in zip(knobs, turns, strict=True):
            if knob.entry < 0:
                old = factors.get(knob.name, 0.0 if knob.kind == "add" else 1.0)
                factors[knob.name] = (
                    old + turn * knob.size if knob.kind == "add" else old * float(np.exp(turn))
                )
                continue
            old = float(entries[knob.entry][knob.name])  # type: ignore[arg-type]
            new = old + turn * knob.size if knob.kind == "add" else old * float(np.exp(turn))
            entries[knob.entry][knob.name] = float(np.clip(new, knob.low, knob.high))
        return self.having(entries, factors)


def _of_stage(name: str) -> Knob:
    return Knob(-1, name, "log", 1.0, *RANGE[name])


def _knob(entry: int, p: Parameter, value: float, longest: float) -> Knob:
    low = p.low + (1e-9 * abs(value) if p.open_low else 0.0)
    if p.name == "phase":
        return Knob(entry, p.name, "add", 1.0, -1e3, 1e3)
    if p.name == "period":
        return Knob(
            entry, p.name, "add", 0.1 * abs(value), 0.8 * value, max(min(1.2 * value, longest), value)
        )
    signed = p.low < 0.0
    if signed:
        return Knob(entry, p.name, "add", abs(value), low, p.high)
    size = abs(value)
    return Knob(entry, p.name, "log", size, max(low, size * np.exp(-MOST)), min(p.high, size * np.exp(MOST)))


def robust(off: Floats, scale: float) -> Floats:
    """Return 2 s^2 (sqrt(1 + (e/s)^2) - 1) of every error: squares near, straight lines far."""
    return np.asarray(2.0 * scale**2 * (np.sqrt(1.0 + (off / scale) ** 2) - 1.0))


def fit(
    setting: Setting, windows: Windows, scale: float, which: np.ndarray, tries: int = 40
) -> tuple[Setting, Floats, Sequence[Knob]]:
    """Turn every knob until the windows of `which` are off least; return setting, jacobian and knobs.

    Levenberg and Marquardt on errors whose far ones count less (`robust`), beyond `scale` (m).
    """
    knobs = setting.knobs()
    low, high = np.array([k.bounds(_value(setting, k)) for k in knobs]).T

    def errors(turns: Floats) -> Floats:
        off = windows.off(setting.turned(knobs, turns).stage(), which).ravel()
        return np.asarray(np.sign(off) * np.sqrt(robust(off, scale)))

    at = np.zeros(len(knobs))
    now = errors(at)
    jacobian = np.zeros((now.size, len(knobs)))
    damping = 1e-2
    for _ in range(tries):
        for j in range(len(knobs)):
            step = STEP if at[j] + STEP <= high[j] else -STEP
            moved = at.copy()
            moved[j] += step
            try:
                jacobian[:, j] = (errors(moved) - now) / step
            except ConfigError:
                jacobian[:, j] = 0.0
        gram, slope, before = jacobian.T @ jacobian, jacobian.T @ now, float(now @ now)
        better = False
        for _ in range(4):
            diagonal = np.diag(gram) + 1e-9 * np.trace(gram) / len(knobs) + 1e-300
            move = -np.linalg.solve(gram + damping * np.diag(diagonal), slope)
            trial = np.clip(at + np.clip(move, -0.5, 0.5), low, high)
            try:
                tried = errors(trial)
            except ConfigError:
                damping *= 10.0
                continue
            if float(tried @ tried) < before:
                better = True
                break
            damping *= 8.0
        if not better:
            break
        at, now = trial, tried
        damping = max(0.2 * damping, 1e-4)
        if float(now @ now) > (1.0 - 3e-4) * before:
            break
    return setting.turned(knobs, at), jacobian, knobs


def _value(setting: Setting, knob: Knob) -> float:
    if knob.entry < 0:
        return setting.factors.get(knob.name, 0.0 if knob.kind == "add" else 1.0)
    return float(setting.entries[knob.entry][knob.name])  # type: ignore[arg-type]
