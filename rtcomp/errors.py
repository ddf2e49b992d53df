"""Every error that a user can cause or meet, in one tree.

RtcompError                 one clear line, exit status 2
├── ConfigError             a configuration, stage or model file (also a ValueError)
├── RecordingError          a recording that cannot be used (also a ValueError)
├── OutputExistsError       an output that would be overwritten (also a FileExistsError)
├── LimitError              a motion or command outside what stage or limits allow (also a ValueError)
└── DeviceError             a device that cannot be opened or has gone (also an OSError)
    ├── DeviceBusyError     its port is used by somebody else
    ├── DeviceTimeoutError  it does not answer (also a TimeoutError)
    └── ProtocolError       it answers, but not as the protocol says

Messages name the thing, the value, the allowed range and what to do; they are one line.
"""

from __future__ import annotations


class RtcompError(Exception):
    """Base of all errors that end a command with one line and exit status 2."""

    exit_status = 2


class ConfigError(RtcompError, ValueError):
    """A configuration, stage or model file is wrong; the message names file, line and key."""


class RecordingError(RtcompError, ValueError):
    """A recording is unreadable or unusable; the message says what was found."""


class OutputExistsError(RtcompError, FileExistsError):
    """An output folder or file exists and was not to be overwritten."""


class LimitError(RtcompError, ValueError):
    """A reference or command leaves what the stage or the limits allow."""


class DeviceError(RtcompError, OSError):
    """A device cannot be opened, or has gone while running."""


class DeviceBusyError(DeviceError):
    """The device's port is held by another process."""


class DeviceTimeoutError(DeviceError, TimeoutError):
    """The device does not answer in time."""


class ProtocolError(DeviceError):
    """The device answers, but not as the protocol says."""
