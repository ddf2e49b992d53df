"""`rtcomp bench`: what this machine does about deadlines, beside plain rivals in the same minutes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from rtcomp.cli.options import Frequency, Within, json_option
from rtcomp.cli.runs import load, to_json

if TYPE_CHECKING:
    from rtcomp.bench.loop import AtRate

F = TypeVar("F", bound=Callable[..., Any])

HEADS = ("p50", "p99", "p99.9", "max")
_PRIORITY = 80
_priority = click.option(
    "--priority", type=click.IntRange(1, 98), default=_PRIORITY, show_default=True, help="Of SCHED_FIFO."
)
_config = click.option(
    "--config", type=click.Path(path_type=Path), help="Another configuration than leuven.yaml."
)
_firmware = click.option(
    "--firmware",
    type=click.Path(path_type=Path),
    help="With a plant: the board's program of `make firmware`.",
)


def _seconds(default: float) -> Callable[[F], F]:
    return click.option(
        "--seconds",
        type=Within(0.1, 1e6),
        default=default,
        show_default=True,
        help="For each that is measured.",
    )


@click.group()
def bench() -> None:
    """Measure what this machine does about deadlines, each beside plain rivals in the same minutes.

    Times depend on the machine and on what else it does; ratios to a rival measured by turns much less.

    \b
    Examples:
      rtcomp bench loop --rate 1000 --seconds 2 --busy
      rtcomp bench link --plant --seconds 2
      rtcomp bench tick
    """


@bench.command()
@click.option(
    "--rate",
    "rates",
    type=Frequency(),
    metavar="HZ",
    multiple=True,
    help="Once for each [1000 2000 5000 10000].",
)
@_seconds(10.0)
@click.option("--busy", is_flag=True, help="Keep the other cores busy meanwhile.")
@click.option("--serial", is_flag=True, help="Over a serial link, the stage in another process.")
@_firmware
@_priority
@_config
@json_option
def loop(
    rates: tuple[float, ...],
    seconds: float,
    busy: bool,
    serial: bool,
    firmware: Path | None,
    priority: int,
    config: Path | None,
    as_json: bool,
) -> None:
    """Lateness of the loop, with identifier, compensator and recorder running on the simulated device.

    By turns with `cyclictest` of Debian's rt-tests, where that is installed, at the same rate and priority
    and on the same core, and with a plain loop in Python that sleeps until its next slot. Times in
    microseconds; `missed` counts slots that passed altogether.

    \b
    Examples:
      rtcomp bench loop --rate 1000 --rate 5000 --seconds 60 --busy
      rtcomp bench loop --rate 1000 --serial
    """
    from rtcomp_drivers.plant_process import PlantProcess

    from rtcomp.bench.busy import busy_cores, other_cores
    from rtcomp.bench.loop import measure
    from rtcomp.jobs.demo import shipped
    from rtcomp.report.terminal import Progress

    if firmware is not None and not serial:
        raise click.UsageError("--firmware is a board on a serial link; give --serial too")
    path = config or shipped("leuven.yaml")
    chosen = load(path)
    found: list[AtRate] = []
    with contextlib.ExitStack() as stack:
        if serial:
            plant = stack.enter_context(PlantProcess(path, firmware=firmware))
            chosen = load(path, port=plant.port)
        else:
            chosen = chosen.changed(device={"driver": "simulated"})
        if busy:
            stack.enter_context(busy_cores(other_cores()))
        progress = stack.enter_context(Progress("lateness", quiet=as_json))
        wanted = rates or (1000.0, 2000.0, 5000.0, 10_000.0)
        for number, rate in enumerate(wanted):

            def tell(part: float, who: str, number: int = number, rate: float = rate) -> None:
                progress.update((number + part) / len(wanted), {f"{rate:g} Hz": who})

            found.append(measure(chosen, rate, seconds, priority=priority, progress=tell))
    if as_json:
        link = "serial" if serial else "simulated"
        about = {"seconds": seconds, "busy": busy, "link": link}
        click.echo(to_json({**about, "rates": [at.to_json() for at in found]}))
        return
    rows: list[Sequence[object]] = []
    for at in found:
        for name, measured in at.runners.items():
            times = measured.spread.figures().values()
            rows.append((f"{at.rate_hz:g} Hz", name, *times, measured.missed, measured.spread.total))
        for rival in at.runners:
            if rival != "loop":
                rows.append(("", f"loop / {rival}", *at.against(rival).values()))
        rows.append(("", "its tick takes", *at.execution.figures().values()))
    _table(("", "lateness, us", *HEADS, "missed", "wake-ups"), rows)
    if "cyclictest" not in found[0].runners:
        click.echo("cyclictest is not installed: `sudo apt install rt-tests` puts it beside the loop")
    _in_force(found[-1].realtime)


@bench.command()
@click.option("--port", metavar="PORT", help="Of a board; it is armed, its output stays at 0 V.")
@click.option("--armed", is_flag=True, help="The board on PORT may be armed; without it nothing is.")
@click.option("--plant", is_flag=True, help="Start a plant server and use its port.")
@_firmware
@click.option(
    "--rate", type=Frequency(), metavar="HZ", default=1000.0, show_default=True, help="Of each way."
)
@_seconds(10.0)
@click.option("--baudrate", type=click.IntRange(9600, 12_000_000), default=1_000_000, show_default=True)
@_priority
@json_option
def link(
    port: str | None,
    armed: bool,
    plant: bool,
    firmware: Path | None,
    rate: float,
    seconds: float,
    baudrate: int,
    priority: int,
    as_json: bool,
) -> None:
    """Round trips over a serial link, through the driver and by raw read and write, by turns.

    Times in microseconds, from writing a command to having its sample; the raw way decodes nothing.

    \b
    Examples:
      rtcomp bench link --plant
      rtcomp bench link --port /dev/ttyACM0 --armed --rate 500 --seconds 30
    """
    from rtcomp_drivers.plant_process import PlantProcess

    from rtcomp.bench.link import measure
    from rtcomp.jobs.demo import shipped
    from rtcomp.report.terminal import Progress

    if (port is None) != plant:
        raise click.UsageError("give either --port PORT of a board or --plant")
    if port is not None and not armed:
        raise click.UsageError(
            f"round trips need the board on {port} armed, though its output stays 0 V; see that its axis may "
            "be held at that, then give --armed"
        )
    if firmware is not None and not plant:
        raise click.UsageError("--firmware is for a plant; give --plant too")
    with contextlib.ExitStack() as stack:
        if port is None:
            port = stack.enter_context(PlantProcess(shipped("leuven.yaml"), firmware=firmware)).port
        progress = stack.enter_context(Progress("round trips", quiet=as_json))
        found = measure(
            port, rate, seconds, baudrate=baudrate, priority=priority,
            progress=lambda part: progress.update(part, {}),
        )  # fmt: skip
    if as_json:
        click.echo(to_json({"seconds": seconds, **found.to_json()}))
        return
    rows: list[Sequence[object]] = [
        ("driver", *found.driver.figures().values(), found.driver.total),
        ("raw read and write", *found.raw.figures().values(), found.raw.total),
        ("driver / raw", *found.ratios().values()),
    ]
    _table((f"round trip at {rate:g} Hz, us", *HEADS, "round trips"), rows)
    odd = {name: count for name, count in found.counters.items() if count and name not in ("sent", "samples")}
    if odd:
        said = ", ".join(f"{name} {count}" for name, count in odd.items())
        click.echo(f"driver: {said.replace('_', ' ')}")
    _in_force(found.realtime)


@bench.command()
@click.option("--ticks", type=click.IntRange(1000, 10_000_000), default=20_000, show_default=True)
@_config
@json_option
def tick(ticks: int, config: Path | None, as_json: bool) -> None:
    """How long a tick takes, and its hysteresis operator beside plain numpy and plain Python.

    \b
    Example:
      rtcomp bench tick
    """
    from rtcomp.bench.tick import measure
    from rtcomp.jobs.demo import shipped

    found = measure(load(config or shipped("leuven.yaml")), ticks)
    if as_json:
        click.echo(to_json(found.to_json()))
        return
    _table(
        (f"{ticks} ticks, us", *HEADS),
        [
            ("kernel: operator, learner, PID, limits, ring", *found.kernel.figures().values()),
            ("... with the simulated device", *found.with_device.figures().values()),
        ],
    )
    ours = found.operator_us
    _table(
        ("operator of 20 intervals, us a sample", "", "over ours"),
        [
            ("ours, compiled", ours, 1.0),
            ("numpy, sample by sample", found.numpy_us, found.numpy_us / ours),
            ("Python alone", found.python_us, found.python_us / ours),
        ],
    )


def _table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print columns: words to the left, numbers to the right with three figures."""
    cells = [list(heads), *([_written(value) for value in row] for row in rows)]
    count = len(heads)
    padded = [row + [""] * (count - len(row)) for row in cells]
    widths = [max(len(row[column]) for row in padded) for column in range(count)]
    words = sum(1 for head in heads if head not in (*HEADS, "missed", "wake-ups", "round trips", "over ours"))
    for row in padded:
        line = [
            c.ljust(w) if i < words else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))
        ]
        click.echo("  ".join(line).rstrip())
    click.echo()


def _written(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}" if value >= 0.01 else f"{value:.2g}"
    return str(value)


def _in_force(realtime: Mapping[str, str]) -> None:
    """Say what the times were measured under."""
    told = realtime
    click.echo(
        f"in force: {told['scheduling_class']} {told['priority']}, cores {told['cores']}, "
        f"{told['locked_memory']} locked, timer slack {told['timer_slack']}, clock {told['clock_source']}"
    )
