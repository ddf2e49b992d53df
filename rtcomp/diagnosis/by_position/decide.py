"""Deciding by simulated position, where the balance of forces cannot: which entries end the windows closest.

Forward with everything refitted, then backward: an entry is named where windows that it was not fitted to end
closer with it. The set of names is all that end as close.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rtcomp.diagnosis.by_position.turning import ANCHORS, Setting, fit, robust
from rtcomp.diagnosis.by_position.windows import Windows
from rtcomp.diagnosis.candidates import searches
from rtcomp.diagnosis.motion import BLOCKS, UNSEEN
from rtcomp.diagnosis.scene import Column, Entry, Scene
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Place, catalogue

MOST = 3
"""Entries named at the most."""
SHORTLIST = 5
"""Entries that are fitted from several starts and judged on windows left out."""
FOLDS = 5
WHOLE = 3
"""Recordings from which on whole ones are left out."""
QUICK = 6
"""Steps of the fits that draw the short list."""
REFIT = 8
"""Steps of fits that tell starts apart, and of those that leave a fold out, from where all windows ended."""
LEAST_GAIN = 0.1
"""Part of the present error of windows left out that an entry must take away."""
ABOVE_FLOOR = 1.0
"""Error above the floor, over the floor, up to which nothing is missing."""
SETTLED = 0.02
"""Part of the first error above the floor up to which nothing more is looked for."""
HARMLESS = 0.7
"""Part of the blocks in which it must do no harm."""
ALIKE = 0.1
"""Names are alike that differ by less than this part of what the best takes away, and by chance."""
EARNED = 0.05
"""Part of what the best takes away that each further number of an entry must earn, to come first."""
SKIPPED = ("position-force", "drive-gain", "inertia", "viscous-friction", "sensor-scale")
"""Entries that take any shape, or are numbers of the stage, which are turned anyway."""
RELEASED = 0.3
"""Part of friction's level that a fit starts from too: the rest may have been what the entry explains."""


@dataclass(frozen=True)
class Judged:
    """A setting fitted to all windows seen, and the errors of every block that was left out of the fit."""

    setting: Setting
    inside: float
    """Robust squared error (m^2) of the windows seen, all fitted."""
    outside: Floats
    """The same of every block seen (B,), predicted by the others."""

    @property
    def names(self) -> list[str]:
        """Names of the entries, in the order found."""
        return [str(e["name"]) for e in self.setting.entries]


@dataclass(frozen=True)
class Step:
    """One entry accepted: the names that end as close, how sure it is one of them, what it took away."""

    names: list[str]
    probability: float
    gain: float
    """m^2, of windows left out."""


