"""The `reference:` section of a configuration: which motion, how large, how fast.

`ReferenceSettings` is a union by `kind`; embed it as a field of a section's model.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import pydantic
from pydantic import Field
from pydantic.config import JsonDict

from rtcomp.errors import ConfigError
from rtcomp.yamlfile import Section
from rtcomp.yamlfile.problems import from_pydantic, not_finite

_M: JsonDict = {"unit": "m"}
_S: JsonDict = {"unit": "s"}
_HZ: JsonDict = {"unit": "Hz"}
_RAD: JsonDict = {"unit": "rad"}

Amplitude = Annotated[float, Field(gt=0, le=1e3, json_schema_extra=_M)]
Frequency = Annotated[float, Field(gt=0, le=1e5, json_schema_extra=_HZ)]
Seconds = Annotated[float, Field(gt=0, le=1e6, json_schema_extra=_S)]
Corner = Annotated[float, Field(gt=0, le=1)]


class _Common(Section):
    start: float = Field(default=0.0, json_schema_extra=_M)
    """Where the stage stands when the run begins; the motion starts there, at rest."""
    offset: float = Field(default=0.0, json_schema_extra=_M)
    """Centre of the motion."""
    delay: float = Field(default=0.0, ge=0, le=1e6, json_schema_extra=_S)
    """Time at rest before the motion begins."""


class _Blended(_Common):
    fade: Annotated[float | None, Field(gt=0, le=1e6, json_schema_extra=_S)] = None
    """Time in which the motion grows from rest at `start` to its full size; by default one period."""
    duration: Seconds = 10.0
    """Time of the whole run, `delay` included."""


class TriangleSettings(_Blended):
    """Triangle of constant speed, its corners rounded by arcs of constant acceleration."""

    kind: Literal["triangle"]
    amplitude: Amplitude
    frequency: Frequency
    phase: float = Field(default=0.0, json_schema_extra=_RAD)
    corner: Corner = 0.1
    """Share of the time that the arcs take: small is sharp, 1 has no straight part left."""


class SineSettings(_Blended):
    """One sine."""

    kind: Literal["sine"]
    amplitude: Amplitude
    frequency: Frequency
    phase: float = Field(default=0.0, json_schema_extra=_RAD)


class Band(Section):
    """Equally spaced sines of equal size between two frequencies, with Schroeder's phases."""

    low: Frequency
    high: Frequency
    count: int = Field(ge=2, le=1000)

    @pydantic.model_validator(mode="after")
    def _ordered(self) -> Band:
        if not self.low < self.high:
            raise ValueError(f"low is {self.low:g} Hz and high {self.high:g} Hz; low must be below high")
        return self


class MultisineSettings(_Blended):
    """Sum of sines: either `frequencies`, `amplitudes` and `phases`, or a `band` and its `amplitude`."""

    kind: Literal["multisine"]
    frequencies: list[Frequency] | None = None
    amplitudes: list[Amplitude] | None = None
    phases: list[float] | None = None
    band: Band | None = None
    amplitude: Annotated[float | None, Field(gt=0, le=1e3, json_schema_extra=_M)] = None
    """Peak of the sum (of a band)."""

    @pydantic.model_validator(mode="after")
    def _one_form(self) -> MultisineSettings:
        if self.band is not None:
            if self.amplitude is None:
                raise ValueError("a band needs an amplitude (m), the peak of the sum")
            if self.frequencies is not None or self.amplitudes is not None or self.phases is not None:
                raise ValueError("give either a band or frequencies and amplitudes, not both")
        elif not self.frequencies or not self.amplitudes:
            raise ValueError("give frequencies and amplitudes, or a band with an amplitude")
        elif self.amplitude is not None:
            raise ValueError("amplitude belongs to a band; with frequencies give amplitudes")
        else:
            for name, values in (("amplitudes", self.amplitudes), ("phases", self.phases)):
                if values is not None and len(values) != len(self.frequencies):
                    raise ValueError(
                        f"{name} has {len(values)} entries and frequencies {len(self.frequencies)}; "
                        "give one for each"
                    )
        return self


class _Strokes(_Common):
    shape: Literal["triangle", "sine"] = "triangle"
    """Constant speed with rounded ends, or half a cosine for each stroke."""
    corner: Corner = 0.2


