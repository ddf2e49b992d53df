"""A stretch of rest is one unknown: what friction did in it, or did not."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.diagnosis.forces.sticking import RestWeights, along

COURSES = st.lists(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=6), min_size=1, max_size=4)


@settings(deadline=None)  # the first compiles
@given(COURSES)
def test_residuals_of_a_course_that_was_taken_or_not_are_white(courses: list[list[float]]) -> None:
    """Their covariance is that of noise and of the course of each stretch; weighed rows have none."""
    first = np.cumsum([0, *(len(one) for one in courses)])
    course = np.concatenate(courses)
    told = RestWeights(np.ones(course.size), along(course, first), first)
    weight = np.eye(course.size)
    told.weigh(weight)
    covariance = np.eye(course.size)
    for begin, end in pairwise(first):
        covariance[begin:end, begin:end] += np.outer(course[begin:end], course[begin:end])
    assert weight @ covariance @ weight.T == pytest.approx(np.eye(course.size), abs=1e-6)
    told.unweigh(weight)
    assert weight == pytest.approx(np.eye(course.size), abs=1e-6)


def test_however_many_rows_a_rest_has_its_course_counts_as_one() -> None:
    for rows in (1, 100, 10_000):
        course = np.full((1, rows), 50.0)
        RestWeights(np.ones(rows), along(course[0], np.array([0, rows])), np.array([0, rows])).weigh(course)
        assert np.sum(course**2) == pytest.approx(1.0, rel=1e-3)