@dataclass
class Verdicts:
    """What was decided: the refitted belief, the best of all, its steps, and every entry's first gain."""

    base: Judged
    best: Judged
    steps: list[Step] = field(default_factory=list)
    floor: float = 0.0
    """Robust squared error (m^2) of the windows seen if the refitted belief were the whole truth."""
    gains: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Entry: part of the error taken away beside the base, and that over its standard error."""


Progress = Callable[[float, str], None]


def decide(scene: Scene, believed: Setting, windows: Windows, say: Progress, seed: int = 0) -> Verdicts:
    """Name what is missing, judged on windows left out."""
    judge = Judge(windows, scale_of(believed, windows))
    base = judge.judged([believed])
    found = Verdicts(base, base)
    stage = base.setting.stage()
    clean = windows.as_if(stage, scene.motion.cut, seed)
    found.floor = float(robust(clean.off(stage, clean.seen), judge.scale).sum())
    points = starts(scene, believed.longest)
    for step in range(MOST):
        left = float(found.best.outside.sum()) - found.floor
        if left < ABOVE_FLOOR * found.floor or left < SETTLED * (float(base.outside.sum()) - found.floor):
            break
        looked = []
        named = found.best.names
        for i, (name, entries) in enumerate(points.items()):
            if name not in named:
                quick = judge.quick(found.best.setting, entries)
                if quick is not None:
                    looked.append((judge.cost(quick), name, quick))
            say((step + 0.7 * (i + 1) / len(points)) / MOST, "screen")
        looked.sort(key=lambda one: one[0])
        tried = []
        for i, (_, _, quick) in enumerate(looked[:SHORTLIST]):
            tried.append(judge.judged(_released(quick, base.setting)))
            say((step + 0.7 + 0.3 * (i + 1) / SHORTLIST) / MOST, "refine")
        if step == 0:
            found.gains = {name: (1.0 - cost / base.inside, 0.0) for cost, name, _ in looked}
            found.gains |= {t.names[-1]: _gain(base, t) for t in tried}
        alike = _alike(found.best, tried)
        if not alike or not worth_it(found.best.outside, alike[0].outside):
            break
        found.steps.append(_step(found.best, alike, tried))
        found.best = alike[0]
    _prune(judge, found)
    return found


def worth_it(before: Floats, after: Floats) -> bool:
    """Tell whether errors of blocks left out, (B,) before and after, fell by no accident."""
    gained = before - after
    scatter = float(gained.std(ddof=1) * np.sqrt(gained.size))
    harmless = float(np.mean(gained > -0.1 * before - 0.02 * float(before.mean())))
    share = float(gained.sum() / before.sum())
    return share > LEAST_GAIN and harmless >= HARMLESS and float(gained.sum()) > 1.5 * scatter


def scale_of(believed: Setting, windows: Windows) -> float:
    """Return the error (m) beyond which one counts less: the usual one of the stage as believed."""
    return max(float(np.median(np.abs(windows.off(believed.stage(), windows.seen)))), 1e-300)


class Judge:
    """Fits settings to windows, and tells how they do on windows left out."""

    def __init__(self, windows: Windows, scale: float) -> None:
        self.windows, self.scale = windows, scale
        seen = np.array([k for k in range(BLOCKS) if k not in UNSEEN and np.any(windows.block == k)])
        self.blocks = seen
        # A motion of another kind is the harder test: of several recordings, whole ones are left out.
        own = windows.recording if windows.recording.max(initial=0) + 1 >= WHOLE else windows.block
        groups = np.array_split(np.unique(own[windows.seen]), FOLDS)
        self.folds = [windows.seen & np.isin(own, group) for group in groups if group.size]

    def cost(self, setting: Setting) -> float:
        """Return the robust squared error (m^2) of the windows seen."""
        return float(robust(self.windows.off(setting.stage(), self.windows.seen), self.scale).sum())

    def errors(self, setting: Setting, which: np.ndarray) -> Floats:
        """Return the robust squared error (m^2) of the windows of `which` in each block seen."""
        sums = robust(self.windows.off(setting.stage(), which), self.scale).sum(axis=1)
        return np.array([float(sums[self.windows.block[which] == b].sum()) for b in self.blocks])

    def quick(self, setting: Setting, entries: Sequence[Entry]) -> Setting | None:
        """Return `setting` with the best of `entries` beside it, roughly fitted; None where none can be."""
        found: list[tuple[float, Setting]] = []
        for entry in entries:
            one = setting.having((*setting.entries, entry))
            try:
                found.append((self.cost(one), one))
            except ConfigError:
                continue
        if not found:
            return None
        best = min(found, key=lambda pair: pair[0])[1]
        try:
            return fit(best, self.windows, self.scale, self.windows.seen, QUICK)[0]
        except (ConfigError, np.linalg.LinAlgError):
            return None

    def judged(self, starts: Sequence[Setting]) -> Judged:
        """Fit from each of `starts`, keep the closest, and judge it fold by fold."""
        fitted = []
        for start in starts:
            try:
                one = fit(start, self.windows, self.scale, self.windows.seen, REFIT)[0]
                fitted.append((self.cost(one), one))
            except (ConfigError, np.linalg.LinAlgError):
                continue
        best = min(fitted, key=lambda pair: pair[0])[1] if fitted else starts[0]
        best = fit(best, self.windows, self.scale, self.windows.seen)[0]
        inside = self.cost(best)
        outside = np.zeros(self.blocks.size)
        for fold in self.folds:
            without = fit(best, self.windows, self.scale, self.windows.seen & ~fold, REFIT)[0]
            outside += self.errors(without, fold)
        return Judged(best, inside, outside)


def _released(quick: Setting, base: Setting) -> list[Setting]:
    """Return where fits start: as it is; with friction's level given free; from the belief's own numbers."""
    places = [catalogue.entry(str(e["name"])).place for e in quick.entries]
    found = [quick, quick.having(quick.entries, {})]
    if Place.FRICTION in places and "friction.level" in quick.factors:
        less = {**base.factors, "friction.level": RELEASED * base.factors["friction.level"]}
        found.append(quick.having(quick.entries, less))
    return found


def _gain(base: Judged, other: Judged) -> tuple[float, float]:
    gained = base.outside - other.outside
    scatter = float(gained.std(ddof=1) * np.sqrt(gained.size)) or 1e-300
    return float(gained.sum() / base.outside.sum()), float(gained.sum()) / scatter


def _alike(before: Judged, tried: Sequence[Judged]) -> list[Judged]:
    """Return what ends closest, and all that end as close, likeliest first: numbers must earn their place."""
    if not tried:
        return []
    best = min(tried, key=lambda t: float(t.outside.sum()))
    reduction = max(float(before.outside.sum() - best.outside.sum()), 1e-300)
    alike = []
    for other in tried:
        worse = other.outside - best.outside
        scatter = float(worse.std(ddof=1) * np.sqrt(worse.size))
        if float(worse.sum()) <= min(ALIKE * reduction, 2.0 * scatter):
            alike.append(other)
    cost = EARNED * reduction
    return sorted(alike, key=lambda t: float(t.outside.sum()) + cost * len(t.setting.knobs()))


def _step(before: Judged, alike: Sequence[Judged], tried: Sequence[Judged]) -> Step:
    """Return the step that the first of `alike` is, with the names of all, and how sure they hold it."""
    least = min(float(t.outside.sum()) for t in alike)
    reduction = max(float(before.outside.sum()) - least, 1e-300)

    def weight(one: Judged) -> float:
        return float(np.exp(-(float(one.outside.sum()) - least) / reduction / (0.3 * ALIKE)))

    probability = sum(map(weight, alike)) / sum(map(weight, tried))
    gained = float(before.outside.sum() - alike[0].outside.sum())
    return Step([t.names[-1] for t in alike], probability, gained)


def _prune(judge: Judge, found: Verdicts) -> None:
    """Delete every entry that the others make needless."""
    at = 0
    while len(found.best.setting.entries) > 1 and at < len(found.best.setting.entries):
        fewer = _fewer(judge, found, at)
        if worth_it(fewer.outside, found.best.outside):
            at += 1
        else:
            found.best = fewer
            del found.steps[at]


def drop(judge: Judge, found: Verdicts, at: int) -> None:
    """Take the entry at place `at` back, and fit the others without it."""
    found.best = _fewer(judge, found, at) if len(found.steps) > 1 else found.base
    del found.steps[at]


def _fewer(judge: Judge, found: Verdicts, at: int) -> Judged:
    """Return the best fit without the entry at place `at`."""
    setting = found.best.setting
    without = tuple(e for i, e in enumerate(setting.entries) if i != at)
    return judge.judged(_released(setting.having(without), found.base.setting))


def starts(scene: Scene, longest: float = np.inf) -> dict[str, list[Entry]]:
    """Return for every entry worth trying the points that a fit may start from; periods to `longest` (m)."""
    found: dict[str, list[Entry]] = {}
    for search in searches(scene):
        if search.name in SKIPPED:
            continue
        entry = _composed(search, scene) if isinstance(search, Column) else search.entry
        if entry is not None and not (float(entry.get("period", 0.0)) > longest):  # type: ignore[arg-type]
            found.setdefault(search.name, []).append(entry)
    if any(e.get("name") in ANCHORS for e in scene.fitted.ledger.stage.mechanics.effects):
        # Gears are loaded from both sides; weight and springs are the other one.
        loads = found.get("load-dependent-friction", [])
        loads += [{**entry, "external": entry["coefficient"]} for entry in loads]
    return found


def _composed(search: Column, scene: Scene) -> Entry | None:
    """Return a column's entry at half the size that the residual force asks for."""
    columns = np.column_stack(search.columns())
    norm = np.linalg.norm(columns, axis=0)
    if not np.all(norm > 0):
        return None
    size = np.linalg.lstsq(columns / norm, scene.residual, rcond=None)[0] / norm
    return search.compose(0.5 * size)
