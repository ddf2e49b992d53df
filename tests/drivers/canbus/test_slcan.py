"""Frames as lines, and the adapter that speaks them: nothing that is no frame is taken for one."""

from __future__ import annotations

import random
import time

import can
import pytest
from can.interfaces.slcan import slcanBus
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcomp_drivers.slcan import LONGEST, Frame, decode, encode
from rtcomp_drivers.slcan_adapter import BELL, BIT_RATES, SlcanAdapter


@st.composite
def frames(draw):
    extended = draw(st.booleans())
    identifier = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    if draw(st.booleans()):
        return Frame(identifier, b"", True, extended, draw(st.integers(0, 8)))
    return Frame(identifier, draw(st.binary(max_size=8)), False, extended)


def opened(bit_rate: int = 1_000_000) -> SlcanAdapter:
    adapter = SlcanAdapter(bit_rate)
    assert adapter.receive(b"S8\rO\r") == (b"\r\r", [])
    return adapter


@given(frames())
def test_what_is_encoded_is_decoded(frame):
    line = encode(frame)
    assert line.endswith(b"\r")
    assert len(line) <= LONGEST + 1
    assert decode(line[:-1]) == frame


@given(st.binary(max_size=30))
def test_a_line_is_a_frame_only_if_it_is_written_as_one(line):
    frame = decode(line)
    if frame is not None:
        assert encode(frame)[:-1].upper() == line.upper()


@given(frames(), st.integers(0, 30), st.integers(0, 255))
def test_a_line_cut_or_lengthened_is_no_frame(frame, where, byte):
    line = encode(frame)[:-1]
    where = min(where, len(line) - 1)
    assert decode(line[:where]) is None
    assert decode(line + bytes([byte])) is None


@given(st.lists(frames(), max_size=6), st.integers(1, 40))
def test_frames_get_through_whole_however_the_line_is_cut_up(sent, size):
    adapter = opened()
    data = b"".join(map(encode, sent))
    answers, got = b"", []
    for k in range(0, len(data), size):
        answer, heard = adapter.receive(data[k : k + size])
        answers += answer
        got += heard
    assert got == sent
    assert answers == b"".join(b"Z\r" if f.extended else b"z\r" for f in sent)
    assert [adapter.send(f) for f in sent] == [encode(f) for f in sent]


LINES = st.one_of(
    st.binary(max_size=40),
    st.just(b"t" * 1000),
    st.sampled_from([*BIT_RATES, b"O", b"C", b"L", b"V", b"N", b"F", b"Z0", b"Z1", b"X1", b"M00000000", b""]),
    frames().map(lambda f: encode(f)[:-1]),
    st.tuples(frames(), st.integers(0, 26)).map(lambda t: encode(t[0])[: t[1]]),
)


@settings(deadline=None)
@given(st.lists(LINES, max_size=30), st.booleans())
def test_it_answers_every_line_once_and_takes_only_frames(lines, is_open):
    adapter = opened() if is_open else SlcanAdapter()
    for line in lines:
        ended = line.count(b"\r") + 1
        was_open = adapter.open
        answer, heard = adapter.receive(line + b"\r")
        assert answer.count(b"\r") + answer.count(BELL) == ended
        assert len(heard) <= ended
        if b"\r" not in line:
            on_the_bus = was_open and adapter.in_tune and not adapter.listening
            assert bool(heard) == (on_the_bus and decode(line) is not None)
            assert heard in ([], [decode(line)])


