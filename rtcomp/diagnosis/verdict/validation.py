"""The final judgement: relative force errors on the reserved blocks, once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.blocks import LEAST_FORCE
from rtcomp.diagnosis.mismatch.where import as_seen, left_seen, noise_seen
from rtcomp.errors import RecordingError
from rtcomp.stage.stage import Stage


class Reserved:
    """Blocks that took no part in fitting or selection; they judge once.

    Raises RecordingError where nothing happens in them.
    """

    def __init__(self, balance: ForceBalance) -> None:
        self._balance, self._judged = balance, False
        force, rows = balance.drive_force(), balance.reserved[balance.block]
        here, elsewhere = float(np.std(force[rows])), float(np.std(force[~rows]))
        if min(here, elsewhere) < LEAST_FORCE * max(here, elsewhere):
            where = "in" if here < elsewhere else "but in"
            raise RecordingError(
                f"nothing moves {where} the part kept for the judgement: its force varies by {here:.3g} N, "
                f"that of the rest by {elsewhere:.3g} N; record motion throughout, or cut the rests"
            )

    def judge(self, stages: Mapping[str, Stage]) -> dict[str, float]:
        """Return the relative force error (rms over rms) of each stage, and as ``noise`` the sensor's.

        Of forces as far as they stand above that noise: what is beyond tells nothing of a stage.

        Raises RuntimeError when asked again: what is asked twice is selected on.
        """
        if self._judged:
            raise RuntimeError("the reserved blocks have judged already")
        self._judged = True
        b = self._balance
        rows = b.reserved[b.block]
        seen = [as_seen(b, b.drive_force()), *left_seen(b, *stages.values())]
        power, *errors = (max(float(np.sqrt(np.mean(each[rows] ** 2))), 1e-150) for each in seen)
        relative = [each / power for each in (*errors, noise_seen(b))]
        return dict(zip([*stages, "noise"], relative, strict=True))
