"""Whatever frames come to the simulated axis, its output is zero unless it is enabled."""

from __future__ import annotations

import math
import random
import struct

import numpy as np
import pytest
from axis_in_virtual_time import BEAT, HOST, NODE, PRE, RESET, START, STOP, SYNC, Host
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcomp_drivers.cia402_states import State
from rtcomp_drivers.slcan import Frame

FRAMES = st.one_of(
    st.sampled_from([SYNC, BEAT, START, STOP, PRE, RESET]),
    st.builds(
        lambda word, torque: Frame(0x200 + NODE, struct.pack("<Hh", word, torque)),
        st.sampled_from([0, 2, 6, 7, 15, 0x80, 0x10F]),
        st.integers(-32768, 32767),
    ),
    st.builds(
        lambda index, value: Frame(0x600 + NODE, struct.pack("<BHBI", 0x23, index, 1, value)),
        st.sampled_from([0x1016, 0x1400, 0x1600, 0x1800, 0x1A00]),
        st.integers(0, 0xFFFFFFFF),
    ),
    st.builds(
        lambda index, value: Frame(0x600 + NODE, struct.pack("<BHBI", 0x2B, index, 0, value)),
        st.sampled_from([0x6040, 0x6060, 0x6071, 0x6072, 0x6007, 0x1017]),
        st.integers(0, 0xFFFF),
    ),
    st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans()),
)


@settings(max_examples=300)
@given(frames=st.lists(st.tuples(FRAMES, st.sampled_from([0.0, 0.001, 0.02, 0.2])), max_size=60))
def test_the_output_is_zero_unless_enabled_whatever_comes(frames):
    host = Host(voltage_limit=5.0)
    host.enable()
    for frame, seconds in frames:
        host.send(frame)
        assert host.axis.state is State.ENABLED or host.axis.output == 0.0
        assert abs(host.axis.output) <= 5.0
        host.let(seconds)
        assert host.axis.state is State.ENABLED or host.axis.output == 0.0
    assert math.isfinite(host.axis.plant.position)
    assert host.axis.time == pytest.approx(host.now)


@pytest.mark.slow
def test_ten_million_frames_of_anything():
    """Any identifier, any data, many at a time: no crash, and no output that nobody may have asked for."""
    noise = random.Random(5)
    host = Host(voltage_limit=5.0)
    axis = host.axis
    own = (0x000, 0x080, 0x200 + NODE, 0x600 + NODE, 0x600 + NODE, 0x700 + HOST)
    enabled = zeroed = 0
    for _ in range(100_000):
        batch = [
            Frame(
                noise.choice(own) if noise.getrandbits(1) else noise.getrandbits(11),
                noise.randbytes(noise.choice((0, 1, 2, 4, 8, 8, 8))),
                not noise.getrandbits(3),
            )
            for _ in range(100)
        ]
        was = axis.state is State.ENABLED
        host.now += noise.random() * 1e-3
        axis.receive(batch, host.now)
        zeroed += was and axis.state is not State.ENABLED
        if noise.random() < 0.05:
            axis.receive([RESET], host.now)
            host.heard = []
            host.enable()
            enabled += 1
        assert axis.state is State.ENABLED or axis.output == 0.0
        assert abs(axis.output) <= 5.0
    assert enabled > 1000 and zeroed > 1000


@pytest.mark.slow
def test_a_million_random_frames_neither_stop_nor_move_it():
    """Frames drawn to hit what it listens to; the output stays zero unless enabled."""
    rng = np.random.default_rng(402)
    listened = np.array([0x000, 0x080, 0x205, 0x605, 0x77F, 0x705, 0x185])
    host = Host(voltage_limit=5.0)
    axis = host.axis
    enabled = 0
    for _ in range(10_000):
        count = 100
        drawn = listened[rng.integers(0, len(listened), count)]
        identifiers = np.where(rng.random(count) < 0.7, drawn, rng.integers(0, 0x800, count)).tolist()
        lengths = np.where(rng.random(count) < 0.6, 8, rng.integers(0, 9, count)).tolist()
        data = rng.bytes(8 * count)
        if axis.state is not State.ENABLED:
            host.send(RESET)
            host.enable()
        for k in range(count):
            axis.receive([Frame(identifiers[k], data[8 * k : 8 * k + lengths[k]])], host.now)
            enabled += axis.state is State.ENABLED
            assert axis.output == 0.0 or axis.state is State.ENABLED
            assert abs(axis.output) <= 5.0
        host.let(1e-3)
    assert enabled > 100_000  # it was worth guarding
    assert axis.counters["zeroed"] > 1000
    host.send(RESET)
    assert host.read(0x1000) == b"\x92\x01\x02\0"
