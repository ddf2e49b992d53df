"""A drive on a CAN bus and the slcan adapter before it, as one: what a plant server puts on its port."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from rtcomp_drivers.slcan import Frame
from rtcomp_drivers.slcan_adapter import SlcanAdapter


class CanAxis(Protocol):
    """A drive as a pure state machine around a plant: frames and time in, frames out."""

    time: float
    """s, the drive's clock: how far the plant has been run."""

    def receive(self, frames: Sequence[Frame], now: float) -> list[Frame]:
        """Take frames that arrived at `now` (s), in their order; return those that it sends."""

    def run_until(self, now: float) -> list[Frame]:
        """Let time pass to `now` (s); return frames that it sends unasked."""

    def shut_down(self, now: float) -> None:
        """Zero the output because the drive itself ends."""

    def summary(self) -> dict[str, Any]:
        """Return what happened: counters, and each time at which the output went to zero."""


class SlcanSide:
    """The adapter and the axis on its bus."""

    def __init__(self, axis: CanAxis, bit_rate: int = 1_000_000) -> None:
        self.axis = axis
        self.adapter = SlcanAdapter(bit_rate)
        self.lagging = False
        """Set where it cannot keep up with real time; no drive on a CAN bus has a word for that."""

    @property
    def time(self) -> float:
        """The axis' clock, s."""
        return self.axis.time

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes from the host: the adapter's answers first, then what the axis sends."""
        answers, frames = self.adapter.receive(data)
        return answers + self._lines(self.axis.receive(frames, now))

    def run_until(self, now: float) -> bytes:
        """Let time pass to `now` (s); return the lines of what the axis sends unasked."""
        return self._lines(self.axis.run_until(now))

    def shut_down(self, now: float) -> None:
        """End the axis in order."""
        self.axis.shut_down(now)

    def summary(self) -> dict[str, Any]:
        """Return the axis' summary with the adapter's counters."""
        counters = self.adapter.counters
        return {
            "frames": counters["frames"],
            "bad_frames": counters["damaged"],
            "unheard_frames": counters["unheard"],
            **self.axis.summary(),
        }

    def _lines(self, frames: list[Frame]) -> bytes:
        return b"".join([self.adapter.send(frame) for frame in frames]) if frames else b""
