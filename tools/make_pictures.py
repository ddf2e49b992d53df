"""Make the pictures of the README: docs/figures/NAME.svg and NAME-dark.svg.

    python tools/make_pictures.py
    python tools/make_pictures.py out/identify out/compensate

Without folders, identifies and compensates configs/leuven.yaml first. The first folder gives the loop: the
motion that the model was judged on, beside the model with frozen weights. The second gives the tracking error
without and with compensation. Figures are counted as the runs' own reports count them. Needs matplotlib
(extra `dev`): plotly's own static pictures need a browser.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import matplotlib as mpl
import numpy as np

from rtcomp.cli.main import run
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.judge import friction_of
from rtcomp.kernels import Floats
from rtcomp.report import palette
from rtcomp.report.decimate import path_indices, peak_indices
from rtcomp.report.figures import first_reversal, rms_and_peak
from rtcomp.report.quantities import Scale, scale, typeset, written
from rtcomp.stage.balance import bandwidth
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

mpl.use("svg")
from matplotlib import pyplot as plt  # after the choice of what draws

TOP = Path(__file__).resolve().parent.parent
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.linewidth": 0.7,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "lines.solid_joinstyle": "round",
    "svg.hashsalt": "rtcomp",  # the same data give the same file
    "svg.fonttype": "path",  # and the same look, whatever fonts the reader has
}


@dataclass(frozen=True)
class Loop:
    """Force (N) against position (m), measured and modelled, equal lengths.

    The first `virgin_rows` are the first loading from the virgin state; the error counts from row `counted`.
    """

    position: Floats
    measured: Floats
    model: Floats
    virgin_rows: int = 0
    counted: int = 0


@dataclass(frozen=True)
class Tracking:
    """Tracking error (m) against time (s) of two runs with the same reference."""

    time_without: Floats
    without: Floats
    time_with: Floats
    compensated: Floats


def static_picture(
    path: Path, loop: Loop, tracking: Tracking, *, dark: bool = False, unit: str = "m", force_unit: str = "N"
) -> None:
    """Draw loop and tracking error side by side into `path` (its ending says the format)."""

    def colour(of: str) -> str:
        return palette.DARK[of] if dark else of

    with mpl.rc_context(
        {
            **STYLE,
            "figure.facecolor": colour(palette.PAPER),
            "axes.facecolor": "none",
            "text.color": colour(palette.INK),
            "axes.labelcolor": colour(palette.INK),
            "xtick.color": colour(palette.MUTED),
            "ytick.color": colour(palette.MUTED),
            "axes.edgecolor": colour(palette.AXIS),
            "grid.color": colour(palette.GRID),
        }
    ):
        figure = plt.figure(figsize=(11.5, 4.4), layout="constrained")
        figure.get_layout_engine().set(w_pad=0.12, h_pad=0.06)
        left, right = figure.subfigures(1, 2, width_ratios=[1.0, 1.25])
        for part in (left, right):
            part.set_facecolor("none")
        _draw_loop(left.subplots(), loop, colour, unit, force_unit)
        _draw_tracking(right.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0]), tracking, colour, unit)
        path.parent.mkdir(parents=True, exist_ok=True)
        metadata = {"Date": None, "Creator": "rtcomp"} if path.suffix == ".svg" else None
        figure.savefig(path, metadata=metadata, dpi=160)
        plt.close(figure)


def _label(name: str, drawn_in: Scale) -> str:
    return f"{name} ({typeset(drawn_in.unit)})"


def _title(axes: Any, text: str) -> None:
    axes.set_title(text, loc="left", fontsize=10.5, fontweight="bold", pad=9)


def _room_above(axes: Any, share: float) -> None:
    """Make room for the legend above the curves."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + share * (high - low))


def _draw_loop(axes: Any, loop: Loop, colour: Any, unit: str, force_unit: str) -> None:
    along, up = scale(unit, loop.position), scale(force_unit, loop.measured, loop.model)
    columns = [loop.position, loop.measured, loop.model]
    rest = max(loop.virgin_rows - 1, 0)
    kept = path_indices([c[rest:] for c in columns], 5000) + rest
    looks = (
        (loop.measured, palette.MEASURED, {"lw": 4.2, "alpha": 0.5, "label": "measured"}),
        (loop.model, palette.MODEL, {"lw": 1.3, "label": "model, weights frozen"}),
    )
    for force, of, look in looks:
        x, y = loop.position * along.factor, force * up.factor
        axes.plot(x[kept], y[kept], color=colour(of), **look)
        if rest:
            first = path_indices([c[: loop.virgin_rows] for c in columns], 600)
            thin = {**look, "label": None, "lw": 0.55 * float(look["lw"])}
            axes.plot(x[first], y[first], color=colour(of), ls=(0, (2, 1.2)), **thin)
    model, measured = loop.model[loop.counted :], loop.measured[loop.counted :]
    error = rms_and_peak(model - measured).rms / rms_and_peak(measured).peak * 100.0
    _title(axes, f"Motion it never saw: force to {written(error, '%', 2)} of its peak")
    _room_above(axes, 0.2)
    axes.set_xlabel(_label("Position", along))
    axes.set_ylabel(_label("Friction force", up))
    axes.legend(loc="upper left", frameon=False, handlelength=1.8)


