"""Recordings that others made, diagnosed: Silverbox, Bouc-Wen, EMPS, a DC motor.

    python tools/bench_benchmarks.py DATA --json benchmarks.json

DATA holds `real/silverbox`, `real/bouc-wen`, `real/emps` (nonlinearbenchmark.org), `real/dc-motor`; what it
does not hold is skipped.
The extended stage of Silverbox is simulated from the drive alone on a realisation left out. That of Bouc-Wen
is simulated on a multisine of other phases against the equation with its true numbers, both by the
same integrator at a fine rate. Of the motor only the speed was measured; it is learned on the first two
thirds.
"""

from __future__ import annotations

import gzip
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.kernels import Floats
from rtcomp.recording.reader import Recording
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage

FINER = 16
"""Times the recording's rate at which a band-limited drive is played."""
SILVERBOX = {"mass": 5.34e-3, "viscous": 0.2253, "force_constant": 1.0, "voltage_limit": 10.0}
SPRING = {"name": "parallel-spring", "stiffness": 1019.0}
BOUC_WEN = {"mass": 2.0, "viscous": 10.0, "force_constant": 1.0, "voltage_limit": 1000.0}
TRUE = {"alpha": 5e4, "beta": 1e3, "gamma": 0.8, "delta": -1.1}
MOTOR = {"axis": "rotary", "mass": 0.01, "force_constant": 1.0, "voltage_limit": 12.0}
"""Of which only the inertia is believed, in units of its torque a volt."""
RPM = 2.0 * np.pi / 60.0
EMPS = {"mass": 95.1089, "viscous": 203.5, "force_constant": 35.1507, "voltage_limit": 10.0}


def table(path: Path) -> dict[str, Floats]:
    """Return the columns of a compressed CSV file."""
    with gzip.open(path, "rt", encoding="utf-8") as text:
        found = np.genfromtxt(text, delimiter=",", names=True)
    assert found.dtype.names is not None
    return {name: np.asarray(found[name], dtype=np.float64) for name in found.dtype.names}


def recording(columns: Mapping[str, Floats]) -> Recording:
    """Return columns as a recording of even rate."""
    time_s = columns["time"]
    rate = float((time_s.size - 1) / (time_s[-1] - time_s[0]))
    even = {**columns, "time": np.arange(time_s.size) / rate}
    return Recording(even, rate, {}, Path("benchmark.csv"))


