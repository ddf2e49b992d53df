"""Is the link good enough to drive a motor over? Pure: time is handed in."""

from __future__ import annotations

WINDOW_S = 0.5
SHARE = 0.1
LEAST = 5


class LinkQuality:
    """Bad frames among all over the last 250 to 500 ms; more than 10 %, and at least 5, is too many."""

    def __init__(self) -> None:
        self._begin = 0.0
        self._good = self._bad = 0
        self._older_good = self._older_bad = 0

    def too_bad(self, good: int, bad: int, now: float) -> bool:
        """Count new frames, `good` and `bad`, at `now` (s, monotonic); return whether the link has failed."""
        half = 0.5 * WINDOW_S
        if now - self._begin >= half:
            recent = now - self._begin < WINDOW_S
            self._older_good, self._older_bad = (self._good, self._bad) if recent else (0, 0)
            self._good = self._bad = 0
            # Right after the last half: begun where a frame happens to come, two could outlast the window.
            self._begin = self._begin + half if recent else now
        self._good += good
        self._bad += bad
        all_bad = self._bad + self._older_bad
        return all_bad >= LEAST and all_bad > SHARE * (all_bad + self._good + self._older_good)
