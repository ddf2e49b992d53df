"""Entries: effects with the values of their parameters, and which of these a fit moves.

Everything here is read from the catalogue: in which parameters an effect is linear, where it changes nothing,
which wires its kernel writes.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from functools import cache
from typing import Any, cast

import numpy as np

from rtcomp import physics
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Parameter, Place, catalogue, wires
from rtcomp.physics.program import Program, run_chain

Entry = dict[str, Any]
"""``{name: ..., parameter: value, ...}``, as a stage file's ``effects`` lists it."""

ADDED = (wires.DRIVE, wires.PUSH, wires.FRICTION)
"""Wires to which forces are added."""
AMPLITUDE, PERIOD, PHASE, MOMENT = "amplitude", "period", "rad", "time"


def kind_of(entry: Mapping[str, Any]) -> type[Effect]:
    """Return the catalogue's class of an entry."""
    return catalogue.entry(str(entry["name"]))


def happens_once(kind: type[Effect]) -> bool:
    """Tell whether an effect is a single event, at a moment of its own."""
    return any(p.name == MOMENT for p in kind.parameters)


def build(entry: Mapping[str, Any]) -> Effect:
    """Build the effect of an entry; raise ConfigError where a value is out of its bounds."""
    return physics.build(entry)


def adds_force(kind: type[Effect]) -> bool:
    """Tell whether an effect only adds a force of free size, which the other forces do not change."""
    return bool(_adds_force(cast(Hashable, kind)))


def waves(kind: type[Effect], entry: Mapping[str, Any]) -> bool:
    """Tell whether a phase only shifts an entry's force along a sine, so that two quarter periods span it."""
    phases = [p.name for p in kind.parameters if p.unit == PHASE and p.name in entry]
    return bool(phases) and bool(_sinusoidal(cast(Hashable, kind), str(entry.get("form", ""))))


def goes_by_time(kind: type[Effect]) -> bool:
    """Tell whether what an effect does goes by the time of the run, and neither once nor in a wave."""
    once_or_wave = happens_once(kind) or any(p.unit == PHASE for p in kind.parameters)
    return not once_or_wave and bool(_by_time(cast(Hashable, kind)))


def goes_by_friction(kind: type[Effect]) -> bool:
    """Tell whether what an effect does goes by the force that the friction model holds."""
    return bool(_by_friction(cast(Hashable, kind)))


def changes_speed(kind: type[Effect]) -> bool:
    """Tell whether an effect changes the speed that viscous friction goes by."""
    return bool(_changes_speed(cast(Hashable, kind)))


@cache
def _changes_speed(kind: Any) -> bool:
    return bool(np.any(_changes(kind.from_dict(kind.example))[:, [wires.LATE, wires.SKEW]]))


@cache
def _adds_force(kind: Any) -> bool:
    if kind.place is Place.SENSOR or not kind.linear:
        return False
    for form in kind.forms or ("",):
        effect = kind.from_dict({**kind.example, **({"form": form} if form else {})})
        made = [_changes(effect, other) for other in (0.0, 0.7)]
        rest = np.setdiff1d(np.arange(wires.COUNT), ADDED)
        if np.any(made[0][:, rest]) or not np.allclose(made[0], made[1], rtol=1e-9, atol=1e-12):
            return False
    return True


@cache
def _sinusoidal(kind: Any, form: str) -> bool:
    phase = next(p.name for p in kind.parameters if p.unit == PHASE)
    found = []
    for angle in (0.0, 0.5 * math.pi, 0.7):
        entry = {**kind.example, phase: angle, **({"form": form} if form else {})}
        zero = {**entry, **{n: neutral(kind, n) for n in kind.linear if _of_wave(n)}}
        found.append(_changes(kind.from_dict(entry)) - _changes(kind.from_dict(zero)))
    expected = math.cos(0.7) * found[0] + math.sin(0.7) * found[1]
    return bool(np.allclose(found[2], expected, rtol=1e-6, atol=1e-9 * float(np.abs(found[0]).max())))


@cache
def _by_time(kind: Any) -> bool:
    effects = [kind.from_dict(kind.example) for _ in range(2)]
    made = [_changes(effect, later=later) for effect, later in zip(effects, (0.0, 1.0), strict=True)]
    return not np.allclose(made[0], made[1], rtol=1e-6, atol=1e-12)


@cache
def _by_friction(kind: Any) -> bool:
    effects = [kind.from_dict(kind.example) for _ in range(2)]
    made = [_changes(effect, held=held) for effect, held in zip(effects, (0.0, 3e-4), strict=True)]
    return not np.allclose(made[0], made[1], rtol=1e-6, atol=1e-12)


