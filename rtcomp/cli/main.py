"""The command `rtcomp`: finds its commands, and turns every error into one line and an exit status.

Exit status: 0 done, 1 done and a verdict does not hold (`hil`), 2 unusable input or a device that fails, 70 a
defect of the program, 130 and 143 interrupted by SIGINT and SIGTERM, 141 nobody reads the output any more.
"""

from __future__ import annotations

import difflib
import gc
import os
import select
import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from types import FrameType

import click
from click.exceptions import NoArgsIsHelpError

from rtcomp import __version__
from rtcomp.cli.lazy import LazyGroup
from rtcomp.errors import Interrupted, RtcompError

INTERNAL, INTERRUPTED, BROKEN_PIPE = 70, 130, 141

AGAIN_S = 0.02
"""After which a signal that was dropped is sent again."""

COMMANDS = {
    "demo": ("rtcomp.cli.demo:demo", "Identify and compensate a simulated stage, to the report."),
    "simulate": ("rtcomp.cli.simulate:simulate", "Simulate a stage, in closed loop or open, and record it."),
    "identify": ("rtcomp.cli.identify:identify", "Identify the friction's hysteresis while the stage moves."),
    "compensate": ("rtcomp.cli.compensate:compensate", "Follow a reference with the friction cancelled."),
    "diagnose": ("rtcomp.cli.diagnose:diagnose", "Say which physics a stage leaves out of recordings."),
    "replay": ("rtcomp.cli.replay:replay", "Put a stage's force balance beside a recording, row by row."),
    "inspect": ("rtcomp.cli.inspect:inspect", "Test a recorded hysteresis: symmetric, congruent, closed?"),
    "trial": ("rtcomp.cli.trial:trial", "Prove the diagnosis on cases whose answers are sealed."),
    "paper": ("rtcomp.cli.paper:paper", "Make the paper's figures anew and test its claims."),
    "convert": ("rtcomp.cli.convert:convert", "Turn a recording into another format."),
    "drivers": ("rtcomp.cli.drivers:drivers", "List the installed drivers and their settings."),
    "doctor": ("rtcomp.cli.doctor:doctor", "Look at this machine: is it fit for a loop, what mends it."),
    "bench": ("rtcomp.cli.bench:bench", "Measure deadlines, links and ticks beside plain rivals."),
    "hil": ("rtcomp.cli.hil:hil", "Both jobs and faults over every link, against stand-ins."),
    "plant": ("rtcomp.cli.plant:plant", "Stand in for hardware: serve a simulated stage on a port."),
}
"""Every command: where it stands, and what it does in one line (so that help imports none of them)."""


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rtcomp", message="%(prog)s %(version)s")
def cli() -> None:
    """Identify friction hysteresis while an axis runs, and cancel it inside a fixed-rate loop.

    \b
    Start with:
      rtcomp demo --out out/demo
    """


def main() -> None:
    """Run the command line of this process and exit with its status."""
    signal.signal(signal.SIGTERM, _terminated)
    sys.unraisablehook = _dropped
    # Matrices are small here: threads for them cost more than they give, and take cores from loop and search.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    status = run(sys.argv[1:])
    gc.freeze()  # what lives to the end is not searched for cycles there: a tenth of a second
    sys.exit(status)


def _terminated(number: int, _frame: FrameType | None) -> None:
    # Once: what it sets off, such as keeping what was written, is not to be cut short by a second one.
    signal.signal(number, signal.SIG_IGN)
    raise Interrupted(number)


def _dropped(what: sys.UnraisableHookArgs) -> None:
    """Send a signal again that came where Python drops what is raised (a finaliser, a hook of fork)."""
    error = what.exc_value
    if not isinstance(error, KeyboardInterrupt):
        sys.__unraisablehook__(what)
        return
    number: int = signal.SIGINT
    if isinstance(error, Interrupted):
        number = error.number
        signal.signal(number, _terminated)
    # In a moment: raised here, it would be dropped as well.
    threading.Timer(AGAIN_S, signal.pthread_kill, (threading.main_thread().ident, number)).start()


