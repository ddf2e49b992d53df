"""A belief of mass, force constant and voltage limit alone: friction is left to the diagnosis."""

from __future__ import annotations

import pytest
from bench_benchmarks import MOTOR, motor
from bench_benchmarks import recording as recording_of
from recorded import STAGE, at_hand, run, stage, there_and_back

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.admit import admit
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage

NEEDED = {"mass": 2.0, "force_constant": 4.0, "voltage_limit": 10.0}
DEADBAND = {"name": "drive-deadband", "width": 0.2}


@pytest.fixture(scope="module")
def recording() -> Recording:
    return run(stage(effects=[DEADBAND]), there_and_back())


@pytest.mark.parametrize("friction", [{}, {"friction": []}], ids=["missing", "empty"])
def test_a_diagnosis_of_a_thin_belief_comes_to_its_end(
    recording: Recording, friction: dict[str, list[object]]
) -> None:
    thin = Stage.from_dict({"stage": NEEDED | friction, "rate": 1000.0})
    assert thin.friction is None
    admit(thin, [recording])
    found = diagnose(thin, [recording], budget=300.0)
    assert found.verdict in ("missing-physics", "unexplained")
    assert found.fit.retuned < 0.3 * found.fit.before
    assert all(r.before == 0.0 for r in found.retuned if r.parameter not in ("mass", "force_constant"))


def test_numbers_bent_to_a_part_of_the_recordings_are_not_given() -> None:
    """Where the axis rubs for a while: friction fitted to that is wrong elsewhere."""
    free = {**NEEDED, "viscous": 8.0, "effects": [{"name": "parallel-spring", "stiffness": 4000.0}]}
    axis = Stage.from_dict({**STAGE, "stage": free})
    rubs = Stage.from_dict({**STAGE, "stage": {**free, "friction": STAGE["stage"]["friction"]}})
    found = diagnose(axis, [run(axis, there_and_back(16.0)), run(rubs, there_and_back(5.0))], budget=300.0)
    assert found.verdict == "unexplained"
    assert found.fit.after < 1.02 * found.fit.before


@pytest.mark.slow
def test_a_measured_motor_of_which_only_the_inertia_is_believed() -> None:
    """Open loop, 100 Hz; the position is the integral of the measured speed."""
    columns = motor(at_hand("real/dc-motor"))
    thin = Stage.from_dict({"stage": MOTOR, "rate": 100.0})
    turned = recording_of({name: columns[name] for name in ("time", "position", "voltage")})
    admit(thin, [turned])
    found = diagnose(thin, [turned], budget=300.0)
    assert found.verdict in ("missing-physics", "unexplained")
