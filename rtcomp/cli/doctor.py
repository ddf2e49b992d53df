"""`rtcomp doctor`: is this machine fit for a loop, and what mends it where not."""

from __future__ import annotations

import dataclasses
import json

import click

from rtcomp.cli.options import json_option

_MARKS = {"good": ("ok", "green"), "weak": ("!", "yellow"), "bad": ("!!", "red")}


@click.command()
@json_option
def doctor(as_json: bool) -> None:
    """Look at this machine: rights, memory, clock, processor, ports, CAN interfaces, drivers.

    Says what stands in the way of deadlines and devices, what follows from it, and the command that mends it.
    It changes nothing. docs/how-to/realtime.md says more of each; `rtcomp bench loop` measures what comes of
    it.

    \b
    Examples:
      rtcomp doctor
      rtcomp doctor --json
    """
    from rtcomp.doctor import BAD, GOOD, WEAK, examine

    findings = examine()
    if as_json:
        click.echo(json.dumps([dataclasses.asdict(f) for f in findings], indent=2))
        return
    width = max(len(f.about) for f in findings)
    for f in findings:
        mark, colour = _MARKS[f.state]
        click.echo(f"{click.style(f'{mark:>2}', fg=colour)} {f.about:<{width}}  {f.found}")
        if f.means:
            click.echo(f"   {'':<{width}}  {f.means}")
        if f.mend:
            click.echo(f"   {'':<{width}}  {click.style(f.mend, bold=True)}")
    count = {state: sum(f.state == state for f in findings) for state in (GOOD, WEAK, BAD)}
    click.echo(
        f"\n{count[GOOD]} as they should be, {count[WEAK]} could be better, {count[BAD]} stand in the way\n"
        "What comes of it: rtcomp bench loop --busy"
    )
