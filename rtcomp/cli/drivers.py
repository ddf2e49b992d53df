"""`rtcomp drivers`: which drivers are installed, and what each can be told."""

from __future__ import annotations

import dataclasses
import json
import textwrap
from typing import TYPE_CHECKING

import click

from rtcomp.cli.options import json_option

if TYPE_CHECKING:
    from rtcomp_drivers.registry import Description, Setting


@click.command()
@click.argument("name", required=False)
@json_option
def drivers(name: str | None, as_json: bool) -> None:
    """List the installed drivers and their settings; only NAME's where it is given.

    A configuration chooses one with `device: {driver: NAME, setting: value}`. Drivers of other packages are
    found through the entry-point group `rtcomp.drivers`.

    \b
    Examples:
      rtcomp drivers
      rtcomp drivers serial --json
    """
    from rtcomp_drivers.registry import describe, find

    if name is not None:
        find(name)  # says which there are where there is no such driver, or why it cannot be loaded
    chosen = [d for d in describe() if name in (None, d.name)]
    if as_json:
        click.echo(json.dumps([dataclasses.asdict(d) for d in chosen], indent=2, default=str))
    else:
        click.echo("\n\n".join(_text(d) for d in chosen))


def _text(description: Description) -> str:
    absent = "" if description.available else "cannot be used: "
    lines = [description.name, *_wrapped(f"{absent}{description.says}", "  ")]
    width = max((len(s.name) for s in description.settings), default=0)
    for setting in description.settings:
        head = f"    {setting.name:<{width}}  "
        lines += _wrapped(f"{setting.says or setting.type} ({_default(setting)})", head)
    return "\n".join(lines)


def _default(setting: Setting) -> str:
    if setting.required:
        return "required"
    if setting.default is None:
        return "optional"
    return f"default {json.dumps(setting.default, default=str)}"


def _wrapped(text: str, head: str) -> list[str]:
    return textwrap.wrap(
        text, 100, initial_indent=head, subsequent_indent=" " * len(head), break_on_hyphens=False
    )
