"""Motions one after the other: the second as it is, the first before it, and no jump between."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.control.following_on import FollowingOn
from rtcomp.control.references import Reference

REVERSALS = {"kind": "nested-reversals", "amplitude": 1e-4, "ratio": 0.8, "count": 8, "stroke_time": 0.15}
SINE = {"kind": "sine", "amplitude": 5e-5, "frequency": 2.0, "duration": 1.0}


def way(end: float, between: float) -> FollowingOn:
    return FollowingOn(Reference.from_dict(REVERSALS), Reference.from_dict(SINE, start=end), between)


@given(st.floats(-4e-5, 4e-5), st.floats(0.02, 0.5))
def test_each_is_what_it_is_alone(end: float, between: float) -> None:
    both = way(end, between)
    t = np.linspace(0.0, 0.9, 400)
    for found, alone in zip(both.evaluate(t), both.now.evaluate(t), strict=True):
        assert np.array_equal(found, alone)
    early = np.linspace(0.0, both.before.duration - 1e-9, 400)
    for found, alone in zip(both.evaluate(early - both.earlier), both.before.evaluate(early), strict=True):
        assert np.allclose(found, alone, rtol=1e-6, atol=1e-9)


@given(st.floats(-4e-5, 4e-5), st.floats(0.02, 0.5))
def test_in_between_it_goes_straight_from_where_the_one_ends_to_where_the_other_starts(
    end: float, between: float
) -> None:
    both = way(end, between)
    t = np.linspace(-between, 0.0, 2001)
    x, v, _ = both.evaluate(t)
    assert x[0] == pytest.approx(both.before.evaluate(both.before.duration)[0].item(), abs=1e-12)
    assert x[-1] == pytest.approx(end, abs=1e-12) and abs(v[0]) + abs(v[-1]) < 1e-12
    assert (np.diff(x) * np.sign(end - x[0]) >= -1e-18).all(), "no reversal that friction would remember"
    assert np.gradient(x, t)[1:-1] == pytest.approx(v[1:-1], abs=1e-5 * max(np.abs(v).max(), 1e-9) + 1e-12)
