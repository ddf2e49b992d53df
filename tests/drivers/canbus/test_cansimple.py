"""CANSimple's frames against ODrive's own DBC files, both dialects; and nothing taken for what it is not."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.cansimple import Command, Heartbeat, Version

cantools = pytest.importorskip("cantools", reason="reads the DBC")
tools = pytest.importorskip("odrive_can", reason="its package holds the DBC")

FILES = {"0.6": "odrive-cansimple-0.6.10", "0.5.6": "odrive-cansimple-0.5.6"}
BOTH = pytest.mark.parametrize("dialect", c.DIALECTS)
DBC = {dialect: tools.get_dbc(name) for dialect, name in FILES.items()}
single = st.floats(width=32, allow_nan=False)
u8, u32 = st.integers(0, 0xFF), st.integers(0, 0xFFFFFFFF)
nodes = st.integers(0, 7)  # the DBC names eight


def described(dialect: str, node: int, command: int):
    return DBC[dialect].get_message_by_frame_id(c.identifier(node, command))


def read(dialect: str, node: int, command: int, data: bytes) -> dict:
    """What the DBC reads in our data, which must have the length it gives."""
    message = described(dialect, node, command)
    assert len(data) == message.length
    return message.decode(data, decode_choices=False, allow_truncated=False)


def test_names_of_commands():
    names = {
        Command.VERSION: "Get_Version", Command.HEARTBEAT: "Heartbeat", Command.ESTOP: "Estop",
        Command.ERROR: "Get_Error", Command.AXIS_STATE: "Set_Axis_State",
        Command.ENCODER_ESTIMATES: "Get_Encoder_Estimates", Command.CONTROLLER_MODE: "Set_Controller_Mode",
        Command.INPUT_POS: "Set_Input_Pos", Command.INPUT_VEL: "Set_Input_Vel",
        Command.INPUT_TORQUE: "Set_Input_Torque", Command.LIMITS: "Set_Limits", Command.REBOOT: "Reboot",
        Command.CLEAR_ERRORS: "Clear_Errors",
    }  # fmt: skip
    assert set(names) == set(Command)
    for node in range(8):
        for command, name in names.items():
            assert described("0.6", node, command).name == f"Axis{node}_{name}"
            if command not in (Command.VERSION, Command.ESTOP, Command.ERROR):
                assert described("0.5.6", node, command).name == f"Axis{node}_{name}"


@BOTH
def test_states_and_errors_have_the_dbc_s_names(dialect):
    signals = {s.name: s for s in described(dialect, 0, Command.HEARTBEAT).signals}
    errors = {bit: str(name) for bit, name in signals["Axis_Error"].choices.items() if bit}
    assert dict(c.ERRORS[dialect]) == errors
    states = {number: str(name) for number, name in signals["Axis_State"].choices.items()}
    assert states.items() <= dict(c.STATES).items()
    if dialect == "0.6":
        assert str(signals["Procedure_Result"].choices[c.INVALID_STATE_RESULT]) == "INVALID_STATE"
        assert states == dict(c.STATES)
    modes = {s.name: s.choices for s in described(dialect, 0, Command.CONTROLLER_MODE).signals}
    assert str(modes["Control_Mode"][c.TORQUE_CONTROL]) == "TORQUE_CONTROL"
    assert str(modes["Input_Mode"][c.PASSTHROUGH]) == "PASSTHROUGH"


@BOTH
@given(node=nodes, state=st.sampled_from(sorted(c.STATES)), torque=single, limits=st.tuples(single, single))
def test_what_is_sent(dialect, node, state, torque, limits):
    assert read(dialect, node, Command.AXIS_STATE, c.encode_state(state)) == {"Axis_Requested_State": state}
    mode = {"Control_Mode": 1, "Input_Mode": 1}
    assert read(dialect, node, Command.CONTROLLER_MODE, c.encode_mode()) == mode
    assert read(dialect, node, Command.INPUT_TORQUE, c.encode_torque(torque)) == {"Input_Torque": torque}
    set_limits = {"Velocity_Limit": limits[0], "Current_Limit": limits[1]}
    assert read(dialect, node, Command.LIMITS, c.encode_limits(*limits)) == set_limits
    assert set(read(dialect, node, Command.CLEAR_ERRORS, c.encode_clear(dialect)).values()) <= {0}
    assert len(b"") == described("0.6", node, Command.ESTOP).length
    assert c.decode_torque(c.encode_torque(torque)) == torque
    assert c.decode_number(c.encode_state(state)) == state
    assert c.decode_two_numbers(c.encode_mode()) == (c.TORQUE_CONTROL, c.PASSTHROUGH)


@BOTH
@given(node=nodes, error=u32, state=u8, result=u8, done=st.booleans(), flags=st.tuples(*[st.booleans()] * 3))
def test_heartbeats(dialect, node, error, state, result, done, flags):
    fields = {"Axis_Error": error, "Axis_State": state, "Trajectory_Done_Flag": int(done)}
    if dialect == "0.6":
        fields["Procedure_Result"] = result
        beat = Heartbeat(error, state, result, (), done)
    else:
        names = ("motor", "encoder", "controller")
        parts = tuple(n for n, flag in zip(names, flags, strict=True) if flag)
        fields |= {f"{n.title()}_Error_Flag": int(n in parts) for n in names}
        beat = Heartbeat(error, state, 0, parts, done)
    data = described(dialect, node, Command.HEARTBEAT).encode(fields)
    assert c.decode_heartbeat(data, dialect) == beat
    assert c.encode_heartbeat(beat, dialect) == data


@BOTH
@given(node=nodes, turns=single, speed=single)
def test_encoder_estimates(dialect, node, turns, speed):
    data = described(dialect, node, Command.ENCODER_ESTIMATES).encode(
        {"Pos_Estimate": turns, "Vel_Estimate": speed}
    )
    assert c.decode_estimates(data) == (turns, speed)
    assert c.encode_estimates(turns, speed) == data


@given(node=nodes, numbers=st.lists(u8, min_size=8, max_size=8), active=u32, reason=u32)
def test_version_and_errors_of_0_6(node, numbers, active, reason):
    protocol, h1, h2, h3, f1, f2, f3, unreleased = numbers
    version = Version(protocol, (h1, h2, h3), (f1, f2, f3), unreleased)
    fields = {
        "Protocol_Version": protocol, "Hw_Version_Major": h1, "Hw_Version_Minor": h2,
        "Hw_Version_Variant": h3,
        "Fw_Version_Major": f1, "Fw_Version_Minor": f2, "Fw_Version_Revision": f3,
        "Fw_Version_Unreleased": unreleased,
    }  # fmt: skip
    data = described("0.6", node, Command.VERSION).encode(fields)
    assert c.decode_version(data) == version
    assert c.encode_version(version) == data
    data = described("0.6", node, Command.ERROR).encode({"Active_Errors": active, "Disarm_Reason": reason})
    assert c.decode_two_numbers(data) == (active, reason)
    assert c.encode_error(active, reason) == data


def test_the_dialects_heartbeats_differ():
    beat = Heartbeat(0, 1, 0, (), True)
    new, old = (c.encode_heartbeat(beat, dialect) for dialect in c.DIALECTS)
    assert new != old
    assert c.decode_heartbeat(new, "0.5.6").parts == ("encoder",)


@BOTH
@given(data=st.binary(max_size=20))
def test_a_frame_of_another_length_is_none_of_the_protocol_s(dialect, data):
    assume(len(data) != 8)
    assert c.decode_heartbeat(data, dialect) is None
    for decode in (
        c.decode_version, c.decode_estimates, c.decode_two_numbers, c.decode_number, c.decode_torque
    ):  # fmt: skip
        assert decode(data) is None


@BOTH
@given(data=st.binary(min_size=8, max_size=8))
def test_any_eight_bytes_are_read_without_harm(dialect, data):
    beat = c.decode_heartbeat(data, dialect)
    assert c.error_names(beat.error, dialect)
    c.decode_version(data)
    turns, _ = c.decode_estimates(data)
    assert isinstance(turns, float)
    again = c.decode_torque(data)
    assert math.isnan(again) or c.encode_torque(again)[:4] == data[:4]


@BOTH
def test_errors_by_name(dialect):
    assert c.error_names(0, dialect) == "none"
    for bit, name in c.ERRORS[dialect].items():
        assert c.error_names(bit, dialect) == name
        assert c.error_bit(name, dialect) == bit
    assert "WATCHDOG_TIMER_EXPIRED" in c.ERRORS[dialect].values()
    assert c.error_names(0x80000001, dialect).endswith("unknown 0x80000000")
