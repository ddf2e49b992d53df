"""The CiA 402 power state machine, its words, modes and errors. Pure: no bus, no clock.

From CiA 402-2 (IEC 61800-7-201): statusword 6041h, controlword 6040h, transitions 0 to 16; error codes 603Fh
and of emergency messages from CiA 301 and 402.
"""

from __future__ import annotations

import enum
from typing import NamedTuple


class State(enum.Enum):
    """States of a drive; torque is put out in ENABLED only."""

    NOT_READY = "not ready to switch on"
    DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


_BITS = {  # the bits of the statusword that tell a state, and what they are in it
    State.NOT_READY: (0x4F, 0x00),
    State.DISABLED: (0x4F, 0x40),
    State.READY: (0x6F, 0x21),
    State.SWITCHED_ON: (0x6F, 0x23),
    State.ENABLED: (0x6F, 0x27),
    State.QUICK_STOP: (0x6F, 0x07),
    State.FAULT_REACTION: (0x4F, 0x0F),
    State.FAULT: (0x4F, 0x08),
}
ENABLED_MASK, ENABLED_BITS = _BITS[State.ENABLED]
"""For the tick: a drive is enabled where ``statusword & ENABLED_MASK == ENABLED_BITS``."""

VOLTAGE_ON, WARNING, REMOTE, LIMIT_ACTIVE = 1 << 4, 1 << 7, 1 << 9, 1 << 11
"""Further bits of the statusword: power applied; warning; controlword heeded; a limit is acting."""

DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, SWITCH_ON, ENABLE = 0x00, 0x02, 0x06, 0x07, 0x0F
"""Controlwords. SWITCH_ON is "disable operation" too, where operation is enabled."""
FAULT_RESET = 0x80
"""Bit of the controlword whose rising edge leaves a fault."""


def state_of(statusword: int) -> State | None:
    """Return the state that a statusword tells, None for a pattern that stands for none."""
    for state, (mask, bits) in _BITS.items():
        if statusword & mask == bits:
            return state
    return None


def statusword_of(state: State) -> int:
    """Return the statusword of a drive in `state`: its bits, with power applied where it may be."""
    powered = state in (State.SWITCHED_ON, State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION)
    return _BITS[state][1] | REMOTE | (VOLTAGE_ON if powered else 0)


def transition(state: State, controlword: int, before: int) -> State:
    """Return where `controlword` leads from `state`; `before` is the controlword that came before it.

    Transitions 2 to 12, 15 and 16. From READY, "enable operation" goes through SWITCHED_ON (3, then 4), as
    the standard allows. What a drive does by itself (0, 1, 13, 14) is not here.
    """
    if state is State.FAULT:
        edge = controlword & ~before & FAULT_RESET
        return State.DISABLED if edge else state
    if controlword & FAULT_RESET:  # no command but the reset has this bit
        return state
    command = _command(controlword)
    return _TRANSITIONS.get((state, command), state)


def _command(controlword: int) -> str:
    if not controlword & 0x02:
        return "disable voltage"
    if not controlword & 0x04:
        return "quick stop"
    if not controlword & 0x01:
        return "shutdown"
    return "enable" if controlword & 0x08 else "switch on"


_TRANSITIONS = {
    (State.DISABLED, "shutdown"): State.READY,
    (State.READY, "switch on"): State.SWITCHED_ON,
    (State.READY, "enable"): State.ENABLED,
    (State.READY, "disable voltage"): State.DISABLED,
    (State.READY, "quick stop"): State.DISABLED,
    (State.SWITCHED_ON, "enable"): State.ENABLED,
    (State.SWITCHED_ON, "shutdown"): State.READY,
    (State.SWITCHED_ON, "disable voltage"): State.DISABLED,
    (State.SWITCHED_ON, "quick stop"): State.DISABLED,
    (State.ENABLED, "switch on"): State.SWITCHED_ON,
    (State.ENABLED, "shutdown"): State.READY,
    (State.ENABLED, "disable voltage"): State.DISABLED,
    (State.ENABLED, "quick stop"): State.QUICK_STOP,
    (State.QUICK_STOP, "disable voltage"): State.DISABLED,
    (State.QUICK_STOP, "enable"): State.ENABLED,
}


