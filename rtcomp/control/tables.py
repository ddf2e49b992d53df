"""A motion from a CSV file: read it, and run a smooth curve through its rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rtcomp.control.motions import Triple
from rtcomp.errors import RecordingError
from rtcomp.kernels import Floats


class Table:
    """A motion through points: times (s, from 0, increasing) and positions (m); at rest at both ends."""

    period: float | None = None

    def __init__(self, times: Floats, positions: Floats, interpolation: str) -> None:
        from scipy import interpolate

        self.length: float | None = float(times[-1])
        self._times = times
        self._curve: interpolate.PPoly[np.float64]
        if interpolation == "cubic":
            self._curve = interpolate.CubicSpline(times, positions, bc_type="clamped")
        else:
            slopes = interpolate.PchipInterpolator(times, positions).derivative()(times)
            slopes[0] = slopes[-1] = 0.0
            self._curve = interpolate.CubicHermiteSpline(times, positions, slopes)
        self._velocity = self._curve.derivative(1)
        self._acceleration = self._curve.derivative(2)

    def evaluate(self, t: Floats) -> Triple:
        """Return the curve and its derivatives; outside the table at rest at its first or last point."""
        outside = (t < 0.0) | (t > self._times[-1])
        u = np.clip(t, 0.0, self._times[-1])
        x = np.asarray(self._curve(u), dtype=np.float64)
        v = np.where(outside, 0.0, self._velocity(u))
        a = np.where(outside, 0.0, self._acceleration(u))
        return x, v, a

    def landmarks(self, _until: float) -> Floats:
        """Return the table's times from both sides, and 16 times between two of them."""
        gaps = np.diff(self._times)
        inner = self._times[:-1, None] + gaps[:, None] * np.linspace(1e-9, 1.0 - 1e-9, 18)
        return np.sort(np.concatenate([self._times, inner.ravel()]))


def read_table(path: Path) -> tuple[Floats, Floats]:
    """Read the columns `time` (s) and `reference` (m) of a CSV file; return times from 0, and positions.

    Raises RecordingError for a file that cannot be read, missing columns, values that are no finite numbers,
    time that does not increase, or fewer than 4 rows.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            header = [name.strip() for name in file.readline().split(",")]
            missing = [name for name in ("time", "reference") if name not in header]
            if missing:
                found = ", ".join(header) if any(header) else "none"
                raise RecordingError(
                    f"{path}: column {missing[0]!r} is missing; found {found}; the first line must name "
                    "time and reference"
                )
            columns = [header.index("time"), header.index("reference")]
            rows = np.loadtxt(file, delimiter=",", usecols=columns, ndmin=2, dtype=np.float64)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path}: is not text; a reference is a CSV file") from error
    except (ValueError, IndexError) as error:
        if isinstance(error, RecordingError):
            raise
        detail = " ".join(str(error).split())
        raise RecordingError(f"{path}: has a row that is no two numbers: {detail}") from error
    return _checked(path, rows)


def _checked(path: Path, rows: Floats) -> tuple[Floats, Floats]:
    if len(rows) < 4:
        raise RecordingError(f"{path}: has {len(rows)} rows; a reference needs at least 4")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise RecordingError(f"{path}: row {bad[0] + 2} is not finite; every time and reference must be")
    back = np.flatnonzero(np.diff(rows[:, 0]) <= 0.0)
    if back.size:
        k = int(back[0])
        raise RecordingError(
            f"{path}: time goes from {rows[k, 0]:g} s to {rows[k + 1, 0]:g} s at row {k + 3}; "
            "it must increase"
        )
    return rows[:, 0] - rows[0, 0], rows[:, 1].copy()
