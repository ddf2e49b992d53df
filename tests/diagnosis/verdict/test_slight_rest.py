"""Something unknown beside numbers that are off: these are given where it is only a slight part."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import STAGE, changed, run, stage, there_and_back

from rtcomp.diagnosis.pipeline import diagnose


def test_numbers_that_leave_a_slight_part_to_what_is_unknown_are_given() -> None:
    """A bump is in no entry of the catalogue; beside friction that is off by a quarter it is little."""
    recording = run(stage(), there_and_back(12.0))
    bump = 0.2 * np.exp(-(((recording.position - 0.8e-4) / 4e-5) ** 2))
    pushed = changed(recording, voltage=recording.voltage + bump / 4.0)
    friction = [{**e, "stiffness": 0.75 * e["stiffness"]} for e in STAGE["stage"]["friction"]]
    found = diagnose(stage(friction=friction), [pushed])
    assert (found.verdict, [e.names for e in found.effects]) == ("unexplained", [("unexplained",)])
    assert 0.0 < found.effects[0].share < 0.05
    (level,) = found.retuned
    assert level.parameter == "friction.level"
    assert level.after.value == pytest.approx(1.52, rel=0.03)
    assert found.fit.after < 0.5 * found.fit.before