def toward_enabled(state: State | None) -> int:
    """Return the controlword of the next step to ENABLED; out of faults and quick stops it leads nowhere.

    A fault is reset by a person's decision, never on the way; a quick stop is left by disabling.
    """
    if state is State.DISABLED:
        return SHUTDOWN
    if state is State.READY:
        return SWITCH_ON
    if state in (State.SWITCHED_ON, State.ENABLED):
        return ENABLE
    return DISABLE_VOLTAGE


PROFILE_TORQUE, CYCLIC_TORQUE = 4, 10
"""Modes of operation, 6060h and 6061h."""
MODES = {PROFILE_TORQUE: "profile torque", CYCLIC_TORQUE: "cyclic synchronous torque"}


def supports(modes: int, mode: int) -> bool:
    """Return whether supported drive modes, 6502h, have `mode`."""
    return bool(modes >> (mode - 1) & 1)


class SiUnit(NamedTuple):
    """An SI unit as 60A8h has it."""

    unit: str
    """``m``, ``rad``, ``deg``, ``rev`` or ``counts``."""
    factor: float


_SI_UNITS = {0x01: "m", 0x10: "rad", 0x41: "deg", 0xB4: "rev", 0xB5: "counts"}


def si_unit(value: int) -> SiUnit | None:
    """Decode an SI unit of position, 60A8h (prefix, numerator, denominator, 0); None where it tells none."""
    name = _SI_UNITS.get(value >> 16 & 0xFF)
    if name is None or value >> 8 & 0xFF:  # with a denominator it is no position
        return None
    exponent = value >> 24 & 0xFF
    exponent -= 256 if exponent > 127 else 0
    return SiUnit(name, float(f"1e{exponent}"))


_ERRORS = {
    0x1000: "generic error",
    0x2000: "current", 0x2100: "current on the supply side", 0x2200: "current inside the drive",
    0x2300: "current on the motor side", 0x2310: "continuous over-current", 0x2320: "short circuit",
    0x2330: "earth fault", 0x2350: "I2t limit of the motor",
    0x3000: "voltage", 0x3100: "mains voltage", 0x3200: "DC link voltage", 0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage", 0x3300: "output voltage",
    0x4000: "temperature", 0x4100: "ambient temperature", 0x4200: "temperature of the drive",
    0x4210: "drive too hot", 0x4300: "temperature of the motor", 0x4310: "motor too hot",
    0x4400: "temperature of the supply",
    0x5000: "hardware of the drive", 0x5200: "control hardware", 0x5300: "operating unit",
    0x5400: "power section", 0x5441: "safe torque off", 0x5500: "data storage",
    0x6000: "software of the drive", 0x6100: "internal software", 0x6200: "user software",
    0x6300: "parameters",
    0x7000: "additional modules", 0x7100: "power module", 0x7120: "motor", 0x7121: "motor blocked",
    0x7122: "motor or commutation", 0x7200: "measurement circuit", 0x7300: "position sensor",
    0x7310: "over-speed", 0x7400: "computation circuit", 0x7500: "communication module",
    0x8000: "monitoring", 0x8100: "communication", 0x8110: "CAN overrun", 0x8120: "CAN error passive",
    0x8130: "heartbeat of the host lost", 0x8140: "recovered from bus-off",
    0x8150: "CAN identifier collision",
    0x8200: "protocol", 0x8210: "PDO too short", 0x8220: "PDO too long", 0x8240: "SYNC of a wrong length",
    0x8250: "RPDO did not come in time", 0x8300: "torque control", 0x8400: "speed control",
    0x8500: "position control", 0x8600: "positioning controller", 0x8611: "following error",
    0x8700: "sync controller", 0x8A00: "synchronisation",
    0x9000: "external error", 0xF000: "additional functions", 0xFF00: "of the manufacturer",
}  # fmt: skip
_REGISTER = (
    "generic", "current", "voltage", "temperature", "communication", "profile", "reserved", "manufacturer",
)  # fmt: skip


def error_name(code: int) -> str:
    """Return what an error code of 603Fh or an emergency message means, by the finest class that is known."""
    if not code & 0xFF00:
        return f"no error ({code:04X}h)"
    for mask in (0xFFFF, 0xFFF0, 0xFF00, 0xF000):
        name = _ERRORS.get(code & mask)
        if name is not None:
            return f"{name} ({code:04X}h)"
    return f"error {code:04X}h, see the drive's manual"


def register_names(register: int) -> str:
    """Return the classes that stand in an error register, 1001h, separated by commas."""
    return ", ".join(name for bit, name in enumerate(_REGISTER) if register >> bit & 1) or "none"
