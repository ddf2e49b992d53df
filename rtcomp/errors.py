"""Every error that a user can cause or meet, in one tree.

RtcompError                 one clear line, exit status 2
├── ConfigError             a configuration, stage or model file (also a ValueError)
├── RecordingError          a recording that cannot be used (also a ValueError)
├── OutputExistsError       an output that would be overwritten (also a FileExistsError)
├── LimitError              a motion or command outside what stage or limits allow (also a ValueError)
├── EmergencyStopError      somebody, or the device, has stopped the loop for good
└── DeviceError             a device that cannot be opened or has gone (also an OSError)
    ├── NotArmedError       it may not be driven without being asked for
    ├── DeviceBusyError     its port is used by somebody else
    ├── DeviceTimeoutError  it does not answer (also a TimeoutError)
    └── ProtocolError       it answers, but not as the protocol says

Interrupted (a KeyboardInterrupt) stands beside them: nothing is wrong, the user ended a run.

Messages name the thing, the value, the allowed range and what to do; they are one line.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any


class RtcompError(Exception):
    """Base of all errors that end a command with one line and exit status 2."""

    exit_status = 2


class ConfigError(RtcompError, ValueError):
    """A configuration, stage or model file is wrong; the message names file, line and key.

    `key` says which part of what was given is wrong, such as ``("elements", 1, "reach")``, so that whoever
    knows the file can name the line.
    """

    def __init__(self, *arguments: Any, key: Iterable[str | int] = ()) -> None:
        super().__init__(*arguments)
        self.key: tuple[str | int, ...] = tuple(key)

    def inside(self, *parts: str | int) -> ConfigError:
        """Return this error with its key seen from further out."""
        self.key = (*parts, *self.key)
        return self


class RecordingError(RtcompError, ValueError):
    """A recording is unreadable or unusable; the message says what was found."""


class OutputExistsError(RtcompError, FileExistsError):
    """An output folder or file exists and was not to be overwritten."""


class LimitError(RtcompError, ValueError):
    """A reference or command leaves what the stage or the limits allow."""


class EmergencyStopError(RtcompError):
    """An emergency stop by key, file or device: zero volts in one tick, and nothing goes on by itself."""


class DeviceError(RtcompError, OSError):
    """A device cannot be opened, or has gone while running."""


class NotArmedError(DeviceError):
    """Hardware was not to be driven: nobody asked for it, or this machine cannot keep its deadlines."""


class DeviceBusyError(DeviceError):
    """The device's port is held by another process."""


class DeviceTimeoutError(DeviceError, TimeoutError):
    """The device does not answer in time."""


class ProtocolError(DeviceError):
    """The device answers, but not as the protocol says."""


class Interrupted(KeyboardInterrupt):
    """A signal ended a run: the loop has stopped in good order, at zero volts.

    With `results`, the folder holds all that the command writes, made from the run up to there.
    """

    def __init__(self, number: int, says: str = "", results: bool = False) -> None:
        super().__init__(says)
        self.number = number
        self.results = results

    @property
    def exit_status(self) -> int:
        """130 for SIGINT, 143 for SIGTERM, as shells have it."""
        return 128 + self.number


def nearest(word: object, known: Iterable[str]) -> str:
    """Return ``did you mean 'x'?`` for the one of `known` most like `word`, else ``known are x, y``."""
    names = sorted(known)
    near = difflib.get_close_matches(str(word), names, n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"known are {', '.join(names)}"
