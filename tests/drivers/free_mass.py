"""A plant whose motion is known in closed form."""

from __future__ import annotations


class FreeMass:
    """1 kg, 1 N/V (or 1 kg m^2, 1 N m/V), no friction: position and velocity after each stretch are exact."""

    def __init__(self, position: float = 0.0) -> None:
        self.position, self.velocity = position, 0.0

    def advance(self, volts: float, seconds: float) -> None:
        self.position += self.velocity * seconds + 0.5 * volts * seconds**2
        self.velocity += volts * seconds

    def measure(self) -> float:
        return self.position
