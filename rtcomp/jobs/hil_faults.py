"""Faults put into a loop that runs against a plant server, and what must come of each.

What the output did is read from the plant's own account, by its clock.
"""

from __future__ import annotations

import math
import random
import signal
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.faults import Fault
from rtcomp_drivers.registry import create

from rtcomp.errors import ConfigError, DeviceError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.follow import where_it_stands
from rtcomp.jobs.forked_loop import RUNNING_TICKS, ForkedLoop
from rtcomp.jobs.hil_device import device_on, patient, plant_on
from rtcomp.jobs.session import make_device
from rtcomp.loop.device import Armable
from rtcomp.loop.realtime import realtime_process

FAULTS = {
    "kill": "SIGKILL of the loop's process",
    "stop": "SIGSTOP of the loop's process, let go on later",
    "estop": "emergency stop: the stop file appears",
    "unplug": "the plant server's process is killed",
    "nan": "a position that is no number",
    "jump": "a position beyond what the limits let an axis do",
    "frozen": "one sample again and again, called new",
    "silent": "no sample comes any more",
    "beam": "the device says that its position must not be used",
}
"""Every fault, with what it is."""
_IN_LOOP = {
    "nan": ("not a number", "DeviceError", "reported the position"),
    "jump": ("jump", "LimitError", "position"),
    "frozen": ("frozen", "DeviceError", "stands still"),
    "silent": ("no reply", "DeviceTimeoutError", "no new sample"),
    "beam": ("beam lost", "DeviceError", "must not be used"),
}
"""Kind of `rtcomp_drivers.faults`, the error that must end the run, words in it."""
_BY_SIGNAL = {"kill": signal.SIGKILL, "stop": signal.SIGSTOP}
_ATTEMPTS = 4
"""A machine that keeps the loop from running ends it before the fault goes in: then once more."""
_LOOP_S = 20.0
_PATIENCE_S = 30.0
_LATEST_S = 0.4
"""s after it runs, at most, until a fault goes in."""
_SETTLE_S = 0.2
_LOOKS = 40
_TICKS_MORE = 2


@dataclass(frozen=True)
class Seen:
    """What came of one fault on one link: verdicts as (what, required, seen, whether it holds)."""

    link: str
    fault: str
    verdicts: list[tuple[str, str, str, bool]]
    attempts: int = 1
    """Times that it was tried: before, the machine had kept the loop for too long."""


@dataclass
class _Trial:
    """What one attempt has left to be judged."""

    told: dict[str, Any]
    status: int | None
    began: float
    """s, monotonic, as all times here."""
    at: float
    """When the fault was there."""
    looked: float
    """When a new host came."""
    refused: bool = False
    moved: float = math.nan
    account: dict[str, Any] | None = None


def faults_named(names: tuple[str, ...]) -> list[str]:
    """Return the faults that `names` ask for (``all``, ``none`` or their names); raise ConfigError."""
    if "none" in names:
        if len(set(names)) > 1:
            raise ConfigError("hil: --fault none and others are both given; leave one of them out")
        return []
    return list(FAULTS) if "all" in names else list(dict.fromkeys(names))


def provoke(
    config: Configuration,
    stage: Path,
    link: str,
    fault: str,
    watchdog: float,
    model: HysteresisModel,
    seed: int,
) -> Seen:
    """Put `fault` into a loop over `link` at a moment drawn with `seed`, against a plant of its own.

    `stage` is the file whose stage moves, `watchdog` (s) the device's. Raises DeviceError where this machine
    does not let a loop live until the fault goes in.
    """
    draw = random.Random(f"{link} {fault} {seed}")
    for attempt in range(_ATTEMPTS):
        trial = _attempt(config, stage, link, fault, watchdog, model, draw)
        if trial is not None:
            return Seen(link, fault, _judge(config, fault, watchdog, trial), attempt + 1)
    raise DeviceError(
        f"hil: {link}: {_ATTEMPTS} loops ended before the fault {fault!r} went in; this machine keeps "
        f"the loop for longer than {watchdog:g} s: give a longer --watchdog, or see `rtcomp doctor`"
    )


