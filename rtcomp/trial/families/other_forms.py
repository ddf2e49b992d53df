"""The micrometre stage; every effect hidden in it has another form than the catalogue's first."""

from __future__ import annotations

from rtcomp.trial.families.family import Family
from rtcomp.trial.families.micrometre import draw_stage

FAMILY = Family(
    "other-forms", "micrometre stage whose hidden effects all have other forms", draw_stage, forms=1.0
)
