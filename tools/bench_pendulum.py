"""The measured servo with a pendulum: diagnosed at two gains, judged at the third by simulated position.

    python tools/bench_pendulum.py DATA --json pendulum.json

DATA holds `real/servo-pendulum`; without it all is skipped. The error is the mean absolute one of position:
of a simulation with the servo's own controller on the recorded reference (as its authors judge, arXiv
2410.08650), and of short simulations from points of the recording, driven by the recorded duty.
"""

from __future__ import annotations

import time
from pathlib import Path

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.positions.windows import Windows
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.simulate import on_reference
from rtcomp.recording.driven import driven
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import YamlFile

GAINS = (100, 200, 400)
DUTY = 2.543
"""Duty per rad of error and unit of gain."""
MAP = {"voltage": "duty", "enabled": "torque_enabled"}
RATE = 200.0
NEAR_REST = {"stribeck", "stiction-ageing"}
"""Names of friction that is larger at rest than in motion."""


def recordings(folder: Path, gain: int) -> list[Recording]:
    """Return all stretches of one gain in which the servo is switched on."""
    files = sorted(folder.glob(f"kp{gain}_*.csv"))
    return [part for path in files for part in driven(read(path, MAP, rate_hz=RATE))]


def rung(done: Diagnosis) -> str:
    """Return the rung of the published ladder that the names amount to."""
    named = {e.names[0] for e in done.effects}
    if "load-dependent-friction" in named:
        load = next(e for e in done.effects if e.names[0] == "load-dependent-friction")
        own, other = load.parameters["coefficient"], load.parameters.get("external")
        directional = other is None or own.low > other.high or other.low > own.high
        if not named & NEAR_REST:
            return "M3 load-dependent" + (", differing by side" if directional else "")
        return "M5 directional" if directional else "M4 Stribeck load-dependent"
    return "M2 Stribeck" if named & NEAR_REST else "M1 Coulomb-viscous"


def in_windows(stage: Stage, windows: Windows) -> float:
    """Return the mean absolute error (mrad) over short windows driven by the recorded duty."""
    return 1e3 * float(np.mean(np.abs(windows.off(stage))))


def in_closed_loop(stage: Stage, data: list[Recording], gain: int) -> float:
    """Return the mean absolute error (mrad) with the servo's own controller on the recorded references."""
    errors = []
    for one in data:
        assert one.reference is not None
        controller = {"kp": DUTY * gain}
        content = {**stage.to_dict(), "controller": controller, "rate": one.rate_hz}
        config = Configuration.of(YamlFile(content, Path("stage")))
        run = on_reference(config, one.reference, float(one.position[0]))
        errors.append(np.mean(np.abs(run.columns["position"] - one.position)))
    return 1e3 * float(np.mean(errors))


def held_out(folder: Path, believed: Stage, learn: tuple[int, ...], judge: int) -> list[Figure]:
    """Diagnose the recordings of the gains `learn`; judge believed, retuned and extended stage at `judge`."""
    began = time.perf_counter()
    done = diagnose(believed, [part for gain in learn for part in recordings(folder, gain)])
    taken = time.perf_counter() - began
    data = recordings(folder, judge)
    balance = ForceBalance(believed, load_data(data))
    baseline(balance)
    windows = Windows.of(balance)
    named = " and ".join(" or ".join(e.names) for e in done.effects)
    retuned = done.retuned_stage or believed
    gains = "+".join(map(str, learn))
    figures = [Figure(f"gains {gains} diagnosed: seconds", taken, "s", "", f"{rung(done)}: {named}")]
    for kind, error in (
        ("windows", lambda s: in_windows(s, windows)),
        ("closed loop", lambda s: in_closed_loop(s, data, judge)),
    ):
        before, refitted, after = error(believed), error(retuned), error(done.stage)
        figures += [
            Figure(f"gain {judge}, {kind}: as believed", before, "mrad"),
            Figure(f"gain {judge}, {kind}: retuned", refitted, "mrad"),
            Figure(f"gain {judge}, {kind}: extended", after, "mrad"),
            Figure(
                f"gain {judge}, {kind}: retuned over extended",
                refitted / after,
                "1",
                "",
                "published: 1.5 to 2.9",
            ),
        ]
    return figures


@click.command()
@click.argument("data", required=False, type=click.Path(path_type=Path))
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(data: Path | None, path: Path | None) -> None:
    if data is None or not (data / "real/servo-pendulum").is_dir():
        click.echo("skipped: name the folder that holds real/servo-pendulum")
        return
    believed = Stage.load(shipped("xl330_pendulum.yaml"))
    figures: list[Figure] = []
    for judge in GAINS:
        learn = tuple(g for g in GAINS if g != judge)
        figures += held_out(data / "real/servo-pendulum", believed, learn, judge)
    show("Servo with a pendulum: position error at a gain that was not diagnosed", figures, path)


if __name__ == "__main__":
    main()
