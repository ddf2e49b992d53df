"""What a CAN adapter that speaks slcan does, as a pure state machine: bytes to frames and back.

This is the adapter's side of the Lawicel protocol: the host opens and closes the channel, chooses the bit
rate, and sends and receives frames as lines of text (rtcomp_drivers.slcan). Port and clock are somebody
else's, so that it runs in virtual time under test and behind a pseudo-terminal in the plant server alike.
"""

from __future__ import annotations

from rtcomp_drivers.slcan import LONGEST, Frame, decode, encode

BIT_RATES = {
    b"S0": 10_000, b"S1": 20_000, b"S2": 50_000, b"S3": 100_000, b"S4": 125_000, b"S5": 250_000,
    b"S6": 500_000, b"S7": 750_000, b"S8": 1_000_000, b"S9": 83_300,
}  # fmt: skip
"""bit/s by command; S9 is what python-can adds to Lawicel's."""
OK, BELL = b"\r", b"\a"
_FOREIGN = b"F80\r"
"""Status flags: bus error (bit 7), as where the bit rate is not the bus's."""
_QUIET = b"F00\r"
_EVERYTHING = (b"M00000000", b"mFFFFFFFF")
"""Acceptance code and mask that let every frame pass; others are refused, for this adapter filters none."""


_COMMANDS = frozenset(
    (*BIT_RATES, *_EVERYTHING, b"O", b"L", b"C", b"V", b"N", b"F", b"Z0", b"Z1", b"X0", b"X1")
)
"""Lines that mean something, if not in every state."""


class SlcanAdapter:
    """The adapter. `bit_rate` is the bus's; opened at another one it hears nothing and nobody hears it."""

    def __init__(self, bit_rate: int = 1_000_000) -> None:
        self.bit_rate = bit_rate
        self.open = False
        self.listening = False
        """Opened to listen only."""
        self.chosen: int | None = None
        """bit/s that the host chose; None before it did."""
        self.counters = dict.fromkeys(("frames", "damaged", "unheard"), 0)
        """Frames taken from the host, lines that were nothing, frames lost to a closed channel or another bit
        rate."""
        self._line = bytearray()
        self._too_long = False

    def receive(self, data: bytes) -> tuple[bytes, list[Frame]]:
        """Take bytes from the host; return what to answer it, and the frames to put on the bus."""
        frames: list[Frame] = []
        answers: list[bytes] = []
        *ended, rest = data.split(b"\r")
        for piece in ended:
            self._collect(piece)
            line = bytes(self._line)
            answers.append(BELL if self._too_long else self._obey(line, frames))
            if answers[-1] == BELL and (self._too_long or line not in _COMMANDS):
                self.counters["damaged"] += 1
            self._line.clear()
            self._too_long = False
        self._collect(rest)
        return b"".join(answers), frames

    def send(self, frame: Frame) -> bytes:
        """Take a frame from the bus; return its line for the host, nothing where none is to have it."""
        if self.open and self.in_tune:
            return encode(frame)
        self.counters["unheard"] += 1
        return b""

    @property
    def in_tune(self) -> bool:
        """Whether the host chose the bit rate that the bus has."""
        return self.chosen == self.bit_rate

    def _collect(self, piece: bytes) -> None:
        """Add to the line; one that is longer than any can be is forgotten up to its end."""
        if len(self._line) + len(piece) > LONGEST:
            self._too_long = True
            self._line.clear()
        elif not self._too_long:
            self._line += piece

    def _obey(self, line: bytes, frames: list[Frame]) -> bytes:
        if not line:
            return OK
        kind = line[:1]
        if kind in b"tTrR":
            return self._transmit(line, frames)
        if line == b"V":
            return b"V1013\r"
        if line == b"N":
            return b"NRT01\r"
        if line == b"F":
            if not self.open:
                return BELL
            return _QUIET if self.in_tune else _FOREIGN
        if line == b"C":
            was_open, self.open = self.open, False
            return OK if was_open else BELL
        if self.open:
            return BELL
        return self._set_up(line)

    def _set_up(self, line: bytes) -> bytes:
        """Obey what a closed channel does."""
        if line in BIT_RATES:
            self.chosen = BIT_RATES[line]
            return OK
        if line in (b"O", b"L") and self.chosen is not None:
            self.open = True
            self.listening = line == b"L"
            return OK
        return OK if line in (b"Z0", b"X1", *_EVERYTHING) else BELL  # no time stamps, frames unasked

    def _transmit(self, line: bytes, frames: list[Frame]) -> bytes:
        frame = decode(line) if self.open and not self.listening else None
        if frame is None:
            return BELL
        self.counters["frames"] += 1
        if self.in_tune:
            frames.append(frame)
        else:
            self.counters["unheard"] += 1
        return b"Z\r" if frame.extended else b"z\r"
