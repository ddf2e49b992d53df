"""The objects of the simulated axis: what they answer, what may be written to them, how PDOs are mapped."""

from __future__ import annotations

import pytest
from axis_in_virtual_time import START, SYNC, Abort, Host
from free_mass import FreeMass
from hypothesis import given
from hypothesis import strategies as st
from rtcomp_drivers.cia402_memory import count_exponent
from rtcomp_drivers.cia402_objects import EDS, ENTRIES, TEXT, eds_text


@given(counts=st.integers(-(1 << 40), 1 << 40))
def test_its_counter_has_32_bits_and_wraps(counts):
    host = Host(FreeMass(counts * 1e-9))
    host.send(START)
    _, shown = host.command(0)
    assert (shown - counts) % (1 << 32) == 0


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
