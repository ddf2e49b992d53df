"""A simulated stage that answers at once: what is compiled on first use is compiled before."""

from __future__ import annotations

from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage


def warm(stage: Stage, seed: int) -> Simulator:
    """Return a simulator of `stage`, at its start, that has run once: compiling it takes seconds."""
    simulator = Simulator(stage, seed=seed)
    simulator.advance(0.0, 1.0 / stage.rate)
    simulator.measure()
    simulator.reset()
    return simulator
