"""Ten million bytes of anything, on a real pty, into the host's end: only whole frames come out of it."""

from __future__ import annotations

import os
import random
import threading
import tty

import pytest
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.can_link import CanSettings
from rtcomp_drivers.odrive_link import OdriveLink
from rtcomp_drivers.slcan import Frame, decode, encode

END = Frame(0x7FF, b"the end")


def anything(noise: random.Random, size: int) -> bytes:
    """Make noise, frames of axis 0 and of others, and frames to which something happened."""
    pieces: list[bytes] = []
    made = 0
    while made < size:
        chance = noise.random()
        if chance < 0.2:
            piece = noise.randbytes(noise.randrange(60))
        else:
            node = 0 if chance < 0.8 else noise.randrange(63)
            data = noise.randbytes(8 if chance < 0.7 else noise.randrange(9))
            line = bytearray(encode(Frame(c.identifier(node, noise.randrange(32)), data)))
            if chance < 0.35:
                line[noise.randrange(len(line))] ^= 1 << noise.randrange(8)
            elif chance < 0.4:
                del line[noise.randrange(len(line))]
            piece = bytes(line)
        pieces.append(piece)
        made += len(piece)
    return b"".join(pieces)


@pytest.mark.parametrize("size", [100_000, pytest.param(10_000_000, marks=pytest.mark.slow)])
def test_only_whole_frames_come_out(size):
    master, slave = os.openpty()
    tty.setraw(slave)
    noise = random.Random(size)
    link = OdriveLink(CanSettings(driver="any", interface="slcan", channel=os.ttyname(slave)), 0, "0.6")
    stream = anything(noise, size)

    def feed():
        for k in range(0, len(stream), 997):
            os.write(master, stream[k : k + 997])
        os.write(master, b"\r" + encode(END))

    lines = stream.replace(b"\a", b"\r").split(b"\r")
    expected = [f for f in map(decode, lines) if f is not None]
    thread = threading.Thread(target=feed, daemon=True)
    thread.start()
    got = 0
    while (message := link.can.receive(20.0)) is not None:
        frame = Frame(
            message.arbitration_id, bytes(message.data), message.is_remote_frame, message.is_extended_id,
            message.dlc if message.is_remote_frame else 0,
        )  # fmt: skip
        if frame == END:
            break
        assert frame == expected[got]
        got += 1
        link.take(message)
        assert link.heartbeat is None or 0 <= link.heartbeat.state <= 255
    thread.join()
    link.can.close()
    os.close(master)
    os.close(slave)
    assert got == len(expected) > size / 100
    assert link.damaged > 0
    assert link.can.damaged > size / 500
    assert link.second_master is not None
