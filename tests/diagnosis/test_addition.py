"""What is found beside an entry that did for it: a bias on the drive's other side, a wave read elsewhere."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recorded import STAGE, run
from test_alike import reference

from rtcomp.diagnosis import addition
from rtcomp.diagnosis.addition import Addition, _biases, best_addition
from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.decide import Choice
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import refine
from rtcomp.diagnosis.scene import Entry
from rtcomp.stage.stage import Stage

WEIGHT: Entry = {"name": "constant-force", "force": 0.8}
OFFSET: Entry = {"name": "drive-offset", "offset": 0.2}
DEAD: Entry = {"name": "drive-deadband", "width": 0.1}
WAVE: Entry = {
    "name": "position-dependent-friction", "amplitude": 0.4, "period": 4e-4, "phase": 0.5, "stiffening": 1.0,
}  # fmt: skip
DRIFT: Entry = {"name": "sensor-drift", "drift": 1.2e-4, "time_constant": 4.0}


def added(first: Entry, *hidden: Entry) -> Addition:
    """What is found beside `first`, refined alone, where `hidden` is."""
    believed = Stage.from_dict(STAGE)
    plant: dict[str, Any] = {**STAGE, "stage": {**STAGE["stage"], "effects": list(hidden)}}
    motion = prepare(believed, [run(Stage.from_dict(plant), reference(), seed=4)])
    alone = refine(fit_base(believed, motion, [effect_of(first)]), motion, [first])
    return best_addition(believed, motion, alone.fitted, alone.entries, lambda _part, _what: None)


def test_a_dead_band_tells_a_weight_from_an_offset() -> None:
    found = added(OFFSET, WEIGHT, DEAD).best
    assert found is not None
    assert [e["name"] for e in found.entries] == ["constant-force", "drive-deadband"]
    assert found.entries[0]["force"] == pytest.approx(0.8, rel=0.02)
    assert found.entries[1]["width"] == pytest.approx(0.1, rel=0.05)


def test_an_offset_beside_a_dead_band_stays_one() -> None:
    found = added(OFFSET, OFFSET, DEAD).best
    assert found is not None
    assert [e["name"] for e in found.entries] == ["drive-offset", "drive-deadband"]


def test_only_what_is_not_in_proportion_asks_for_the_other_side() -> None:
    stage = Stage.from_dict(STAGE)
    lag: Entry = {"name": "drive-lag", "time_constant": 1e-3}
    assert _biases([OFFSET], lag, stage) == [[OFFSET]]
    assert _biases([lag], DEAD, stage) == [[lag]]
    assert _biases([OFFSET, lag], DEAD, stage) == [[OFFSET, lag], [WEIGHT, lag]]
    assert _biases([WEIGHT], DEAD, stage) == [[WEIGHT], [OFFSET]]


def test_the_name_at_work_comes_first() -> None:
    choice = Choice(["drive-offset", "constant-force", "gravity"], 0.5, 1.0)
    choice.put_first("constant-force")
    assert choice.names == ["constant-force", "drive-offset", "gravity"]


@pytest.mark.slow
def test_a_drift_is_found_beside_a_wave_that_it_moves_along() -> None:
    """Where the wave is refined alone its phase is that of the place to which the reading drifts."""
    found = added({**WAVE, "phase": 0.5 - 2.0 * np.pi * 1.2e-4 / 4e-4}, WAVE, DRIFT).best
    assert found is not None
    wave, drift = found.entries
    assert drift["name"] == "sensor-drift"
    assert drift["drift"] == pytest.approx(1.2e-4, rel=0.05)
    assert wave["phase"] == pytest.approx(0.5, abs=0.1)


def contending(monkeypatch: pytest.MonkeyPatch, left: dict[str, float], known: float = 0.0) -> list[str]:
    """Names of those that are settled where they leave so much of 67 N^2 after a few steps."""
    settled: list[str] = []

    def settling(_stage: Any, _motion: Any, refined: Any) -> Any:
        settled.append(refined.entries[-1]["name"])
        return refined

    monkeypatch.setattr(addition, "_well_settled", settling)
    monkeypatch.setattr(addition, "shared", lambda call, items: list(map(call, items)))
    tried: list[Any] = [SimpleNamespace(entries=[{"name": n}], errors=np.array([e])) for n, e in left.items()]
    current: Any = SimpleNamespace(errors=np.array([67.0]))
    addition._settle_contenders(current, current, current, tried, {}, known)
    return settled


def test_a_plainer_name_is_settled_as_what_is_it_and_more_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else what frees the number comes before the number, as only that is refined together with others."""
    left = {"drive-gain": 3.2, "asymmetric-viscous-friction": 3.3, "sensor-scale": 3.4, "quadratic-drag": 3.5}
    left |= {"viscous-friction": 5.4, "inertia": 5.5}
    assert contending(monkeypatch, left) == [*list(left)[:3], "viscous-friction"]


def test_far_behind_what_is_known_to_be_reached_nothing_but_the_nearest_is_settled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As far behind the first it is else: the first may not be what it will be."""
    left = {"cogging": 1.0, "position-force": 2.0, "drive-gain": 20.0}
    assert contending(monkeypatch, left) == [*left]
    assert contending(monkeypatch, left, known=0.9) == [*left]
    assert contending(monkeypatch, left, known=0.7) == [*list(left)[:2]]
    assert contending(monkeypatch, left, known=1e-3) == [*list(left)[:2]]


def test_viscous_friction_is_not_looked_for_beside_one_that_differs_by_direction() -> None:
    """That lets the viscous friction go: the two would grow against each other, and both sides with them."""
    one_way: Entry = {"name": "asymmetric-viscous-friction", "ratio": 0.01}
    late: Entry = {"name": "drive-delay", "delay": 3e-3}
    found = added(one_way, {"name": "viscous-friction", "coefficient": 4.0}, late)
    assert found.best is not None and found.best.entries[-1]["name"] in ("drive-delay", "sensor-delay")
    assert not {"viscous-friction", "back-emf"} & {str(r.entries[-1]["name"]) for r in found.others}
