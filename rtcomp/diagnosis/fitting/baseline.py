"""The baseline: the belief refitted, its friction on yield displacements that the recording asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.believed import prior_of
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.law import law_of
from rtcomp.diagnosis.fitting.replicated import replicated
from rtcomp.diagnosis.fitting.timing import put_in_step
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.reaches import further
from rtcomp.diagnosis.forces.signals import BASE, FURTHEST
from rtcomp.diagnosis.settings import LEAST_GAIN
from rtcomp.kernels import Floats

DENSE = 64
"""Yield displacements that are tried at first, over the whole range."""
SPEEDS = 9
"""Speeds below which micro-damping may act, where the belief has none."""
STEPS = 4
"""Times that a believed speed is moved to where a fit has it, at most."""
FOUND_SPEED, SETTLED_SPEED = 0.03, 2e-3
"""How well that speed is looked for (logarithm); the change of it at which fits have settled it."""
FINER = 3
"""Times finer they stand around those found, in the second try."""
SMOOTHED = (1.0, 0.1, 0.01)
"""Parts of the noise's power for which the position is smoothed: each is tried."""
EARLIER, CLOSE = 4.0, 1.4
"""Times earlier than an axis seems to, that its friction may yield behind a play; ratio of units there, and
of the gaps that are looked through: a play shows within a fifth of its gap."""
HARDLY = 0.02
"""Part of the friction level that the shortest units hold together, or the longest, which are not counted."""
SLIGHT = 1e-3
"""Part of the friction level below which a unit is not needed."""


def baseline(balance: ForceBalance) -> Fitted:
    """Whiten `balance`, settle its grid of yield displacements, and return the refitted belief."""
    m = balance.stage.mechanics
    sizes = [float(size) for entry in balance.believed for size in ent.sizes_of(entry)]
    friction = [*np.ones(balance.models.size), *balance.weights]
    balance.whiten(np.array([m.mass, m.viscous, m.micro_damping, 0.0, *friction, 0.0, *sizes]))
    fitter = Fitter(balance)
    _put_grid(fitter, ())
    balance.whiten(fitter.fit([]).coefficients)
    settle(fitter)
    _let_go(fitter)
    return fitter.fit([])


def _let_go(fitter: Fitter) -> None:
    """Hold numbers of the belief, beside any effect, as the belief alone does: those far off by little.

    Beside an effect they would be let go of to suit that: a damping against a friction that falls with speed.
    """
    model, balance = fitter.fit([]), fitter.balance
    terms = [Term.of(e) for e in balance.believed]
    plain = prior_of(balance, terms, model.system, offset=fitter.offset).precision
    held = np.where(plain > 0.0, model.prior.precision / np.where(plain > 0.0, plain, 1.0), 1.0)
    balance.let_go = np.append(held[: len(BASE)], held[balance.size :])


def _damp(fitter: Fitter, terms: Sequence[Term], ends: float) -> None:
    """Let micro-damping act below the speed that fits best: near the believed one, or any of the motion.

    What friction does at low speed is steep in it: a few per cent off look like another effect. One that is
    not believed is looked for, and from there moved with all other numbers, as a believed one is.
    """
    balance = fitter.balance
    if balance.without("micro_damping"):
        return
    if balance.believed_speed is None:
        balance.speed_room = 0.0
        _search_speed(fitter, terms)
    else:
        balance.damp_below(balance.believed_speed)  # a poorer model may have bent it
    found = None
    for _ in range(STEPS):
        found = fitter.fit(terms, found)
        if balance.believed_speed is None:
            balance.speed_room = FURTHEST * float(found.coefficients[balance.faster - 1])
        speed, before = balance.speed_of(found.coefficients), balance.stage.mechanics.micro_damping_speed
        balance.damp_below(speed)
        if abs(np.log(speed / before)) < SETTLED_SPEED or clock.now() > ends:
            return
        terms = found.terms


def _search_speed(fitter: Fitter, terms: Sequence[Term]) -> None:
    from scipy.optimize import minimize_scalar

    balance = fitter.balance
    v = np.abs(balance.plain([p.v for p in balance.paths()]))
    moving = v[v > 1e-3 * v.max()]
    if not moving.size:
        return

    def left(log_speed: float) -> float:
        balance.damp_below(float(np.exp(log_speed)))
        return fitter.quick(terms)

    slow, fast = (float(np.log(np.quantile(moving, q))) for q in (0.02, 0.9))
    tried = np.linspace(slow, fast, SPEEDS)
    at = int(np.argmin([left(one) for one in tried.tolist()]))
    near = (tried[max(at - 1, 0)], tried[min(at + 1, SPEEDS - 1)])
    best = minimize_scalar(left, bounds=near, method="bounded", options={"xatol": FOUND_SPEED})
    balance.damp_below(float(np.exp(best.x)))


def with_offset(fitter: Fitter, fitted: Fitted) -> Fitted:
    """Return the belief refitted beside a constant force where that matters too little to be named.

    No axis is free of one: of a current loop, a cable, a position whose zero is not that of a spring.
    """
    fitter.offset = True
    beside = fitter.fit([])
    gained = 1.0 - float(np.sqrt(beside.errors.sum() / fitted.errors.sum()))
    if 0.0 < gained < LEAST_GAIN:
        return beside
    fitter.offset = False
    return fitted


