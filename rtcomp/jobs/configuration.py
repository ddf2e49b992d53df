"""A run configuration: a stage file, and beside it what to do with the stage."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator
from rtcomp_drivers.registry import find, names

from rtcomp.control.reference_settings import ReferenceSettings, reference_settings
from rtcomp.control.references import Reference, build_reference, check
from rtcomp.errors import ConfigError, LimitError
from rtcomp.hysteresis import Basis, Learner, basis_named, build_learner
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.moving.self_placing import SelfPlacingBasis
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.arming import Arming
from rtcomp.jobs.limit_settings import Limits, Loop, Positive, beyond_stage
from rtcomp.stage.schema import StageFile
from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import Section, YamlFile, load_yaml, validate

Times = Annotated[list[Annotated[float, Field(ge=0)]], Field(min_length=2, max_length=2)]


AUTO = "auto"
"""In the place of a basis: the interval operator, and the shape that pays on motion not learned from."""
MODELS = (
    "basis: interval, self-placing, shaped-interval, stop, extended-stop, preisach; or auto, the shape that "
    "pays"
)


class Shape(Section):
    """The section ``identify.shape``: what the model shaped-interval adds to the interval operator."""

    parts: list[Literal["reversible", "position", "output", "branches"]] = Field(
        ["reversible", "position", "output"], description="what is added"
    )
    places: int = Field(5, ge=3, le=25, description="points of the range where weights may differ, odd")
    groups: int | None = Field(None, ge=1, description="of intervals whose weights differ alike; 4")
    skew: float = Field(0.0, ge=-0.9, le=0.9, description="how much stiffer forward; ratchets, see the docs")
    grain: float = Field(0.0, ge=0, description="m, motion back and forth that a skew does not count")
    smooth: float = Field(0.0, ge=0, le=10, description="halves of the range over which weights are alike")


class Identify(Section):
    """The section ``identify``: the model and how it learns."""

    model: str = Field("interval", description=MODELS)
    intervals: int = Field(20, ge=1, le=100_000, description="number of elements")
    range: Positive | None = Field(None, description="m, from full saturation to full saturation")
    spacing: float = Field(1.0, ge=1e-3, le=1e3, description="last width over first")
    widths: Annotated[list[Positive], Field(min_length=1)] | None = Field(
        None, description="m, each interval, instead of the three above"
    )
    learner: dict[str, Any] = Field(
        default_factory=lambda: {"learner": "rls", "forgetting": 0.9995},
        description="learner and its settings",
    )
    smoothing: float = Field(0.0, ge=0, description="Hz, low-pass of position and force alike; 0 for none")
    gate: float = Field(0.0, ge=0, description="m of motion between two updates")
    offset: bool = Field(True, description="learn a constant force too")
    prior: Literal["none", "non-increasing"] = Field("none", description="what is known of the virgin curve")
    beyond: Literal["zero", "continue"] = Field(
        "zero", description="weights of intervals hardly reached: none, or the fall of the known ones goes on"
    )
    learn: Times | None = Field(None, description="s, when to learn; all of the run if not given")
    shape: Shape | None = Field(None, description="of the model shaped-interval")

    @field_validator("model")
    @classmethod
    def _known_basis(cls, value: str) -> str:
        if value != AUTO:
            basis_named(value)
        return value

    @field_validator("learner")
    @classmethod
    def _known_learner(cls, value: dict[str, Any]) -> dict[str, Any]:
        build_learner(value)
        return value

    @model_validator(mode="after")
    def _one_way_to_say_where(self) -> Identify:
        if self.widths is None and self.range is None:
            raise ValueError("give range (m, from full saturation to full saturation) or widths")
        if self.widths is not None and self.range is not None:
            says = "range and widths are both given; the widths alone say where the intervals lie"
            raise ConfigError(says, key=("range",))
        for key, given in (("prior", self.prior != "none"), ("widths", self.widths is not None)):
            if given and self.model not in ("interval", SelfPlacingBasis.name, AUTO):
                raise ConfigError(f"speaks of intervals; model is {self.model!r}", key=(key,))
        with_continuation = ("interval", SelfPlacingBasis.name, ShapedIntervalBasis.name, AUTO)
        if self.beyond != "zero" and self.model not in with_continuation:
            raise ConfigError(f"speaks of intervals; model is {self.model!r}", key=("beyond",))
        if self.shape is not None and self.model != ShapedIntervalBasis.name:
            raise ConfigError(f"speaks of the model shaped-interval; model is {self.model!r}", key=("shape",))
        if self.shape is not None and self.shape.smooth:
            learner = build_learner(self.learner)
            if not learner.knows_likeness:
                says = f"needs a learner that keeps a covariance, rls; the learner is {learner.name}"
                raise ConfigError(says, key=("shape", "smooth"))
        if self.learn is not None:
            _in_order(self.learn, ("learn",))
        return self


def _in_order(window: list[float], key: tuple[str, ...] = ()) -> None:
    if not window[0] < window[1]:
        raise ConfigError(f"is [{window[0]:g}, {window[1]:g}] s; the start must come first", key=key)


class Judge(Section):
    """The section ``judge``: the motion that frozen weights are judged on."""

    reference: ReferenceSettings | None = Field(None, description="another motion of the stage")
    window: Times | None = Field(None, description="s of a recording")
    settle: float = Field(0.0, ge=0, description="s left out while the model's memory fills")

    @field_validator("window")
    @classmethod
    def _ordered(cls, value: list[float] | None) -> list[float] | None:
        if value is not None:
            _in_order(value)
        return value


class Compensate(Section):
    """The section ``compensate``."""

    reference: ReferenceSettings | None = Field(None, description="motion to compare on; else the first one")
    settle: float = Field(1.0, ge=0, description="s at the start that the comparison leaves out")
    learn: bool = Field(False, description="go on learning while compensating")


class Relax(Section):
    """The section ``relax``: decaying reversals before each run on a real device, about where it stands.

    Friction remembers what the stage did before; models and compensators start from the virgin state. A
    motion that dies out slowly brings every contact back to it, as the paper does with magnetism.
    """

    amplitude: Positive = Field(description="m, of the first reversal; as far as friction remembers")
    ratio: float = Field(0.8, gt=0.2, lt=0.99, description="from one reversal to the next")
    count: int = Field(24, ge=4, le=1000, description="of reversals")
    stroke_time: Positive = Field(0.15, description="s from reversal to reversal")


class RecordingSection(Section):
    """The section ``recording``: what to make of a recording given on the command line."""

    map: dict[str, str] = Field(default_factory=dict, description="our column: the file's column")
    rate: Positive | None = Field(None, description="Hz, to resample to; else the median rate")
    delay_ticks: int = Field(0, ge=0, le=10, description="rows until a recorded command takes effect")


class RunFile(StageFile):
    """A whole run configuration."""

    reference: ReferenceSettings | None = None
    clock: Literal["virtual", "wall"] | None = Field(None, description="wall on links, virtual in simulation")
    device: dict[str, Any] = Field(default_factory=lambda: {"driver": "simulated"})
    limits: Limits = Field(default_factory=lambda: Limits.model_validate({}))
    loop: Loop = Field(default_factory=lambda: Loop.model_validate({}))
    identify: Identify | None = None
    judge: Judge = Field(default_factory=lambda: Judge.model_validate({}))
    relax: Relax | None = None
    compensate: Compensate = Field(default_factory=lambda: Compensate.model_validate({}))
    recording: RecordingSection = Field(default_factory=lambda: RecordingSection.model_validate({}))
    seed: int = Field(0, ge=0, description="of the simulated noise")


@dataclass(frozen=True)
class Configuration:
    """A checked run configuration with the objects it stands for."""

    run: RunFile
    stage: Stage
    file: YamlFile
    plant: Stage | None = None
    """What the driver ``simulated`` simulates, where that is not what is believed."""
    arming: Arming = field(default_factory=Arming)
    """Whether hardware may move."""

    @classmethod
    def load(cls, path: str | Path) -> Configuration:
        """Read and check the file; raise ConfigError or LimitError in one line naming file, line and key."""
        return cls.of(load_yaml(path))

    @classmethod
    def of(cls, file: YamlFile) -> Configuration:
        """Check a configuration that has been read, or made."""
        run = validate(RunFile, file)
        driver = run.device.get("driver")
        if "device" in file.data and driver in names():  # another machine's driver matters only where used
            validate(find(driver).Settings, file, ("device",))
        stage_keys = set(StageFile.model_fields)
        stage = Stage(StageFile.model_validate(run.model_dump(include=stage_keys, exclude_unset=True)))
        for key, says in beyond_stage(run.limits, stage):
            raise file.error(key, says)
        return cls(run, stage, file)

    @property
    def path(self) -> Path:
        """Where it was read from."""
        return self.file.path

    @property
    def period(self) -> float:
        """Time between two ticks (s)."""
        return 1.0 / self.stage.rate

    @property
    def voltage_limit(self) -> float:
        """Largest command (V)."""
        return self.run.limits.voltage or self.stage.voltage_limit

    @property
    def wall_clock(self) -> bool:
        """Whether deadlines are real: unless told otherwise, on everything but simulation and replay."""
        if self.run.clock is not None:
            return self.run.clock == "wall"
        return self.real_device

    @property
    def real_device(self) -> bool:
        """Whether the stage stands somewhere, with a past: on everything but simulation and replay."""
        return self.run.device.get("driver") not in ("simulated", "replay")

    @property
    def stop_file(self) -> Path | None:
        """The file that stops a run while it exists; a relative one lies beside the configuration."""
        name = self.run.limits.stop_file
        return None if name is None else self.path.parent / name

    def relaxing(self, start: float) -> tuple[Reference, float] | None:
        """Return the decaying reversals about `start` (m) of the section ``relax``, checked, if any.

        And the time (s) over which the axis is let go after them: that of one stroke.
        """
        relax = self.run.relax
        if relax is None:
            return None
        entry = {"kind": "nested-reversals", **relax.model_dump(), "offset": start, "start": start}
        return self._checked(build_reference(reference_settings(entry)), "relax"), relax.stroke_time

    def reference(self, section: str = "", start: float | None = None) -> Reference:
        """Return the reference of `section` (``judge``, ``compensate``), else the main one, checked.

        It begins where the configuration says, or at `start` (m), where the stage was found.
        """
        settings, key = None, "reference"
        if section:
            settings = getattr(self.run, section).reference
            key = f"{section}.reference" if settings is not None else key
        settings = settings or self.run.reference
        if settings is None:
            raise ConfigError(f"{self.path}: section reference is missing; say how the stage shall move")
        reference = self._checked(build_reference(settings, start=start, folder=self.path.parent), key)
        self._check_times(section or "judge", reference.duration)
        return reference

    def _checked(self, reference: Reference, key: str) -> Reference:
        try:
            self._check(reference)
        except LimitError as error:
            raise LimitError(f"{self.file.at(tuple(key.split('.')))}: {key}: {error}") from error
        return reference

    def _check_times(self, section: str, duration: float) -> None:
        """Raise ConfigError where nothing of a run so long (s) would be learned from, or judged."""
        settle = getattr(self.run, section).settle
        if settle >= duration:
            raise self.file.error(
                (section, "settle"), f"is {settle:g} s, but the reference ends at {duration:g} s"
            )
        learn = self.run.identify.learn if self.run.identify is not None else None
        if learn is not None and section == "judge" and learn[0] >= duration:
            raise self.file.error(
                ("identify", "learn"), f"begins at {learn[0]:g} s, but the reference ends at {duration:g} s"
            )

    def _check(self, reference: Reference) -> None:
        limits, stage = self.run.limits, self.stage
        force = self.voltage_limit * stage.force_constant
        viscous = stage.mechanics.viscous
        check(
            reference,
            stroke=None if limits.travel is None else (limits.travel[0], limits.travel[1]),
            speed=min(limits.speed or math.inf, force / viscous if viscous else math.inf),
            acceleration=min(limits.acceleration or math.inf, force / stage.mass),
        )

    def basis(self) -> Basis:
        """Return the hysteresis basis that ``identify`` asks for."""
        section = self.identify
        try:
            if section.widths is not None:
                return self.moving(IntervalBasis(section.widths))
            assert section.range is not None
            if section.shape is not None:
                shape = section.shape.model_dump()
                return ShapedIntervalBasis.over(section.intervals, section.range, section.spacing, **shape)
            name = IntervalBasis.name if section.model == AUTO else section.model
            return basis_named(name).over(section.intervals, section.range, section.spacing)
        except ConfigError as error:
            laid = section.widths is None and error.key[:1] == ("widths",)  # by range, intervals and spacing
            raise self.file.error(("identify", *(("range",) if laid else error.key)), str(error)) from error

    def moving(self, basis: Basis) -> Basis:
        """Return a model's basis, its intervals free to move on where ``identify`` asks for that."""
        section = self.run.identify
        if section is None or section.model != SelfPlacingBasis.name or not isinstance(basis, IntervalBasis):
            return basis
        return SelfPlacingBasis(basis.widths)

    def learner(self) -> Learner:
        """Return the learner that ``identify`` asks for."""
        return build_learner(self.identify.learner)

    @property
    def identify(self) -> Identify:
        """The section ``identify``; raises ConfigError where there is none."""
        if self.run.identify is None:
            raise ConfigError(f"{self.path}: section identify is missing; say at least identify.range (m)")
        return self.run.identify

    def changed(self, **sections: Any) -> Configuration:
        """Return the configuration with whole top-level sections replaced."""
        changed = Configuration.of(replace(self.file, data={**self.file.data, **sections}))
        return replace(changed, plant=self.plant, arming=self.arming)

    def simulating(self, plant: Stage) -> Configuration:
        """Return the configuration with `plant` simulated; the loop goes on believing its own stage."""
        return replace(self, plant=plant)
