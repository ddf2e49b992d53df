"""Reaches between those of the coarse choice are found, and the believed ones are left where they fit."""

from __future__ import annotations

import pytest
from recorded import run, stage
from rtcomp.diagnosis.base import SCALES, finer, fit_base
from rtcomp.diagnosis.motion import prepare
from test_alike import reference

from rtcomp.diagnosis.retuned import level_and_reach

ELEMENTS = [(2e5, 4e-6), (6e4, 1.2e-5)]


@pytest.mark.parametrize("factor", [0.75, 1.18, 1.64])
def test_reaches_between_those_tried_are_found(factor: float) -> None:
    """At the same level, the reach is the true one within two hundredths."""
    true = stage(friction=[{"stiffness": k / factor, "reach": r * factor} for k, r in ELEMENTS])
    motion = prepare(stage(), [run(true, reference())])
    coarse = fit_base(stage(), motion)
    fitted = finer(stage(), motion, coarse)
    assert float(fitted.errors.sum()) <= float(coarse.errors.sum())
    reaches = fitted.ledger.reaches
    found = list(zip(fitted.coefficients[3 : 3 + reaches.size], reaches, strict=True))
    own = level_and_reach([(k / factor, r * factor) for k, r in ELEMENTS])
    assert level_and_reach(found)[0] == pytest.approx(own[0], rel=0.02)
    assert level_and_reach(found)[1] == pytest.approx(own[1], rel=0.02)
    if factor == 1.64:
        assert factor not in SCALES
        assert float(fitted.errors.sum()) < 0.85 * float(coarse.errors.sum())


def test_believed_reaches_that_fit_are_kept() -> None:
    motion = prepare(stage(), [run(stage(), reference())])
    base = fit_base(stage(), motion)
    assert base.scale == 1.0
    assert finer(stage(), motion, base) is base
