"""What a whole stage leaves of blocks put aside, in all and in the typical one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import changed, run, stage, there_and_back

from rtcomp.diagnosis.held_out import HeldOut
from rtcomp.diagnosis.motion import prepare
from rtcomp.stage.stage import Stage


def test_the_right_stage_leaves_little_and_a_wrong_one_more_in_every_block() -> None:
    right = stage()
    motion = prepare(right, [run(right, there_and_back(12.0))])
    good, bad = HeldOut.of(right, motion), HeldOut.of(stage(viscous=30.0), motion)
    assert good.off.shape == (len(motion.unseen),)
    assert good.error < 0.01 < bad.error
    assert (bad.off > good.off).all()
    assert good.typically(bad) < 0.5
    assert bad.typically(good) == pytest.approx(1.0 / good.typically(bad))


def test_a_jump_of_the_sensor_is_undone_as_smoothed_rows_have_it() -> None:
    """They have no step any more; undone as one, it would leave a spike, which friction remembers."""
    plain = Stage.from_dict({**stage().to_dict(), "sensor": {"noise": 2.2e-7, "resolution": 1e-9}})
    jump = {"name": "sensor-jump", "size": 1.5e-5, "time": 4.9 - 5e-4}
    reference = there_and_back(12.0)
    reference[4500:6000] = reference[4500]
    recording = run(plain, reference)
    jumped = changed(recording, position=recording.position + 1.5e-5 * (recording.time >= 4.9))
    bare, motion = (replace(prepare(plain, [r]), jumps=()) for r in (recording, jumped))
    assert motion.smoothed and motion.averaged > 1
    without = HeldOut.of(plain, bare).off
    assert HeldOut.of(plain.with_changes(stage={"effects": [jump]}), motion).off == pytest.approx(
        without, rel=1e-6
    )
    assert HeldOut.of(plain, motion).off.sum() > 1.5 * without.sum()


@given(st.floats(0.1, 10.0), st.floats(1.0, 1e6))
def test_one_bad_block_decides_the_sum_and_not_what_is_typical(factor: float, bad: float) -> None:
    before = np.array([1.0, 2.0, 3.0, bad])
    after = HeldOut(before * np.array([factor**2, factor**2, factor**2, factor**2]), 100.0)
    assert after.typically(HeldOut(before, 100.0)) == pytest.approx(factor)
    three = HeldOut(before * np.array([factor**2, factor**2, factor**2, 1.0]), 100.0)
    assert three.typically(HeldOut(before, 100.0)) == pytest.approx(factor**0.75)
    assert HeldOut(before, 100.0).error == pytest.approx(np.sqrt(before.sum() / 100.0))


def test_nothing_left_and_nothing_needed_are_no_errors() -> None:
    nothing = HeldOut(np.zeros(3), 0.0)
    assert nothing.error == 0.0 and nothing.typically(nothing) == 1.0
