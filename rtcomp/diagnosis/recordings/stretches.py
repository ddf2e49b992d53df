"""A recording in stretches: a long gap is not bridged, what comes after it begins anew."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

BRIDGED = 8
"""Doubtful rows in a row up to which a straight line stands for them."""
LEAST_ROWS = 200
"""Rows of a stretch, at the least."""
MOST = 12
"""Stretches of a recording, at the most: the longest."""


def stretches(trusted: npt.NDArray[np.bool_]) -> list[slice]:
    """Return the stretches of rows, in order, between runs of more than BRIDGED rows that are not `trusted`.

    Of many stretches the longest are returned, of those that are too short none.
    """
    if trusted.all():
        return [slice(0, trusted.size)]
    edges = np.flatnonzero(np.diff(np.concatenate([[True], trusted, [True]]).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2]  # of doubtful runs
    long = ends - begins > BRIDGED
    starts = np.concatenate([[0], ends[long]])
    stops = np.concatenate([begins[long], [trusted.size]])
    found = [(int(a), int(b)) for a, b in zip(starts, stops, strict=True) if b - a >= LEAST_ROWS]
    found = sorted(sorted(found, key=lambda ab: ab[0] - ab[1])[:MOST])
    return [slice(a, b) for a, b in found]
