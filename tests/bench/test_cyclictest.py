"""What cyclictest prints is read as it stands: here, and from the program where it is installed."""

from __future__ import annotations

import os

import pytest

from rtcomp.bench.cyclictest import LONGEST_US, available, measure, parse
from rtcomp.errors import RtcompError

PRINTED = """\
# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000
000001 000003
000002 000090
000003 000005
000004 000000
# Total: 000000098
# Min Latencies: 00001
# Avg Latencies: 00002
# Max Latencies: 01234
# Histogram Overflows: 00002
# Histogram Overflow at cycle number:
# Thread 0: 00017 00056

"""


def test_a_histogram_with_two_beyond_its_end():
    """One of them is the longest, exactly; the other is at least as late as the last row."""
    spread = parse(PRINTED)
    assert spread.total == 100
    assert spread.values.tolist() == [1.0, 2.0, 3.0, 4.0, 1234.0]
    assert spread.counts.tolist() == [3, 90, 5, 1, 1]
    assert spread.figures() == {"p50_us": 2.0, "p99_us": 4.0, "p999_us": 1234.0, "max_us": 1234.0}
    assert spread.missed(1000.0) == 1 and spread.missed(100.0) == 12


def test_a_histogram_without_any():
    text = PRINTED.replace("Overflows: 00002", "Overflows: 00000").replace("01234", "00003")
    assert parse(text).counts.tolist() == [3, 90, 5]


def test_a_total_that_is_not_the_sum_is_no_histogram():
    with pytest.raises(RtcompError, match="holds 98 cycles, its total says 99"):
        parse(PRINTED.replace("000000098", "000000099"))


@pytest.mark.parametrize("text", ["", "T: 0 ( 123) P:80 I:1000 C:  500 Min:   3\n", PRINTED[:90]])
def test_other_words_are_no_histogram(text):
    with pytest.raises(RtcompError, match="no histogram"):
        parse(text)


def test_a_program_that_fails_is_told_with_its_last_words():
    with pytest.raises(RtcompError, match="cyclictest: ended with status 1"):
        measure("/bin/false", 1000.0, 0.1, 80)


@pytest.mark.skipif(available() is None, reason="cyclictest is not installed (rt-tests)")
def test_the_program_itself():
    core = max(os.sched_getaffinity(0))
    for rate in (1000.0, 5000.0):
        try:
            spread = measure(str(available()), rate, 0.2, 10, core)
        except RtcompError as error:
            pytest.skip(str(error))  # no right to SCHED_FIFO here
        assert spread.total == round(0.2 * rate)
        assert 0.0 <= spread.percentile(50.0) <= spread.longest
        assert spread.percentile(50.0) < LONGEST_US
