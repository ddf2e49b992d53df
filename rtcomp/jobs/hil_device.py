"""What a loop finds on each link of a plant server: the section `device`, and a patient configuration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rtcomp_drivers.plant_links import LINKS
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.errors import ConfigError, nearest
from rtcomp.jobs.configuration import Configuration

NO_MATTER = 1_000_000_000
"""Slots that may be lost: a busy machine must not end a run whose verdicts say how many were."""
_MISSED = 20_000
_CONNECT_S = 10.0


def device_on(link: str, port: str, watchdog: float, axis: str, *, prove: bool = True) -> dict[str, Any]:
    """Return the section `device` for the plant server of `link` at `port`, and a `watchdog` (s).

    Nodes, bit rate and screw are the plant server's own. Missing samples do not end a run here: `limits.age`
    does. `prove` has a drive whose watchdog cannot be read back prove it whenever it is opened.
    """
    common: dict[str, Any] = {
        "driver": link, "watchdog": watchdog, "max_missed": _MISSED, "connect_timeout": _CONNECT_S,
    }  # fmt: skip
    if link not in LINKS:
        raise ConfigError(f"hil: unknown link {link!r}; {nearest(link, LINKS)}")
    if link == "serial":
        return {**common, "port": port}
    common |= {"interface": "slcan", "channel": port, "bitrate": 1_000_000}
    if link == "odrive-can":
        from rtcomp_drivers.odrive_axis import LEAD

        lead = {"lead": LEAD} if axis == "linear" else {}
        return {**common, **lead, "check_watchdog": prove, "heartbeat_timeout": 10.0}
    return {**common, "node": 5}


def plant_on(link: str, stage: Path, watchdog: float, *, seed: int = 0) -> PlantProcess:
    """Start the plant server of `link` with the stage in the file `stage`, in a process of its own."""
    own = watchdog if link == "odrive-can" else None  # on the others the host sets it
    return PlantProcess(stage, link=link, watchdog=own, seed=seed)


def patient(config: Configuration, device: dict[str, Any], age: float, **limits: Any) -> Configuration:
    """Return `config` on `device`, with `limits.age` (s) and other limits, that lost slots do not end."""
    data = config.file.data
    given = {**(data.get("limits") or {}), "age": age, **limits}
    if "invalid" in given:  # an age shorter than it would leave it without effect, which is refused
        given["invalid"] = min(given["invalid"], given["age"])
    return config.changed(
        device=device,
        limits=given,
        loop={**(data.get("loop") or {}), "slots_lost": NO_MATTER},
    )
