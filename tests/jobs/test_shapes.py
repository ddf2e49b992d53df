"""The shape that pays: found where it is there, left off where it is not, or where data are few."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.rls import Rls
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.shapes import Candidate, Motion, choose, smallest_that_pays

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
    for parts in (("output",), ("reversible",), ("reversible", "position")):
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


def test_a_block_that_errs_much_has_no_more_say_in_the_skew_than_others():
    usual, other = (Candidate((), s, 8, np.array(e)) for s, e in ((0.1, [9.0, 1.0]), (0.2, [6.0, 2.0])))
    assert usual.typical < other.typical and usual.rms > other.rms


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


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"model": "stop", "shape": {"parts": []}}, "shaped-interval"),
        ({"model": "shaped-interval", "shape": {"parts": ["positon"]}}, "parts"),
        ({"model": "shaped-interval", "shape": {"places": 4}}, "places"),
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
