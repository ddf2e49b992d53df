"""The simulated axis in virtual time: zero unless enabled, a watchdog at its own instant, CiA 301's rules."""

from __future__ import annotations

import math
import random
import struct

import numpy as np
import pytest
from free_mass import FreeMass
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcomp_drivers.cia402_axis import Cia402Axis
from rtcomp_drivers.cia402_memory import AxisFacts, count_exponent
from rtcomp_drivers.cia402_objects import EDS, ENTRIES, TEXT, eds_text
from rtcomp_drivers.cia402_states import State, state_of
from rtcomp_drivers.slcan import Frame

NODE, HOST = 5, 127
SYNC = Frame(0x80)
BEAT = Frame(0x700 + HOST, b"\x05")
START, STOP, PRE, RESET = (Frame(0, bytes([code, NODE])) for code in (1, 2, 0x80, 0x81))


class Abort(Exception):
    pass


class Host:
    """Talks to an axis in virtual time."""

    def __init__(self, plant=None, **facts):
        self.axis = Cia402Axis(plant or FreeMass(), AxisFacts(node=NODE, **facts))
        self.now = 0.0
        self.heard = list(self.axis.run_until(0.0))

    def send(self, *frames):
        answer = self.axis.receive(frames, self.now)
        self.heard += answer
        return answer

    def let(self, seconds):
        self.now += seconds
        answer = self.axis.run_until(self.now)
        self.heard += answer
        return answer

    def write(self, index, sub, value, size):
        data = value.to_bytes(size, "little", signed=value < 0)
        head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
        (answer,) = self.send(Frame(0x600 + NODE, (head + data).ljust(8, b"\0")))
        assert answer.identifier == 0x580 + NODE
        if answer.data[0] == 0x80:
            raise Abort(int.from_bytes(answer.data[4:], "little"))

    def read(self, index, sub=0):
        (answer,) = self.send(Frame(0x600 + NODE, struct.pack("<BHBI", 0x40, index, sub, 0)))
        if answer.data[0] == 0x80:
            raise Abort(int.from_bytes(answer.data[4:], "little"))
        if answer.data[0] & 2:
            return bytes(answer.data[4 : 8 - (answer.data[0] >> 2 & 3)])
        data, toggle = b"", 0
        while True:
            (answer,) = self.send(Frame(0x600 + NODE, bytes([0x60 | toggle]) + bytes(7)))
            assert answer.data[0] & 0x10 == toggle
            data += answer.data[1 : 8 - (answer.data[0] >> 1 & 7)]
            if answer.data[0] & 1:
                return data
            toggle ^= 0x10

    def command(self, controlword, torque=0):
        """RPDO and SYNC; returns statusword and position of the TPDO."""
        answer = self.send(Frame(0x200 + NODE, struct.pack("<Hh", controlword, torque)), SYNC)
        (tpdo,) = [frame for frame in answer if frame.identifier == 0x180 + NODE]
        return struct.unpack("<Hi", tpdo.data)

    def enable(self, watchdog_ms=100):
        self.write(0x6060, 0, 10, 1)
        if watchdog_ms:
            self.write(0x1016, 1, HOST << 16 | watchdog_ms, 4)
        self.send(START, BEAT)
        for controlword in (0x06, 0x07, 0x0F):
            self.command(controlword)
        assert self.axis.state is State.ENABLED


def test_it_boots_once_into_pre_operational():
    host = Host()
    assert host.heard == [Frame(0x700 + NODE, b"\0")]
    host.let(10.0)
    assert len(host.heard) == 1
    host.send(SYNC)
    assert len(host.heard) == 1  # no PDOs before it is started


def test_torque_becomes_volts_where_it_is_enabled():
    host = Host(voltage_limit=8.0, peak=4.0)  # rated torque is that of 2 V
    host.enable()
    host.command(0x0F, 500)
    assert host.axis.output == pytest.approx(1.0)
    host.command(0x0F, -32768)
    assert host.axis.output == -8.0
    assert host.axis.counters["clamped"] == 1


def test_a_sample_is_from_before_its_own_command():
    host = Host()
    host.enable()
    host.command(0x0F, 1000)
    host.send(BEAT)
    host.let(0.05)
    position = host.axis.plant.position
    word, counts = host.command(0x00, 0)
    assert counts == round(position / 1e-9)
    assert state_of(word) is State.ENABLED
    assert host.axis.state is State.DISABLED
    assert host.axis.output == 0.0


