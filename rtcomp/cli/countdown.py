"""Seconds in which a person can still say no."""

from __future__ import annotations

import sys
import time

import click

SECONDS = 3


class Countdown:
    """Counts down on a terminal, once a command; Ctrl-C ends the command before anything moves."""

    def __init__(self, seconds: int = SECONDS) -> None:
        self._left = seconds

    def __call__(self) -> None:
        """Count down the first time; then, and away from a terminal, do nothing."""
        left, self._left = self._left, 0
        if not left or not sys.stderr.isatty():
            return
        click.echo("Arming; Ctrl-C stops. While it runs, space or Enter is the emergency stop.", err=True)
        for second in range(left, 0, -1):
            click.echo(f"{second} ", nl=False, err=True)
            time.sleep(1.0)
        click.echo("", err=True)
