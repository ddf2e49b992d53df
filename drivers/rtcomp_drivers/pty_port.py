"""A pseudo-terminal that stands for a port: the device's end of it here, a path for the host."""

from __future__ import annotations

import os
import tty

from rtcomp.errors import DeviceError


class PtyPort:
    """An open pseudo-terminal in raw mode. Raises DeviceError where none is to be had."""

    def __init__(self) -> None:
        try:
            self.master, self._slave = os.openpty()
        except OSError as error:
            raise DeviceError(
                f"no pseudo-terminal to be had ({error.strerror}); are too many open?"
            ) from error
        # Held open here too: with no host on it, the master would otherwise read end-of-file for ever.
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)
        self.name = os.ttyname(self._slave)
        """Path of the port for the host."""

    def close(self) -> None:
        """Let go of both ends."""
        os.close(self.master)
        os.close(self._slave)
