"""One thing looked at: how it stands, what that means for a loop, what mends it."""

from __future__ import annotations

from dataclasses import dataclass

GOOD, WEAK, BAD = "good", "weak", "bad"
"""As it should be; works, with deadlines missed now and then or less convenience; does not work."""


@dataclass(frozen=True)
class Finding:
    """What was looked at, and how it stands (`GOOD`, `WEAK`, `BAD`)."""

    about: str
    """What was looked at: ``scheduling``, ``serial port /dev/ttyACM0``."""
    state: str
    found: str
    """What there is."""
    means: str = ""
    """What follows from it for a loop; empty where all is well."""
    mend: str = ""
    """A command, or what to do, that mends it; empty where nothing is to be done."""
