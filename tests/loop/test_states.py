"""The states: every step there is leads where it should, every other is refused, and nothing leaves FAULT."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from rtcomp.errors import LimitError
from rtcomp.loop.states import DRIVING, EDGES, Machine, State, Step

WAYS = {
    State.DISCONNECTED: [],
    State.CONNECTED: [Step.OPEN],
    State.READY: [Step.OPEN, Step.SAMPLE],
    State.ARMED: [Step.OPEN, Step.SAMPLE, Step.ARM],
    State.RUNNING: [Step.OPEN, Step.SAMPLE, Step.ARM, Step.TICK],
    State.DEGRADED: [Step.OPEN, Step.SAMPLE, Step.ARM, Step.TICK, Step.DEGRADE],
    State.STOPPING: [Step.OPEN, Step.SAMPLE, Step.ARM, Step.TICK, Step.STOP],
    State.FAULT: [Step.OPEN, Step.FAIL],
}


def at(state: State) -> Machine:
    machine = Machine()
    for step in WAYS[state]:
        machine.take(step, 1.0, why="a cause")
    assert machine.state is state
    return machine


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("step", Step)
def test_every_pair_of_state_and_step(state, step):
    """The whole table: what is in it happens, what is not is refused in one line and changes nothing."""
    machine = at(state)
    expected = EDGES.get((state, step))
    if (state, step) == (State.FAULT, Step.CLEAR):
        expected = State.CONNECTED
    if expected is None:
        with pytest.raises(LimitError, match=rf"^no step {step.name} from the state {state.name}[^\n]*$"):
            machine.take(step, 2.0)
        assert machine.state is state
        assert state is State.DISCONNECTED or machine.set_point == 1.0
    else:
        assert machine.take(step, 2.0) is expected is machine.state


def test_the_table_is_the_one_that_was_asked_for():
    """Written out once more by hand: a change of an edge is a decision."""
    by_hand = """
        DISCONNECTED: OPEN>CONNECTED
        CONNECTED: SAMPLE>READY CLOSE>DISCONNECTED FAIL>FAULT
        READY: SAMPLE>READY LOSE>CONNECTED ARM>ARMED CLOSE>DISCONNECTED FAIL>FAULT
        ARMED: TICK>RUNNING STOP>STOPPING FAIL>FAULT
        RUNNING: TICK>RUNNING DEGRADE>DEGRADED STOP>STOPPING FAIL>FAULT
        DEGRADED: TICK>DEGRADED RECOVER>RUNNING STOP>STOPPING FAIL>FAULT
        STOPPING: ZEROED>CONNECTED FAIL>FAULT
        FAULT: FAIL>FAULT CLOSE>FAULT
    """
    told = {
        (State[line.split(":")[0].strip()], Step[step]): State[target]
        for line in by_hand.strip().splitlines()
        for step, target in re.findall(r"(\w+)>(\w+)", line)
    }
    assert told == EDGES


def test_the_page_says_the_same_of_the_states():
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "safety.md").read_text()
    for state in State:
        assert f"| {state.value} | {state.name} |" in page


@pytest.mark.parametrize("open_still", [True, False])
def test_a_fault_is_cleared_to_what_is_there_and_armed_by_nothing(open_still):
    machine = at(State.RUNNING)
    machine.take(Step.FAIL, 3.0, why="cable pulled")
    machine.take(Step.FAIL, why="and then this")
    assert machine.why == "cable pulled"
    if not open_still:
        machine.take(Step.CLOSE)
    for step in set(Step) - {Step.FAIL, Step.CLOSE, Step.CLEAR}:
        with pytest.raises(LimitError, match=r"cable pulled\); clear the fault first"):
            machine.take(step)
    assert machine.take(Step.CLEAR) is (State.CONNECTED if open_still else State.DISCONNECTED)
    assert machine.why == "" and not machine.driving


class Life(RuleBasedStateMachine):
    """A loop's life, in any order of what may happen to it, beside a model of what must hold."""

    @initialize()
    def born(self):
        self.machine = Machine()
        self.measured = math.nan
        self.cleared = True
        self.armed_at = None

    def take(self, step, position=math.nan):
        before, point = self.machine.state, self.machine.set_point
        try:
            self.machine.take(step, position, why=step.name)
        except LimitError as error:
            assert "\n" not in str(error)
            assert self.machine.state is before
            assert (before, step) not in EDGES
            return
        if math.isfinite(position):
            self.measured = position
        after = self.machine.state
        if after is State.FAULT:
            self.cleared = False
        if step is Step.CLEAR:
            assert before is State.FAULT
            self.cleared = True
        if after is State.ARMED and before is not State.ARMED:
            assert before is State.READY
            # Arming moves nothing: what is to be is what is.
            assert self.machine.set_point == self.measured
        if after in DRIVING and before in DRIVING:
            assert self.machine.set_point == point or (math.isnan(point))

    @rule(step=st.sampled_from(Step), position=st.floats(-1.0, 1.0))
    def anything(self, step, position):
        self.take(step, position)

    @rule(position=st.floats(-1.0, 1.0))
    def come_up(self, position):
        """The good way, so that the driving states are reached often."""
        for step in (Step.CLEAR, Step.OPEN, Step.SAMPLE, Step.ARM, Step.TICK):
            self.take(step, position)

    @precondition(lambda self: self.machine.driving)
    @rule(steps=st.lists(st.sampled_from([Step.TICK, Step.DEGRADE, Step.RECOVER]), max_size=8))
    def drive(self, steps):
        for step in steps:
            self.take(step, 0.5)
        assert self.machine.driving

    @invariant()
    def latched(self):
        assert (self.machine.state is State.FAULT) == (not self.cleared)

    @invariant()
    def driving_needs_a_device(self):
        if self.machine.state not in (State.DISCONNECTED, State.FAULT):
            assert self.machine.connected


Life.TestCase.settings = settings(max_examples=150, stateful_step_count=40, deadline=None)
TestLife = Life.TestCase
