"""How benchmarks state their figures: a table for a person, JSON for machines, met or not beside each."""

from __future__ import annotations

import json
import operator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table


@dataclass(frozen=True)
class Figure:
    """One figure: what it is, the number, its unit, and the target (``<= 2``) where there is one."""

    name: str
    value: float
    unit: str = ""
    target: str = ""
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None where there is none."""
        if not self.target:
            return None
        sign, limit = self.target.split()
        return bool({"<=": operator.le, ">=": operator.ge}[sign](self.value, float(limit)))


def show(title: str, figures: list[Figure], path: Path | None, **more: Any) -> None:
    """Print the table; write everything to `path` as JSON where one is given."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE)
    for head in ("", "figure", "target", "", ""):
        table.add_column(head, justify="right" if head == "figure" else "left")
    for f in figures:
        met = {None: "", True: "met", False: "MISSED"}[f.met]
        table.add_row(
            f.name,
            f"{f.value:.4g} {f.unit}".rstrip(),
            f"{f.target} {f.unit if f.target else ''}",
            met,
            f.note,
        )
    Console(width=150).print(table)
    if path is not None:
        data = {"title": title, "figures": [{**asdict(f), "met": f.met} for f in figures], **more}
        path.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
