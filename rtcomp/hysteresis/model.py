"""An identified hysteresis model: a basis with its weights, as a file and as a function of position."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError, nearest
from rtcomp.hysteresis.basis import Basis, bases, basis_named, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.kernels import Floats
from rtcomp.yamlfile import dump_yaml, load_yaml

VERSION = 1
_NUMBERS = ("offset", "travel", "reach", "divisions", "places", "groups", "skew", "grain", "smooth")
_LISTS = ("weights", "reached", "widths", "reaches", "shape")
_COMMENTS = {"widths": "m, of each interval", "weights": "N/m, of each regressor", "offset": "N"}


class HysteresisModel:
    """Force = offset + sum of weight * regressor, with frozen weights.

    weights: (basis.size,) N/m. offset: N, the force in the virgin state; in the paper's (6), where the
    regressors are not centred, w_bias = offset - sum(w_i a_i / 2). `reached` (0 to 1 each) is the part of
    every element that the learned motion exercised; an element never reached has weight 0 by ignorance.
    """

    def __init__(
        self, basis: Basis, weights: Floats, offset: float = 0.0, reached: Floats | None = None
    ) -> None:
        self.basis = basis
        self.weights = np.asarray(weights, dtype=np.float64).reshape(-1)
        self.offset = float(offset)
        self.reached = None if reached is None else np.asarray(reached, dtype=np.float64)
        if self.weights.size != basis.size:
            raise ConfigError(
                f"hysteresis model: {basis.size} elements but {self.weights.size} weights; "
                "give as many of each",
                key=("weights",),
            )
        if self.reached is not None and self.reached.shape != self.weights.shape:
            raise ConfigError(
                f"hysteresis model: {basis.size} elements but {self.reached.size} in reached; "
                "give as many of each",
                key=("reached",),
            )
        if not (np.isfinite(self.weights).all() and np.isfinite(self.offset)):
            raise ConfigError("hysteresis model: weights and offset must be finite numbers", key=("weights",))
        if self.reached is not None and not np.isfinite(self.reached).all():
            raise ConfigError("hysteresis model: reached must be finite numbers", key=("reached",))

    def response(self, position: Floats) -> Floats:
        """Return the force (N, (K,)) along a motion (m, (K,)) that starts in the virgin state."""
        return np.asarray(self.offset + regressors(self.basis, position) @ self.weights, dtype=np.float64)

    def virgin_curve(self) -> tuple[Floats, Floats]:
        """Return travel from rest (m) and force less offset (N) at the corners of the virgin curve.

        For the interval operator, whose weights are the slopes of this curve over half the widths.
        """
        if not isinstance(self.basis, IntervalBasis):
            raise ConfigError(f"a model of basis {self.basis.name!r} has no virgin curve in its weights")
        half = self.basis.widths / 2
        return np.append(0.0, np.cumsum(half)), np.append(0.0, np.cumsum(half * self.weights))

    def to_dict(self) -> dict[str, Any]:
        """Return what a model file holds; a stage's ``friction`` may be the same."""
        data = {**self.basis.to_dict(), "weights": [float(w) for w in self.weights], "offset": self.offset}
        if self.reached is not None:
            data["reached"] = [round(float(r), 4) for r in self.reached]
        return {**data, "version": VERSION}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> HysteresisModel:
        """Build from a model file's content; raise ConfigError where it does not fit."""
        rest = dict(entry)
        version = rest.pop("version", VERSION)
        if version != VERSION:
            mend = "give that number"
            if isinstance(version, int | float):
                mend = "identify it anew" if version < VERSION else "update this program"
            raise ConfigError(
                f"hysteresis model: version is {version!r}; this program reads version {VERSION}: {mend}",
                key=("version",),
            )
        name, weights = rest.pop("model", None), rest.pop("weights", None)
        offset, reached = rest.pop("offset", 0.0), rest.pop("reached", None)
        if not isinstance(name, str):
            wrong = "is missing" if name is None else f"is {name!r}"
            raise ConfigError(f"hysteresis model: model {wrong}; {nearest(name, bases())}", key=("model",))
        for key, value in (*rest.items(), ("weights", weights), ("offset", offset), ("reached", reached)):
            if key in _NUMBERS or key in _LISTS:  # what is left is unknown: the basis says so
                _check_numbers(key, value)
        basis = basis_named(name).from_dict(rest)  # says of a misspelt key which was meant
        if weights is None:
            raise ConfigError("hysteresis model: key 'weights' is missing", key=("weights",))
        return cls(basis, np.asarray(weights, dtype=np.float64), offset, reached)

    def save(self, path: str | Path) -> None:
        """Write the model as YAML, whole or not at all."""
        dump_yaml(path, self.to_dict(), comments=_COMMENTS)

    @classmethod
    def load(cls, path: str | Path) -> HysteresisModel:
        """Read a model file; raise ConfigError naming the file where it cannot be used."""
        file = load_yaml(path)
        try:
            return cls.from_dict(file.data)
        except ConfigError as error:
            line = f":{file.line(error.key)}" if error.key else ""
            raise ConfigError(f"{path}{line}: {error}", key=error.key) from error


def _check_numbers(key: str, value: Any) -> None:
    """Raise ConfigError where `value`, of a model file, is neither a number nor a list of numbers."""
    single = key in _NUMBERS
    if value is None and key in ("weights", "reached"):
        return
    if not single and not isinstance(value, list | tuple | np.ndarray):
        raise ConfigError(f"hysteresis model: {key} is {value!r}; it must be a list of numbers", key=(key,))
    for i, item in enumerate([value] if single else value):
        if isinstance(item, bool) or not isinstance(item, int | float | np.number):
            where = (key,) if single else (key, i)
            name = key if single else f"{key}[{i}]"
            raise ConfigError(f"hysteresis model: {name} is {item!r}; it must be a number", key=where)
