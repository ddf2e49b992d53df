"""Figures 9a to 15 of the paper, remade: the curves of each, and its key numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from rtcomp.jobs.compensate import Compensated
from rtcomp.jobs.paper.closed_loop import FLAWED, followed, papers_model
from rtcomp.jobs.paper.identification import NOISE, case
from rtcomp.jobs.paper.measured import Measured, measured_lessons
from rtcomp.jobs.paper.minor import TAUGHT, Lessons, lessons_of
from rtcomp.jobs.paper.rig import ASYMMETRY, CYCLE, SOFTENING, rig
from rtcomp.jobs.paper.shape import apart, branches, mirrored, to_and_back
from rtcomp.jobs.paper.training import LEVEL, Exam, Lesson, train
from rtcomp.kernels import Floats

SHOWN_S = (3.0, 5.5)
"""Part of a run in closed loop that is drawn."""
STAND_IN = (
    f"simulated stage with asymmetry {ASYMMETRY:g} and softening {SOFTENING:g}, in the place of the real "
    "setup"
)


class Trace(NamedTuple):
    """One curve: its name, x and y of one length, and its role in the figure."""

    name: str
    x: Floats
    y: Floats
    role: str = ""


@dataclass(frozen=True)
class Remade:
    """One figure of the paper made anew."""

    number: str
    title: str
    paper: str
    """What the paper reports."""
    here: str
    """What came out."""
    source: str
    """Of what stage or recording, and which learner."""
    traces: Sequence[Trace]
    x: tuple[str, str] = ("Position", "m")
    y: tuple[str, str] = ("Force", "N")
    numbers: dict[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the figure as paper.json lists it, without its curves."""
        return {
            "figure": self.number,
            "title": self.title,
            "paper": self.paper,
            "here": self.here,
            "source": self.source,
            "numbers": self.numbers,
        }


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"


def identified(
    number: str,
    title: str,
    paper: str,
    lesson: Lesson,
    exam: Exam,
    step: float,
    source: str,
    cycles: int = 60,
) -> Remade:
    """Return a loop and the model trained on it for as many cycles as the paper needed."""
    done = train(lesson, exam, step, cycles, whole=True)
    said = lesson.activations() @ done.weights
    last = slice(-CYCLE, None)
    driven = lesson.position[last]
    if lesson.position_noise:
        chance = np.random.default_rng([lesson.seed, 8])
        driven = driven + lesson.position_noise * chance.uniform(-1, 1, driven.size)
    traces = [
        Trace("measured", driven, lesson.force[last], "measured"),
        Trace("model", lesson.position[last], said[last], "model"),
    ]
    error = float(done.errors[-1])
    return Remade(
        number,
        title,
        paper,
        f"After {cycles} cycles the frozen model is off by {_percent(error)} of the peak.",
        f"{source}; {lesson.basis.size} equal intervals, LMS (8) with step {step:g}",
        traces,
        numbers={"error": error, "cycles": float(cycles)},
    )


def symmetry(position: Floats, force: Floats, source: str) -> Remade:
    """Return Fig. 11a: one cycle of the main loop, and turned half round."""
    x, y, far = mirrored(position, force)
    return Remade(
        "11a",
        "Symmetry test",
        "the measured loop and its mirrored counterpart do not quite overlap (no number)",
        f"They lie at most {_percent(far)} of half the loop's height apart.",
        source,
        [Trace("main loop", position, force, "measured"), Trace("mirrored", x, y, "model")],
        numbers={"asymmetry": far},
    )


def congruency(found: Sequence[tuple[Floats, Floats]], source: str) -> Remade:
    """Return Fig. 11b: the branches of main and minor loops, their turning points in the origin."""
    far = apart(found)
    largest = max(range(len(found)), key=lambda k: found[k][0].max())
    gap = np.array([np.nan])

    def joined(keep: list[tuple[Floats, Floats]], axis: int) -> Floats:
        return np.concatenate([part for pair in keep for part in (pair[axis], gap)])

    large = [pair for pair in found if pair[0].max() > 0.9 * found[largest][0].max()]
    small = [pair for pair in found if pair[0].max() <= 0.9 * found[largest][0].max()]
    traces = [Trace("main loop", joined(large, 0), joined(large, 1), "measured")]
    if small:
        traces.append(Trace("minor loops", joined(small, 0), joined(small, 1), "model"))
    return Remade(
        "11b",
        "Congruency test",
        "the branches of major and minor loops do not quite coincide (no number)",
        f"{len(found)} branches; they lie at most {_percent(far)} of the highest apart.",
        source,
        traces,
        ("Way since the reversal", "m"),
        ("Force since the reversal", "N"),
        {"incongruency": far},
    )


def on_minor(
    number: str, title: str, paper: str, lessons: Lessons, step: float, both: bool, source: str
) -> Remade:
    """Return Fig. 12a or 12b: minor and main loops, and the model trained on the main one, or on both."""
    weights = train(lessons.both if both else lessons.main, lessons.on_main, step, TAUGHT, whole=True).weights
    lesson, rows = lessons.both, lessons.shown
    said = (lesson.activations() @ weights)[rows]
    position, force = lesson.position[rows].copy(), lesson.force[rows]
    # Cycles of a recording need not follow each other: no line from one to the next.
    position[1:][np.abs(np.diff(position)) > 0.02 * np.ptp(position)] = np.nan
    on_main, on_small = lessons.on_main.error(weights), lessons.on_minor.error(weights)
    return Remade(
        number,
        title,
        paper,
        f"Frozen, it is off by {_percent(on_small)} on other minor loops and {_percent(on_main)} on the "
        "main loop.",
        f"{source}; LMS (8) with step {step:g}, {TAUGHT} cycles",
        [
            Trace("measured", position, force, "measured"),
            Trace("model", position, said, "model"),
        ],
        numbers={"error_main": on_main, "error_minor": on_small},
    )


