"""Faults: every row of the table, drawn variants each, the worst reaction as the plant's side saw it.

In virtual time, so the figures are the loop's own: ticks from the fault until the plant was at zero volts.

    python tools/bench_faults.py --variants 100 --json faults.json
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click
from fault_rows import ROWS
from fault_run import CONFIG, variant
from rich import box
from rich.console import Console
from rich.table import Table


@click.command()
@click.option("--variants", default=100, show_default=True, type=click.IntRange(1), help="Of each fault.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0))
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(variants: int, seed: int, path: Path | None) -> None:
    table = Table(title="Faults", title_justify="left", box=box.SIMPLE)
    for head in ("fault", "variants", "required", "as required", "worst reaction"):
        table.add_column(head, justify="left" if head in ("fault", "required") else "right")
    figures = []
    for row in ROWS:
        ran = [variant(row, 10_000 * seed + k) for k in range(variants)]
        wrong = [problem for one in ran for problem in one.problems]
        worst = max(one.reaction for one in ran)
        stops = worst >= 0
        required = row.raises.__name__ if row.raises else "DEGRADED, goes on" if row.degrades else "goes on"
        required = "zero volts, ends in order" if row.name == "signal" else required
        good = sum(not one.problems for one in ran)
        shown = f"{worst} ticks, {1e3 * worst * CONFIG.period:g} ms" if stops else ""
        shown += f" after {row.after}" if row.after else ""
        table.add_row(row.name, str(variants), required, f"{good}", shown)
        figures.append(
            {
                "fault": row.name, "variants": variants, "required": required, "as_required": good,
                "worst_ticks": worst if stops else None,
                "worst_ms": 1e3 * worst * CONFIG.period if stops else None,
                "counted_from": row.after or "the fault", "problems": wrong[:5],
            }
        )  # fmt: skip
        for problem in wrong[:3]:
            print(f"{row.name}: {problem}", file=sys.stderr)
    Console(width=130).print(table)
    if path is not None:
        path.write_text(json.dumps({"rate_hz": CONFIG.stage.rate, "faults": figures}, indent=2) + "\n")
    sys.exit(int(any(f["problems"] for f in figures)))


if __name__ == "__main__":
    main()
