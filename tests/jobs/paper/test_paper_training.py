"""The paper's learner on known truths, and a recording cut into its loops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rtcomp.errors import RecordingError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.judge import Friction
from rtcomp.jobs.paper.measured import cut, measured_lessons
from rtcomp.jobs.paper.rig import main_loop, minor_loops, rig
from rtcomp.jobs.paper.training import Exam, Lesson, activations, model_of, train, train_rls
from rtcomp.recording.reader import Recording

BASIS = IntervalBasis.over(6, 1e-4)
TRUTH = HysteresisModel(BASIS, np.array([2e5, 1.2e5, 8e4, 5e4, 2e4, 1e4]), 0.3)


def lesson(**more: float) -> Lesson:
    position = main_loop(3)
    return Lesson(BASIS, position, TRUTH.response(position), 2000, **more)


def exam() -> Exam:
    position = np.concatenate([main_loop(1), minor_loops(3, 2)])
    force = TRUTH.response(position)
    return Exam.on(BASIS, Friction(position, position, force, force < np.inf))


def test_the_papers_rule_finds_the_weights() -> None:
    done = train(lesson(), exam(), 0.1, 300, whole=True)
    assert done.errors.size == 300
    assert done.errors[-1] < 2e-3 < 0.05 < done.errors[0]
    model = model_of(BASIS, done.weights)
    position = minor_loops(5, 1)
    assert model.response(position) == pytest.approx(TRUTH.response(position), abs=0.05)


def test_training_ends_when_it_stays_below_the_limit() -> None:
    done = train(lesson(), exam(), 0.1, 300)
    assert done.cycles == done.errors.size - 9 < 100
    assert train(lesson(), exam(), 0.1, 5).cycles == np.inf
    assert train_rls(lesson(), exam(), 20).cycles == 1.0


def test_an_exam_says_what_the_samples_say() -> None:
    position = np.concatenate([main_loop(1), minor_loops(3, 2)])
    force = TRUTH.response(position)
    w = np.arange(7.0) * 1e4
    off = force[1000:] - (activations(BASIS, position) @ w)[1000:]
    assert exam().error(w) == pytest.approx(np.sqrt(np.mean(off**2)) / np.abs(force[1000:]).max())


def test_a_lesson_goes_round_without_a_break_in_memory() -> None:
    position = main_loop(6)
    short = Lesson(BASIS, position[:3000], position[:3000], 2000)
    whole = activations(BASIS, position)
    for number, (x, _) in zip(range(6), short.cycles(), strict=False):
        assert x == pytest.approx(whole[number * 1000 : (number + 1) * 1000], abs=1e-15)


def test_noise_is_drawn_anew_and_is_the_seeds_own() -> None:
    noisy = lesson(force_noise=0.5, position_noise=1e-6)
    first, second = ([f for _, (_, f) in zip(range(4), lesson_.cycles(), strict=False)]
                     for lesson_ in (noisy, replace(noisy, seed=1)))  # fmt: skip
    assert not np.allclose(first[2], first[3])
    assert not np.allclose(first[0], second[0])
    assert np.abs(first[2] - lesson().force[2000:]).max() <= 0.5
    slow = replace(noisy, noise_every=100)
    x = next(iter(slow.cycles()))[0]
    assert np.isfinite(x).all()


def test_the_loop_believes_in_a_stage_without_flaws() -> None:
    assert rig(0.1, 0.3).plant is not None
    assert rig().plant is None
    assert rig(0.1).stage.to_dict() == rig().stage.to_dict()


def recording(amplitudes: list[float], cycles: int = 5) -> Recording:
    t = np.arange(1000) / 1000
    position = np.concatenate([a * np.sin(2 * np.pi * t) for a in amplitudes for _ in range(cycles)])
    columns = {"time": np.arange(position.size) / 100.0, "position": position}
    return Recording({**columns, "voltage": 1e-2 * TRUTH.response(position)}, 100.0)


def test_the_main_loop_is_the_largest_that_comes_often() -> None:
    axis = Configuration.load(shipped("heads_yaw.yaml"))
    found = cut(axis, recording([2e-5, 4e-5, 8e-5]))
    main = [float(np.ptp(found.part([k])[0])) for k in found.main]
    assert main == pytest.approx([1.6e-4] * len(main), rel=0.05) and len(main) >= 4
    assert len(found.minor) >= 6 and max(found.minor) < found.main.start
    lessons = measured_lessons(found)
    assert train_rls(lessons.main, lessons.on_main, 20).errors[-1] < 0.1


@pytest.mark.parametrize(
    ("amplitudes", "cycles", "says"),
    [
        ([5e-5], 8, "closed loops are clearly smaller"),
        ([2e-5, 4e-5, 8e-5], 2, "no loop comes 4 times in a row"),
    ],
)
def test_a_recording_without_loops_is_refused(amplitudes: list[float], cycles: int, says: str) -> None:
    axis = Configuration.load(shipped("heads_yaw.yaml"))
    with pytest.raises(RecordingError, match=says):
        cut(axis, recording(amplitudes, cycles))
