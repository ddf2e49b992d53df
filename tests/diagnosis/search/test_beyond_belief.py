"""Numbers of a belief that are so far off that something missing may have made them so."""

from __future__ import annotations

import pytest
from recorded import RATE, run, there_and_back

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.stage.stage import Stage

FLEXURE = {"mass": 0.5, "force_constant": 20.0, "voltage_limit": 1.0, "viscous": 1.5}
SPRING = {"name": "parallel-spring", "stiffness": 1.5e4}
LOOP = {"kp": 600.0, "ki": 1e4, "kd": 4.0}


def diagnosed(viscous: float, *effects: dict[str, float | str]) -> Diagnosis:
    def axis(of: float, *more: dict[str, float | str]) -> Stage:
        made = {
            "stage": {**FLEXURE, "viscous": of, "effects": [SPRING, *more]},
            "sensor": {"noise": 1e-8},
            "rate": RATE,
            "controller": LOOP,
        }
        return Stage.from_dict(made)

    recording = run(axis(viscous, *effects), there_and_back(20.0))
    return diagnose(axis(FLEXURE["viscous"]), [recording])


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect", [{"name": "drive-delay", "delay": 3e-3}, {"name": "drive-lag", "time_constant": 4e-3}]
)
def test_a_late_drive_against_a_spring_is_no_damping_beyond_belief(
    effect: dict[str, float | str],
) -> None:
    """The force of a spring that comes late by t is that of a damping of stiffness times t."""
    found = diagnosed(FLEXURE["viscous"], effect)
    (one,), (name, size) = found.effects, effect.values()
    assert name in one.names
    (found_size,) = one.parameters.values()
    assert found_size.value == pytest.approx(size, rel=0.1)
    assert all(r.parameter != "viscous" for r in found.retuned)


@pytest.mark.slow
def test_a_damping_beyond_belief_is_no_late_drive() -> None:
    found = diagnosed(30.0 * FLEXURE["viscous"])
    assert (found.verdict, found.effects) == ("retuned", [])
    assert [r.parameter for r in found.retuned] == ["viscous"]
