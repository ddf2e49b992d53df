"""What a fit leaves of a recording is what the stage made of it leaves, for every entry a diagnosis can name.

The belief is off in mass, damping and friction, so that entries whose force goes by one of these are told
from those that go by its believed value.
"""

from __future__ import annotations

import numpy as np
import pytest
from every_effect import every
from test_effect_balance import FRICTION, PLAIN, recorded, stage_with

from rtcomp import physics
from rtcomp.diagnosis.fitting.baseline import baseline, settle
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.recording.reader import Recording

NEARLY = {"backlash": 0.04}  # the fit has the load's own motion behind the play, the stage its kernel
"""Parts of the force by which some may differ, and why."""
NOISE = 2e-9
"""m rms, of the reading."""
BELIEVED = PLAIN.with_changes(
    stage={
        "mass": 1.84,
        "viscous": 43.0,
        "micro_damping": 265.0,
        "friction": [{**e, "stiffness": 1.07 * e["stiffness"]} for e in FRICTION],
    },
    sensor={"noise": NOISE},
)


@every
def test_the_extended_stage_leaves_what_the_fit_left(entry: type[physics.Effect]) -> None:
    if not entry.searchable or entry.stands_for:
        pytest.skip("a diagnosis gives no such entry beside the stage's own numbers")
    time, position, voltage = recorded(stage_with(entry))
    position = position + NOISE * np.random.default_rng(3).standard_normal(position.size)
    data = load_data([Recording({"time": time, "position": position, "voltage": voltage}, 1000.0)])
    balance = ForceBalance(BELIEVED, data)
    baseline(balance)
    fitter = Fitter(balance)
    terms = [Term({"name": entry.name, **entry.example}, frozenset())]
    settle(fitter, terms)
    model = fitter.fit(terms)
    drive, needed = balance.both_sides(fitter.stage(model))
    apart = drive - needed - fitter.force(model)
    assert np.sqrt(np.mean(apart**2) / np.mean(drive**2)) < NEARLY.get(entry.name, 2e-3)
