"""The talk with a drive, fed by hand: whatever comes is decoded, dropped or the end in one line."""

from __future__ import annotations

import can
import numpy as np
import pytest
from rtcomp_drivers.cia402_settings import Cia402Settings
from rtcomp_drivers.cia402_talk import Talk

from rtcomp.errors import DeviceError


class Quiet:
    """A link on which frames are handed over by hand; everything that is sent is taken."""

    who, damaged = "CAN interface of a test", 0

    def send(self, message):
        pass

    def receive(self, seconds):
        return None


@pytest.mark.slow
def test_a_million_random_frames_are_decoded_or_dropped():
    """No crash, and no sample but from a TPDO of the right length that says enabled."""
    rng = np.random.default_rng(402)
    settings = Cia402Settings(driver="cia402", channel="x", node=5)
    counters = dict.fromkeys(
        ("sent", "samples", "bad_frames", "other_frames", "warnings", "late", "duplicate"), 0
    )
    heard = np.array([0x185, 0x085, 0x705, 0x585, 0x80, 0x205])
    ended = taken = 0
    talk = None
    for _ in range(1000):
        drawn = heard[rng.integers(0, len(heard), 1000)]
        drawn = np.where(rng.random(1000) < 0.4, 0x185, drawn)
        identifiers = np.where(rng.random(1000) < 0.9, drawn, rng.integers(0, 0x800, 1000)).tolist()
        lengths = np.where(rng.random(1000) < 0.5, 6, rng.integers(0, 9, 1000)).tolist()
        enabled = (rng.random(1000) < 0.5).tolist()
        data = bytearray(rng.bytes(8000))
        for k in range(1000):
            if talk is None:
                talk = Talk(Quiet(), settings, counters)
                talk.armed = True
            payload = data[8 * k : 8 * k + lengths[k]]
            if enabled[k] and lengths[k]:
                payload[0] = 0x37
            before = counters["samples"]
            message = can.Message(arbitration_id=identifiers[k], data=payload, is_extended_id=False)
            talk.send(0, 0)
            try:
                talk.hear(message)
            except DeviceError as error:
                assert "\n" not in str(error)
                assert counters["samples"] == before
                ended += 1
                talk = None
                continue
            if counters["samples"] != before:
                taken += 1
                assert identifiers[k] == 0x185
                assert lengths[k] == 6
                assert payload[0] & 0x6F == 0x27
                assert talk.last.position == talk.last.position
    assert ended > 10_000
    assert taken > 10_000
