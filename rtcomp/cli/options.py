"""Options that several commands share, each a decorator, so that they read alike everywhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from rtcomp.cli.output import prepare_output

__all__ = [
    "Frequency",
    "Within",
    "force_option",
    "json_option",
    "map_option",
    "output_options",
    "prepare_output",
    "rate_option",
]

F = TypeVar("F", bound=Callable[..., Any])


class Frequency(click.ParamType[float]):
    """A positive, finite number of Hz."""

    name = "HZ"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number, or fail with what is allowed."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number > 0.0):
            self.fail(f"{value!r} is not a rate; give a positive number of Hz", param, ctx)
        return number


class Within(click.FloatRange):
    """A finite number within a range; `click.FloatRange` lets NaN pass."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number, or fail with what is allowed."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


def output_options(default: str | None = None) -> Callable[[F], F]:
    """Add ``--out DIR`` (argument `out`: Path; required where there is no `default`) and ``--force``."""

    def add(function: F) -> F:
        folder = click.option(
            "--out",
            metavar="DIR",
            type=click.Path(path_type=Path),
            default=default,
            required=default is None,
            show_default=default is not None,
            help="Folder for the results; must be new or empty.",
        )
        return folder(force_option(function))

    return add


def force_option(function: F) -> F:
    """Add ``--force`` (argument `force`: bool)."""
    return click.option("--force", is_flag=True, help="Replace the results of an earlier run.")(function)


def json_option(function: F) -> F:
    """Add ``--json`` (argument `as_json`: bool)."""
    says = "Print the summary as JSON, and nothing else."
    return click.option("--json", "as_json", is_flag=True, help=says)(function)


def map_option(function: F) -> F:
    """Add ``--map COLUMN=NAME``, many times (argument `mapping`: dict from our names to the file's)."""
    return click.option(
        "--map",
        "mapping",
        metavar="COLUMN=NAME",
        multiple=True,
        callback=_to_dict,
        help="What the file calls a column, such as position=qm; once for each.",
    )(function)


def rate_option(function: F) -> F:
    """Add ``--rate HZ`` (argument `rate`: float or None)."""
    says = "Rate of the ticks, instead of the file's."
    return click.option("--rate", type=Frequency(), metavar="HZ", help=says)(function)


def _to_dict(ctx: click.Context, param: click.Parameter, pairs: tuple[str, ...]) -> dict[str, str]:
    if not pairs:
        return {}
    from rtcomp.recording.reader import parse_map

    return parse_map(pairs)