def _attempt(
    config: Configuration, stage: Path, link: str, fault: str, watchdog: float, model: HysteresisModel,
    draw: random.Random,
) -> _Trial | None:  # fmt: skip
    with tempfile.TemporaryDirectory() as folder, plant_on(link, stage, watchdog) as plant:
        stop_file = Path(folder, "stop")
        here = patient(
            config, device_on(link, plant.port, watchdog, config.stage.axis), watchdog,
            **({"stop_file": str(stop_file)} if fault == "estop" else {}),
        )  # fmt: skip
        start = where_it_stands(make_device(here))
        moment = draw.uniform(0.0, _LATEST_S)
        with ForkedLoop(
            here, here.reference("", start), _LOOP_S, model, _faults(here, fault, moment)
        ) as loop:
            if not loop.wait_for("fault" if fault in _IN_LOOP else "running", _PATIENCE_S):
                return None
            began = loop.told["running"]
            if fault in _IN_LOOP:
                at = loop.told["fault"]
            else:
                time.sleep(moment)
                if loop.wait_for("ended", 0.0):
                    return None
                at = _strike(fault, loop, plant, stop_file)
            if fault in _BY_SIGNAL:
                time.sleep(watchdog + _SETTLE_S)
                if fault == "stop":
                    loop.signal(signal.SIGCONT)
            status = loop.join(_PATIENCE_S)
            trial = _Trial(loop.told, status, began, at, time.monotonic())
        if fault != "unplug":
            time.sleep(_SETTLE_S)
            trial.looked = time.monotonic()
            stop_file.unlink(missing_ok=True)
            trial.refused = fault in _BY_SIGNAL and _refuses(here)
            trial.moved = _moved_by_arming(here)
            trial.account = plant.stop()
        return trial


def _faults(config: Configuration, fault: str, moment: float) -> list[Fault]:
    if fault not in _IN_LOOP:
        return []
    size = {"nan": math.nan, "jump": jump_size(config)}.get(fault, 0.0)
    at = RUNNING_TICKS + 1 + round(moment * config.stage.rate)
    return [Fault(_IN_LOOP[fault][0], at, size=size)]


def jump_size(config: Configuration) -> float:
    """Return a jump (m) beyond what the limits let an axis do. Raises ConfigError without limits."""
    limits = config.run.limits
    sizes = []
    if limits.jump is not None:
        sizes.append(3.0 * limits.jump)
    if limits.speed is not None:
        sizes.append(20.0 * limits.speed * config.period)
    if limits.travel is not None:
        sizes.append(2.0 * (limits.travel[1] - limits.travel[0]))
    if not sizes:
        raise ConfigError(
            f"{config.path}: nothing in section limits would notice a jump of the encoder; give limits.jump, "
            "speed or travel, or leave --fault jump out"
        )
    return min(sizes)


def _strike(fault: str, loop: ForkedLoop, plant: Any, stop_file: Path) -> float:
    if fault in _BY_SIGNAL:
        return loop.signal(_BY_SIGNAL[fault])
    at = time.monotonic()
    if fault == "estop":
        stop_file.touch()
    else:
        plant.kill()
    return at


def _open_host(config: Configuration, clear: bool) -> Any:
    settings = {**config.run.device, "clear_fault": clear}
    device = create(settings, Bench(stage=config.stage, period=config.period, realtime=True))
    device.open()
    return device


def _refuses(config: Configuration) -> bool:
    """Whether a new host goes no further than the fault that the device's watchdog has latched."""
    try:
        _open_host(config, clear=False).close()
    except DeviceError:
        return True
    return False


