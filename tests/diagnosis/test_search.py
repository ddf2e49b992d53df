"""Where a search for missing physics starts, and what the first look keeps of it."""

from __future__ import annotations

import pytest
from recorded import run, stage, there_and_back
from rtcomp.diagnosis.addition import _agrees, _below_a_count, best_addition
from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.certain import intervals
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.scene import Scene
from rtcomp.diagnosis.screen import BENT, screen
from rtcomp.diagnosis.search_at_work import _cyclic_periods, _ringing

from rtcomp.diagnosis.pipeline import diagnose


def scene(*effects: dict[str, object]) -> Scene:
    """What a recording of the stage with `effects` offers to one that does not know of them."""
    motion = prepare(stage(), [run(stage(effects=list(effects)), there_and_back(12.0))])
    return Scene.of(motion, fit_base(stage(), motion))


def test_a_small_second_mass_is_looked_for_where_it_rings() -> None:
    found = _ringing(scene({"name": "resonance", "frequency": 17.0, "damping": 0.03, "mass_ratio": 0.03}))
    assert found[0] == pytest.approx(17.0, rel=0.06)


@pytest.mark.parametrize("period", [2e-5, 8e-6, 5e-6, 3e-6])
def test_an_error_of_the_reading_is_looked_for_where_the_motion_is_slow_enough(period: float) -> None:
    """At full speed the shorter of these waves are beyond the bandwidth, or between two rows."""
    at = scene({"name": "sensor-periodic-error", "amplitude": 1e-7, "period": period, "phase": 0.3})
    found = _cyclic_periods(at)
    assert len(found) <= 4
    assert min(abs(p / period - 1.0) for p in found) < 0.005


def test_a_first_look_keeps_every_form() -> None:
    looked = {s.name: s for s in screen(scene({"name": "constant-force", "force": 0.3}), [])}
    for name in ("stribeck", "frictional-lag", "stiction-ageing", "load-dependent-friction"):
        both = [looked[name].entry, *(form.entry for form in looked[name].forms)]
        assert sorted(bool(entry.get("following")) for entry in both) == [False, True]
    for name, key in (("backlash", "contact"), ("cogging", "harmonics")):
        assert {key in e for e in (looked[name].entry, *(f.entry for f in looked[name].forms))} == {
            False,
            True,
        }


@pytest.mark.parametrize(
    ("name", "size", "more"),
    [
        ("stribeck", {"rise": 0.03}, {"velocity": 2e-3}),
        ("asymmetric-friction", {"asymmetry": 0.01}, {}),
        ("non-congruent-friction", {"softening": 0.015}, {}),
        ("load-dependent-friction", {"coefficient": 0.01}, {}),
    ],
)
def test_a_small_effect_is_looked_for_at_its_size(
    name: str, size: dict[str, float], more: dict[str, float]
) -> None:
    """Much smaller than any that is tried: each of those would leave more than there was."""
    at = scene({"name": name, **size, **more})
    looked = {s.name: s for s in screen(at, [])}[name]
    assert looked.gain(at.fitted.errors) > 0.1
    ((parameter, truth),) = size.items()
    assert looked.entry[parameter] == pytest.approx(truth, rel=0.5)


def found_first(at: Scene) -> Refined:
    """The entry that explains most of what a recording shows."""
    best = best_addition(stage(), at.motion, at.fitted, [], lambda _part, _what: None).best
    assert best is not None
    return best


@pytest.mark.parametrize(
    ("name", "size", "value"),
    [
        ("load-dependent-friction", "coefficient", 0.25),
        ("non-congruent-friction", "softening", 0.4),
        ("backlash", "gap", 1.2e-7),
    ],
)
def test_what_other_reaches_do_much_of_is_found_on_the_believed_ones(
    name: str, size: str, value: float
) -> None:
    at = scene({"name": name, size: value})
    assert at.fitted.scale >= BENT
    best = found_first(at).entries[-1]
    assert best["name"] == name
    assert best[size] == pytest.approx(value, rel=0.12)


def test_a_strong_creep_is_settled_on_the_friction_found_beside_it() -> None:
    best = found_first(scene({"name": "creep", "fraction": 0.7, "time_constant": 0.4}))
    assert best.entries[-1]["name"] == "creep"
    assert best.entries[-1]["fraction"] == pytest.approx(0.7, rel=0.15)
    assert _agrees(best)


