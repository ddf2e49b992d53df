"""The job `paper`: every experiment, in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rtcomp.jobs.paper.claim import Claim, Spread, ratio
from rtcomp.jobs.paper.closed_loop import compensation
from rtcomp.jobs.paper.figures import Remade, figures
from rtcomp.jobs.paper.identification import (
    NOTICEABLE,
    Effort,
    convergence,
    cycles,
    matched_step,
    noise,
    output_noise,
    slowed,
)
from rtcomp.jobs.paper.locality import locality
from rtcomp.jobs.paper.measured import Measured, cycles_on, measured_lessons
from rtcomp.jobs.paper.minor import TAUGHT, minor_claims

Say = Callable[[float, str], None]
"""Hears how far it is (0 to 1) and what comes next."""


@dataclass(frozen=True)
class Study:
    """What came out: the claims in the order of the text, and the figures."""

    claims: Sequence[Claim]
    figures: Sequence[Remade]
    step: float
    """Of (8), chosen to need the paper's 60 cycles in the ideal case."""
    fastest: float
    effort: Effort
    recording: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return paper.json."""
        return {
            "format": "rtcomp paper 1",
            "claims_true": sum(c.holds for c in self.claims),
            "claims_false": sum(not c.holds for c in self.claims),
            "step": self.step,
            "fastest_step": self.fastest,
            "seeds": self.effort.seeds,
            "most_cycles": self.effort.most,
            "recording": self.recording or None,
            "claims": [c.to_json() for c in self.claims],
            "figures": [f.to_json() for f in self.figures],
        }


def study(effort: Effort, measured: Measured | None = None, say: Say = lambda part, what: None) -> Study:
    """Test every claim and remake every figure; with a recording also what it can tell of the claims."""
    say(0.0, "learning factor")
    step, table = matched_step(effort)
    fastest = min(table, key=lambda s: table[s])
    parts: list[tuple[str, Callable[[], list[Claim]]]] = [
        ("convergence", lambda: [convergence(effort, step, table)]),
        ("noise", lambda: [noise(effort, step)]),
        ("asymmetry, congruency", lambda: slowed(effort, step, fastest)),
        ("minor loops", lambda: minor_claims(effort, step, fastest)),
        ("output noise", lambda: [output_noise(effort, step)]),
        ("locality", lambda: locality(effort, step, fastest)),
        ("compensation", lambda: compensation(effort, step, fastest)),
    ]
    if measured is not None:
        parts.insert(5, ("recording", lambda: _of_recording(effort, step, fastest, measured)))
    claims: list[Claim] = []
    for number, (name, test) in enumerate(parts):
        say((number + 0.5) / (len(parts) + 1), name)
        claims += test()
    say(len(parts) / (len(parts) + 1), "figures")
    drawn = figures(step, measured)
    say(1.0, "")
    return Study(claims, drawn, step, fastest, effort, measured.name if measured else "")


def _of_recording(effort: Effort, step: float, fastest: float, measured: Measured) -> list[Claim]:
    lessons = measured_lessons(measured)
    basis = lessons.main.basis
    where = (
        f"recording {measured.name}, {basis.size} equal intervals over the main loop's travel, LMS (8) with "
        f"step {step:g}, every other cycle learned from, the others judged, each taken as 1000 samples"
    )
    ours = cycles_on(lessons, step, effort.most, 0.0, False, 0)
    found = Spread.of([ratio(ours, n) for n in cycles(effort, step)])
    slower = Claim(
        "slower-measured",
        "the convergence in the real setup was much slower than in the simulation",
        found.median > NOTICEABLE,
        found,
        "cycles on the recording over cycles in the ideal simulation",
        "times",
        "median above 1.25",
        where,
        "",
        {"cycles": ours},
    )
    return [
        slower,
        *minor_claims(
            Effort(1, effort.most),
            step,
            fastest,
            given=lambda seed: lessons,
            suffix="-measured",
            where=f"{where}, {TAUGHT} cycles",
            remark=" What moved the axis before the recording is not known; the virgin state is assumed.",
        ),
        output_noise(
            effort,
            step,
            suffix="-measured",
            where=f"{where}; noise uniform",
            given=lambda level, own, seed: cycles_on(lessons, step, effort.most, level, own, seed),
        ),
    ]
