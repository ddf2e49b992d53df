"""What a fit leaves of a recording is what the stage made of it leaves, for every entry a diagnosis can name.

The belief is off in mass, damping and friction, so that entries whose force goes by one of these are told
from those that go by its believed value.
"""

from __future__ import annotations

import numpy as np
import pytest
from every_effect import every
from test_effect_balance import FRICTION, MODELS, PLAIN, UNSEEN, recorded, stage_with

from rtcomp import physics
from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.extend import extended_stage
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import evaluate
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import force_balance

NUMBERS = {"inertia", "viscous-friction", "micro-damping"}
"""Entries that are a number of the stage: they are not given beside it."""
NEARLY = {
    "backlash": 0.02,  # what is behind the play moves with what is believed, until it is settled
    "load-dependent-friction": 0.004,  # a fit goes by the friction that it begins with; `consistent` mends it
    "non-congruent-friction": 0.005,  # so does this, until it is settled
    "creep": 0.001,
}
"""Parts of the force by which some may differ, and why."""
BELIEVED = PLAIN.with_changes(
    stage={
        "mass": 1.84,
        "viscous": 43.0,
        "micro_damping": 265.0,
        "friction": [{**e, "stiffness": 1.07 * e["stiffness"]} for e in FRICTION],
    }
)


@every
def test_the_extended_stage_leaves_what_the_fit_left(entry: type[physics.Effect]) -> None:
    if entry.name in MODELS | NUMBERS | UNSEEN.keys():
        pytest.skip("a diagnosis gives no such entry beside the stage's own numbers")
    time, position, voltage = recorded(stage_with(entry))
    columns = {"time": time, "position": position, "voltage": voltage}
    motion = prepare(BELIEVED, [Recording(columns, 1000.0)])
    found = [{"name": entry.name, **entry.example}]
    fitted, _ = evaluate(fit_base(BELIEVED, motion), found)
    assert fitted.coefficients[0] == pytest.approx(2.0, rel=0.04)  # a mass that was believed 8 % lighter
    extended = extended_stage(BELIEVED, fitted, found)
    (strip,) = motion.strips
    balance = force_balance(extended, strip.time, strip.position, strip.voltage, motion.cut)
    left = (balance.force_drive - balance.force_motion)[motion.kept(strip)]
    part = np.sqrt(np.mean((left - fitted.residual) ** 2) / np.mean(balance.force_motion**2))
    assert part < NEARLY.get(entry.name, 1e-5)
