"""The judgement on reserved blocks: once, by forces that are seen, and of motion."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import STAGE, changed, run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.mismatch.where import as_seen, noise_seen
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.verdict.validation import Reserved
from rtcomp.errors import RecordingError
from rtcomp.stage.stage import Stage


def test_reserved_blocks_judge_once() -> None:
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back())]))
    baseline(balance)
    reserved = Reserved(balance)
    errors = reserved.judge({"before": believed})
    assert errors["before"] < 3.0 * errors["noise"] + 0.01
    with pytest.raises(RuntimeError, match="judged already"):
        reserved.judge({"before": believed})


def test_a_judgement_counts_forces_that_stand_above_the_sensors_noise() -> None:
    """A tone in the drive's band is kept; beyond it one above the noise is, one within the noise is not."""
    believed = Stage.from_dict({**STAGE, "sensor": {"noise": 5e-7, "resolution": 1e-8}})
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0))]))
    baseline(balance)
    time = balance.plain([s.time for s in balance.data.segments])
    beyond = 0.9 * balance.noise.bandwidth
    assert beyond > balance.force_bandwidth

    def kept(hertz: float, size: float) -> float:
        """Return the part that is left of a tone of `size` (N)."""
        tone = size * np.sin(2.0 * np.pi * hertz * time)
        return float(np.std(as_seen(balance, tone)) / np.std(tone))

    assert kept(1.0, 1.0) > 0.97
    assert kept(beyond, 20.0 * balance.noise_power**0.5) > 0.95
    assert kept(beyond, 0.02 * balance.noise_power**0.5) < 0.1
    assert noise_seen(balance) < 1.05 * balance.noise_power**0.5

    # By its own lines a tone counts more than a wide band with a third more force. Compared they count alike.
    tone = 20.0 * balance.noise_power**0.5 * np.sin(2.0 * np.pi * beyond * time)
    sines = np.sin(2.0 * np.pi * np.linspace(0.4, 1.0, 60)[:, None] * beyond * time + np.arange(60)[:, None])
    wide = 1.3 * tone.std() * sines.sum(axis=0) / sines.sum(axis=0).std()
    assert np.std(as_seen(balance, tone)) > np.std(as_seen(balance, wide))
    assert np.std(as_seen(balance, tone, wide)) < np.std(as_seen(balance, wide, wide))


def test_a_judgement_needs_motion_in_the_reserved_blocks() -> None:
    believed, moving = stage(), there_and_back(20.0)
    t = np.arange(moving.size) / 1000.0

    def balance(resting: np.ndarray, rustle: float = 0.0) -> ForceBalance:
        recording = run(believed, np.where(resting, 0.0, moving))
        # A controller that differentiates its reading adds to the command what is too fast to move anything.
        fast = rustle * (-1.0) ** np.arange(moving.size)
        recording = changed(recording, voltage=recording.columns["voltage"] + fast)
        found = ForceBalance(believed, load_data([recording]))
        baseline(found)
        assert found.blocks == 10
        return found

    # At rest in the third block of five another is kept; at rest in all but those that go furthest, none.
    third = np.any([np.abs(t - middle) < 1.6 for middle in (5.0, 15.0)], axis=0)
    for rustle in (0.0, 0.03):
        Reserved(balance(third, rustle))
    with pytest.raises(RecordingError, match=r"nothing moves .*in the part kept for the judgement"):
        Reserved(balance(np.abs(t - 10.0) < 8.3))
