"""What remembers has its state where a window begins: it was led along the way there."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import cut, run, stage, there_and_back

from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.kinematics import Path
from rtcomp.diagnosis.forces.led import led_there, way_there
from rtcomp.diagnosis.recordings.data import MOST_ROWS, Segment, load_data
from rtcomp.kernels import Floats
from rtcomp.physics import build


@pytest.mark.parametrize("drift", [0.0, 5e-3])
def test_friction_remembers_the_way_to_a_window(drift: float) -> None:
    """The way that the axis went: what the sensor did to the reading on the way is undone as well."""
    believed, whole = stage(), run(stage(), there_and_back(72.0))
    balance = ForceBalance(believed, load_data([whole]))
    sensors = [build({"name": "sensor-drift", "drift": drift, "time_constant": 20.0})] if drift else []
    windows, (everything,) = balance.data.segments, load_data([cut(whole, 0, MOST_ROWS)]).segments
    assert len(windows) > 1 and everything.before is None
    assert way_there(windows[0], [build({"name": "sensor-delay", "delay": 1e-3})]) is None

    def units(segment: Segment, path: Path) -> Floats:
        return balance._units(segment, path, balance._start(segment, sensors), [], [], None)

    path = balance._path(everything, sensors)
    along = units(everything, path)
    inside = [w for w in windows[1:] if w.time[-1] < everything.time[-1]]
    assert inside
    for window in inside:
        first = round(float(window.time[0]) * 1000.0)
        part = path.part(slice(first, first + window.time.size))
        stops = slice(2 + balance.reaches.size // 2, None)  # short ones forget the way at once
        assert units(window, part)[10:-10, stops] == pytest.approx(
            along[first + 10 : first + window.time.size - 10, stops], abs=0.02 * float(balance.reaches[-1])
        )


def test_what_swings_remembers_the_way_to_a_window() -> None:
    """A mass that swings for seconds: in a window it swings as it does in the whole recording."""
    swings = build({"name": "resonance", "mass_ratio": 0.4, "frequency": 7.0, "damping": 0.01})
    believed, whole = stage(), run(stage(), there_and_back(72.0))
    balance = ForceBalance(believed, load_data([whole]))
    (everything,) = load_data([cut(whole, 0, MOST_ROWS)]).segments
    path = balance._path(everything, [])
    _, along = led_there(believed, [swings], everything, path)
    inside = [w for w in balance.data.segments[1:] if w.time[-1] < everything.time[-1]]
    assert inside
    for window in inside:
        rows = slice(round(float(window.time[0]) * 1000.0), round(float(window.time[-1]) * 1000.0) + 1)
        mass, push = led_there(believed, [swings], window, path.part(rows))
        np.testing.assert_allclose(push, along[rows], atol=0.03 * float(np.abs(along).max()))
        np.testing.assert_allclose(mass, 0.6 * believed.mass)
