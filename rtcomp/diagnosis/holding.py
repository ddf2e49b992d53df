"""Whether names hold on what was put aside: they help there, do no harm, and explain most of it."""

from __future__ import annotations

from rtcomp.diagnosis.result import Fit

HARM, WORSE, HELP = 1.02, 1.1, 0.95
"""Factors on the held-out error of the stage, believed, retuned and (where it is more than the floor) retuned
again, beyond which names are taken back."""
LEAST, HALF, MUCH, OPEN = 0.35, 0.5, 0.7, 0.2
"""Part of the held-out squared error above the floor that names with a shape of their own must explain: in
general, where the floor is a double's, and where they leave more than the part OPEN of the mismatch that was
seen."""
AGREES = 0.006
"""Relative force error up to which a recording is held to agree, whatever its noise promises."""
FAR, NEARLY_ALL, TOGETHER = 4.0, 0.97, 0.9
"""Names that leave more than FAR times the floor of what was put aside, and explain less of its squared error
above that than NEARLY_ALL (a lone one) or TOGETHER, are the nearest of the catalogue to something that is not
in it. Several are held to that only where the floor is a double's: what the method leaves at the least is no
measure of how far four names may be from a machine."""
VERY_FAR = 10.0
"""Times the floor that several leave, from which on they are held to as much as a lone one."""


def does_harm(fit: Fit, much: float = 0.0) -> bool:
    """Tell whether what was put aside is predicted worse with names than without, and leaves over `much`."""
    return fit.after > max(HARM * fit.before, much) or fit.after > max(WORSE * fit.retuned, much)


def holds(fit: Fit, typical: float = 1.0, once: bool = False) -> bool:
    """Tell whether names hold on what was put aside: they do no harm there, and help where there is need.

    There, or in the `typical` block of it (error over that of the retuned stage). What happens `once`
    happens in no block that is put aside; there it can only harm, and may by a little.
    """
    much = max(1.5 * fit.floor, AGREES if once else 0.0)
    if does_harm(fit, much):
        return False
    return fit.retuned < much or fit.after < HELP * fit.retuned or typical < HELP


def must_explain(left: float, doubled: bool) -> float:
    """Return the part of what was put aside that names must explain.

    `left` is the part of the mismatch seen that they leave; `doubled` tells whether the floor is a
    double's, so that it is known how much there is to explain.
    """
    return MUCH if left > OPEN else HALF if doubled else LEAST


def explains_little(fit: Fit, least: float) -> bool:
    """Tell whether names explain so little of what was put aside that they are the nearest, not the right."""
    floor = (1.5 * fit.floor) ** 2
    return fit.retuned**2 > floor and fit.after**2 - floor > (1.0 - least) * (fit.retuned**2 - floor)


def leaves_much(fit: Fit, names: int = 1, doubled: bool = True) -> bool:
    """Tell whether far more than noise is left of what was put aside, and more than trimming explains."""
    least = NEARLY_ALL if names == 1 or fit.after > VERY_FAR * fit.floor else TOGETHER
    return (names == 1 or doubled) and fit.after > FAR * fit.floor and explains_little(fit, least)
