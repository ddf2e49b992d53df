"""What the system's small files say; None where they do not."""

from __future__ import annotations

from pathlib import Path


def text(path: Path) -> str | None:
    """Return what the file says, without blanks around it."""
    try:
        return path.read_text().strip()
    except OSError:
        return None


def number(path: Path) -> int | None:
    """Return the whole number in the file."""
    said = text(path)
    try:
        return None if said is None else int(said)
    except ValueError:
        return None
