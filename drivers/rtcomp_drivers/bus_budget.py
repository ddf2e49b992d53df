"""Does a set of CAN frames fit the bus? Pure arithmetic on bits."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from rtcomp.errors import ConfigError

SHARE = 0.8
"""Largest planned share of a bus's bits. Above some 80 % a frame that is sent again after an error, or
another node's, finds no gap within the same period, and what loses arbitration is late tick after tick."""
BIT_RATES = (125_000, 250_000, 500_000, 1_000_000)
"""bit/s, usual ones, to name one that does."""


class Traffic(NamedTuple):
    """One kind of frame on the bus."""

    name: str
    per_second: float
    """Frames in a second."""
    data_bytes: int
    """0 to 8; a remote frame has none."""
    extended: bool = False


def worst_bits(data_bytes: int, extended: bool = False) -> int:
    """Return the most bits that a classic frame can take, stuff bits and the gap between frames included.

    34 bits (54, extended) and the data are subject to stuffing, at worst one bit after the first five and
    then one after each four; 13 more are not. Davis, Burns, Bril, Lukkien: Controller Area Network (CAN)
    schedulability analysis, Real-Time Systems 35, 2007, equation (1). Eight bytes take 135 (160).
    Raises ValueError outside 0 to 8 bytes.
    """
    if not 0 <= data_bytes <= 8:
        raise ValueError(f"a classic CAN frame has 0 to 8 data bytes, not {data_bytes}")
    stuffed = (54 if extended else 34) + 8 * data_bytes
    return stuffed + (stuffed - 1) // 4 + 13


def load(traffic: Iterable[Traffic], bit_rate: float) -> float:
    """Return the worst share of the bus that `traffic` takes at `bit_rate` (bit/s); over 1 does not fit."""
    return sum(t.per_second * worst_bits(t.data_bytes, t.extended) for t in traffic) / bit_rate


def check_budget(traffic: Iterable[Traffic], bit_rate: int, rate_hz: float) -> float:
    """Return the load; raise ConfigError where it is more than `SHARE`, naming what would fit.

    Of `traffic` the part that comes at `rate_hz` (the loop's) is what a lower rate makes less of.
    """
    listed = list(traffic)
    share = load(listed, bit_rate)
    if share <= SHARE:
        return share
    faster = [r for r in BIT_RATES if r > bit_rate and load(listed, r) <= SHARE]
    paced = sum(load([t], bit_rate) for t in listed if t.per_second >= rate_hz)
    rest = share - paced
    slower = rate_hz * (SHARE - rest) / paced if paced > 0.0 else 0.0
    advice = [f"a bit rate of {faster[0]}"] if faster else []
    if slower >= 1.0:
        advice.append(f"a rate of at most {math.floor(slower)} Hz")
    raise ConfigError(
        f"device: at {rate_hz:g} Hz its frames take {100.0 * share:.0f} % of a bus at {bit_rate} bit/s, more "
        f"than the {100.0 * SHARE:.0f} % that leave room for errors; "
        + (f"use {' or '.join(advice)}" if advice else "take something else off the bus"),
        key=("bitrate",),
    )
