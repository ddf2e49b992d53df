"""Screening: what each search explains beside the base, on blocks left out of the fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rtcomp.diagnosis.base import Fitted, fit_base
from rtcomp.diagnosis.candidates import effect_of, searches
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.ledger import WHOLE, Ledger, System
from rtcomp.diagnosis.lengths import beside, has_places
from rtcomp.diagnosis.scene import Column, Entry, Point, Scene
from rtcomp.diagnosis.search_at_work import at_work
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats

SIZES = {
    "asymmetric-friction": "asymmetry", "creep": "fraction", "drive-deadband": "width",
    "drive-delay": "delay", "drive-lag": "time_constant", "frictional-lag": "time_constant",
    "load-dependent-friction": "coefficient",
    "non-congruent-friction": "softening", "resonance": "mass_ratio", "sensor-delay": "delay",
    "stiction-ageing": "growth", "stribeck": "rise",
}  # fmt: skip
"""By entry, the parameter that says how large the effect is."""
NO_GAIN = 0.97
"""Part of the error left at which an effect as it was tried is of no use; a smaller one may be."""
SMALLEST, LARGEST = 0.02, 0.8
"""Range of how much smaller."""
BENT = 1.2
"""Factor on the believed reaches, up or down, from which on a base has bent to what is missing."""
SMALL = 0.1
"""Part of the longest reach up to which a play hides in reaches; a larger one stands out of any."""


@dataclass(frozen=True)
class Screened:
    """The best starting point of one entry, with the squared error it leaves in every block left out."""

    name: str
    entry: Entry
    errors: Floats
    forms: tuple[Screened, ...] = ()
    """The best starting points of its other forms: a few steps tell which is right, a first look does not."""
    ground: Fitted | None = None
    """The base that it was tried on; None where that is the one at hand."""

    def gain(self, base: Floats) -> float:
        """Return the part of the base's squared error that is gone."""
        return 1.0 - float(self.errors.sum() / base.sum())


def screen(
    scene: Scene, effects: list[Entry], progress: Callable[[float], None] | None = None
) -> list[Screened]:
    """Try everything beside `effects`; return the best point of each name, the most explaining first."""
    fitted = scene.fitted
    # An entry that shrinks the drive side shrinks every error; all are stated for the believed drive.
    power = float(fitted.system.blocks.power[fitted.ledger.seen].sum())
    best: dict[tuple[object, ...], Screened] = {}
    wavy = has_places(effects)
    at_hand = shared(lambda search: _tried(fitted, effects, power, search), searches(scene), progress)
    for one in (*at_hand, *_as_believed(scene, effects, power)):
        if one is not None:
            _keep(best, one, wavy)
    first: dict[str, Screened] = {}
    for one in sorted(best.values(), key=lambda b: float(b.errors.sum())):
        known = first.setdefault(one.name, one)
        if known is not one:
            first[one.name] = replace(known, forms=(*known.forms, one))
    return list(first.values())


def _tried(fitted: Fitted, others: list[Entry], power: float, search: Column | Point) -> Screened | None:
    """Try one search beside `others`; None where it cannot be evaluated."""
    ledger, seen = fitted.ledger, fitted.ledger.seen
    if isinstance(search, Column):
        columns = search.columns()
        system = ledger.extended(fitted.system, [search.name] * len(columns), np.column_stack(columns))
        bounds = fitted.bounds.with_free(len(columns))
        errors = system.blocks.left_out(seen, bounds)
        entry = search.compose(system.blocks.coefficients(seen, bounds)[-len(columns) :])
    else:
        entry = search.entry
        try:
            system = ledger.system([effect_of(e) for e in beside(others, entry)])
        except ConfigError:
            return None
        scale = power / max(float(system.blocks.power[seen].sum()), 1e-300)
        errors = system.blocks.left_out(seen, fitted.bounds) * scale
        if errors.sum() > NO_GAIN * fitted.errors.sum() and search.name in SIZES:
            smaller = _smaller(fitted, system, search)
            if smaller is not None:
                entry, errors = smaller
    return Screened(search.name, entry, errors) if np.isfinite(errors).all() else None


def _keep(best: dict[tuple[object, ...], Screened], one: Screened, wavy: bool) -> None:
    """Keep the best of each name and form, on either ground.

    Of a drift beside waves (`wavy`) each size: it moves them along, and only a fit of both tells which.
    """
    size = one.entry.get("drift") if wavy else None
    key = (one.name, *_form(one.entry), size, one.ground is None)
    if key not in best or one.errors.sum() < best[key].errors.sum():
        best[key] = one


def _as_believed(scene: Scene, others: list[Entry], power: float) -> list[Screened | None]:
    """Try what other reaches do much of on the believed ones, where those of the base have gone elsewhere."""
    ledger = scene.fitted.ledger
    if 1.0 / BENT < scene.fitted.scale < BENT:
        return []

    def tried(point: Point) -> Screened | None:
        try:
            effects = [effect_of(e) for e in beside(others, point.entry)]
            own = fit_base(ledger.stage, scene.motion, effects, (1.0,), ledger.memory, scene.fitted.freed)
        except ConfigError:
            return None
        scale = power / max(float(own.system.blocks.power[ledger.seen].sum()), 1e-300)
        if not np.isfinite(own.errors).all():
            return None
        return Screened(point.name, point.entry, own.errors * scale, ground=own)

    return shared(tried, (p for p in at_work(scene) if p.name in WHOLE or _small_play(p.entry, ledger)))


def _smaller(fitted: Fitted, system: System, tried: Point) -> tuple[Entry, Floats] | None:
    """Return a smaller effect than the one `tried` in `system`, and the squared errors it should leave.

    What a size does is nearly in proportion to it: the change that the effect made of the residual is a
    column, whose coefficient is by how much smaller it must be. None where it is not, or is nothing.
    """
    before = fitted.system
    ledger, coefficients = fitted.ledger, fitted.coefficients
    change = (before.y - before.columns @ coefficients) - (system.y - system.columns @ coefficients)
    extended = ledger.extended(before, [tried.name], change[:, np.newaxis])
    bounds = fitted.bounds.with_free(1)
    part = float(extended.blocks.coefficients(ledger.seen, bounds)[-1])
    if not SMALLEST < part < LARGEST:
        return None
    size = SIZES[tried.name]
    entry = {**tried.entry, size: part * float(tried.entry[size])}  # type: ignore[arg-type]
    return entry, extended.blocks.left_out(ledger.seen, bounds)


def _form(entry: Entry) -> tuple[bool, ...]:
    """Say in which of its forms an entry is: whether what sticks follows it, whether its branches close,
    whether its contact is soft, whether its wave has a harmonic."""
    return bool(entry.get("following")), "closing" in entry, "contact" in entry, "harmonics" in entry


def _small_play(entry: Entry, ledger: Ledger) -> bool:
    """Tell whether an entry is a play so small that it hides in reaches."""
    return entry["name"] == "backlash" and float(entry["gap"]) < SMALL * ledger.reaches.max()  # type: ignore[arg-type]