def _changes(effect: Effect, other: float = 0.0, later: float = 0.0, held: float = 0.0) -> Floats:
    """Return what an effect changes on the wires along a motion like its example's, beside `other` forces.

    The motion begins so many seconds `later` than the run, and friction has `held` so much more (N).
    """
    random = np.random.default_rng(0)
    count = 400
    given = random.uniform(0.5, 1.5, (count, wires.COUNT)) * 1e-3
    given[:, wires.STEP] = 0.01
    given[:, wires.TIME] = later + 0.01 * np.arange(1, count + 1)
    given[:, wires.VOLTS] = random.uniform(-10.0, 10.0, count)
    given[:, wires.POSITION] = random.uniform(-1e-3, 1e-3, count)
    given[:, wires.VELOCITY] = random.uniform(-0.05, 0.05, count)
    given[:, [wires.REACH, wires.SCALE, wires.MASS, wires.GAIN]] = 1.0
    given[:, [wires.LATE, wires.LATE_MIDWAY, wires.SKEW, wires.STIFFENS, wires.FOLLOWS, wires.SOFTENS]] = 0.0
    given[:, [*ADDED, wires.GRIP, wires.GRIP_LEVEL, wires.GRIP_STIFFNESS]] += other
    given[:, wires.GRIP] += held
    if other:
        given[:, wires.VOLTS] *= 1.0 + other
    program, made = Program([effect]), given.copy()
    for row in made:
        run_chain(program.steps, program.p, program.s, row, 0, 1)
    return made - given


def parameter(kind: type[Effect], name: str) -> Parameter:
    """Return a parameter of an effect by its name."""
    return next(p for p in kind.parameters if p.name == name)


def highest(entry: Mapping[str, Any], p: Parameter) -> float:
    """Return the highest value of a parameter in the form that the entry states, without one in the first."""
    return p.highest(str(entry.get("form", next(iter(kind_of(entry).forms), ""))))


def neutral(kind: type[Effect], name: str) -> float:
    """Return the value of a parameter at which the effect changes nothing, 0 where none is stated."""
    return float((kind.neutral or {}).get(name, 0.0))


def free_parameters(entry: Mapping[str, Any], *, linear: bool) -> list[Parameter]:
    """Return the parameters that the entry states and a fit moves; the `linear` ones of a force, or not."""
    kind = kind_of(entry)
    own = [p for p in kind.parameters if p.name in entry and not _settled(kind, p)]
    if not adds_force(kind):
        return [] if linear else own
    wave = waves(kind, entry)
    ruled = [p for p in own if p.name in kind.linear or (p.unit == PHASE and wave)]
    return [p for p in own if (p in ruled) == linear]


def shape_parameters(entry: Mapping[str, Any]) -> list[Parameter]:
    """Return the parameters that the entry states and a fit moves, but for its sizes: what bends its law."""
    kind = kind_of(entry)
    own = [*free_parameters(entry, linear=True), *free_parameters(entry, linear=False)]
    return [p for p in own if p.name not in kind.linear]


def is_form(kind: type[Effect], p: Parameter) -> bool:
    """Tell whether a parameter says in which form an effect comes: it has a default and a few values.

    Of a single value in the grid a fit begins.
    """
    return p.choice or (p.default is not None and len(kind.search_grid.get(p.name, ())) > 1)


def in_other_forms(entry: Mapping[str, Any]) -> list[Entry]:
    """Return an entry in each other form that one of its parameters may have."""
    kind = kind_of(entry)
    forms = [p for p in kind.parameters if p.name in entry and is_form(kind, p)]
    values = [(p.name, v) for p in forms for v in kind.search_grid.get(p.name) or (p.low, p.high)]
    return [{**entry, name: value} for name, value in values if value != entry[name]]


def _settled(kind: type[Effect], p: Parameter) -> bool:
    """Tell whether a parameter is settled by the search: a form is, and a moment, between two rows."""
    return p.held or p.name == MOMENT or is_form(kind, p)


def _sized(entry: Mapping[str, Any]) -> list[tuple[str, tuple[float, ...]]]:
    """Return the linear parameters that an entry states, with the phases at which each is a column."""
    kind = kind_of(entry)
    wave = waves(kind, entry)
    quarter = (0.0, 0.5 * math.pi)
    return [(n, quarter if wave and _of_wave(n) else ()) for n in kind.linear if n in entry]