@given(
    watchdog=st.integers(1, 2000),
    before=st.floats(0.0, 0.9),
    looks=st.lists(st.floats(0.01, 1.0), max_size=5),
)
def test_the_watchdog_acts_at_its_own_instant(watchdog, before, looks):
    host = Host()
    host.enable(watchdog)
    host.let(1e-3 * watchdog * before)
    host.send(BEAT)
    host.command(0x0F, 700)
    began = host.now
    trips = began + 1e-3 * watchdog
    for seconds in looks:
        host.let(seconds * 1e-3 * watchdog)
    velocity_before = host.axis.plant.velocity
    host.let(2e-3 * watchdog)
    (zeroing,) = host.axis.zeroings
    assert zeroing.cause == "watchdog"
    assert zeroing.time == pytest.approx(trips)
    assert zeroing.since_command == pytest.approx(1e-3 * watchdog)
    assert host.axis.state is State.FAULT
    # 0.7 V held exactly for the watchdog's time, whenever anybody looked
    assert host.axis.plant.velocity == pytest.approx(0.7 * 1e-3 * watchdog, rel=1e-6, abs=1e-12)
    assert velocity_before <= host.axis.plant.velocity + 1e-12
    emergencies = [f for f in host.heard if f.identifier == 0x80 + NODE]
    assert [f.data[:3] for f in emergencies] == [b"\x30\x81\x11"]


@given(gaps=st.lists(st.floats(0.0, 0.099), max_size=30))
def test_a_host_that_beats_in_time_is_not_given_up(gaps):
    host = Host()
    host.enable(100)
    for gap in gaps:
        host.let(gap)
        host.send(BEAT)
    assert host.axis.state is State.ENABLED


@pytest.mark.parametrize(
    ("option", "state"),
    [(0, State.ENABLED), (1, State.FAULT), (2, State.DISABLED), (3, State.QUICK_STOP)],
)
def test_what_is_to_happen_without_host_is_a_setting(option, state):
    host = Host()
    host.write(0x6007, 0, option, 2)
    host.enable(50)
    host.command(0x0F, 300)
    host.let(0.2)
    assert host.axis.state is state
    assert (host.axis.output == 0.0) == (state is not State.ENABLED)


def test_commands_without_a_heartbeat_do_not_feed_it():
    host = Host()
    host.enable(100)
    for _ in range(20):
        host.command(0x0F, 10)
        host.let(0.01)
    assert host.axis.state is State.FAULT


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


def test_a_fault_is_latched_until_a_rising_edge():
    host = Host()
    host.enable()
    host.heard += host.axis.fail(0x2310, host.now)
    for _ in range(3):
        host.command(0x0F, 100)
        assert host.axis.state is State.FAULT
    assert host.read(0x603F) == b"\x10\x23"
    assert host.read(0x1003, 1)[:2] == b"\x10\x23"
    host.command(0x80)
    assert host.axis.state is State.DISABLED
    assert host.read(0x603F) == b"\0\0"
    assert Frame(0x80 + NODE, bytes(8)) in host.heard


def test_a_bit_that_stays_up_resets_no_later_fault():
    host = Host()
    host.enable()
    host.command(0x8F)
    host.axis.fail(0x2310, host.now)
    for _ in range(3):
        host.command(0x8F)
    assert host.axis.state is State.FAULT


@pytest.mark.parametrize("frame", [STOP, PRE, RESET, Frame(0, b"\x82\x00")])
def test_leaving_operational_zeroes(frame):
    host = Host()
    host.enable()
    host.command(0x0F, 300)
    assert host.axis.output > 0.0
    host.send(frame)
    assert host.axis.output == 0.0
    assert host.axis.state is State.DISABLED


def test_a_sensor_that_fails_is_a_fault():
    host = Host()
    host.enable()
    host.command(0x0F, 300)
    host.axis.plant.measure = lambda: math.nan
    answer = host.send(SYNC)
    assert host.axis.state is State.FAULT
    assert host.axis.output == 0.0
    assert any(f.identifier == 0x80 + NODE and f.data[:2] == b"\x00\x73" for f in answer)


def test_a_short_rpdo_is_not_acted_on():
    host = Host()
    host.enable()
    host.command(0x0F, 300)
    before = host.axis.output
    answer = host.send(Frame(0x200 + NODE, b"\x0f\x00\x00"), SYNC)
    assert host.axis.output == before
    assert any(f.identifier == 0x80 + NODE and f.data[:2] == b"\x10\x82" for f in answer)