def between(signal: Floats) -> Floats:
    """Return a band-limited signal at FINER times its rate, each value the mean until the next."""
    count = signal.size
    spectrum = np.fft.rfft(signal)
    padded = np.zeros(count * FINER // 2 + 1, dtype=np.complex128)
    padded[: spectrum.size] = spectrum
    fine = np.fft.irfft(padded * FINER, count * FINER)
    return np.asarray(0.5 * (fine + np.roll(fine, -1)))


def played(stage: Stage, drive: Floats, rate: float) -> Floats:
    """Return the position (m, (K,)) of a stage that starts at rest, driven by a band-limited signal (V)."""
    still = stage.with_changes(sensor={"noise": 0.0, "resolution": 0.0})
    simulator, fine = Simulator(still, seed=0), between(drive)
    position = np.empty(drive.size)
    for k, volts in enumerate(fine.tolist()):
        if k % FINER == 0:
            position[k // FINER] = simulator.measure()
        simulator.advance(volts, 1.0 / (rate * FINER))
    return position


def said(found: Diagnosis) -> str:
    """Return the names that a diagnosis gives."""
    return ", ".join(" or ".join(e.names) for e in found.effects) or found.verdict


def timed(belief: dict[str, Any], data: Recording, budget: float) -> tuple[Diagnosis, float]:
    """Return the diagnosis of one recording, and how long it took (s)."""
    began = time.perf_counter()
    found = diagnose(Stage.from_dict({"stage": belief}), [data], budget=budget)
    return found, time.perf_counter() - began


def right(found: Diagnosis, *names: str) -> float:
    """Return 1 where exactly these effects are named, each alone."""
    return float(sorted(e.names for e in found.effects) == sorted((n,) for n in names))


def silverbox(folder: Path, budget: float) -> list[Figure]:
    """Learn on nine realisations, the mean of the drive taken away; simulate the tenth."""
    data = table(folder / "multisine.csv.gz")
    last = 9 * data["time"].size // 10
    mean = float(data["V1"][:last].mean())
    learn = {"time": data["time"][:last], "position": 1e-3 * data["V2"][:last]}
    rate = 1.0 / float(np.median(np.diff(data["time"])))
    figures = []
    for belief, drive, says in (
        ({**SILVERBOX, "effects": [SPRING]}, data["V1"][:last] - mean, "linear belief"),
        (SILVERBOX, data["V1"][:last] - mean, "belief without a spring"),
        ({**SILVERBOX, "effects": [SPRING]}, data["V1"][:last], "mean left in"),
    ):
        found, seconds = timed(belief, recording({**learn, "voltage": drive}), budget)
        wanted = ["parallel-spring"]
        if says == "mean left in":
            alone = {n for e in found.effects for n in e.names} - {"parallel-spring"}
            hit = float(len(found.effects) == 2 and alone <= {"drive-offset", "constant-force", "gravity"})
        else:
            hit = right(found, *wanted)
        figures.append(Figure(f"Silverbox, {says}: named right", hit, "", ">= 1", said(found)))
        figures.append(Figure(f"Silverbox, {says}: time", seconds, "s"))
        offset = mean if says == "mean left in" else 0.0
        left_out = played(found.stage, data["V1"][last:] - mean + offset, rate)
        true = 1e-3 * data["V2"][last:]
        start = true.size // 5  # until the start, which is not at rest in the recording, is forgotten
        error = 1e6 * float(np.sqrt(np.mean((left_out - true)[start:] ** 2)))
        figures.append(
            Figure(f"Silverbox, {says}: simulated, left out", error, "um (mV)", "<= 1", "published 0.3 to 1")
        )
    return figures


def bouc_wen(folder: Path, budget: float) -> list[Figure]:
    """Learn on the noisy benchmark; simulate against its equation on a multisine of other phases."""
    data = table(folder / "train.csv.gz")
    belief: dict[str, Any] = {**BOUC_WEN, "effects": [{"name": "parallel-spring", "stiffness": 1e5}]}
    columns = {"time": data["time"], "position": data["position"], "voltage": data["force"]}
    found, seconds = timed(belief, recording(columns), budget)
    figures = [
        Figure("Bouc-Wen: named right", right(found, "bouc-wen"), "", ">= 1", said(found)),
        Figure("Bouc-Wen: time", seconds, "s"),
    ]
    values = next((e.parameters for e in found.effects if e.names[0] == "bouc-wen"), None)
    if values is None:
        return figures
    number = {name: v.value for name, v in values.items()}
    for sign in (1.0, -1.0):
        product = number["beta"] * (number["gamma"] + sign * number["delta"])
        true = TRUE["beta"] * (TRUE["gamma"] + sign * TRUE["delta"])
        name = f"Bouc-Wen: beta (gamma {'+' if sign > 0 else '-'} delta), relative error"
        figures.append(Figure(name, abs(product / true - 1.0), "", "<= 0.05"))
    rate = 750.0
    random = np.random.default_rng(17)
    count = 8192
    spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
    lines = np.arange(int(5.0 * count / rate), int(150.0 * count / rate) + 1)
    spectrum[lines] = np.exp(2j * np.pi * random.random(lines.size))
    drive = np.fft.irfft(spectrum, count)
    drive *= 50.0 / np.std(drive)
    effects = [{"name": "parallel-spring", "stiffness": 5e4}, {"name": "bouc-wen", **TRUE}]
    truth = Stage.from_dict({"stage": {**BOUC_WEN, "effects": effects}})
    apart = played(found.stage, drive, rate) - played(truth, drive, rate)
    error = float(np.sqrt(np.mean(apart**2)))
    note = "published 7.5e-6, another multisine"
    return [*figures, Figure("Bouc-Wen: simulated, another multisine", error, "m", "<= 2e-6", note)]


def left_in_full(stage: Stage, data: Recording) -> float:
    """Return the relative force error on the reserved parts over the whole band of the force balance."""
    balance = ForceBalance(stage, load_data([data]))
    baseline(balance)
    drive, needed = balance.both_sides(stage)
    rows = balance.reserved[balance.block]
    return float((np.mean((drive - needed)[rows] ** 2) / np.mean(drive[rows] ** 2)) ** 0.5)


def emps(folder: Path, budget: float) -> list[Figure]:
    """Five beliefs of one axis: are the names the same, and what do they leave?"""
    import scipy.io

    data = {k: np.ravel(v) for k, v in scipy.io.loadmat(folder / "DATA_EMPS.mat").items() if k[0] != "_"}
    columns = {"time": data["t"], "position": data["qm"], "voltage": data["vir"], "reference": data["qg"]}
    one = [{"stiffness": 2e6, "reach": 1e-5}]
    two = [{"stiffness": 2e6, "reach": 5e-6}, {"stiffness": 2e5, "reach": 5e-5}]
    off = {k: {**EMPS, "mass": k * EMPS["mass"], "viscous": k * EMPS["viscous"]} for k in (1.08, 0.92)}
    beliefs: dict[str, dict[str, Any]] = {
        "one element": {**EMPS, "friction": one},
        "two elements": {**EMPS, "friction": two},
        "no friction": EMPS,
        "+8 %": {**off[1.08], "friction": one},
        "-8 %": {**off[0.92], "friction": one},
    }
    figures, names = [], []
    for says, belief in beliefs.items():
        found, seconds = timed(belief, recording(columns), budget)
        names.append({n for e in found.effects for n in e.names})
        screw = [e.parameters["period"].value for e in found.effects if "period" in e.parameters]
        note = f"{said(found)}; {seconds:.0f} s" + (f"; periods {screw}" if screw else "")
        full = 100 * left_in_full(found.stage, recording(columns))
        figures.append(Figure(f"EMPS, {says}: left on reserved parts, whole band", full, "%", "<= 2.5", note))
        above = Figure(f"EMPS, {says}: left above the sensor's noise", 100 * found.fit.after, "%")
        figures.append(above)
    same = float(all(n == names[0] for n in names))
    figures.append(Figure("EMPS: the same names from all beliefs", same, "", ">= 1"))
    directed = float(all("asymmetric-viscous-friction" in n for n in names))
    return [*figures, Figure("EMPS: direction-dependent viscous friction named", directed, "", ">= 1")]


def motor(folder: Path) -> dict[str, Floats]:
    """Return time (s), voltage and speed (rad/s) of the motor, and the position (rad) that it adds up to."""
    path = folder / "run_minimal.csv"
    read = np.genfromtxt(path, delimiter=",", names=True, usecols=(0, 1, 2))
    time_s, speed = read["time"], read["rpm"] * RPM
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time_s)
    position = np.append(0.0, np.cumsum(steps))
    return {"time": time_s, "voltage": read["voltage"], "speed": speed, "position": position}


def dc_motor(folder: Path, budget: float) -> list[Figure]:
    """What its author found by hand, and the speed on the last third, simulated from the voltage alone."""
    data = motor(folder)
    rows = data["time"].size
    learned = {k: data[k][: 2 * rows // 3] for k in ("time", "voltage", "position")}
    found, seconds = timed(MOTOR, recording(learned), budget)
    named = {n: e for e in found.effects for n in e.names}
    wanted = {"drive-deadband"}, {"drive-offset", "constant-force"}, {"drive-delay", "sensor-delay"}
    hits = float(sum(bool(one & named.keys()) for one in wanted))
    delay = next((e.parameters["delay"].value for e in named.values() if "delay" in e.parameters), 0.0)
    simulator = Simulator(found.stage.with_changes(sensor={"noise": 0.0, "resolution": 0.0}), seed=0)
    reached = np.empty(rows)
    for k, volts in enumerate(data["voltage"].tolist()):
        reached[k] = simulator.measure()
        simulator.advance(volts, float(data["time"][1] - data["time"][0]))
    apart = np.abs(np.gradient(reached, data["time"]) - data["speed"]) / RPM
    error = float(np.mean(apart[2 * rows // 3 :]))
    note = f"{said(found)}; {seconds:.0f} s"
    return [
        Figure("DC motor: of dead zone, bias, delay named", hits, "of 3", ">= 3", note),
        Figure("DC motor: delay, 0 where none is named", 1e3 * delay, "ms", "", "31 by its author"),
        Figure("DC motor: mean error of speed, last third", error, "rpm", "<= 2.2", "2.2 by its author"),
    ]


@click.command()
@click.argument("data", required=False, type=click.Path(path_type=Path))
@click.option("--budget", default=60.0, show_default=True, help="Seconds for each diagnosis.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(data: Path | None, budget: float, path: Path | None) -> None:
    figures: list[Figure] = []
    cases = (("silverbox", silverbox), ("bouc-wen", bouc_wen), ("emps", emps), ("dc-motor", dc_motor))
    for name, run in cases:
        if data is None or not (data / "real" / name).is_dir():
            click.echo(f"{name} skipped: name the folder that holds real/{name}")
            continue
        figures += run(data / "real" / name, budget)
    if figures:
        show("Recordings that others made", figures, path)


if __name__ == "__main__":
    main()
