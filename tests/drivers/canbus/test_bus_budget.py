"""How many bits frames take, against frames built bit by bit; and what fits a bus."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rtcomp_drivers.bus_budget import SHARE, Traffic, check_budget, load, worst_bits

from rtcomp.errors import ConfigError


def crc15(bits):
    crc = 0
    for bit in bits:
        top = bit ^ (crc >> 14)
        crc = (crc << 1) & 0x7FFF
        if top:
            crc ^= 0x4599
    return [(crc >> k) & 1 for k in range(14, -1, -1)]


def bits_of(identifier, data, extended):
    """A frame on the wire as ISO 11898-1 has it: fields, CRC, stuff bits, end of frame, gap."""

    def number(value, width):
        return [(value >> k) & 1 for k in range(width - 1, -1, -1)]

    if extended:
        head = [0, *number(identifier >> 18, 11), 1, 1, *number(identifier & 0x3FFFF, 18), 0, 0, 0]
    else:
        head = [0, *number(identifier, 11), 0, 0, 0]
    body = head + number(len(data), 4) + [b for byte in data for b in number(byte, 8)]
    body += crc15(body)
    stuffed, run, last = 0, 0, None
    for bit in body:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed += 1
            last, run = 1 - bit, 1
    return len(body) + stuffed + 3 + 7 + 3  # CRC delimiter, acknowledge and its delimiter; end; gap


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans())
def test_no_frame_takes_more_bits_than_its_worst(identifier, data, extended):
    identifier &= 0x1FFFFFFF if extended else 0x7FF
    assert bits_of(identifier, data, extended) <= worst_bits(len(data), extended)


def test_the_worst_case_is_nearly_met():
    """Runs of four after the first five, stuffed each: as in data of 11110000."""
    frames = [bits_of(i, bytes([b]) * 8, False) for i in (0, 0x78, 0x7FF, 0x087) for b in range(256)]
    assert max(frames) >= worst_bits(8) - 4


@pytest.mark.parametrize(
    ("data_bytes", "extended", "bits"), [(8, False, 135), (0, False, 55), (8, True, 160), (0, True, 80)]
)
def test_known_figures(data_bytes, extended, bits):
    assert worst_bits(data_bytes, extended) == bits


@pytest.mark.parametrize("data_bytes", [-1, 9])
def test_there_are_no_other_frames(data_bytes):
    with pytest.raises(ValueError, match="0 to 8"):
        worst_bits(data_bytes)


def test_command_and_feedback_at_1_khz_take_27_percent_of_1_mbit():
    both = [Traffic("command", 1000.0, 8), Traffic("feedback", 1000.0, 8)]
    assert load(both, 1e6) == pytest.approx(0.27)
    assert load(both, 250e3) > 1.0


kinds = st.builds(Traffic, st.just("x"), st.floats(0.1, 5000.0), st.integers(0, 8), st.booleans())


@given(st.lists(kinds, max_size=6), st.sampled_from([125_000, 250_000, 500_000, 1_000_000]))
def test_what_is_refused_names_what_fits(traffic, bit_rate):
    rate = max((t.per_second for t in traffic), default=1000.0)
    share = load(traffic, bit_rate)
    if share <= SHARE:
        assert check_budget(traffic, bit_rate, rate) == share
        return
    with pytest.raises(ConfigError) as caught:
        check_budget(traffic, bit_rate, rate)
    message = str(caught.value)
    assert str(bit_rate) in message
    assert f"{100 * share:.0f} %" in message
    assert "\n" not in message
    if "a bit rate of " in message:
        better = int(message.split("a bit rate of ")[1].split()[0])
        assert better > bit_rate
        assert load(traffic, better) <= SHARE
    if "at most " in message:
        slower = float(message.split("at most ")[1].split()[0])
        fits = [t._replace(per_second=slower) if t.per_second >= rate else t for t in traffic]
        assert load(fits, bit_rate) <= SHARE + 1e-9
        assert slower < rate
