"""Effects that take a list besides their plain parameters: friction elements, harmonics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from rtcomp.errors import ConfigError, nearest
from rtcomp.kernels import Floats
from rtcomp.physics.effect import Effect


class ListEffect(Effect):
    """An effect with parameters and one list, each item of which has the parameters `element`.

    Items are mappings ``{stiffness: ..., reach: ...}`` or tuples in the order of `element`.
    """

    list_name: ClassVar[str] = "elements"
    list_needed: ClassVar[bool] = True
    """False where the list may be empty or left out."""
    list_owner: ClassVar[str] = "friction"
    """What a message calls the list: ``friction[2]: reach is ...``."""

    def __init__(self, elements: Sequence[Any] = (), **values: Any) -> None:
        super().__init__(**values)
        if self.list_needed and not elements:
            inside = ", ".join(q.name for q in self.element)
            raise ConfigError(
                f"{self.name}: {self.list_owner} is empty; give at least one element {{{inside}}}",
                key=(self.list_name,),
            )
        self.elements = [self._located_item(i, item) for i, item in enumerate(elements)]

    def _names(self) -> list[str]:
        return [*super()._names(), self.list_name]

    def _located_item(self, index: int, item: Any) -> tuple[float, ...]:
        try:
            return self._item(index, item)
        except ConfigError as error:
            raise error.inside(self.list_name, index) from None

    def _item(self, index: int, item: Any) -> tuple[float, ...]:
        owner = f"{self.list_owner}[{index}]"
        names = [q.name for q in self.element]
        if isinstance(item, Mapping):
            for key in item:
                if key not in names:
                    raise ConfigError(
                        f"{owner}: unknown parameter {key!r}; {nearest(key, names)}", key=(key,)
                    )
            found = {**{q.name: q.default for q in self.element}, **item}
        elif isinstance(item, Sequence) and not isinstance(item, str) and len(item) == len(names):
            found = dict(zip(names, item, strict=True))
        else:
            raise ConfigError(f"{owner} is {item!r}; it must be {{{', '.join(names)}}}")
        for q in self.element:
            if found.get(q.name) is None:
                raise ConfigError(f"{owner}: parameter {q.name!r} ({q.unit}) is missing", key=(q.name,))
        return tuple(q.check(found[q.name], owner) for q in self.element)

    def vector(self) -> Floats:
        """Return the plain parameters, the count of items, then the items one after the other."""
        return np.concatenate([super().vector(), [float(len(self.elements))], np.ravel(self.elements)])

    def to_dict(self) -> dict[str, Any]:
        """Return the entry in long form; an empty list is left out."""
        items = [dict(zip((q.name for q in self.element), item, strict=True)) for item in self.elements]
        return {**super().to_dict(), **({self.list_name: items} if items else {})}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> ListEffect:
        """Build the effect from a stage file's entry (without its name)."""
        rest = dict(entry)
        items = rest.pop(cls.list_name, ())
        if not isinstance(items, Sequence) or isinstance(items, str):
            raise ConfigError(
                f"{cls.name}: {cls.list_name} is {items!r}; it must be a list", key=(cls.list_name,)
            )
        if "elements" in rest:
            raise ConfigError(
                f"{cls.name}: unknown parameter 'elements'; its list is {cls.list_name!r}", key=("elements",)
            )
        return cls(items, **rest)

    def __repr__(self) -> str:
        inner = ", ".join([f"{len(self.elements)} {self.list_name}", *self._shown()])
        return f"{type(self).__name__}({inner})"
