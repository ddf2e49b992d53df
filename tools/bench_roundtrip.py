"""Round trips: the serial driver beside raw os.write, select, os.read, the CAN driver beside bare python-can.

Exchange by exchange, by turns. The other side is the plant server, on serial with its board in Python and,
where a compiler is, with the firmware in C, on CAN with an ODrive axis behind an slcan adapter.

    python tools/bench_roundtrip.py --seconds 60 --json roundtrip.json
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import click
from figures_table import Figure, show
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.bench import can_link
from rtcomp.bench.link import RoundTrips, measure
from rtcomp.jobs.demo import shipped

TOP = Path(__file__).resolve().parent.parent


def firmware() -> Path | None:
    """The board's program for this machine, made where it can be."""
    folder = TOP / "drivers" / "firmware"
    if shutil.which("make") is None or subprocess.run(["make", "-s", "-C", folder]).returncode:
        return None
    return folder / "build" / "rtcomp-board"


def figures_of(found: RoundTrips, head: str, rival: str = "raw", allowed: float = 1.3) -> list[Figure]:
    figures, most = [], f"<= {allowed:g}"
    for name, percent, target in (("p50", 50.0, most), ("p99", 99.0, most), ("p99.9", 99.9, "")):
        ours, raw = found.driver.percentile(percent), found.raw.percentile(percent)
        note = f"{ours:.4g} us; {rival} {raw:.4g} us"
        figures.append(Figure(f"{head}: {name} over {rival}", ours / raw, "times", target, note))
    odd = sum(n for name, n in found.counters.items() if name not in ("sent", "samples"))
    figures.append(Figure(f"{head}: exchanges otherwise than well", float(odd), f"of {found.driver.total}"))
    return figures


@click.command()
@click.option("--seconds", default=60.0, show_default=True, help="Of each board.")
@click.option("--rate", default=1000.0, show_default=True, help="Hz, of each way.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(seconds: float, rate: float, path: Path | None) -> None:
    boards: dict[str, Path | None] = {"board in Python": None}
    if (program := firmware()) is not None:
        boards["firmware in C"] = program
    figures, links = [], {}
    for board, program in boards.items():
        with PlantProcess(shipped("leuven.yaml"), firmware=program) as plant:
            found = measure(plant.port, rate, seconds)
        figures += figures_of(found, f"serial, {board}")
        links[board] = found.to_json()
    with PlantProcess(shipped("leuven.yaml"), link="odrive-can", watchdog=can_link.WATCHDOG_S) as plant:
        found = can_link.measure(plant.port, rate, seconds)
    figures += figures_of(found, "odrive-can on slcan", "python-can", 1.2)
    links["odrive-can"] = found.to_json()
    show(f"Round trips at {rate:g} Hz, {seconds:g} s, two ways by turns", figures, path, links=links)


if __name__ == "__main__":
    main()