class NestedReversalsSettings(_Strokes):
    """Reversals about `offset` at decreasing (or given) amplitudes, ending at rest at `offset`."""

    kind: Literal["nested-reversals"]
    amplitudes: list[Amplitude] | None = Field(default=None, min_length=1, max_length=10000)
    amplitude: Annotated[float | None, Field(gt=0, le=1e3, json_schema_extra=_M)] = None
    """The first reversal, where there is no list."""
    ratio: float = Field(default=0.8, gt=0, lt=1)
    """Each reversal's amplitude over that of the one before."""
    count: int = Field(default=10, ge=1, le=10000)
    speed: Annotated[float | None, Field(gt=0, le=1e3, json_schema_extra={"unit": "m/s"})] = None
    """Speed of every stroke between its rounded ends; or"""
    stroke_time: Annotated[float | None, Field(gt=0, le=1e6, json_schema_extra=_S)] = None
    """time of every stroke."""
    direction: Literal[1, -1] = 1
    """Side of the first reversal."""
    repeats: int = Field(default=1, ge=1, le=10000)

    @pydantic.model_validator(mode="after")
    def _complete(self) -> NestedReversalsSettings:
        if (self.amplitudes is None) == (self.amplitude is None):
            raise ValueError("give either amplitudes (a list, m) or amplitude (m) with ratio and count")
        if (self.speed is None) == (self.stroke_time is None):
            raise ValueError("give either speed (m/s) or stroke_time (s)")
        return self


class MinorLoop(Section):
    """A minor loop: at `position` the motion turns back by `size`, then goes on."""

    position: float = Field(json_schema_extra=_M)
    """From the centre of the motion."""
    size: Amplitude
    branch: Literal["up", "down", "both"] = "both"
    """On the way up, down, or both ways."""


class MinorLoopsSettings(_Strokes):
    """A major triangle or sine with minor loops at chosen places, again and again."""

    kind: Literal["minor-loops"]
    amplitude: Amplitude
    frequency: Frequency
    """Of the major loop alone; the minor loops take their time on top."""
    loops: list[MinorLoop] = Field(min_length=1, max_length=1000)
    duration: Seconds = 10.0

    @pydantic.model_validator(mode="after")
    def _inside(self) -> MinorLoopsSettings:
        for i, loop in enumerate(self.loops):
            ways = [w for w in (1, -1) if loop.branch in ("both", "up" if w == 1 else "down")]
            for way in ways:
                back = loop.position - way * loop.size
                if not max(abs(loop.position), abs(back)) < self.amplitude:
                    raise ValueError(
                        f"loops[{i}] turns at {loop.position:g} m and {back:g} m; both must lie inside "
                        f"+-{self.amplitude:g} m, the amplitude"
                    )
        return self


class FileSettings(_Common):
    """A motion from a CSV file with the columns `time` (s) and `reference` (m)."""

    kind: Literal["file"]
    path: str = Field(min_length=1)
    """Relative paths start at the folder of the configuration."""
    interpolation: Literal["cubic", "pchip"] = "pchip"
    """Smooth acceleration, or no overshoot between the rows."""
    scale: float = 1.0
    fade: Annotated[float | None, Field(gt=0, le=1e6, json_schema_extra=_S)] = None
    """Time in which the motion joins the file's from `start`; by default a tenth of the file's."""


class HoldSettings(_Common):
    """Move to `offset` and stay there."""

    kind: Literal["hold"]
    fade: Seconds = 0.5
    duration: Seconds = 10.0


ReferenceSettings = Annotated[
    TriangleSettings
    | SineSettings
    | MultisineSettings
    | NestedReversalsSettings
    | MinorLoopsSettings
    | FileSettings
    | HoldSettings,
    Field(discriminator="kind"),
]


class _Holder(Section):
    reference: ReferenceSettings


def reference_settings(entry: Mapping[str, Any]) -> ReferenceSettings:
    """Check a `reference:` section and return its settings; raise ConfigError in one line."""
    data = {"reference": dict(entry)}
    problems = not_finite(data, ())
    if not problems:
        try:
            return _Holder.model_validate_json(json.dumps(data), strict=True).reference
        except pydantic.ValidationError as error:
            problems = from_pydantic(error, _Holder, data, ())
        except TypeError as error:
            raise ConfigError(f"reference: {error}") from error
    raise ConfigError(problems[0].says)
