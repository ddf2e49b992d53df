"""The firmware that ships does what the Python board does, byte for byte, and survives any bytes."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from in_virtual_time import VirtualBoard
from rtcomp_drivers import protocol
from rtcomp_drivers.board import Board, BoardFacts
from rtcomp_drivers.protocol import ARMED, DISARMED, FAULT, encode

LIMIT_V = 10.0
TEXT = "rtcomp firmware, host build"
SOUND = [HealthCheck.function_scoped_fixture]
# Times are multiples of 7 us and no watchdog is: none ever acts at the very instant that a board is asked.
TICK = 7


class Held:
    """A position for the Python board."""

    def __init__(self) -> None:
        self.counts: int | None = 0

    def advance(self, volts: float, seconds: float) -> None:
        pass

    def measure(self) -> float:
        return float("nan") if self.counts is None else float(self.counts)


@pytest.fixture
def sanitized(built: Path) -> Iterator[VirtualBoard]:
    with VirtualBoard(built / "rtcomp-board-sanitized", "--count-size", "1") as board:
        yield board


messages = st.one_of(
    st.builds(protocol.Hello, tag=st.integers(0, 255), version=st.integers(0, 255)),
    st.builds(
        protocol.Arm,
        tag=st.integers(0, 3),
        watchdog_ms=st.sampled_from([0, 1, 5, 20, 100, 10_001]),
        voltage_limit_uv=st.sampled_from([0, 1_000_000, 20_000_000, 0xFFFFFFFF]),
        period_us=st.sampled_from([0, 49, 50, 1000]),
    ),
    st.builds(protocol.Arm, tag=st.just(1), watchdog_ms=st.just(20), voltage_limit_uv=st.just(5_000_000),
              period_us=st.just(1000)),
    st.builds(
        protocol.Command,
        sequence=st.one_of(st.integers(0, 12), st.sampled_from([1 << 31, 0xFFFFFFFF])),
        voltage_uv=st.integers(-(1 << 31), (1 << 31) - 1),
    ),
    st.builds(protocol.Disarm, tag=st.integers(0, 255)),
    st.builds(protocol.Clear, tag=st.integers(0, 255)),
)  # fmt: skip


@st.composite
def arrivals(draw: st.DrawFn) -> bytes:
    """What comes at once: frames, damaged frames, garbage, nothing."""
    data = b""
    for message in draw(st.lists(messages, max_size=4)):
        frame = bytearray(encode(message))
        damage = draw(st.sampled_from(["none"] * 6 + ["flip", "cut", "garbage"]))
        if damage == "flip":
            frame[draw(st.integers(0, len(frame) - 1))] ^= 1 << draw(st.integers(0, 7))
        elif damage == "cut":
            del frame[draw(st.integers(0, len(frame) - 1)) :]
        elif damage == "garbage":
            data += draw(st.binary(max_size=300))
        data += bytes(frame)
    return data


def untimed(sent: bytes) -> list[protocol.Message]:
    """The messages, without the instant of a fault: a board acts when its timer does, in Python exactly."""
    decoder = protocol.Decoder()
    found = [m._replace(time_us=0) if isinstance(m, protocol.Fault) else m for m in decoder.feed(sent)]
    assert decoder.bad == decoder.unknown == 0
    return found


steps = st.lists(
    st.tuples(
        st.integers(0, 30_000 // TICK),
        arrivals(),
        st.one_of(st.none(), *[st.integers(-(1 << 50), 1 << 50)] * 5),
    ),
    min_size=1,
    max_size=25,
)


@settings(max_examples=150, deadline=None, suppress_health_check=SOUND)
@given(steps)
def test_it_answers_as_the_board_in_python_does(
    built: Path, drawn: list[tuple[int, bytes, int | None]]
) -> None:
    plant = Held()
    python = Board(plant, BoardFacts(voltage_limit=LIMIT_V, count_size=1.0, text=TEXT))
    with VirtualBoard(built / "rtcomp-board", "--count-size", "1") as board:
        now = 0
        for wait, data, position in drawn:
            now += TICK * wait
            plant.counts = position
            expected = python.receive(data, 1e-6 * now) if data else python.run_until(1e-6 * now)
            found = board.step(now, data, position)
            assert untimed(found.sent) == untimed(expected)
            assert (found.output_uv, found.state, found.fault) == (
                python.output_uv,
                python.state,
                python.fault,
            )
            assert found.output_uv == 0 or found.state == ARMED
        counters = board.end()
    assert counters["good"] + counters["unknown"] == python.decoder.good + python.decoder.unknown
    assert counters["bad"] == python.decoder.bad
    for name, count in python.counters.items():
        assert counters[name] == count, name


def test_it_says_who_it_is_and_moves_only_when_armed_and_fed(sanitized: VirtualBoard) -> None:
    (info,) = untimed(sanitized.step(7, encode(protocol.Hello(5))).sent)
    assert info == protocol.Info(5, 1, 0, DISARMED, 0, 20_000, 10_000_000, 1.0, TEXT)
    (sample,) = untimed(sanitized.step(14, encode(protocol.Command(1, 3_000_000)), 42).sent)
    assert sample == protocol.Measured(1, 14, 42, 0, protocol.IGNORED, DISARMED)
    sanitized.step(21, encode(protocol.Arm(9, 20, 5_000_000, 1000)))
    moved = sanitized.step(28, encode(protocol.Command(2, 7_000_000)), -42)
    assert moved.output_uv == 5_000_000 and moved.state == ARMED
    assert untimed(moved.sent) == [protocol.Measured(2, 28, -42, 0, protocol.CLAMPED, ARMED)]
    assert sanitized.step(20_027).output_uv == 5_000_000
    late = sanitized.step(20_028)
    assert (late.output_uv, late.state, late.fault) == (0, FAULT, protocol.WATCHDOG)
    assert sanitized.end()["watchdog_trips"] == 1


def test_a_position_that_cannot_be_read_ends_it(sanitized: VirtualBoard) -> None:
    sanitized.step(7, encode(protocol.Arm(9, 20, 5_000_000, 1000)))
    sanitized.step(14, encode(protocol.Command(1, 1_000_000)), 5)
    lost = sanitized.step(21, encode(protocol.Command(2, 1_000_000)), None)
    assert (lost.output_uv, lost.state, lost.fault) == (0, FAULT, protocol.SENSOR)
    sample, fault = untimed(lost.sent)
    assert sample == protocol.Measured(2, 21, 0, 1_000_000, protocol.POSITION_INVALID, FAULT)
    assert isinstance(fault, protocol.Fault) and fault.fault == protocol.SENSOR


def bytes_that_may_come(seed: int, size: int) -> bytes:
    """Garbage that a line may carry: random bytes, zeros, frames whole, cut, merged and damaged."""
    chance = random.Random(seed)
    pieces: list[bytes] = []
    total = 0
    while total < size:
        frame = encode(protocol.Command(chance.getrandbits(32), chance.getrandbits(31)))
        kind = chance.randrange(6)
        if kind == 0:
            piece = chance.randbytes(chance.randrange(1, 400))
        elif kind == 1:
            piece = bytes(chance.randrange(1, 5))
        elif kind == 2:
            piece = frame[: chance.randrange(len(frame))]
        elif kind == 3:
            at = chance.randrange(len(frame))
            piece = frame[:at] + bytes([frame[at] ^ (1 << chance.randrange(8))]) + frame[at + 1 :]
        else:
            piece = frame
        pieces.append(piece)
        total += len(piece)
    return b"".join(pieces)


def fuzzed(built: Path, size: int, seed: int) -> None:
    """Feed `size` bytes in chunks: no crash, no hang, nothing accepted that the Python codec would not."""
    data = bytes_that_may_come(seed, size)
    decoder, chance = protocol.Decoder(), random.Random(seed + 1)
    with VirtualBoard(built / "rtcomp-board-sanitized") as board:
        at = now = 0
        while at < len(data):
            piece = data[at : at + chance.randrange(1, 4000)]
            at, now = at + len(piece), now + TICK
            decoder.feed(piece)
            outcome = board.step(now, piece)
            assert outcome.output_uv == 0 and outcome.state == DISARMED
        counters = board.end()
    assert counters["good"] + counters["unknown"] == decoder.good + decoder.unknown
    assert counters["bad"] == decoder.bad


def test_it_survives_any_bytes(built: Path) -> None:
    fuzzed(built, 300_000, 3)


@pytest.mark.slow
def test_it_survives_ten_million_bytes(built: Path) -> None:
    for seed in range(10):
        fuzzed(built, 1_000_000, seed)
