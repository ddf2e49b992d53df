"""The CiA 402 power state machine: every edge, in whatever order, and beside canopen's tables of it."""

from __future__ import annotations

import pytest
from canopen.profiles import p402
from hypothesis import given
from hypothesis import strategies as st
from rtcomp_drivers.cia402_states import (
    CYCLIC_TORQUE,
    DISABLE_VOLTAGE,
    ENABLE,
    ENABLED_BITS,
    ENABLED_MASK,
    FAULT_RESET,
    PROFILE_TORQUE,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON,
    SiUnit,
    State,
    error_name,
    register_names,
    si_unit,
    state_of,
    statusword_of,
    supports,
    toward_enabled,
    transition,
)

WORDS = st.integers(0, 0xFFFF)
STATES = st.sampled_from(State)
NAMES = {
    "NOT READY TO SWITCH ON": State.NOT_READY,
    "SWITCH ON DISABLED": State.DISABLED,
    "READY TO SWITCH ON": State.READY,
    "SWITCHED ON": State.SWITCHED_ON,
    "OPERATION ENABLED": State.ENABLED,
    "FAULT": State.FAULT,
    "FAULT REACTION ACTIVE": State.FAULT_REACTION,
    "QUICK STOP ACTIVE": State.QUICK_STOP,
}
EDGES = {  # CiA 402-2, figure of the power drive system's state machine: number, from, controlword, to
    2: (State.DISABLED, SHUTDOWN, State.READY),
    3: (State.READY, SWITCH_ON, State.SWITCHED_ON),
    4: (State.SWITCHED_ON, ENABLE, State.ENABLED),
    5: (State.ENABLED, SWITCH_ON, State.SWITCHED_ON),
    6: (State.SWITCHED_ON, SHUTDOWN, State.READY),
    7: (State.READY, DISABLE_VOLTAGE, State.DISABLED),
    8: (State.ENABLED, SHUTDOWN, State.READY),
    9: (State.ENABLED, DISABLE_VOLTAGE, State.DISABLED),
    10: (State.SWITCHED_ON, DISABLE_VOLTAGE, State.DISABLED),
    11: (State.ENABLED, QUICK_STOP, State.QUICK_STOP),
    12: (State.QUICK_STOP, DISABLE_VOLTAGE, State.DISABLED),
    15: (State.FAULT, FAULT_RESET, State.DISABLED),
    16: (State.QUICK_STOP, ENABLE, State.ENABLED),
}
IRRELEVANT = st.integers(0, 0xFF).map(lambda bits: bits << 8)
"""Bits of the controlword that no transition looks at."""


@pytest.mark.parametrize("number", EDGES)
@given(more=IRRELEVANT, mode_bits=st.integers(0, 7))
def test_every_edge_of_the_standard(number, more, mode_bits):
    start, word, end = EDGES[number]
    assert transition(start, word | more | mode_bits << 4, 0) is end


@given(state=STATES, word=WORDS, before=WORDS)
def test_there_are_no_other_edges(state, word, before):
    end = transition(state, word, before)
    if end is not state:
        both = {(start, to) for start, _, to in EDGES.values()}
        both |= {(State.READY, State.ENABLED), (State.SWITCHED_ON, State.DISABLED)}  # 3 and 4 at once
        assert (state, end) in both


@given(word=WORDS, before=WORDS)
def test_torque_comes_only_by_an_explicit_enable(word, before):
    for state in State:
        if state is not State.ENABLED and transition(state, word, before) is State.ENABLED:
            assert word & 0x8F == ENABLE
            assert state in (State.READY, State.SWITCHED_ON, State.QUICK_STOP)


@given(words=st.lists(WORDS, max_size=50))
def test_a_fault_is_left_by_a_rising_edge_only(words):
    before = FAULT_RESET
    for word in words:
        state = transition(State.FAULT, word, before)
        rises = bool(word & FAULT_RESET) and not before & FAULT_RESET
        assert (state is State.DISABLED) == rises
        before = word


@given(words=st.lists(st.sampled_from([0, 2, 6, 7, 15]), max_size=20), before=WORDS)
def test_from_wherever_a_drive_is_three_steps_enable_it(words, before):
    state = State.DISABLED
    for word in words:
        state, before = transition(state, word, before), word
    steps = 0
    while state is not State.ENABLED:
        word = toward_enabled(state)
        state, before = transition(state, word, before), word
        steps += 1
        assert steps <= 4  # out of a quick stop by disabling, then three


@pytest.mark.parametrize("state", [State.FAULT, State.FAULT_REACTION, State.NOT_READY, None])
def test_nothing_on_the_way_to_enabled_resets_a_fault(state):
    assert not toward_enabled(state) & FAULT_RESET
    if state is not None:
        assert transition(state, toward_enabled(state), 0) is state


def test_a_statusword_tells_the_state_that_it_was_made_of():
    for state in State:
        assert state_of(statusword_of(state)) is state


def test_statuswords_mean_what_canopen_reads_in_them():
    for word in range(1 << 16):
        theirs = [n for n, (mask, bits) in p402.State402.SW_MASK.items() if word & mask == bits]
        ours = state_of(word)
        assert [NAMES[n] for n in theirs] == ([ours] if ours else [])
        assert (word & ENABLED_MASK == ENABLED_BITS) == (ours is State.ENABLED)


def test_controlwords_lead_where_canopen_has_them_lead():
    by_itself = {"START", "NOT READY TO SWITCH ON", "FAULT REACTION ACTIVE"}
    for (start, end), word in p402.State402.TRANSITIONTABLE.items():
        if start not in by_itself:
            assert transition(NAMES[start], word, 0) is NAMES[end]


def test_modes_by_their_bit():
    both = 1 << 3 | 1 << 9
    assert [m for m in range(1, 33) if supports(both, m)] == [PROFILE_TORQUE, CYCLIC_TORQUE]


@pytest.mark.parametrize(
    ("value", "unit"),
    [
        (0x00010000, SiUnit("m", 1.0)),
        (0xF7010000, SiUnit("m", 1e-9)),
        (0xFD100000, SiUnit("rad", 1e-3)),
        (0x00B50000, SiUnit("counts", 1.0)),
        (0x00410000, SiUnit("deg", 1.0)),
        (0x00014700, None),  # m/min is no position
        (0x00000000, None),
    ],
)
def test_si_units(value, unit):
    assert si_unit(value) == unit


@given(code=WORDS)
def test_every_error_has_a_name_with_its_code(code):
    assert f"{code:04X}h" in error_name(code)
    assert "\n" not in error_name(code)


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (0x8130, "heartbeat of the host"),
        (0x3211, "DC link over-voltage"),
        (0x4319, "motor too hot"),
        (0x73FF, "position sensor"),
        (0xFF42, "manufacturer"),
        (0x0000, "no error"),
        (0xA123, "manual"),
    ],
)
def test_errors_by_the_finest_class_that_is_known(code, says):
    assert says in error_name(code)


def test_the_error_register():
    assert register_names(0x11) == "generic, communication"
    assert register_names(0) == "none"
