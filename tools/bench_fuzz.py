"""Ten million damaged bytes into the host's end of the serial protocol: no crash, no hang, none accepted.

Garbage, zeros, frames whole, cut, merged, with bits flipped, repeated, in pieces of every size. The firmware
gets the same kind in tests/drivers/firmware (`make prove`), with the host's codec beside it as the judge.

    python tools/bench_fuzz.py --bytes 10000000 --json fuzz.json
"""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from pathlib import Path

import click
from figures_table import Figure, show
from rtcomp_drivers import protocol

PIECE = 1 << 20
"""Bytes made at a time."""
TEXTS = ("", "board", "x" * protocol.MAX_TEXT)


def message(draw: random.Random) -> protocol.Message:
    """One of what a board or a host may say."""
    bits = draw.getrandbits
    kinds: tuple[protocol.Message, ...] = (
        protocol.Measured(bits(32), bits(60), bits(62) - (1 << 61), bits(31) - (1 << 30), bits(8), bits(8)),
        protocol.Reply(bits(8), bits(8), bits(8), bits(8)),
        protocol.Fault(bits(8), bits(64), draw.choice(TEXTS)),
        protocol.Info(
            bits(8), protocol.VERSION, bits(8), bits(8), bits(8), bits(32), bits(32), draw.random(),
            draw.choice(TEXTS),
        ),
        protocol.Command(bits(32), bits(31) - (1 << 30)),
    )  # fmt: skip
    return draw.choice(kinds)


def damaged(draw: random.Random, size: int) -> Iterator[bytes]:
    """Give pieces of about `size` bytes in all, whole frames and damage of every kind."""
    given = 0
    while given < size:
        frame = protocol.encode(message(draw))
        kind = draw.randrange(7)
        at = draw.randrange(len(frame))
        if kind == 0:
            piece = draw.randbytes(draw.randrange(1, 400))
        elif kind == 1:
            piece = bytes(draw.randrange(1, 5))
        elif kind == 2:
            piece = frame[:at]
        elif kind == 3:
            piece = frame[:at] + bytes([frame[at] ^ (1 << draw.randrange(8))]) + frame[at + 1 :]
        elif kind == 4:
            piece = frame[:at] + frame[at + 1 :]
        else:
            piece = frame * draw.randrange(1, 3)
        given += len(piece)
        yield piece


def fuzz(size: int, seed: int) -> tuple[int, int, int, float]:
    """Return bytes fed, messages accepted, bad ones among them, and the longest call (s).

    A message is bad where the very bytes that it makes as a frame, CRC and all, were not on the line.
    """
    draw, decoder = random.Random(seed), protocol.Decoder()
    fed = accepted = bad = 0
    longest, before = 0.0, b""
    while fed < size:
        data = b"".join(damaged(draw, min(PIECE, size - fed)))
        at = 0
        while at < len(data):
            piece = data[at : at + draw.randrange(1, 4000)]
            at += len(piece)
            began = time.perf_counter()
            found = decoder.feed(piece)
            longest = max(longest, time.perf_counter() - began)
            line = before + piece
            accepted += len(found)
            bad += sum(protocol.encode(said) not in line for said in found)
            before = line[-2 * protocol.MAX_FRAME :]
        fed += len(data)
    return fed, accepted, bad, longest


@click.command()
@click.option("--bytes", "size", default=10_000_000, show_default=True)
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(size: int, seed: int, path: Path | None) -> None:
    fed, accepted, bad, longest = fuzz(size, seed)
    figures = [
        Figure("bytes fed", 1e-6 * fed, "million", f">= {1e-6 * size:g}"),
        Figure("messages accepted", float(accepted)),
        Figure("bad ones among them", float(bad), "", "<= 0"),
        Figure("longest call", 1e3 * longest, "ms", "<= 1000"),
    ]
    show("The host's end of the serial protocol, fuzzed", figures, path)


if __name__ == "__main__":
    main()
