"""The shape that pays: found where it is there, left off where it is not, or where data are few."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.moving.self_placing import MOST_INTERVALS
from rtcomp.hysteresis.rls import Rls
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.shape.choice import Candidate, Motion, choose, smallest_that_pays
from rtcomp.jobs.shape.placed import placed

PLAIN = IntervalBasis.over(8, 2.0, 3.0)
FALL = np.exp(-2.0 * np.cumsum(PLAIN.widths) / 2.0)


def motion(basis, weights, rows=6000, noise=0.003, seed=1, size=1.3):
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(0.0, 0.05, rows))
    u = size * np.sin(u - u[0])
    force = regressors(basis, u) @ weights
    return Motion(
        u, force + noise * np.abs(force).max() * rng.normal(size=rows), np.ones(rows, dtype=np.bool_), 0.01
    )


def test_nothing_is_added_to_a_symmetric_truth():
    choice = choose(PLAIN, Rls(1.0), motion(PLAIN, FALL))
    assert choice.chosen.parts == () and choice.chosen.skew == 0.0
    assert isinstance(choice.model.basis, IntervalBasis)
    assert "model symmetric" in choice.notes[0]


@pytest.mark.parametrize("seed", [1, 2])
def test_the_parts_that_are_there_are_found(seed):
    for parts in (("output",), ("branches",), ("reversible",), ("reversible", "position")):
        truth = ShapedIntervalBasis(PLAIN.widths, parts, shape=FALL)
        added = np.random.default_rng(seed).uniform(0.4, 0.8, truth.size - 8)
        choice = choose(PLAIN, Rls(1.0), motion(truth, np.append(FALL, added), seed=seed))
        assert set(parts) <= set(choice.chosen.parts), (parts, choice.notes)
        assert choice.chosen.rms < 0.6 * choice.tried[0].rms


def test_a_skew_is_found_and_its_size():
    truth = ShapedIntervalBasis(PLAIN.widths, [], skew=0.12)
    choice = choose(PLAIN, Rls(1.0), motion(truth, FALL, size=3.0))
    assert choice.chosen.skew == pytest.approx(0.12, abs=0.005) and choice.chosen.parts == ()
    assert choice.model.basis.skew == choice.chosen.skew


def test_too_little_data_leaves_parts_off_and_says_so():
    few = motion(PLAIN, FALL, rows=250)
    choice = choose(PLAIN, Rls(1.0), few)
    assert choice.chosen.parts == ()
    assert "left off for want of data" in choice.notes[1] and "position" in choice.notes[1]


def test_rows_that_do_not_count_are_not_learned_from():
    clean = motion(PLAIN, FALL)
    bad = np.zeros(clean.force.size, dtype=np.bool_)
    bad[2000:2500] = True
    spoilt = Motion(clean.position, np.where(bad, 99.0, clean.force), ~bad, clean.gate)
    assert choose(PLAIN, Rls(1.0), spoilt).chosen.rms < 0.05


def test_the_smallest_whose_error_is_not_significantly_worse():
    rng = np.random.default_rng(0)
    base = rng.uniform(0.5, 2.0, 6)
    plain, output = Candidate((), 0.0, 8, base), Candidate(("output",), 0.0, 10, 0.5 * base)
    scattered = Candidate(("reversible",), 0.0, 12, 0.5 * base * rng.uniform(0.7, 1.3, 6))
    assert smallest_that_pays([plain, output, scattered]) == 1
    assert smallest_that_pays([plain, Candidate(("output",), 0.0, 10, 0.98 * base)]) == 0


def test_worse_in_every_block_is_worse_whatever_the_scatter():
    base = np.ones(6)
    plain = Candidate((), 0.1, 8, base * np.array([6.0, 1.2, 1.2, 1.2, 1.2, 1.2]))
    assert smallest_that_pays([plain, Candidate(("output",), 0.1, 10, base)]) == 1
    seldom = Candidate((), 0.1, 8, base * np.array([6.0, 1.2, 1.2, 0.9, 1.2, 1.2]))
    assert smallest_that_pays([seldom, Candidate(("output",), 0.1, 10, base)]) == 0


def test_much_worse_in_one_block_and_better_in_none_is_worse():
    """The block in which motion grows is often the only one with small loops."""
    base = np.ones(6)
    growing = Candidate(("branches",), 0.0, 9, base * np.array([3.0, 0.98, 1.0, 0.99, 1.01, 1.0]))
    elsewhere = replace(growing, squares=base * np.array([3.0, 0.6, 1.0, 0.99, 1.01, 1.0]))
    plain, both = Candidate((), 0.0, 8, 9.0 * base), Candidate(("output", "branches"), 0.0, 11, base)
    assert smallest_that_pays([plain, growing, both]) == 2
    assert smallest_that_pays([plain, elsewhere, both]) == 1


def test_what_cannot_ratchet_comes_before_what_does_as_well_with_less():
    base = np.random.default_rng(0).uniform(0.5, 2.0, 6)
    plain, skewed = Candidate((), 0.0, 8, 9.0 * base), Candidate((), 0.1, 8, base)
    closing = Candidate(("branches",), 0.0, 12, 1.02 * base)
    assert smallest_that_pays([plain, skewed, closing]) == 2
    assert smallest_that_pays([plain, skewed, replace(closing, squares=1.5 * base)]) == 1


def test_a_shape_pays_from_a_quarter_of_the_error_on():
    base = np.random.default_rng(0).uniform(0.5, 2.0, 6)
    plain = Candidate((), 0.0, 8, base)
    assert smallest_that_pays([plain, Candidate(("output",), 0.0, 10, 0.8**2 * base)]) == 0
    assert smallest_that_pays([plain, Candidate(("output",), 0.0, 10, 0.7**2 * base)]) == 1


def test_a_block_that_errs_much_has_no_more_say_in_the_skew_than_others():
    usual, other = (Candidate((), s, 8, np.array(e)) for s, e in ((0.1, [9.0, 1.0]), (0.2, [6.0, 2.0])))
    assert usual.typical < other.typical and usual.rms > other.rms


def test_intervals_lie_as_configured_unless_placed_ones_are_significantly_better():
    base = np.random.default_rng(0).uniform(0.5, 2.0, 6)
    plain, output = Candidate((), 0.0, 8, base), Candidate(("output",), 0.0, 10, 0.3 * base)
    lies = Candidate((), 0.0, 8, 0.98 * base, places=7)
    assert smallest_that_pays([lies, plain]) == 1
    assert smallest_that_pays([plain, replace(lies, squares=0.3 * base)]) == 1
    assert smallest_that_pays([plain, replace(lies, squares=0.3 * base), output]) == 2
    assert "8 weights and 7 places" in lies.holds and "intervals placed" in str(lies)


def test_placed_intervals_do_not_change_which_shape_pays_with_the_configured_ones():
    """A placed model that is best by a hair, and steadily so, makes no other configured model the choice."""
    base = np.random.default_rng(0).uniform(0.5, 2.0, 6)
    at_times = Candidate((), 0.1, 8, base * np.array([0.3, 0.6, 1.0, 1.0, 1.05, 1.05]))
    plain, steady = Candidate((), 0.0, 8, base), Candidate(("position",), 0.0, 20, 0.8 * base, places=7)
    assert smallest_that_pays([plain, at_times]) == 0
    assert smallest_that_pays([plain, at_times, steady]) != 1


BENDING = IntervalBasis.over(200, 2.0)
BENT = np.exp(-np.cumsum(BENDING.widths) / 0.2)
"""Most of the virgin curve bends within a tenth of the range."""


def test_intervals_are_placed_where_equal_ones_miss_the_bend():
    equal = IntervalBasis.over(8, 2.0)
    choice = choose(equal, Rls(1.0), motion(BENDING, BENT))
    assert choice.chosen.places == 7 and choice.chosen.parts == ()
    assert choice.chosen.rms < 0.5 * choice.tried[0].rms
    widths = choice.model.basis.widths
    assert isinstance(choice.model.basis, IntervalBasis) and widths.sum() == pytest.approx(2.0)
    assert np.count_nonzero(np.cumsum(widths) < 0.6) >= 4
    assert "intervals placed" in choice.notes[0] and "identify has them 0.25 to 0.25 m" in choice.notes[1]


def test_intervals_that_lie_where_the_curve_bends_stay_as_configured():
    choice = choose(PLAIN, Rls(1.0), motion(PLAIN, FALL))
    assert choice.chosen.places == 0 and np.array_equal(choice.model.basis.widths, PLAIN.widths)
    assert "intervals lie as configured" in choice.notes[1]


def test_a_shape_is_found_with_intervals_that_were_placed():
    truth = ShapedIntervalBasis(BENDING.widths, ["reversible"], shape=BENT)
    added = 40.0 * np.array([1.0, -0.5, 0.5, 1.0]) / 200  # of the size that 200 intervals have
    choice = choose(IntervalBasis.over(8, 2.0), Rls(1.0), motion(truth, np.append(BENT, added * 8)))
    assert "reversible" in choice.chosen.parts and choice.chosen.places == 7, choice.notes
    assert choice.model.basis.widths.min() < 0.5 * choice.model.basis.widths.max()


def test_places_are_found_on_the_motion_as_a_skew_counts_it():
    truth = ShapedIntervalBasis(BENDING.widths, [], skew=0.12)
    choice = choose(IntervalBasis.over(8, 2.0), Rls(1.0), motion(truth, BENT, size=3.0))
    assert choice.chosen.skew == pytest.approx(0.12, abs=0.02) and choice.chosen.places == 7, choice.notes
    least = min(c.rms for c in choice.tried if not c.places)
    assert choice.chosen.rms < 0.5 * least


def test_places_know_nothing_of_the_block_held_out():
    seen = motion(BENDING, BENT)
    rows = np.arange(seen.force.size)
    blocks = np.array_split(rows, 3)
    equal = IntervalBasis.over(8, 2.0)

    def lie(force):
        return placed(equal, Rls(1.0), seen.position, force, seen.good, seen.gate, blocks)

    told = lie(seen.force)
    for k, block in enumerate(blocks):
        other = lie(np.where(np.isin(rows, block), -7.0 * seen.force[::-1], seen.force))
        assert np.array_equal(other.without[k], told.without[k])
        assert not np.array_equal(other.widths, told.widths)


def test_why_intervals_were_not_placed_is_said():
    few = choose(PLAIN, Rls(1.0), motion(PLAIN, FALL, rows=250))
    assert "intervals placed (300)" in few.notes[-1] and few.chosen.places == 0
    many = IntervalBasis.over(MOST_INTERVALS + 1, 2.0)
    still = np.zeros(10)
    why = placed(many, Rls(1.0), still, still, still == 0.0, 0.0, [np.arange(5)])
    assert isinstance(why, str) and str(MOST_INTERVALS) in why


def test_auto_in_a_configuration_chooses_and_notes():
    from rtcomp.jobs.identify import identify

    config = Configuration.load(shipped("leuven.yaml"))
    section = {**config.file.data["identify"], "model": "auto"}
    reference = {**config.file.data["reference"], "duration": 3.0}
    effects = [{"name": "non-congruent-friction", "softening": 0.4}]
    plant = config.changed(stage={**config.file.data["stage"], "effects": effects}).stage
    done = identify(config.changed(identify=section, reference=reference).simulating(plant))
    note = next(n for n in done.summary()["notes"] if n.startswith("model symmetric"))
    assert "held-out error" in note
    assert "output" in note and isinstance(done.model.basis, ShapedIntervalBasis)
    assert done.model.to_dict()["model"] == "shaped-interval"


def test_auto_places_intervals_and_keeps_what_is_known():
    from rtcomp.jobs.identify import identify

    config = Configuration.load(shipped("leuven.yaml"))
    section = {**config.file.data["identify"], "spacing": 1.0}
    reference = {**config.file.data["reference"], "duration": 3.0}
    judged = {}
    for model in ("interval", "auto"):
        done = identify(config.changed(identify={**section, "model": model}, reference=reference))
        judged[model] = done.held_out.relative
    assert any(n.startswith("intervals placed") for n in done.notes), done.notes
    assert judged["auto"] < 0.7 * judged["interval"]
    assert done.model.to_dict()["model"] == "interval" and done.model.reached is not None
    assert np.ptp(done.model.basis.widths) > 1e-6
    assert (np.diff(done.model.weights) <= 1e-9 * done.model.weights[0]).all()  # the prior of the file


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"model": "stop", "shape": {"parts": []}}, "shaped-interval"),
        ({"model": "shaped-interval", "shape": {"parts": ["positon"]}}, "parts"),
        ({"model": "shaped-interval", "shape": {"places": 4}}, "places"),
        ({"model": "shaped-interval", "shape": {"smooth": -0.5}}, "smooth"),
        (
            {"model": "shaped-interval", "shape": {"smooth": 1.0}, "learner": {"learner": "nlms"}},
            "smooth: needs a learner that keeps a covariance, rls; the learner is nlms",
        ),
        ({"model": "shaped-interval", "prior": "non-increasing"}, "speaks of intervals"),
        ({"model": "stop", "beyond": "continue"}, "speaks of intervals"),
    ],
)
def test_what_a_configuration_refuses(change, says):
    config = Configuration.load(shipped("leuven.yaml"))
    section = {**config.file.data["identify"], **change}
    if "prior" not in change:
        section.pop("prior", None)
    with pytest.raises(ConfigError, match=says):
        config.changed(identify=section).basis()
