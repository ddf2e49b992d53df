"""What the terminal says of a diagnosis: the verdict first, then what it stands on."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from rtcomp.diagnosis.result import Diagnosis, Named, Place, PositionFit
from rtcomp.report.diagnosis_words import (
    UNEXPLAINED,
    from_size,
    joined,
    next_command,
    percent,
    probability,
    sentence,
    share_explained,
    title,
    within,
)
from rtcomp.report.quantities import si, written
from rtcomp.units import for_axis

_WIDTH, _LABEL = 100, 12


def diagnosis_text(found: Diagnosis, out: str) -> str:
    """Return the summary of a diagnosis whose files are in the folder `out`, lines of 100 characters."""
    lines = [found.sentence(), ""]
    lines += _block("Where", [place.says for place in found.where])
    lines += _block("Named", [line for effect in found.effects for line in _effect(effect)])
    lines += _block(
        "Retuned",
        [
            f"{moved.parameter} {written(moved.after.value, moved.after.unit, 4)} "
            f"({within(moved.after, printed=False)}), believed {written(moved.before, moved.after.unit, 4)}"
            for moved in found.retuned
        ],
    )
    lines += _block("Force error", [_fit(found)])
    if found.position is not None:
        lines += _block("Position", [_position_fit(found.position, found.stage.axis)])
    if found.not_observable:
        lines += _block("Not seen", [f"in this motion: {', '.join(found.not_observable)}"])
    if found.verdict in ("consistent", "retuned"):
        axis = found.stage.axis
        sizes = [f"{s.name} {from_size(s, axis, printed=False)}" for s in found.sights if s.seen]
        lines += _block("Would show", [f"from these sizes on: {', '.join(sizes)}"] if sizes else [])
    if found.next_experiment is not None:
        e = found.next_experiment
        unit = for_axis("m", found.stage.axis)
        size = e.reference.get("amplitude")
        how = f" of {si(size, unit)}" if isinstance(size, int | float) else ""
        what = f"{si(e.seconds, 's')}, {e.reference.get('kind', 'a motion')}{how}"
        lines += _block("Next", [f"{what}, tell apart {joined(e.tells_apart, 'and')}", next_command(out)])
    return "\n".join(lines)


def where_so_far(left: float, places: Sequence[Place]) -> str:
    """Return where the mismatch shows, as it is known before anything is named.

    `left` is the part of the force (rms) that the refitted stage leaves open.
    """
    lines = _block("Where", [place.says for place in places[:3]] or ["in no one place more than by chance"])
    return "\n".join([f"Refitted, the stage leaves {si(100 * left, '%')} of the force open.", *lines])


def _effect(effect: Named) -> list[str]:
    if effect.names == UNEXPLAINED:
        return [f"unexplained: {percent(effect.share)} of the mismatch, by no entry of the catalogue"]
    lines = [
        f"{title(effect)}: {percent(effect.share)} of the mismatch, probability "
        f"{probability(effect.probability)}"
    ]
    for name, value in effect.parameters.items():
        interval = within(value, printed=False)
        lines.append(f"  {name} {si(value.value, value.unit, 4)}{f' ({interval})' if interval else ''}")
    if effect.separate_by:
        lines.append(f"  told apart by {effect.separate_by}")
    return lines


def _fit(found: Diagnosis) -> str:
    fit = found.fit
    steps = [("as believed", fit.before), ("retuned", fit.retuned), ("extended", fit.after)]
    said = ", ".join(f"{name} {si(100 * error, '%')}" for name, error in steps)
    share = share_explained(found)
    gain = f" {sentence(f'{percent(share)} of the mismatch is explained')}" if share == share else ""
    return f"{said}; noise alone {si(100 * fit.floor, '%')}; on parts not seen in fitting.{gain}"


def _position_fit(fit: PositionFit, axis: str) -> str:
    unit = for_axis("m", axis)
    steps = [("as believed", fit.before), ("retuned", fit.retuned), ("extended", fit.after)]
    said = ", ".join(f"{name} {si(error, unit)}" for name, error in steps)
    return (
        f"{said}; noise alone {si(fit.floor, unit)}; mean over {si(fit.seconds, 's')} from points not seen."
    )


def _block(label: str, entries: list[str]) -> list[str]:
    lines: list[str] = []
    for index, entry in enumerate(entries):
        inside = len(entry) - len(entry.lstrip())
        head = f"{label if index == 0 else '':<{_LABEL}}{' ' * inside}"
        lines += textwrap.wrap(
            entry.lstrip(), _WIDTH, initial_indent=head, subsequent_indent=" " * (_LABEL + inside + 2),
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip
    return lines
