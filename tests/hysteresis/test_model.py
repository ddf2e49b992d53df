"""Identified models: saved, loaded, refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.hysteresis import bases
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel

GOOD = {"model": "interval", "widths": [1e-6, 2e-6], "weights": [3e5, 1e5], "offset": 0.1, "version": 1}


@pytest.mark.parametrize("name", sorted(bases()))
def test_round_trip_through_a_file(name, tmp_path):
    basis = bases()[name].over(9, 1e-4)
    weights = np.random.default_rng(1).normal(1e5, 1e4, basis.size)
    reached = np.linspace(0.0, 1.0, basis.size)
    model = HysteresisModel(basis, weights, -0.25, reached)
    model.save(tmp_path / "model.yaml")
    again = HysteresisModel.load(tmp_path / "model.yaml")
    assert type(again.basis) is type(basis) and again.basis.to_dict() == basis.to_dict()
    assert np.array_equal(again.weights, weights) and again.offset == -0.25
    assert np.allclose(again.reached, reached, atol=1e-4)
    motion = 3e-5 * np.sin(np.linspace(0, 20, 300))
    assert np.array_equal(again.response(motion), model.response(motion))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(1e-9, 1.0), st.floats(-1e9, 1e9)), min_size=1, max_size=8))
def test_numbers_survive_the_file_exactly(tmp_path_factory, elements):
    path = tmp_path_factory.mktemp("m") / "model.yaml"
    widths, weights = zip(*elements, strict=True)
    HysteresisModel(IntervalBasis(widths), np.array(weights)).save(path)
    again = HysteresisModel.load(path)
    assert np.array_equal(again.basis.widths, widths) and np.array_equal(again.weights, weights)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"version": 0}, "version is 0; this program reads version 1: identify it anew"),
        ({"version": 2}, "version is 2; .* update this program"),
        ({"version": "one"}, "version is 'one'"),
        ({"weights": [3e5]}, "2 elements but 1 weights"),
        ({"weights": [3e5, float("nan")]}, "finite"),
        ({"weights": [3e5, float("inf")]}, "finite"),
        ({"weights": ["a", "b"]}, "weights"),
        ({"weights": None}, "weights"),
        ({"offset": float("nan")}, "finite"),
        ({"offset": "none"}, "offset"),
        ({"offset": [1.0, 2.0]}, "offset"),
        ({"model": "intervall"}, "did you mean 'interval'"),
        ({"model": 3}, "model"),
        ({"widths": [1e-6, -2e-6]}, r"widths\[1\]"),
        ({"widths": [1e-6, 1e-320]}, r"widths\[1\] is 9.99989e-321 m of 1e-06 m in all; less than 1e-15 m"),
        ({"widths": [1.0, 1e-13]}, r"widths\[1\] is 1e-13 m of 1 m in all; less than 1e-12 m"),
        ({"widths": ["a", 2e-6]}, "widths"),
        ({"widht": [1e-6]}, "widht.*did you mean 'widths'"),
        ({"reached": [1.0]}, "reached"),
        ({"reached": [1.0, float("nan")]}, "reached"),
        ({"reached": "all"}, "reached"),
    ],
)
def test_what_is_no_model_is_refused_in_one_line(change, says):
    with pytest.raises(ConfigError, match=says) as caught:
        HysteresisModel.from_dict({**GOOD, **change})
    assert "\n" not in str(caught.value)


def test_a_missing_basis_parameter_is_named():
    entry = {key: value for key, value in GOOD.items() if key != "widths"}
    with pytest.raises(ConfigError, match="widths"):
        HysteresisModel.from_dict(entry)


def test_a_file_that_is_no_model_is_named(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("model: interval\nwidths: [1e-6]\nweights: [.nan]\n")
    with pytest.raises(ConfigError, match=r"model\.yaml"):
        HysteresisModel.load(path)
    path.write_text("- 1\n- 2\n")
    with pytest.raises(ConfigError, match=r"model\.yaml"):
        HysteresisModel.load(path)
    with pytest.raises(ConfigError, match=r"absent\.yaml"):
        HysteresisModel.load(tmp_path / "absent.yaml")


def test_only_intervals_have_a_virgin_curve_in_their_weights():
    basis = bases()["stop"].over(3, 1.0)
    with pytest.raises(ConfigError, match="virgin"):
        HysteresisModel(basis, np.ones(3)).virgin_curve()