def test_harmonics_are_refined_like_all_numbers() -> None:
    true = {"order": 2.0, "amplitude": 0.1, "phase": 2.0}
    waves = {"name": "cogging", "amplitude": 0.4, "period": 4e-5, "phase": 0.7}
    at = scene({**waves, "harmonics": [true]})
    off = {**waves, "harmonics": [{**true, "amplitude": 0.16, "phase": 1.5}]}
    refined = refine(at.fitted, at.motion, [off])
    (found,) = refined.entries[0]["harmonics"]  # type: ignore[misc]
    assert found["amplitude"] == pytest.approx(0.1, rel=0.05)
    assert found["phase"] == pytest.approx(2.0, abs=0.05)
    assert found["order"] == 2.0
    assert off["harmonics"][0]["amplitude"] == 0.16  # type: ignore[index]
    told = intervals(refined, [])
    assert {name for _, name in told} == {"amplitude", "period", "phase"}
    assert told[0, "amplitude"][0] < 0.4 < told[0, "amplitude"][1]


@pytest.mark.parametrize(("counts", "is_none"), [(0.5, True), (-0.5, True), (1.5, False), (-40.0, False)])
def test_a_jump_is_of_whole_counts(counts: float, is_none: bool) -> None:
    count = stage().sensor.resolution
    assert _below_a_count({"name": "sensor-jump", "size": counts * count, "time": 1.0}, stage()) is is_none
    assert not _below_a_count({"name": "sensor-drift", "drift": 0.5 * count, "time_constant": 1.0}, stage())


def test_an_interval_ends_where_its_parameter_does() -> None:
    motion = prepare(stage(), [run(stage(), there_and_back(6.0))])
    entry = {"name": "load-dependent-friction", "coefficient": 1e-3, "following": 1.0, "stiffening": 0.5}
    spans = intervals(refine(fit_base(stage(), motion), motion, [entry], tries=1), [], worse=50.0)
    assert spans[0, "stiffening"] == (0.0, 1.0)
    assert spans[0, "coefficient"][0] == 0.0


@pytest.mark.slow
def test_cogging_with_a_harmonic_is_cogging_and_no_free_curve() -> None:
    waves = [
        {"name": "cogging", "amplitude": 0.4, "period": 4e-5, "phase": 0.7},
        {"name": "cogging", "amplitude": 0.12, "period": 2e-5, "phase": 2.0},
    ]
    found = diagnose(stage(), [run(stage(effects=waves), there_and_back(20.0))])
    assert [e.names[0] for e in found.effects] == ["cogging"]
    assert found.effects[0].parameters["period"].value == pytest.approx(4e-5, rel=0.02)
    assert found.fit.after < 0.5 * found.fit.retuned


@pytest.mark.slow
def test_drag_beside_cogging_is_no_second_wave() -> None:
    hidden = [
        {"name": "cogging", "amplitude": 0.4, "period": 6e-5, "phase": 0.7},
        {"name": "viscous-friction", "coefficient": 25.0},
    ]
    found = diagnose(stage(), [run(stage(effects=hidden), there_and_back(20.0))])
    assert [e.names for e in found.effects] == [("cogging",)]
    assert found.effects[0].parameters["period"].value == pytest.approx(6e-5, rel=0.01)
    assert found.fit.after < 0.1 * found.fit.retuned


@pytest.mark.slow
def test_a_jump_beside_a_lag_is_found_by_the_stretch_that_it_spoils() -> None:
    hidden = [
        {"name": "drive-lag", "time_constant": 3e-3},
        {"name": "sensor-jump", "size": 3e-6, "time": 11.3},
    ]
    found = diagnose(stage(), [run(stage(effects=hidden), there_and_back(20.0))])
    assert sorted(e.names[0] for e in found.effects) == ["drive-lag", "sensor-jump"]


@pytest.mark.slow
def test_a_weight_beside_a_spring_is_no_end_stop() -> None:
    """Nor is it a free curve, which explains both at once, or something that only does beside no spring."""
    hidden = [
        {"name": "constant-force", "force": 0.9},
        {"name": "parallel-spring", "stiffness": 700.0, "cubic": 3e10},
    ]
    found = diagnose(stage(), [run(stage(effects=hidden), there_and_back(20.0))])
    assert {e.names for e in found.effects} <= {
        ("parallel-spring",),
        ("constant-force", "drive-offset", "gravity"),
        ("drive-offset", "constant-force", "gravity"),
    }
    assert len(found.effects) == 2
    assert found.fit.after < 0.1 * found.fit.retuned
