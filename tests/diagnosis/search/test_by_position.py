"""What is only seen to be a smooth function of the position is a spring, whatever law could be bent to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from recorded import changed, run, stage, there_and_back

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.by_position import bent, by_plain_laws
from rtcomp.kernels import Floats

HALF = 3.5e-4
"""Half of the stroke (m)."""
FORCE = 3.0
"""N at its end."""


def pushed(law: Callable[[Floats], Floats], chosen: dict[str, Any]) -> tuple[Fitter, Fitted]:
    """Return a fit of the `chosen` effect to an axis that a force by `law` of x / HALF acts on."""
    recording = run(stage(), there_and_back(20.0))
    against = FORCE * law(recording.position / HALF) / stage().force_constant
    balance = ForceBalance(stage(), load_data([changed(recording, voltage=recording.voltage + against)]))
    base, fitter = baseline(balance), Fitter(balance)
    return fitter, fitter.fit([Term.of(chosen)], base)


def leaves(model: Fitted, times: float) -> Null:
    """Return a null distribution whose replicates leave so many times less than a model."""
    spread = 1.0 + 0.01 * np.random.default_rng(0).standard_normal((6, model.errors.size))
    return Null(np.zeros(6), spread * model.errors / times)


WAVE = {"name": "cogging", "amplitude": FORCE, "period": 6.0 * HALF, "phase": 0.0}
STOP = {"name": "end-stop", "position": 0.0, "stiffness": FORCE / HALF}
LAWS: list[tuple[Callable[[Floats], Floats], dict[str, Any]]] = [
    (lambda x: x * np.abs(x), WAVE),
    (lambda x: np.tanh(2.0 * x), {**WAVE, "period": 3.0 * HALF}),
    (lambda x: 0.3 * np.expm1(1.5 * x), STOP),
]


@pytest.mark.parametrize(("law", "chosen"), LAWS)
def test_a_spring_of_another_law_is_told_by_its_plainest_name(
    law: Callable[[Floats], Floats], chosen: dict[str, Any]
) -> None:
    """A wave not seen to repeat, or a stop amid the stroke, comes nearer to it than a cubic spring."""
    fitter, model = pushed(law, chosen)
    assert ent.names(by_plain_laws(fitter, model, leaves(model, 30.0)).entries) == ("parallel-spring",)


@pytest.mark.parametrize(("law", "chosen"), LAWS)
def test_what_leaves_only_noise_has_the_right_form(
    law: Callable[[Floats], Floats], chosen: dict[str, Any]
) -> None:
    fitter, model = pushed(law, chosen)
    assert by_plain_laws(fitter, model, leaves(model, 1.0)) is model


def test_a_stop_amid_the_stroke_explains_more_than_a_smooth_function_does() -> None:
    fitter, model = pushed(lambda x: np.maximum(x - 0.1, 0.0), {**STOP, "position": 0.1 * HALF})
    assert bent(fitter, model.entries[0])
    assert by_plain_laws(fitter, model, leaves(model, 30.0)) is model


@pytest.mark.parametrize(
    ("law", "chosen"),
    [
        (lambda x: np.sin(3.0 * np.pi * x), {**WAVE, "period": 2.0 / 3.0 * HALF}),
        (lambda x: 5.0 * np.maximum(x - 0.8, 0.0), {**STOP, "position": 0.8 * HALF}),
    ],
)
def test_what_repeats_and_what_begins_near_the_end_stays(
    law: Callable[[Floats], Floats], chosen: dict[str, Any]
) -> None:
    fitter, model = pushed(law, chosen)
    assert not bent(fitter, model.entries[0])
    assert by_plain_laws(fitter, model, leaves(model, 30.0)) is model
