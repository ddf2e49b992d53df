"""What an effect is.

An effect is one piece of physics, written once: its place in the chain, its parameters with units and
bounds, its kernel, where it comes from and how it is seen best. Simulation, force balance, feedforward
and diagnosis all read this entry. To add one, write a class like those in this folder and register it.

The chain, run for every integration step, in this order::

    drive        volts -> DRIVE force            (reads VOLTS, changes VOLTS, DRIVE, GAIN)
    disturbance  forces from outside             (adds to PUSH)
    mechanics    springs, weight, contact, mass  (adds to PUSH, changes MASS)
    friction     modifiers, then models and speed laws (see below)
    sensor       true to measured position       (changes SENSED; once a tick, not a step)

An effect may come in several `forms`: kernels of the same physics, with the same parameters. A stage file's
entry says which (``form: level``), without it the first. Names of effects are names of families.

Within a place, effects run by `order`, lowest first. The drive's orders stand in `drive`, the sensor's in
`sensor`; mechanics: mass (10), then second masses, which take from MASS what is left (20 resonance; 30
backlash, after which POSITION, MOVED, VELOCITY and PUSH are the load's), then what adds forces (50).
Friction::

     5  frictional-lag                  sets LATE, LATE_MIDWAY
    10  asymmetric-viscous-friction     sets SKEW
    15  non-congruent-friction          sets SOFTENS (its form by elements)
    20  stribeck                        REACH  (the yield level at equal stiffness)
        load-dependent-friction         REACH
        stiction-ageing                 REACH
        position-dependent-friction     REACH
        friction-drift                  SCALE  (the whole force; REACH in its forms of the level)
    30  creep                           MOVED less what the contacts creep
    40  asymmetric-friction             MOVED larger forward than backward
    50  models, bouc-wen, speed laws    add to FRICTION; a model leaves GRIP, GRIP_LEVEL, GRIP_STIFFNESS
    70  asymmetric-friction, closing    bends GRIP and exchanges it in FRICTION
        non-congruent-friction          the same (its form by branches)
    80  non-congruent-friction          bends GRIP and exchanges it in FRICTION (its first form)
   100  (end of backlash)               FRICTION and PUSH act on the load behind the play: BEHIND

What modifies friction acts on every model of the catalogue through these wires: displacement reaches a model
by MOVED only, speed by VELOCITY less LATE, its level by REACH, its size by SCALE, its curvature by SOFTENS.

What a search for a missing effect needs to know stands here too, and nowhere by name: `linear` parameters,
`neutral` values, `searchable`, `search_grid`, `whole_friction`, `moving_mass`, `behind`, `steady`,
`command_only`, `bias`, `known_law`, `stands_for`, `other_unit`,
`Parameter.physical_low` and `Parameter.held`. Each has its sentence at `Effect`; the defaults do for most.

To feed an effect forward, there are two ways, and its place says which:

- An effect on a signal on its way (VOLTS through the drive, SENSED through the sensor) has, where it can be
  undone, an `inverse`: a kernel with the same `p` and `s` that turns what comes out into what went in. The
  inverses of a chain run in reverse order.
- An effect that adds a force or changes a factor (DRIVE, PUSH, FRICTION, GAIN, MASS, REACH, SCALE) needs
  none: its own kernel is run on the reference with a state of its own, and what it adds is taken away, what
  it multiplies is divided by.
"""

from __future__ import annotations

import enum
import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from rtcomp.errors import ConfigError, nearest
from rtcomp.kernels import Floats, Kernel


