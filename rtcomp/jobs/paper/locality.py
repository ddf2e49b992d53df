"""Section 3: the interval basis trains locally, the stop basis everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtcomp.hysteresis.basis import Basis
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.stop import StopBasis
from rtcomp.jobs.paper.claim import Claim, Spread, participation, ratio
from rtcomp.jobs.paper.identification import Effort
from rtcomp.jobs.paper.rig import CYCLE, INTERVALS, RANGE_M, main_loop, moved, rig
from rtcomp.jobs.paper.shape import since_reversal
from rtcomp.jobs.paper.training import Exam, Lesson, activations, train
from rtcomp.kernels import Floats

WRONG, LONG = 0.05, 0.1
"""The disturbance: a step of the force over the peak, along this part of the range after each reversal."""
DISTURBED = 60
"""Cycles of training with the disturbance, as many as the paper trains."""
EARLY = 10


def changed(
    basis: Basis, loop: Lesson, exam: Exam, zone: tuple[float, float], step: float, most: int = DISTURBED
) -> Floats:
    """Return by what force (N, (N,)) a disturbance in `zone` (m after reversals) moves each weight.

    It is trained with and without the disturbance and the two are compared. As (8) is linear, that is
    the same from whatever weights.
    """
    lesson = replace(loop, basis=basis)
    way = since_reversal(lesson.position)
    rising = np.sign(np.gradient(lesson.position))
    wrong = WRONG * exam.peak * rising * ((way >= zone[0]) & (way < zone[1]))
    plain = train(lesson, exam, step, most, whole=True).weights
    other = replace(lesson, force=lesson.force + wrong)
    bent = train(other, exam, step, most, whole=True).weights
    return np.asarray((bent - plain)[:-1] * basis.scales())


def locality(effort: Effort, step: float, fastest: float) -> list[Claim]:
    """Test that (8) moves few interval weights and all stop weights: in a step, and in the end."""
    shown = moved(rig(), main_loop(5))
    bases: dict[str, Basis] = {
        "interval": IntervalBasis.over(INTERVALS, RANGE_M),
        "stop": StopBasis.over(INTERVALS, RANGE_M),
    }
    spread: dict[tuple[str, float, int], list[float]] = {}
    touched: dict[str, Spread] = {}
    for name, basis in bases.items():
        loop = Lesson(basis, shown.position, shown.force, 4 * CYCLE)
        exam = Exam.on(basis, shown, settle=4 * CYCLE)
        x = activations(basis, shown.position)[4 * CYCLE :, :-1]
        touched[name] = Spread.of([float(v) for v in np.mean(np.abs(x) > 1e-9 * basis.scales(), axis=1)])
        for pace, most in ((step, DISTURBED), (fastest, DISTURBED), (step, EARLY)):
            spread[name, pace, most] = []
            for seed in range(effort.seeds):
                start = float(np.random.default_rng([seed, 6]).uniform(0.05, 0.75)) * RANGE_M
                moves = changed(basis, loop, exam, (start, start + LONG * RANGE_M), pace, most)
                spread[name, pace, most].append(participation(moves))

    def compared(pace: float, most: int) -> Spread:
        pairs = zip(spread["interval", pace, most], spread["stop", pace, most], strict=True)
        return Spread.of([ratio(a, b) for a, b in pairs])

    found, fast = compared(step, DISTURBED), compared(fastest, DISTURBED)
    early = compared(step, EARLY)
    one = touched["interval"]
    return [
        Claim(
            "local-updates",
            "a step of training changes all weights of the stop model, of the interval model not",
            one.median < 0.8 <= touched["stop"].median,
            Spread(*(100 * v for v in one)),
            "interval weights that one sample moves (over the samples of a cycle)",
            "%",
            "median below 80 %, and of the stop basis above",
            "simulated Leuven stage, 20 elements each, (8) on every sample of a cycle of the main loop",
            f"Of the stop weights it is {100 * touched['stop'].median:.0f} %. An interval already filled "
            "has its whole width for x_i and is moved as well, wherever the error came from.",
            {"moved_percent_stop": 100 * touched["stop"].median},
        ),
        Claim(
            "local-errors",
            "local errors in the training data appear localized in the trained model",
            found.median < 0.8,
            found,
            "share of weights that take part, interval over stop basis",
            "times",
            "median below 0.8; share (sum |c|)^2 / (N sum c^2) of the changes c in force",
            f"simulated Leuven stage, 20 elements each, LMS (8) with step {step:g}, {DISTURBED} cycles with "
            f"the force off by {100 * WRONG:g} % of the peak along a tenth of the range after each "
            f"reversal, against as many without; {effort.seeds} places",
            f"After {EARLY} cycles it is {early.median:.2g}, with the fastest step, {fastest:g}, "
            f"{fast.median:.2g}"
            + (
                ": an error begins spread over every filled interval and gathers in its place as training "
                "goes on."
                if fast.median < found.median < early.median
                else "."
            ),
            {
                "share_interval": Spread.of(spread["interval", step, DISTURBED]).median,
                "share_stop": Spread.of(spread["stop", step, DISTURBED]).median,
                f"ratio_step_{fastest:g}": fast.median,
                f"ratio_after_{EARLY}_cycles": early.median,
            },
        ),
    ]