def _of_wave(name: str) -> bool:
    """Tell whether a linear parameter is the size of what has the phase, where an effect has one."""
    return name == AMPLITUDE


def _phases(entry: Mapping[str, Any]) -> list[str]:
    return [p.name for p in kind_of(entry).parameters if p.unit == PHASE and p.name in entry]


def basis(entry: Mapping[str, Any]) -> list[Entry]:
    """Return entries of unit size whose forces, in free proportions, are all that the `entry` can add.

    One for each linear parameter; of a sine two, a quarter of a period apart.
    """
    kind = kind_of(entry)
    still = {n: neutral(kind, n) for n in kind.linear if n in entry}
    found = []
    for name, quarters in _sized(entry):
        one = {**entry, **still, name: 1.0}
        found += [{**one, **dict.fromkeys(_phases(entry), q)} for q in quarters] or [one]
    return found


def composed(entry: Mapping[str, Any], sizes: Floats) -> Entry:
    """Return `entry` with the sizes of its `basis` put back into its linear parameters and phase."""
    out, at = dict(entry), 0
    for name, quarters in _sized(entry):
        if quarters:
            sine, cosine = float(sizes[at]), float(sizes[at + 1])
            out[name] = min(math.hypot(sine, cosine), highest(entry, parameter(kind_of(entry), name)))
            out.update(dict.fromkeys(_phases(entry), math.atan2(cosine, sine)))
        else:
            out[name] = float(sizes[at])
        at += max(len(quarters), 1)
    return out


def sizes_of(entry: Mapping[str, Any]) -> Floats:
    """Return the sizes of the `basis` that make the entry."""
    found: list[float] = []
    for name, quarters in _sized(entry):
        size = float(entry[name])
        if quarters:
            phase = float(entry[_phases(entry)[0]])
            found += [size * math.cos(phase), size * math.sin(phase)]
        else:
            found.append(size)
    return np.array(found)


def wave_of(entry: Mapping[str, Any]) -> slice | None:
    """Return where among the sizes of the `basis` the two of a wave stand; None where there is no wave."""
    sized = _sized(entry)
    found = (slice(at, at + len(quarters)) for at, (_, quarters) in enumerate(sized) if quarters)
    return next(found, None)


def units_of(entry: Mapping[str, Any]) -> list[str]:
    """Return the unit of each of these sizes."""
    kind = kind_of(entry)
    return [parameter(kind, name).unit for name, quarters in _sized(entry) for _ in quarters or (0.0,)]


def amounts_of(entry: Mapping[str, Any]) -> dict[str, float]:
    """Return the linear parameters that the entry states, by name: of a wave one, whatever its phase."""
    return {n: float(entry[n]) for n in kind_of(entry).linear if n in entry}


def all_amounts(entries: Sequence[Mapping[str, Any]]) -> Floats:
    """Return the linear parameters that entries state, one after the other."""
    return np.array([amount for entry in entries for amount in amounts_of(entry).values()])


def turns(entry: Mapping[str, Any]) -> bool:
    """Tell whether an entry is a wave that repeats with the angle itself, as a weight: it has no period."""
    units = {p.unit for p in kind_of(entry).parameters}
    return PHASE in units and not units & {"m", "Hz"} and bool(entry.get(AMPLITUDE))


def tone_of(entry: Mapping[str, Any]) -> float:
    """Return the frequency (Hz) of an entry that is a wave in time, 0 for any other."""
    units = {p.unit: p.name for p in kind_of(entry).parameters}
    return float(entry[units["Hz"]]) if PHASE in units and "Hz" in units else 0.0


def with_other_unit(unit: str, size: float) -> Entry:
    """Return the entry that puts another unit, true over believed of this `size`, in the place of a unit."""
    kind = next(kind for kind in catalogue.entries() if kind.other_unit == unit)
    return {"name": kind.name, kind.parameters[0].name: size}


def bounds_of(entry: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Return the lowest and highest size of each of the `basis`."""
    kind = kind_of(entry)
    low: list[float] = []
    high: list[float] = []
    for name, quarters in _sized(entry):
        p = parameter(kind, name)
        shifted = bool(_phases(entry)) and _of_wave(name)
        most = highest(entry, p)
        low += [-most if shifted else p.lowest] * max(len(quarters), 1)
        high += [most] * max(len(quarters), 1)
    return np.array(low), np.array(high)


def names(entries: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the names of entries."""
    return tuple(str(e["name"]) for e in entries)