class Place(enum.IntEnum):
    """Where in the chain an effect acts; the value is the order of evaluation."""

    DRIVE = 0
    MECHANICS = 1
    DISTURBANCE = 2
    FRICTION = 3
    SENSOR = 4


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: its name, unit, the range in which it makes sense, and what it is."""

    name: str
    unit: str
    low: float
    high: float
    says: str
    default: float | None = None
    open_low: bool = False
    """True where `low` itself is not allowed (a period of zero, say)."""
    choice: bool = False
    """True where only `low` and `high` are allowed: which of two kinds it is, no size that a fit moves."""
    physical_low: float | None = None
    """Lowest physical value, where a stage file may hold less: as a correction of a number that the stage
    holds elsewhere, or with the sign in place of half a turn of phase. A search goes no lower."""

    held: bool = False
    """True where a fit leaves it as it is: other parameters make up for any change of it."""
    high_in: Mapping[str, float] = field(default_factory=dict)
    """Highest value in a form of the effect, by its name, where that is not `high`."""

    @property
    def lowest(self) -> float:
        """Lowest physical value: `physical_low`, or `low` where none is stated."""
        return self.low if self.physical_low is None else self.physical_low

    def highest(self, form: str) -> float:
        """Return the highest value in a form of the effect, "" where it has one only."""
        return self.high_in.get(form, self.high)

    def check(self, value: Any, owner: str, form: str = "") -> float:
        """Return `value` as a float, or raise ConfigError naming the parameter, the value and the range."""
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ConfigError(
                f"{owner}: {self.name} is {value!r}; it must be a number ({self.unit})", key=(self.name,)
            )
        number, high = float(value), self.highest(form)
        inside = self.low < number <= high if self.open_low else self.low <= number <= high
        if not np.isfinite(number) or not inside:
            bracket = "(" if self.open_low else "["
            raise ConfigError(
                f"{owner}: {self.name} is {number:g} {self.unit}; "
                f"allowed is {bracket}{self.low:g}, {high:g}]",
                key=(self.name,),
            )
        if self.choice and number not in (self.low, self.high):
            raise ConfigError(
                f"{owner}: {self.name} is {number:g}; allowed is {self.low:g} or {self.high:g}",
                key=(self.name,),
            )
        return number


class Effect:
    """Base of every catalogue entry. Subclasses set the class attributes; most need no methods."""

    name: ClassVar[str]
    """The name in stage files, diagnoses and reports."""
    place: ClassVar[Place]
    parameters: ClassVar[Sequence[Parameter]]
    kernel: Kernel
    """``kernel(p, s, w)`` with `p` from `vector()`, `s` from `initial_state()` and `w` the wires: of the
    class that of its first form, of an effect that of its own."""
    forms: ClassVar[Mapping[str, Kernel]] = {}
    """Kernels of the same physics by the name of their form, the first one `kernel`; empty for one form only.
    All take the same parameters, state and neutral values, and are linear in the same parameters."""
    says: ClassVar[str]
    """What it is, one sentence."""
    equation: ClassVar[str]
    source: ClassVar[str]
    signature: ClassVar[str]
    """How it looks in a recording."""
    experiment: ClassVar[str]
    """The motion that shows it best."""
    example: ClassVar[Mapping[str, Any]]
    """A representative entry, as `from_dict` takes it, that shows within the motion of the contract tests:
    strokes of +-1 mm and of micrometres, speeds to 50 mm/s, +-8 V, 4 s. The tests run on it by themselves."""
    neutral: ClassVar[Mapping[str, Any] | None] = None
    """Values that, put over the example, make it change nothing; None where there are none. Of `linear`
    parameters these are where their change is counted from."""
    linear: ClassVar[Sequence[str]] = ()
    """Parameters that its share of the force balance is linear in, the others held: exactly where it adds a
    force, to first order around `neutral` (around 0 where none is stated) where it changes the friction, the
    drive, the sensor or the mass. Each is linear alone; together they are where it adds a force."""
    searchable: ClassVar[bool] = True
    """Whether a search for missing physics tries it. False for what every stage has or what is identified
    otherwise: friction models, the sensor's noise and resolution, free curves."""
    search_grid: ClassVar[Mapping[str, Sequence[float]]] = {}
    """Start values of a search for parameters without a unit, which gives others their scale. Several of one
    that has a default are all that it may be; from a single one a fit begins."""
    whole_friction: bool = False
    """Whether it asks for the whole of friction (its force or level), so that the friction with it at work is
    no longer a sum of what single friction elements do."""
    moving_mass: ClassVar[bool] = False
    """Whether it sets the moving mass or couples part of it elastically: a share of the stage's own."""
    behind: ClassVar[bool] = False
    """Whether part of the mass and the forces on it are behind it, with a motion of their own (a play)."""
    steady: ClassVar[bool] = False
    """Of the drive: whether its force stays as it is while the command is held. Forces beside the drive's,
    such as cogging's, do not count."""
    command_only: ClassVar[bool] = False
    """Of the drive: whether what it does depends on the command alone, wherever the axis is."""
    averages: ClassVar[bool] = False
    """Of the drive, where it remembers: whether what it gives over a step is the mean over that step."""
    bias: ClassVar[bool] = False
    """Whether it is a constant force on a linear axis."""
    known_law: ClassVar[bool] = False
    """Whether physics leaves it no other form, as of a weight: what it does not explain is something else."""
    stands_for: ClassVar[str] = ""
    """Key of the stage file's section ``stage`` that it is another way to write, "" for none: a fit moves
    that number instead."""
    other_unit: ClassVar[str] = ""
    """Unit of the stage in whose place it puts another, so that all numbers that have it move; "" for none.
    Its one parameter is the true over the believed unit."""
    inverse: ClassVar[Kernel | None] = None
    """Undoes the effect on the signal that it passes on (see above); None where it cannot or need not."""
    element: ClassVar[Sequence[Parameter]] = ()
    """Parameters of each entry of its list, where it takes one (see `lists.ListEffect`)."""
    order: int = 50
    states: ClassVar[int] = 0
    """Length of the kernel's own state."""

    def __init__(self, *, form: Any = None, **values: float) -> None:
        known = {p.name for p in self.parameters}
        for key in (*values, *(["form"] if form is not None and not self.forms else [])):
            if key not in known:
                raise ConfigError(
                    f"{self.name}: unknown parameter {key!r}; {nearest(key, self._names())}", key=(key,)
                )
        self.form = self._form(form)
        self.values: dict[str, float] = {}
        for parameter in self.parameters:
            value = values.get(parameter.name, parameter.default)
            if value is None:
                raise ConfigError(
                    f"{self.name}: parameter {parameter.name!r} ({parameter.unit}) is missing",
                    key=(parameter.name,),
                )
            self.values[parameter.name] = parameter.check(value, self.name, self.form)

    def _form(self, form: Any) -> str:
        """Take the kernel of `form`, None for the first; return its name, "" where there is one form only."""
        if not self.forms:
            return ""
        first = next(iter(self.forms))
        if form is None:
            return first
        if form not in list(self.forms):
            raise ConfigError(
                f"{self.name}: form is {form!r}; {nearest(str(form), self.forms)}", key=("form",)
            )
        self.kernel = self.forms[form]
        return str(form)

    def _names(self) -> list[str]:
        """Return the keys that an entry of this effect may have, without its name."""
        return [*(p.name for p in self.parameters), *(["form"] if self.forms else [])]

    def vector(self) -> Floats:
        """Return the parameters as the kernel's `p`."""
        return np.array([self.values[p.name] for p in self.parameters], dtype=np.float64)

    def initial_state(self) -> Floats:
        """Return the kernel's state at rest in the virgin state."""
        return np.zeros(self.states)

    def stiffness(self) -> float:
        """Largest stiffness (N/m) it can put on the mass; bounds the integration step."""
        return 0.0

    def stiffness_within(self, stroke: float) -> float:
        """Largest stiffness (N/m) within `stroke` (m) of position zero, where it grows with the position."""
        return self.stiffness()

    def damping(self) -> float:
        """Largest damping (N s/m) it can put on the mass; bounds the integration step."""
        return 0.0

    def damping_under(self, force: float) -> float:
        """Largest damping (N s/m) at any speed that `force` (N) can hold, where it grows with the speed."""
        return self.damping()

    def frequency(self) -> float:
        """Largest angular frequency (rad/s) it gives to any mass it stands on; bounds the integration step.

        For what brings a mass or stiffness in proportion to the stage's own: at a moving mass m it puts no
        more than m frequency()^2 of stiffness and m frequency() of damping on it.
        """
        return 0.0

    def longest_step(self) -> float:
        """Longest step (s) its kernel bears; rows of a recording are cut into such."""
        return math.inf

    def least_parts(self) -> int:
        """Parts that a row of a recording is cut into at least: several where its force jumps at the row."""
        return 1

    def companions(self) -> list[Effect]:
        """Effects that it needs elsewhere in the chain and that no stage lists."""
        return []

    def equivalent(self) -> Effect | None:
        """Return the effect of the sensor that no recording tells from this one of the drive, or the reverse.

        None where there is none: most effects.
        """
        return None

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as a stage file's ``effects`` lists it; the first form goes without saying."""
        form = {"form": self.form} if self.form not in ("", *list(self.forms)[:1]) else {}
        return {"name": self.name, **form, **self.values}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> Effect:
        """Build the effect from a stage file's entry (without its name)."""
        return cls(**entry)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self._shown())})"

    def _shown(self) -> list[str]:
        form = [f"form={self.form!r}"] if self.form else []
        return [*form, *(f"{k}={v:g}" for k, v in self.values.items())]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Effect) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]
