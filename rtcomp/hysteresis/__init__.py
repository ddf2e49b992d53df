"""Hysteresis: the interval operator of the paper, its rivals, and what learns their weights."""

from rtcomp.hysteresis import interval, lms, rls
from rtcomp.hysteresis.basis import Basis, bases, basis_named, regressors
from rtcomp.hysteresis.learner import Learner, build_learner, learn, learners

__all__ = [
    "Basis", "Learner", "bases", "basis_named", "build_learner", "interval", "learn", "learners", "lms",
    "regressors", "rls",
]  # fmt: skip
