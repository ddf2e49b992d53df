"""Entries under the names of others that act alike."""

from __future__ import annotations

import pytest
from recorded import run, there_and_back
from recorded import stage as axis

from rtcomp.diagnosis.renamed import other_side, renamed
from rtcomp.diagnosis.scene import Entry

OFFSET: Entry = {"name": "drive-offset", "offset": 0.2}
WEIGHT: Entry = {"name": "constant-force", "force": 0.8}
WAVE: Entry = {"name": "cogging", "amplitude": 0.3, "period": 1e-3, "phase": 0.4}


@pytest.mark.parametrize(
    ("entry", "other"),
    [
        (OFFSET, WEIGHT),
        (OFFSET, {"name": "gravity", "force": 0.8}),
        ({"name": "drive-delay", "delay": 1e-3}, {"name": "sensor-delay", "delay": 1e-3}),
        ({"name": "drive-delay", "delay": 1e-3}, {"name": "drive-lag", "time_constant": 1e-3}),
    ],
)
def test_there_and_back_it_is_the_same(entry: Entry, other: Entry) -> None:
    stage = axis()
    assert renamed(entry, str(other["name"]), stage) == pytest.approx(other)
    assert renamed(other, str(entry["name"]), stage) == pytest.approx(entry)


def test_an_offset_moves_the_axis_as_the_force_that_it_makes_does() -> None:
    one, other = (run(axis(effects=[e]), there_and_back(2.0)) for e in (OFFSET, other_side(OFFSET, axis())))
    assert other.columns["position"] == pytest.approx(one.columns["position"], abs=2e-8)


def test_a_wave_becomes_a_ripple_of_its_period_and_what_has_no_rule_nothing() -> None:
    ripple = renamed(WAVE, "torque-ripple", axis())
    assert ripple is not None and (ripple["period"], ripple["phase"]) == (1e-3, 0.4)
    assert renamed(WAVE, "drive-delay", axis()) is None
    assert renamed(OFFSET, "drive-lag", axis()) is None
    assert other_side(WAVE, axis()) == WAVE
