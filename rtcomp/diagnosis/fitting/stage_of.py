"""From a fitted model to a stage in the belief's own format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.at_hand import by_weights
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.balance import BASE, ForceBalance
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Parameter, catalogue
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.stage import Stage
from rtcomp.units import power_of

UNITS = {
    "mass": "kg",
    "force_constant": "N/V",
    "viscous": "N s/m",
    "micro_damping": "N s/m",
    "micro_damping_speed": "m/s",
}
"""Numbers of the stage file's section ``stage`` that have a force or a length in their unit."""
SLIGHT = 1e-6
"""Part of the largest yield force below which a friction unit is left out; of the drive's force too, where no
effect makes many times as much of it."""


def stage_of(balance: ForceBalance, fitted: Fitted, *, between: bool = False) -> Stage:
    """Return the believed stage with the fit's numbers, and the fit's entries among its effects.

    `between` shares out friction that is not believed to places between those of the grid: as the recording's
    own friction, it is then not quite within reach of a fit on the grid.
    """
    c = fitted.coefficients
    data = balance.stage.to_dict()
    mechanics: dict[str, Any] = data["stage"]
    for key, value in zip(BASE, c, strict=False):
        mechanics[key] = float(max(value, 0.0))
    mechanics["micro_damping_speed"] = balance.speed_of(c)
    stiffness, reaches = c[balance.friction], balance.reaches
    if between:
        stiffness, reaches = _between(balance, stiffness)
    level = stiffness * reaches
    force = float(np.sqrt(np.mean(np.concatenate([s.voltage for s in balance.data.segments]) ** 2)))
    none = 0.0 if by_weights(balance, fitted.entries) else force * balance.stage.force_constant
    least = SLIGHT * max(float(level.max()), none)
    units = [(float(k), float(r)) for k, r, f in zip(stiffness, reaches, level, strict=True) if f > least]
    kept = [float(factor) for factor in c[balance.model] if factor > SLIGHT]
    model = [friction_in("N", data["stage"]["friction"], factor) for factor in kept]
    mechanics.pop("friction", None)
    if model or units:
        mechanics["friction"] = model[0] if model else bank(units, balance.exponent)
    believed: list[Entry] = []
    at = iter(fitted.system.of_entry)
    refitted = {id(e): next(at) for e in balance.believed}
    by_content = {repr(e): refitted[id(e)] for e in balance.believed}
    for entry in mechanics.get("effects", []):
        span = by_content.get(repr(dict(entry)))
        believed.append(dict(entry) if span is None else ent.composed(entry, c[span]))
    offset = float(c[balance.size - 1])
    constant: list[Entry] = [bias_entry(-offset)] if offset != 0.0 else []
    stops: Entry = {"name": MaxwellSlip.name, "elements": bank(units, 0.0)}
    besides = [stops] if model and units else []
    effects = merged([*believed, *constant, *fitted.entries, *besides])
    mechanics["effects"] = effects
    if not effects:
        del mechanics["effects"]
    try:
        return Stage.from_dict(data)
    except ValueError as error:
        raise ConfigError(f"a fit ran away: it has numbers that no stage may have ({error})") from error


def in_units(stage: Stage, unit: str, factor: float) -> Stage:
    """Return `stage` in another `unit`, ``"N"`` or ``"m"``: numbers times `factor` for each that they have.

    For a command it moves as it did where force is another; where length is, `factor` times as far.
    """
    m = stage.mechanics
    changes: dict[str, Any] = {
        key: factor ** power_of(unit, of) * getattr(m, key) for key, of in UNITS.items()
    }
    friction = stage.to_dict()["stage"].get("friction")
    if friction:
        changes["friction"] = friction_in(unit, friction, factor)
    changed = stage.with_changes(stage=changes).to_dict()
    effects = [dict(e) for e in changed["stage"].get("effects", [])]
    if effects:
        changed["stage"]["effects"] = [_in_units(e, unit, factor) for e in effects]
    return Stage.from_dict(changed)


def bank(elements: Sequence[tuple[float, ...]], exponent: float) -> Any:
    """Return elements (N/m, m) as friction of a stage file, yielding by Dahl's law; of 0, stops."""
    units = [{"stiffness": float(k), "reach": float(r)} for k, r in elements]
    if exponent == 0.0:
        return units
    return {"model": MaxwellSlip.name, "exponent": exponent, "elements": units}


def friction_in(unit: str, friction: Any, factor: float) -> Any:
    """Return friction of a stage file in another `unit`: stop elements, or a model of the catalogue."""
    if isinstance(friction, list):
        return [_scaled(MaxwellSlip.element, each, unit, factor) for each in friction]
    kind = catalogue.entry(str(friction["model"]))
    found = _scaled(kind.parameters, friction, unit, factor)
    items = friction.get("elements")
    return found if items is None else {
        **found, "elements": [_scaled(kind.element, each, unit, factor) for each in items]
    }  # fmt: skip


def _scaled(
    parameters: Sequence[Parameter], entry: Mapping[str, Any], unit: str, factor: float
) -> dict[str, Any]:
    times = {p.name: factor ** power_of(unit, p.unit) for p in parameters if p.name in entry}
    return {**entry, **{name: float(entry[name]) * by for name, by in times.items()}}


def with_effect(stage: Stage, entry: Mapping[str, Any]) -> Stage:
    """Return a stage with one effect more."""
    effects = [*(dict(e) for e in stage.to_dict()["stage"].get("effects", [])), dict(entry)]
    return stage.with_changes(stage={"effects": effects})


def _in_units(entry: dict[str, Any], unit: str, factor: float) -> dict[str, Any]:
    if not ent.adds_force(ent.kind_of(entry)):
        return entry
    powers = np.array([power_of(unit, of) for of in ent.units_of(entry)], dtype=float)
    return ent.composed(entry, factor**powers * ent.sizes_of(entry))


def bias_entry(force: float) -> Entry:
    """Return the catalogue's plainest constant force (N)."""
    kinds = [k for k in catalogue.entries() if k.bias and ent.adds_force(k)]
    kind = min(kinds, key=lambda k: len(k.parameters))
    return {"name": kind.name, kind.linear[0]: force}


def _between(balance: ForceBalance, stiffness: Floats) -> tuple[Floats, Floats]:
    """Return stiffnesses (N/m) and reaches (m) of units halfway between those of the grid, same forces."""
    reaches = balance.reaches
    grid = ~np.isin(reaches, balance.believed_reaches)
    away = np.exp(0.5 * balance.step)
    below, above = reaches[grid] / away, reaches[grid] * away
    half = 0.5 * stiffness[grid] * reaches[grid]
    made = np.concatenate([reaches[~grid], below, above])
    stiff = np.concatenate([stiffness[~grid], half / below, half / above])
    order = np.argsort(made)
    return stiff[order], made[order]


def merged(effects: Sequence[Entry]) -> list[Entry]:
    """Return effects, those of one name that differ in linear parameters only added up."""
    found: list[Entry] = []
    for entry in effects:
        kind = ent.kind_of(entry)
        plain = ent.adds_force(kind) and bool(kind.linear) and set(entry) <= {"name", *kind.linear}
        same = next(
            (e for e in found if plain and e["name"] == entry["name"] and set(e) <= {"name", *kind.linear}),
            None,
        )
        if same is None:
            found.append(dict(entry))
            continue
        for name in kind.linear:
            if name in entry or name in same:
                same[name] = float(same.get(name, 0.0)) + float(entry.get(name, 0.0))
    return found
