"""The codec: what goes in comes out, nothing damaged gets through, and the line is soon back in step."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
import zlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcomp_drivers import protocol
from rtcomp_drivers.protocol import Decoder, encode

README = Path(__file__).parents[2] / "drivers" / "README.md"

u8 = st.integers(0, 0xFF)
u16 = st.integers(0, 0xFFFF)
u32 = st.integers(0, 0xFFFFFFFF)
u64 = st.integers(0, 0xFFFFFFFFFFFFFFFF)
i32 = st.integers(-(1 << 31), (1 << 31) - 1)
i64 = st.integers(-(1 << 63), (1 << 63) - 1)
text = st.text(max_size=16)  # at most 64 bytes of UTF-8

messages = st.one_of(
    st.builds(protocol.Hello, u8, u8),
    st.builds(protocol.Arm, u8, u16, u32, u32),
    st.builds(protocol.Command, u32, i32),
    st.builds(protocol.Disarm, u8),
    st.builds(protocol.Clear, u8),
    st.builds(
        protocol.Info, u8, st.just(protocol.VERSION), u8, u8, u8, u32, u32, st.floats(allow_nan=False), text
    ),
    st.builds(protocol.OtherVersion, u8, u8.filter(lambda v: v != protocol.VERSION)),
    st.builds(protocol.Reply, u8, u8, u8, u8),
    st.builds(protocol.Measured, u32, u64, i64, i32, u8, u8),
    st.builds(protocol.Fault, u8, u64, text),
)


def numbered(first: int, count: int) -> list[protocol.Command]:
    return [protocol.Command(first + i, 1_000_000 * i - 3) for i in range(count)]


def line(sent: list[protocol.Command]) -> bytes:
    return b"".join(encode(m) for m in sent)


@settings(deadline=None)
@given(messages)
def test_what_is_encoded_is_decoded(message):
    decoder = Decoder()
    (back,) = decoder.feed(encode(message))
    assert type(back) is type(message)
    assert back == message
    assert (decoder.good, decoder.bad, decoder.unknown) == (1, 0, 0)


@settings(deadline=None)
@given(st.binary(min_size=1, max_size=protocol.MAX_PAYLOAD))
def test_a_frame_holds_one_zero_and_little_overhead(payload):
    frame = protocol.frame(payload)
    assert frame.count(0) == 1
    assert frame[-1] == 0
    assert len(frame) == len(payload) + 6
    assert protocol.payload_of(frame[:-1]) == payload


@settings(deadline=None)
@given(u32, i32)
def test_the_quick_way_to_encode_a_command_is_the_same(sequence, microvolts):
    assert protocol.encode_command(sequence, microvolts) == encode(protocol.Command(sequence, microvolts))


@settings(deadline=None)
@given(st.lists(messages, max_size=8), st.lists(st.integers(0, 400), max_size=12))
def test_where_the_bytes_are_split_does_not_matter(sent, cuts):
    data = b"".join(encode(m) for m in sent)
    places = [0, *sorted(min(c, len(data)) for c in cuts), len(data)]
    decoder = Decoder()
    got = [m for a, b in itertools.pairwise(places) for m in decoder.feed(data[a:b])]
    assert got == sent
    assert [type(m) for m in got] == [type(m) for m in sent]
    assert decoder.bad == 0


@settings(deadline=None)
@given(messages, st.data())
def test_no_frame_with_flipped_bits_is_accepted(message, data):
    frame = encode(message)
    bits = data.draw(st.sets(st.integers(0, 8 * len(frame) - 1), min_size=1, max_size=6))
    damaged = bytearray(frame)
    for bit in bits:
        damaged[bit // 8] ^= 1 << bit % 8
    decoder = Decoder()
    assert decoder.feed(bytes(damaged) + b"\0") == []
    assert decoder.good == decoder.unknown == 0
    assert decoder.bad >= 1


@settings(deadline=None, max_examples=200)
@given(st.binary(max_size=600), st.integers(1, 64))
def test_after_any_garbage_it_is_in_step_within_two_frames(garbage, piece):
    sent = numbered(7, 4)
    data = garbage + line(sent)
    decoder = Decoder()
    got = [m for i in range(0, len(data), piece) for m in decoder.feed(data[i : i + piece])]
    assert got in (sent, sent[1:])  # the first may be merged with the garbage
    if len(got) < len(sent):
        assert decoder.bad >= 1


@settings(deadline=None)
@given(st.integers(0, 4), st.integers(0, 20), st.integers(0, 20))
def test_lost_bytes_cost_the_frames_that_they_touch_and_no_more(which, start, length):
    sent = numbered(1, 8)
    frames = [encode(m) for m in sent]
    begin = sum(len(f) for f in frames[:which]) + min(start, len(frames[which]))
    data = b"".join(frames)
    got = Decoder().feed(data[:begin] + data[begin + length :])
    touched = set()
    at = 0
    for i, frame in enumerate(frames):
        if length and at < begin + length and begin < at + len(frame):
            touched |= {i, i + 1}  # the next is merged with what is left where the zero was lost
        at += len(frame)
    assert [m for i, m in enumerate(sent) if i not in touched] == [
        m for m in got if m.sequence - 1 not in touched
    ]
    assert all(m in sent for m in got)


def test_a_line_that_never_ends_a_frame_takes_no_memory_and_counts_once():
    decoder = Decoder()
    for _ in range(10_000):
        decoder.feed(b"\x55" * 100)
    assert decoder.bad == 1
    assert decoder.feed(b"\0" + encode(protocol.Disarm(3))) == [protocol.Disarm(3)]


def test_a_right_frame_of_unknown_type_or_length_is_counted_apart():
    decoder = Decoder()
    assert decoder.feed(protocol.frame(b"\x7f\x01\x02")) == []
    assert decoder.feed(protocol.frame(b"\x03\x01")) == []
    assert (decoder.good, decoder.bad, decoder.unknown) == (0, 0, 2)


@pytest.mark.parametrize(
    "message",
    [
        protocol.Command(1, 1 << 31),
        protocol.Command(-1, 0),
        protocol.Fault(0, 0, "x" * 65),
        protocol.Hello(256),
    ],
)
def test_what_does_not_fit_is_refused(message):
    with pytest.raises(ValueError, match=r"fit the protocol|allowed is"):
        encode(message)


def test_a_payload_too_long_for_its_coding_is_refused():
    with pytest.raises(ValueError, match="247"):
        protocol.frame(b"\x01" * 247)


def test_the_specification_s_example_is_what_is_sent():
    page = README.read_text()
    wanted = bytes.fromhex(re.search(r"^line +([0-9A-F ]+)$", page, re.MULTILINE)[1])
    assert protocol.encode_command(1, 1_500_000) == wanted
    assert zlib.crc32(b"123456789") == 0xCBF43926


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_specification_s_c_code_reads_our_frames(tmp_path):
    """The snippet in drivers/README.md, compiled as it stands, with a CRC-32 written from its polynomial."""
    snippet = re.search(r"```c\n(.*?)```", README.read_text(), re.DOTALL)[1]
    source = tmp_path / "peer.c"
    source.write_text(
        r"""
        #include <stdint.h>
        #include <stdio.h>
        static uint32_t crc32(const uint8_t *p, int n) {
            uint32_t c = 0xFFFFFFFF;
            for (int i = 0; i < n; i++) {
                c ^= p[i];
                for (int k = 0; k < 8; k++) c = c & 1 ? c >> 1 ^ 0xEDB88320u : c >> 1;
            }
            return ~c;
        }
        static uint32_t get_u32(const uint8_t *p) {
            return p[0] | p[1] << 8 | p[2] << 16 | (uint32_t)p[3] << 24;
        }
        """
        + snippet
        + r"""
        int main(void) {
            uint8_t in[512], out[512];
            int n = 0, c;
            while ((c = getchar()) != EOF) {
                if (c) { if (n < 251) in[n++] = c; continue; }
                int size = n ? unframe(in, n, out) : -2;
                if (size >= 0) for (int i = 0; i < size; i++) printf("%02x", out[i]);
                if (size != -2) printf("%s\n", size < 0 ? "bad" : "");
                n = 0;
            }
        }
        """
    )
    program = tmp_path / "peer"
    subprocess.run(["cc", "-Wall", "-o", program, source], check=True)
    sent = [
        protocol.Command(0, 0),
        protocol.Command(0xFFFFFFFF, -1),
        protocol.Measured(1, 2, -3, 4, 5, 1),
        protocol.Info(1, 1, 0, 0, 0, 1000, 10_000_000, 1e-12, "Ein Brett, größer"),
        protocol.Fault(1, 1 << 60, ""),
    ]
    frames = [encode(m) for m in sent]
    damaged = bytearray(frames[0])
    damaged[3] ^= 0x10
    result = subprocess.run(
        [program], input=b"\0".join([*frames, bytes(damaged)]), capture_output=True, check=True
    )
    lines = result.stdout.decode().split("\n")[:-1]
    assert lines == [protocol.payload_of(f[:-1]).hex() for f in frames] + ["bad"]