def _moved_by_arming(config: Configuration) -> float:
    """Return how far (m) arming and zero volts move the axis, with the fault cleared as a person would."""
    with realtime_process():
        device = _open_host(config, clear=True)
        try:
            if isinstance(device, Armable):
                before = [device.look().position for _ in range(_LOOKS)]
                device.arm()
            else:
                before = [device.exchange(0.0).position]
            after = []
            for _ in range(_LOOKS):
                after.append(device.exchange(0.0).position)
                time.sleep(config.period)
        finally:
            device.close()
    return abs(float(np.mean(after)) - float(np.mean(before)))


def _judge(
    config: Configuration, fault: str, watchdog: float, trial: _Trial
) -> list[tuple[str, str, str, bool]]:
    verdicts = []
    if (zero := _zeroed(config, fault, watchdog, trial)) is not None:
        verdicts.append(zero)
    if (end := _ended(fault, watchdog, trial)) is not None:
        verdicts.append(end)
    if fault in _BY_SIGNAL:
        seen = "refused" if trial.refused else "went on"
        verdicts.append(("a new host, nothing cleared", "refused", seen, trial.refused))
    if trial.account is not None:
        most = still(config)
        verdicts.append(
            (
                "moved by arming again",
                f"<= {1e9 * most:.3g} nm",
                f"{1e9 * trial.moved:.3g} nm",
                trial.moved <= most,
            )
        )
    return verdicts


def still(config: Configuration) -> float:
    """Return how far (m, rad) a mean of positions may be off another though nothing has moved."""
    sensor = config.stage.sensor
    learned = float(np.max(config.basis().scales()))
    return max(10.0 * (sensor.noise + sensor.resolution), 1e-3 * learned)


def _zeroed(
    config: Configuration, fault: str, watchdog: float, trial: _Trial
) -> tuple[str, str, str, bool] | None:
    """Judge when the plant's output went to zero, of what the plant server says."""
    if trial.account is None:
        return None
    began, lost = trial.account["started_monotonic_s"], trial.account["lost_s"]
    mine = [z for z in trial.account["zeroings"] if trial.began - lost <= began + z["time"] <= trial.looked]
    ms = 1e3 * watchdog
    if fault in _BY_SIGNAL:  # by the device's own clock: from the last command that it acted on
        what, allowed = "zero at the plant, after the last command", watchdog + _TICKS_MORE * config.period
        if not mine:
            return what, f"<= {ms:g} ms, by its watchdog", "not", False
        silent, cause = mine[-1]["since_command"], mine[-1]["cause"]
        return (
            what, f"<= {ms:g} ms, by its watchdog", f"{1e3 * silent:.1f} ms, {cause}",
            cause == "watchdog" and silent <= allowed,
        )  # fmt: skip
    what = "zero at the plant, after the fault"
    allowed = watchdog + (watchdog if fault == "silent" else 0.0)  # limits.age is the watchdog's time here
    required = f"<= {1e3 * allowed:g} ms"
    if not mine:
        return what, required, "not", False
    after = max(0.0, began + mine[-1]["time"] - trial.at)
    return what, required, f"{1e3 * after:.1f} ms, {mine[-1]['cause']}", after <= allowed + lost


def _ended(fault: str, watchdog: float, trial: _Trial) -> tuple[str, str, str, bool] | None:
    """Judge how the loop ended."""
    if fault == "kill":
        return None
    error, says = trial.told.get("error", "nothing"), trial.told.get("says", "")
    what, words = "the run ends by", ""
    match fault:
        case "stop" | "unplug":
            required, good = "an error of the device", error.startswith("Device")
        case "estop":
            required, good = "the emergency stop", error == "EmergencyStopError"
        case _:
            _, required, words = _IN_LOOP[fault]
            good = error == required and words in says
    return what, required, _brief(says) or error, good and trial.status == 2 and "\n" not in says


def _brief(says: str) -> str:
    """Return what an error's line says happened, without where and what to do."""
    return says.split(" at tick ")[0].split("; ")[0]
