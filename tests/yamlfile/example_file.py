"""The stage file that the formats' page shows."""

from __future__ import annotations

EXAMPLE = """\
stage:
  axis: linear                  # linear (default) or rotary
  mass: 2.0                     # kg
  friction:
    - {stiffness: 3.2e5, reach: 1.5e-6}
    - stiffness: 2.2e5
      reach: 1e-6
sensor: {noise: 15.0e-9, resolution: 10.0e-9}
rate: 1000.0
"""