def _tracked(
    number: str, title: str, paper: str, done: Compensated, compensated: bool, source: str
) -> Remade:
    run = done.with_it if compensated else done.without
    size = done.error_with if compensated else done.error_without
    c = run.columns
    rows = (c["time"] >= SHOWN_S[0]) & (c["time"] <= SHOWN_S[1])
    desired, actual = c["reference"][rows], c["position"][rows]
    traces = [
        Trace("desired", c["time"][rows], desired, "reference"),
        Trace("actual", c["time"][rows], actual, "with" if compensated else "without"),
    ]
    if compensated:
        traces.append(Trace("error, 10 times", c["time"][rows], 10.0 * (desired - actual), "model"))
    return Remade(
        number,
        title,
        paper,
        f"The tracking error is {1e6 * size.rms:.2g} um rms, {1e6 * size.peak:.2g} um at most.",
        source,
        traces,
        ("Time", "s"),
        ("Position", "m"),
        {"error_rms_um": 1e6 * size.rms, "error_peak_um": 1e6 * size.peak},
    )


def figures(step: float, measured: Measured | None = None) -> list[Remade]:
    """Return all figures: the real setup's from `measured` where there is one, else from the flawed stage."""
    plain = case(0.0, 0.0, 0)
    noisy = replace(plain.lesson, position_noise=NOISE * float(np.ptp(plain.lesson.position)))
    ideal = "simulated Leuven stage"
    found = [
        identified(
            "9a",
            "Simulation, ideal case",
            f"converged to {_percent(LEVEL)} in about 60 cycles",
            plain.lesson,
            plain.held_out,
            step,
            ideal,
        ),
        identified(
            "9b",
            "Simulation, with measurement noise",
            "no noticeable difference with about 5 % of noise",
            noisy,
            plain.held_out,
            step,
            f"{ideal}, uniform position noise of 5 %",
        ),
        *_of_setup(step, measured),
    ]
    sine: dict[str, float | str] = {"kind": "sine", "amplitude": 6e-5, "frequency": 1.0, "duration": 6.0}
    small: dict[str, Any] = {
        "kind": "multisine",
        "frequencies": [0.5, 2.0],
        "amplitudes": [2.5e-5, 1.5e-5],
        "duration": 6.0,
    }
    learner = f"20 equal intervals, LMS (8) with step {step:g}"
    a = followed(rig(), papers_model((0.0, 0.0), step, 0), sine)
    b = followed(rig(*FLAWED), papers_model(FLAWED, step, 0), sine)
    minor = followed(rig(*FLAWED), papers_model(FLAWED, step, 0), small)
    none = "without compensation the axis stays behind at every reversal (no number)"
    flawed = f"{STAND_IN}; {learner}"
    return [
        *found,
        _tracked("13a", "Simulation, without compensation", none, a, False, ideal),
        _tracked("13b", "Real setup, without compensation", none, b, False, STAND_IN),
        _tracked(
            "14a", "Simulation, with compensation", "extraordinarily good", a, True, f"{ideal}; {learner}"
        ),
        _tracked(
            "14b", "Real setup, with compensation, major loop", "visible bumps of about 5 um", b, True, flawed
        ),
        _tracked(
            "15", "Compensation in minor loops", "bumps as in Fig. 14b (no number)", minor, True, flawed
        ),
    ]


def _of_setup(step: float, measured: Measured | None) -> list[Remade]:
    if measured is None:
        of = case(*FLAWED, 0)
        lessons = lessons_of(*FLAWED, 0)
        source = STAND_IN
        cycle = of.lesson.position[-CYCLE:], of.lesson.force[-CYCLE:]
        moves = lessons.both.position[CYCLE:]
        several = branches(moves, lessons.both.force[CYCLE:], 0.05 * float(np.ptp(moves)))
        first, judged = of.lesson, of.held_out
    else:
        lessons = measured_lessons(measured)
        source = f"recording {measured.name}"
        last = measured.main[-1]
        cycle = measured.part([last])
        pairs = [measured.part([k]) for k in [*measured.minor, *measured.main[1:]]]
        several = [branch for pair in pairs for branch in to_and_back(*pair)]
        first, judged = lessons.main, lessons.on_main
    found = [
        identified(
            "10",
            "Real setup, main loop",
            "much slower than in the simulation (no number)",
            first,
            judged,
            step,
            source,
        ),
        symmetry(*cycle, source),
        congruency(several, source),
        on_minor(
            "12a",
            "Minor loops, trained on the main loop only",
            "smooth, with a large error on minor loops",
            lessons,
            step,
            False,
            source,
        ),
        on_minor(
            "12b",
            "Minor loops, trained on minor loops too",
            "better on minor loops, a little worse on the main loop",
            lessons,
            step,
            True,
            source,
        ),
    ]
    if measured is not None and measured.axis == "rotary":
        rotary = {"m": "rad", "N": "N m"}
        found = [replace(f, x=(f.x[0], rotary[f.x[1]]), y=(f.y[0], rotary[f.y[1]])) for f in found]
    return found
