"""A case as files, for experiments: recording, stage and, in the open, the truth.

Run as ``python -m rtcomp.trial.files FAMILY SEED FOLDER [KIND [EFFECT ...]]``; writes ``train.csv.gz``,
``stage.yaml``, ``unseen.csv.gz`` and ``truth.json`` into a new folder. KIND is one of a trial's (``one`` by
default), EFFECT what is hidden; without it, something that the family can hide.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rtcomp.trial.draw import SHARES, Case, Plan, draw, plan
from rtcomp.trial.families import FAMILIES
from rtcomp.trial.hidden import SECRETS
from rtcomp.trial.stagefile import write_case, write_recording


def drawn(family: str, seed: int, kind: str = "one", effects: Sequence[str] = ()) -> Case:
    """Return a case of a family; the same arguments give the same case."""
    chosen: Plan = plan(1, seed, kind, [family])[0]
    if effects:
        chosen = replace(chosen, secrets=tuple(effects), tier="full")
    return draw(chosen)


def write(case: Case, folder: Path) -> None:
    """Write recording, stage, a second recording and the truth into a new folder."""
    write_case(folder, case.believed, case.run("train"), case.loop)
    write_recording(folder / "unseen.csv.gz", case.run("unseen"), case.loop)
    text = json.dumps(case.answer(), indent=1)
    (folder / "truth.json").write_text(text + "\n", encoding="utf-8")


def main(arguments: Sequence[str]) -> int:
    """Write the case that the arguments ask for; return the exit status."""
    kind = arguments[3] if len(arguments) > 3 else "one"
    unknown = set(arguments[4:]) - SECRETS.keys()
    if len(arguments) < 3 or arguments[0] not in FAMILIES or kind not in SHARES or unknown:
        print(f"{__doc__}\nFamilies: {', '.join(FAMILIES)}. Kinds: {', '.join(SHARES)}.", file=sys.stderr)
        print(f"Effects: {', '.join(SECRETS)}.", file=sys.stderr)
        return 2
    folder = Path(arguments[2])
    if folder.exists():
        print(f"error: {folder} exists", file=sys.stderr)
        return 2
    write(drawn(arguments[0], int(arguments[1]), kind, arguments[4:]), folder)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