def _draw_tracking(panels: Any, tracking: Tracking, colour: Any, unit: str) -> None:
    both, enlarged = panels
    runs = (
        ("without compensation", tracking.time_without, tracking.without, palette.WITHOUT),
        ("with compensation", tracking.time_with, tracking.compensated, palette.WITH),
    )
    large, small = scale(unit, tracking.without), scale(unit, tracking.compensated)
    sizes = {}
    for name, time, error, of in runs:
        kept = peak_indices([error], 3000)
        sizes[name] = rms_and_peak(error)
        rms, peak = (written(v, unit, printed=True) for v in sizes[name])
        label = f"{name}: rms {rms}, peak {peak}"
        both.plot(time[kept], error[kept] * large.factor, color=colour(of), lw=1.0, label=label)
        if of == palette.WITH:
            enlarged.plot(time[kept], error[kept] * small.factor, color=colour(of), lw=0.7)
    ratio = sizes["without compensation"].rms / sizes["with compensation"].rms
    _title(both, f"Same controller: tracking error {written(ratio, '', 2)} times smaller")
    _room_above(both, 0.42)
    both.legend(loc="upper left", frameon=False, handlelength=1.4, borderaxespad=0.2)
    both.set_ylabel(_label("Error", large))
    enlarged.set_ylabel(_label("enlarged", small))
    enlarged.set_xlabel("Time (s)")
    both.margins(x=0.01)


def read(path: Path) -> tuple[dict[str, Floats], dict[str, Any]]:
    """Return the columns and the metadata of a recording (HDF5 as FORMATS.md has it)."""
    with h5py.File(path, "r") as file:
        columns = {name: np.asarray(item) for name, item in file.items() if isinstance(item, h5py.Dataset)}
        return columns, dict(file.attrs)


def loop_of(folder: Path) -> tuple[Loop, str]:
    """Return measured and modelled friction in a folder of `rtcomp identify`, and the kind of axis."""
    judged = folder / "judge.h5"
    columns, about = read(judged if judged.exists() else folder / "recording.h5")
    stage = Stage.from_dict(json.loads(about["stage"]))
    configured = json.loads(about["configuration"])
    smoothing = float((configured.get("identify") or {}).get("smoothing", 0.0))
    friction = friction_of(
        stage, columns["time"], columns["position"], columns["voltage"], int(about["delay_ticks"]),
        # As the job judges: on unsmoothed motion, but where noise asked for a low cut-off.
        smoothing if 0.0 < smoothing < bandwidth(stage.rate) else 0.0,
    )  # fmt: skip
    force = HysteresisModel.load(folder / "model.yaml").response(friction.position)
    settle = float((configured.get("judge") or {}).get("settle", 0.0))
    counted = int(np.searchsorted(friction.time, friction.time[0] + settle))
    virgin = first_reversal(friction.position)
    return Loop(friction.position, friction.force, force, virgin, counted), stage.axis


def tracking_of(folder: Path) -> Tracking:
    """Return the errors in a folder of `rtcomp compensate`, without what its comparison leaves out."""
    runs = []
    for name in ("without.h5", "with.h5"):
        columns, about = read(folder / name)
        settle = float((json.loads(about["configuration"]).get("compensate") or {}).get("settle", 1.0))
        shown = columns["time"] >= settle
        runs += [columns["time"][shown], (columns["reference"] - columns["position"])[shown]]
    return Tracking(*runs)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("identified", type=Path, nargs="?", help="folder of rtcomp identify")
    parser.add_argument("compensated", type=Path, nargs="?", help="folder of rtcomp compensate")
    parser.add_argument("--out", type=Path, default=TOP / "docs" / "figures")
    parser.add_argument("--name", default="compensation")
    given = parser.parse_args(arguments)
    if given.identified is not None and given.compensated is None:
        parser.error("give both folders, or none")
    with contextlib.ExitStack() as stack:
        if given.identified is None:
            given.identified, given.compensated = stack.enter_context(finished_runs())
        loop, axis = loop_of(given.identified)
        tracking = tracking_of(given.compensated)
    for suffix, dark in (("", False), ("-dark", True)):
        path = given.out / f"{given.name}{suffix}.svg"
        static_picture(
            path, loop, tracking, dark=dark, unit=for_axis("m", axis), force_unit=for_axis("N", axis)
        )
        print(path)


@contextlib.contextmanager
def finished_runs() -> Iterator[tuple[Path, Path]]:
    """Identify and compensate the simulated stage; give both folders while the context lasts."""
    config = str(TOP / "configs" / "leuven.yaml")
    with tempfile.TemporaryDirectory() as place:
        identified, compensated = Path(place) / "identified", Path(place) / "compensated"
        model = ["--model", str(identified / "model.yaml")]
        for command in (
            ["identify", config, "--out", str(identified)],
            ["compensate", config, *model, "--out", str(compensated)],
        ):
            if run(command) != 0:
                raise SystemExit(f"rtcomp {' '.join(command)} did not end well")
        yield identified, compensated


if __name__ == "__main__":
    main()