@pytest.mark.parametrize(
    ("before", "line", "answer"),
    [
        (b"", b"O", b"\a"),  # no bit rate chosen
        (b"", b"t1230", b"\a"),  # closed
        (b"S8\r", b"O", b"\r"),
        (b"S8\rO\r", b"O", b"\a"),
        (b"S8\rO\r", b"S6", b"\a"),  # open
        (b"S8\rO\r", b"C", b"\r"),
        (b"", b"C", b"\a"),
        (b"S8\rL\r", b"t1230", b"\a"),  # only listens
        (b"S8\rO\r", b"t8000", b"\a"),  # 12 bits
        (b"S8\rO\r", b"T200000000", b"\a"),  # 30 bits
        (b"S8\rO\r", b"t12391122334455667788FF", b"\a"),  # nine bytes
        (b"S8\rO\r", b"r1238", b"z\r"),
        (b"S8\rO\r", b"R0000012300", b"\a"),
        (b"S8\rO\r", b"F", b"F00\r"),
        (b"S6\rO\r", b"F", b"F80\r"),  # the bus has another bit rate
        (b"", b"F", b"\a"),
        (b"", b"V", b"V1013\r"),
        (b"", b"Z0", b"\r"),
        (b"", b"Z1", b"\a"),  # it stamps no times
        (b"", b"mFFFFFFFF", b"\r"),
        (b"", b"m00000000", b"\a"),  # it filters nothing
        (b"", b"Q" * 1000, b"\a"),
    ],
)
def test_what_it_answers(before, line, answer):
    adapter = SlcanAdapter()
    adapter.receive(before)
    heard = [Frame(0x123, b"", True, False, 8)] if line == b"r1238" else []
    assert adapter.receive(line + b"\r") == (answer, heard)


def test_at_another_bit_rate_nobody_hears_anybody():
    adapter = opened(bit_rate=500_000)
    assert adapter.receive(b"t1230\r") == (b"z\r", [])
    assert adapter.send(Frame(1)) == b""
    assert adapter.counters["unheard"] == 2


@pytest.mark.slow
def test_ten_million_bytes_of_anything():
    """Half of it noise, half lines that were frames until something happened to them."""
    noise = random.Random(7)
    adapter = opened()
    heard = wanted = fed = 0
    while fed < 10_000_000:
        pieces = []
        for _ in range(200):
            chance = noise.random()
            if chance < 0.3:
                pieces.append(noise.randbytes(noise.randrange(40)).replace(b"C\r", b"?\r"))
                continue
            line = bytearray(encode(Frame(noise.randrange(0x800), noise.randbytes(noise.randrange(9)))))
            if chance < 0.6:
                line[noise.randrange(len(line))] ^= 1 << noise.randrange(8)
            elif chance < 0.7:
                del line[noise.randrange(len(line))]
            pieces.append(bytes(line))
        data = b"".join(pieces)
        fed += len(data)
        was_open = adapter.open
        # What is to come of it, the slow way: whole lines that decode.
        begun = b"?" if adapter._too_long else bytes(adapter._line)
        lines = (begun + data).split(b"\r")[:-1]
        expected = [f for f in map(decode, lines) if f is not None]
        closes = any(line == b"C" for line in lines)
        answers, got = adapter.receive(data)
        assert answers.count(b"\r") + answers.count(BELL) == data.count(b"\r")
        if was_open and not closes:
            assert got == expected
        heard += len(got)
        wanted += len(expected)
        if not adapter.open:
            adapter.receive(b"\rS8\rO\r")
    assert heard > 100_000
    assert heard >= 0.9 * wanted


def test_python_can_s_own_client_works_with_it(adapter):
    bus = slcanBus(adapter.port, bitrate=1_000_000, sleep_after_open=0.0)
    assert bus.get_version(1.0) == (10, 13)
    assert bus.get_serial_number(1.0) == "RT01"
    sent = [
        can.Message(arbitration_id=0x29, is_extended_id=False, data=bytes(range(8))),
        can.Message(arbitration_id=0x7FF, is_extended_id=False, data=b""),
        can.Message(arbitration_id=0x1ABCDEF0, is_extended_id=True, data=b"\xff\x00"),
        can.Message(arbitration_id=0x29, is_extended_id=False, is_remote_frame=True, dlc=8),
    ]
    for message in sent:
        bus.send(message)
        back = _frame_from(bus)
        assert back.equals(message, timestamp_delta=None, check_direction=False, check_channel=False)
    bus.shutdown()
    end = time.monotonic() + 2.0
    while adapter.adapter.open and time.monotonic() < end:
        time.sleep(0.01)
    assert not adapter.adapter.open
    assert len(adapter.heard) == 4


def _frame_from(bus, seconds=2.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        message = bus.recv(0.1)
        if message is not None:
            return message
    raise AssertionError("no frame came")
