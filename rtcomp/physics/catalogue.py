"""The catalogue: every effect by its name. `rtcomp.physics` fills it by importing the families."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from rtcomp.errors import ConfigError, nearest
from rtcomp.physics.effect import Effect

E = TypeVar("E", bound=type[Effect])
_ENTRIES: dict[str, type[Effect]] = {}


def register(effect: E) -> E:
    """Class decorator: put an effect into the catalogue under its name."""
    if effect.name in _ENTRIES:
        raise ValueError(f"the catalogue already has an effect named {effect.name!r}")
    _ENTRIES[effect.name] = effect
    return effect


def entry(name: str) -> type[Effect]:
    """Return the effect class of that name; raise ConfigError naming the nearest where there is none."""
    if name not in _ENTRIES:
        raise ConfigError(f"no effect is named {name!r}; {nearest(name, _ENTRIES)}", key=("name",))
    return _ENTRIES[name]


def build(description: Mapping[str, Any]) -> Effect:
    """Build an effect from ``{name: ..., parameter: value, ...}``."""
    rest = dict(description)
    name = rest.pop("name", None)
    if not isinstance(name, str):
        found = f"it is {name!r}" if name is not None else f"found {', '.join(map(repr, rest)) or 'nothing'}"
        raise ConfigError(f"an effect needs a name; {found}", key=("name",))
    return entry(name).from_dict(rest)


def entries() -> Iterator[type[Effect]]:
    """Go through all entries, by place and name."""
    yield from sorted(_ENTRIES.values(), key=lambda e: (e.place, e.name))
