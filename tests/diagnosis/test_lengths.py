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
from rtcomp.diagnosis.lengths import METRES, beside, has_places, left_out, takes_along
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import refine
from rtcomp.diagnosis.scene import Entry
from rtcomp.physics import catalogue
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
    assert found["end-stop"]["stiffness"] == pytest.approx(2e4 / scale)
    assert found["cogging"]["amplitude"] == 0.3 and found["position-force"]["values"] == CURVE["values"]
    again = left_out(first, len(first) - 1)
    for before, after in zip(entries, again, strict=True):
        for key, value in before.items():
            assert after[key] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-12))


@pytest.mark.parametrize(
    ("entry", "key", "power"),
    [
        ({"name": "quadratic-drag", "coefficient": 3.0}, "coefficient", -2),  # F = c v |v|
        ({"name": "parallel-spring", "stiffness": 3.0, "cubic": 0.0}, "stiffness", -1),  # F = k x
        ({"name": "parallel-spring", "stiffness": 0.0, "cubic": 3.0}, "cubic", -3),
        ({"name": "inertia", "mass": 3.0}, "mass", -1),  # F = m a
        ({"name": "stribeck", "rise": 0.1, "velocity": 3.0}, "velocity", 1),
        ({"name": "stiction-ageing", "growth": 0.1, "distance": 3.0, "onset": 0.1}, "distance", 1),
    ],
)  # fmt: skip
def test_the_same_force_along_longer_lengths(entry: Entry, key: str, power: int) -> None:
    longer = beside([entry], SCALE)[0]
    assert longer[key] == pytest.approx(3.0 * 1.2**power)
    assert {k: v for k, v in longer.items() if k != key} == {k: v for k, v in entry.items() if k != key}


def test_every_unit_with_a_length_is_known() -> None:
    units = {p.unit for entry in catalogue.entries() for p in entry.parameters}
    assert {u for u in units - {"N m"} if "m" in u or u == "kg"} == set(METRES)


def test_what_changes_no_length_moves_nothing() -> None:
    assert beside([COGGING], STOP) == [COGGING, STOP]
    assert left_out([COGGING, STOP], 0) == [STOP]
    assert has_places([CYCLIC, COGGING]) and not has_places([CYCLIC])


def test_what_is_read_elsewhere_takes_waves_along_and_a_scale_whatever_has_a_length() -> None:
    drift: Entry = {"name": "sensor-drift", "drift": 1e-5, "time_constant": 3.0}
    drag: Entry = {"name": "quadratic-drag", "coefficient": 3.0}
    assert takes_along(drift, [COGGING]) and not takes_along(drift, [drag])
    assert takes_along(SCALE, [drag]) and not takes_along(SCALE, [CYCLIC])
    assert not takes_along(drag, [COGGING])


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
