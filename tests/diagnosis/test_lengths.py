"""Places beside a sensor's scale: waves are of true lengths, and searches see readings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import STAGE, run
from test_alike import reference

from rtcomp.diagnosis.addition import best_addition
from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.lengths import beside, has_places, left_out
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import refine
from rtcomp.diagnosis.scene import Entry
from rtcomp.stage.stage import Stage

COGGING: Entry = {"name": "cogging", "amplitude": 0.3, "period": 7e-5, "phase": 0.4}
CYCLIC: Entry = {"name": "sensor-periodic-error", "amplitude": 1e-8, "period": 3e-6, "phase": 0.0}
STOP: Entry = {"name": "end-stop", "position": 1e-4, "stiffness": 2e4}
CURVE: Entry = {"name": "position-force", "knots": [-1e-4, 0.0, 1e-4], "values": [0.1, 0.0, 0.2]}
SCALE: Entry = {"name": "sensor-scale", "scale": 1.2}


@given(st.floats(0.5, 2.0), st.permutations([COGGING, CYCLIC, STOP, CURVE]))
def test_a_scale_takes_places_along_and_gives_them_back(scale: float, entries: list[Entry]) -> None:
    first = beside(entries, {**SCALE, "scale": scale})
    last = [{**SCALE, "scale": scale}]
    for entry in entries:
        last = beside(last, entry)
    assert first[:-1] == last[1:]
    found = {str(e["name"]): e for e in first}
    assert found["cogging"]["period"] == pytest.approx(scale * 7e-5)
    assert found["end-stop"]["position"] == pytest.approx(scale * 1e-4)
    assert found["position-force"]["knots"] == pytest.approx([-scale * 1e-4, 0.0, scale * 1e-4])
    assert found["sensor-periodic-error"] == CYCLIC  # the sensor's own
    assert found["end-stop"]["stiffness"] == 2e4
    again = left_out(first, len(first) - 1)
    for before, after in zip(entries, again, strict=True):
        for key, value in before.items():
            assert after[key] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-12))


def test_what_changes_no_length_moves_nothing() -> None:
    assert beside([COGGING], STOP) == [COGGING, STOP]
    assert left_out([COGGING, STOP], 0) == [STOP]
    assert has_places([CYCLIC, COGGING]) and not has_places([CYCLIC])


def test_a_scale_is_found_beside_a_wave_along_the_way() -> None:
    """Of the wave's amplitude and phase nothing changes, but its period is as much longer as all lengths."""
    believed = Stage.from_dict(STAGE)
    hidden = [COGGING, SCALE]
    plant = Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": hidden}})
    motion = prepare(believed, [run(plant, reference(), seed=3)])
    base = fit_base(believed, motion)
    wave = refine(base, motion, [{**COGGING, "period": 7e-5 / 1.2}])
    found = best_addition(believed, motion, wave.fitted, wave.entries, lambda _part, _what: None).best
    assert found is not None
    names = {str(e["name"]): e for e in found.entries}
    scale, period = float(names["sensor-scale"]["scale"]), float(names["cogging"]["period"])  # type: ignore[arg-type]
    assert 1.1 < scale < 1.3  # other values of mass and damping do for the rest of it
    assert period / scale == pytest.approx(7e-5 / 1.2, rel=0.005)
    assert np.sum(found.errors) < 0.1 * np.sum(wave.errors)