@given(counts=st.integers(-(1 << 40), 1 << 40))
def test_its_counter_has_32_bits_and_wraps(counts):
    host = Host(FreeMass(counts * 1e-9))
    host.send(START)
    _, shown = host.command(0)
    assert (shown - counts) % (1 << 32) == 0


def test_heartbeats_come_at_the_time_set():
    host = Host()
    host.write(0x1017, 0, 100, 2)
    host.let(1.05)
    beats = [f for f in host.heard[1:] if f.identifier == 0x700 + NODE]
    assert beats == [Frame(0x700 + NODE, b"\x7f")] * 10
    host.write(0x1017, 0, 0, 2)
    host.heard.clear()
    host.let(1.0)
    assert host.heard == []


def test_profile_torque_mode_keeps_to_its_slope():
    host = Host(voltage_limit=10.0, peak=10.0)
    host.enable(0)
    host.write(0x6060, 0, 4, 1)
    host.write(0x6087, 0, 1000, 4)  # 1000 thousandths, 1 V, a second
    host.let(0.1)
    host.command(0x0F, 500)
    assert host.axis.output == pytest.approx(0.1)
    host.let(1.0)
    host.command(0x0F, 500)
    assert host.axis.output == pytest.approx(0.5)


def test_every_object_of_the_eds_answers_with_its_size():
    host = Host()
    for entry in ENTRIES:
        data = host.read(entry.number, entry.sub)
        if entry.type == TEXT:
            assert data == b"rtcomp simulated CiA 402 axis"
        else:
            assert len(data) == {1: 1, 2: 1, 3: 2, 4: 4, 5: 1, 6: 2, 7: 4}[entry.type]


def test_the_eds_beside_it_is_written_from_its_objects():
    assert EDS.read_text() == eds_text()


@pytest.mark.parametrize(
    ("index", "sub", "value", "size", "code"),
    [
        (0x6041, 0, 0, 2, 0x06010002),  # read only
        (0x2000, 0, 0, 2, 0x06020000),  # not there
        (0x1018, 9, 0, 4, 0x06090011),
        (0x6040, 0, 0, 4, 0x06070010),  # length
        (0x6060, 0, 1, 1, 0x06090030),  # no such mode
        (0x1600, 1, 0x60400010, 4, 0x06010000),  # mapped while the PDO is on
        (0x1400, 1, 0x206, 4, 0x06090030),  # another identifier while the PDO is on
        (0x1003, 0, 1, 1, 0x06090030),
    ],
)
def test_what_may_not_be_written_is_refused(index, sub, value, size, code):
    host = Host()
    with pytest.raises(Abort) as caught:
        host.write(index, sub, value, size)
    assert caught.value.args[0] == code


def test_pdos_are_mapped_in_the_order_of_the_standard():
    host = Host()
    host.write(0x1A00 - 0x200, 1, 1 << 31 | 0x185, 4)
    with pytest.raises(Abort):
        host.write(0x1A00, 1, 0x60640020, 4)  # count first
    host.write(0x1A00, 0, 0, 1)
    with pytest.raises(Abort):
        host.write(0x1A00, 1, 0x10000020, 4)  # not mappable
    with pytest.raises(Abort):
        host.write(0x1A00, 1, 0x60640010, 4)  # not its size
    for sub, mapped in ((1, 0x60640020), (2, 0x60410010), (3, 0x60770010)):
        host.write(0x1A00, sub, mapped, 4)
    host.write(0x1A00, 0, 3, 1)
    host.write(0x1800, 1, 0x185, 4)
    host.send(START)
    (tpdo,) = host.send(SYNC)
    assert len(tpdo.data) == 8
    with pytest.raises(Abort):
        host.write(0x1800, 2, 255, 1)  # not while it is operational


def test_what_it_serves_fits_its_stage():
    host = Host(
        FreeMass(), axis="rotary", force_constant=0.2, voltage_limit=5.0, peak=10.0, count_exponent=-7
    )
    assert host.read(0x60A8) == b"\0\0\x10\xf9"
    assert int.from_bytes(host.read(0x6076), "little") == 100  # mN m: 0.2 N m/V, 5 V, a tenth
    assert int.from_bytes(host.read(0x6072), "little") == 10_000


@pytest.mark.parametrize(
    ("resolution", "exponent"), [(0.0, -9), (1e-8, -8), (2.5e-9, -9), (1e-15, -12), (0.1, -5)]
)
def test_counts_are_no_coarser_than_the_sensor(resolution, exponent):
    assert count_exponent(resolution) == exponent


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