def settle(fitter: Fitter, terms: Sequence[Term] = (), ends: float = math.inf, *, law: bool = True) -> None:
    """Put yield displacements, smoothing, the speed of micro-damping and timing to what `terms` have.

    And the `law` by which friction yields, where that is asked for. As far as the time `ends` (clock.now)
    allows: each is begun only before.
    """
    for step in (partial(_put_friction, law=law), _smooth, partial(_damp, ends=ends), put_in_step):
        if fitter.by_force and clock.now() < ends:
            step(fitter, terms)


def _put_friction(fitter: Fitter, terms: Sequence[Term], *, law: bool) -> None:
    """Put yield displacements, and the `law` by which friction yields there, to what `terms` have."""
    _put_grid(fitter, terms)
    exponent = law_of(fitter, terms) if law else fitter.balance.exponent
    if exponent != fitter.balance.exponent:
        fitter.balance.exponent = exponent
        _put_grid(fitter, terms)


def _smooth(fitter: Fitter, terms: Sequence[Term]) -> None:
    """Smooth the position for that part of its noise with which a model of `terms` fits a replicate best.

    Wiener's filter has the least error on average. Where friction sticks it is stiff, and motion that is
    smoothed away there is missing from its force. Whether that or noise matters more depends on the axis; a
    replicate of the model tells it, for nothing is missing in that.
    """
    balance = fitter.balance
    balance.smooth_for(SMOOTHED[0])
    model = fitter.fit(terms, steps=0)
    data = replicated(fitter, model)
    if data is None:
        return
    others = [fitter.on(data) for _ in SMOOTHED]
    for other, part in zip(others, SMOOTHED, strict=True):
        other.balance.smooth_for(part)
    left = shared(lambda other: other.fit(terms, model, steps=0).sse, others)
    balance.smooth_for(SMOOTHED[int(np.argmin(left))])


def _put_grid(fitter: Fitter, terms: Sequence[Term]) -> None:
    """Put the grid of yield displacements where a model of `terms` has friction.

    Stiffnesses that must not be negative come out sparse: of a dense grid, a dozen units are not zero. These
    are kept beside the believed ones, a close grid where friction may yield and a coarse one elsewhere, so
    that candidates find friction that can give way.
    """
    balance = fitter.balance
    coarse = balance.coarse
    step = float(np.log(coarse[-1] / coarse[0])) / (DENSE - 1)
    dense, kept = np.geomspace(coarse[0], coarse[-1], DENSE), np.zeros(0)
    for _ in range(2):
        balance.put(dense, step)
        fitted = fitter.fit(terms, steps=0)
        kept, (low, high) = _needed(balance, fitted), yields(balance, fitted)
        step /= FINER
        around = np.exp(np.log(kept)[:, None] + step * np.arange(1 - FINER, FINER)[None, :]).ravel()
        dense = np.unique(around[(around >= coarse[0]) & (around <= coarse[-1])])
        if not kept.size:
            break
    close = np.exp(np.arange(np.log(low), np.log(high), np.log(CLOSE)))
    skeleton = np.concatenate([coarse[::2][(coarse[::2] < low) | (coarse[::2] > high)], close])
    far = np.array([not kept.size or np.min(np.abs(np.log(kept / r))) > step * FINER for r in skeleton])
    balance.put(np.concatenate([kept, skeleton[far]]), step * FINER)


def yielding_later(fitter: Fitter, model: Fitted) -> Fitter | None:
    """Return the objective on a grid that goes on to where nothing yields, settled on the model's terms.

    None where a model has hardly any friction in the last step of the grid. Not the first choice: what yields
    late is much like a spring.
    """
    balance = fitter.balance
    if not fitter.by_force:
        return None
    force, low, high = model.coefficients[balance.friction] * balance.reaches, *balance.data.stroke
    longer = further(balance.coarse, high - low)
    last = force[balance.reaches > balance.coarse[-2]].sum()
    if longer.size == balance.coarse.size or last <= HARDLY * max(float(force.sum()), 1e-300):
        return None
    other = fitter.on(balance.data)
    other.balance.coarse = longer
    _put_grid(other, model.terms)
    return other


def yields(balance: ForceBalance, fitted: Fitted) -> tuple[float, float]:
    """Return the shortest and longest displacement (m) in which friction may yield, also behind a play.

    Equal ones where a fit has no friction.
    """
    held = np.cumsum(fitted.coefficients[balance.friction] * balance.reaches)
    if held[-1] <= 0.0:
        return float(balance.coarse[0]), float(balance.coarse[0])
    first, last = (int(np.searchsorted(held, part * held[-1])) for part in (HARDLY, 1.0 - 1e-9))
    return max(float(balance.reaches[first]) / EARLIER, float(balance.coarse[0])), float(
        balance.reaches[last]
    )


def _needed(balance: ForceBalance, fitted: Fitted) -> Floats:
    """Return the yield displacements of a fit that hold a part of the friction."""
    force = fitted.coefficients[balance.friction] * balance.reaches
    return balance.reaches[force > SLIGHT * max(float(force.sum()), 1e-300)]