def run(arguments: Sequence[str]) -> int:
    """Run `rtcomp` with `arguments` and return the exit status; errors are one line on standard error."""
    if "_RTCOMP_COMPLETE" in os.environ:
        cli.main(args=list(arguments), prog_name="rtcomp")  # answers the shell's completion, then exits
    try:
        status = _invoke(list(arguments) or ["--help"])
        sys.stdout.flush()
        return status
    except click.exceptions.Exit as done:
        return done.exit_code
    except NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 0
    except click.ClickException as error:
        return _say(_usage(error), 2)
    except RtcompError as error:
        _trace()
        return _say(_with_notes(error), error.exit_status)
    except Interrupted as error:
        return _say(
            "; ".join(filter(None, ["interrupted", _with_notes(error)])), error.exit_status, prefix=""
        )
    except (KeyboardInterrupt, click.Abort) as error:
        return _say("; ".join(["interrupted", *_notes(error)]), INTERRUPTED, prefix="")
    except BrokenPipeError as error:
        if _stdout_is_gone():
            return BROKEN_PIPE
        return _defect(error)
    except OSError as error:
        if error.strerror is None:
            return _defect(error)
        _trace()
        what = f"{error.filename}: " if error.filename is not None else ""
        return _say("; ".join([f"{what}{error.strerror.lower()}", *_notes(error)]), 2)
    except Exception as error:
        return _defect(error)


def _invoke(arguments: list[str]) -> int:
    # Not click's own `main`, which prints errors over several lines and takes every EPIPE for a closed pipe.
    with cli.make_context("rtcomp", arguments) as context:
        result = cli.invoke(context)
    return result if isinstance(result, int) else 0


def _usage(error: click.ClickException) -> str:
    message = error.format_message()
    context = getattr(error, "ctx", None)
    if isinstance(error, click.NoSuchOption):
        message = f"no option {error.option_name}"
        known = (
            [o for p in context.command.get_params(context) for o in p.opts] if context is not None else []
        )
        near = difflib.get_close_matches(error.option_name, known, n=1)
        message += f"; did you mean {near[0]}?" if near else ""
    if isinstance(error, click.UsageError) and context is not None:
        message = message.rstrip(".")
        end = "" if message.endswith("?") else ";"
        message = f"{message[:1].lower()}{message[1:]}{end} see {context.command_path} --help"
    return message


def _defect(error: Exception) -> int:
    if not _trace():
        what = f"{type(error).__name__}: {_with_notes(error)}"
        return _say(f"internal error ({what}); set RTCOMP_DEBUG=1 to see where", INTERNAL)
    return INTERNAL


def _trace() -> bool:
    """Print the traceback of the error at hand if RTCOMP_DEBUG=1 asks for it."""
    wanted = os.environ.get("RTCOMP_DEBUG", "") not in ("", "0")
    if wanted:
        traceback.print_exc()
    return wanted


def _notes(error: BaseException) -> list[str]:
    return list(getattr(error, "__notes__", []))


def _with_notes(error: BaseException) -> str:
    return "; ".join(filter(None, [str(error), *_notes(error)]))


def _say(message: str, status: int, prefix: str = "error: ") -> int:
    line = prefix + " ".join(message.split())
    try:
        click.echo(line, err=True)
    except OSError:  # standard error is closed; the status still says it
        return status
    return status


def _stdout_is_gone() -> bool:
    """Say whether the reader of standard output has closed it; if so, drop what is still to be written."""
    try:
        descriptor = sys.stdout.fileno()
    except (OSError, ValueError):  # not a file at all
        return False
    poll = select.poll()
    poll.register(descriptor, 0)
    gone = any(events & (select.POLLERR | select.POLLHUP) for _, events in poll.poll(0))
    if gone:
        os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
    return gone


if __name__ == "__main__":
    main()
