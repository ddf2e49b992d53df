"""What of this machine stands in the way of deadlines and of devices, and the command that mends it."""

from rtcomp.doctor.examine import examine
from rtcomp.doctor.finding import BAD, GOOD, WEAK, Finding

__all__ = ["BAD", "GOOD", "WEAK", "Finding", "examine"]
