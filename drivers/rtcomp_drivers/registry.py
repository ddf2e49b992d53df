"""Drivers by name, found through the entry-point group ``rtcomp.drivers`` and imported only when asked for.

A third party's driver is a package of its own with, in its pyproject.toml::

    [project.entry-points."rtcomp.drivers"]
    mine = "my_package.my_module:MyDriver"
"""

from __future__ import annotations

import difflib
import importlib.metadata
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtcomp.errors import ConfigError

if TYPE_CHECKING:
    from rtcomp.loop.device import Device
    from rtcomp.yamlfile import YamlFile
    from rtcomp_drivers.driver import Bench, Driver

GROUP = "rtcomp.drivers"


@dataclass(frozen=True)
class Setting:
    """One key of a driver's settings."""

    name: str
    type: str
    default: Any
    """None where there is none."""
    required: bool
    says: str


@dataclass(frozen=True)
class Description:
    """A driver, for `rtcomp drivers`."""

    name: str
    module: str
    says: str
    """What it is, one line; where it cannot be imported, why."""
    settings: list[Setting] = field(default_factory=list)
    available: bool = True


def names() -> list[str]:
    """Return the names of all installed drivers, without importing any."""
    return sorted(_entries())


def find(name: str) -> type[Driver]:
    """Import and return the driver class `name`; raise ConfigError where there is none or it cannot load."""
    entries = _entries()
    if name not in entries:
        near = difflib.get_close_matches(str(name), entries, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        known = ", ".join(sorted(entries))
        raise ConfigError(f"device: unknown driver {name!r}; {hint}installed are {known}")
    try:
        found: type[Driver] = entries[name].load()
    except (ImportError, AttributeError) as error:
        value = entries[name].value
        raise ConfigError(f"device: driver {name!r} cannot be loaded from {value}: {error}") from error
    return found


def create(
    settings: Mapping[str, Any], bench: Bench, file: YamlFile | None = None, section: str = "device"
) -> Device:
    """Build the device that a configuration's section `device` asks for; it is not opened.

    `settings` is ``{driver: NAME, setting: value, ...}``; where `file` is given, which holds it as its
    `section`, errors name file and line. Raises ConfigError.
    """
    from rtcomp.yamlfile import YamlFile, validate

    if file is None:
        file = YamlFile({section: dict(settings)}, Path("configuration"))
    name = settings.get("driver")
    if not isinstance(name, str):
        wrong = "is missing" if name is None else f"is {name!r}, not a name"
        raise file.error((section, "driver"), f"{wrong}; installed are {', '.join(names())}")
    try:
        driver = find(name)
    except ConfigError as error:
        raise file.error((section, "driver"), str(error).removeprefix("device: ")) from error
    checked = validate(driver.Settings, file, (section,))
    try:
        return driver(checked, bench)
    except ConfigError as error:
        if not error.key:
            raise
        says = str(error).removeprefix("device: ").removeprefix(f"{error.key[-1]} ")
        raise file.error((section, *error.key), says) from error


def describe() -> list[Description]:
    """Describe every installed driver, one that cannot be imported too."""
    descriptions = []
    for name, entry in sorted(_entries().items()):
        try:
            descriptions.append(_describe(name, find(name)))
        except ConfigError as error:
            descriptions.append(Description(name, entry.module, str(error), available=False))
    return descriptions


def _describe(name: str, driver: type[Driver]) -> Description:
    from rtcomp_drivers.driver import says_of

    settings = []
    for key, about in driver.Settings.model_fields.items():
        if key == "driver":
            continue
        kind = about.annotation.__name__ if isinstance(about.annotation, type) else str(about.annotation)
        required = about.is_required()
        default = None if required else about.get_default(call_default_factory=True, validated_data={})
        settings.append(Setting(key, kind, default, required, about.description or ""))
    return Description(name, driver.__module__, says_of(driver), settings)


def _entries() -> dict[str, importlib.metadata.EntryPoint]:
    return {entry.name: entry for entry in importlib.metadata.entry_points(group=GROUP)}
