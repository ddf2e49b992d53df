"""Hysteresis: the interval operator of the paper, its rivals, and what learns their weights."""

from rtcomp.hysteresis import (
    extended_stop,
    gradient,
    interval,
    lms,
    preisach,
    rls,
    shaped,
    stop,
)
from rtcomp.hysteresis.basis import Basis, bases, basis_named, regressors
from rtcomp.hysteresis.learner import Learner, build_learner, learn, learners
from rtcomp.hysteresis.moving import self_placing

__all__ = [
    "Basis", "Learner", "bases", "basis_named", "build_learner", "extended_stop", "gradient", "interval",
    "learn", "learners", "lms", "preisach", "regressors", "rls", "self_placing", "shaped", "stop",
]  # fmt: skip
