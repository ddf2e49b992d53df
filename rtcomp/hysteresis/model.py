"""An identified hysteresis model: a basis with its weights, as a file and as a function of position."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import Basis, basis_named, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.kernels import Floats
from rtcomp.yamlfile import dump_yaml, load_yaml

VERSION = 1
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
                "give as many of each"
            )
        if not (np.isfinite(self.weights).all() and np.isfinite(self.offset)):
            raise ConfigError("hysteresis model: weights and offset must be finite numbers")

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
            raise ConfigError(
                f"hysteresis model: version is {version!r}; this program reads version {VERSION}"
            )
        name, weights = rest.pop("model", None), rest.pop("weights", None)
        offset, reached = rest.pop("offset", 0.0), rest.pop("reached", None)
        if not isinstance(name, str) or weights is None:
            raise ConfigError("hysteresis model: keys 'model' and 'weights' are needed")
        try:
            basis = basis_named(name).from_dict(rest)
            return cls(basis, np.asarray(weights, dtype=np.float64), offset, reached)
        except (TypeError, ValueError, KeyError) as error:
            if isinstance(error, ConfigError):
                raise
            raise ConfigError(f"hysteresis model {name!r}: {error}") from error

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
            raise ConfigError(f"{path}: {error}") from error
