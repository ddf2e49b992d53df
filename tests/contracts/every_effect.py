"""Every entry of the catalogue in each of its forms, as contracts are tried on it; third parties' too."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import pytest

from rtcomp import physics

ENTRIES = list(physics.entries())


@dataclass(frozen=True)
class InForm:
    """An entry as if it had one form only, other than its first."""

    kind: type[physics.Effect]
    form: str

    @property
    def example(self):
        return {**self.kind.example, "form": self.form}

    @property
    def kernel(self):
        return self.kind.forms[self.form]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.kind, name)


FORMS = [InForm(e, form) for e in ENTRIES for form in list(e.forms)[1:]]
every = pytest.mark.parametrize("entry", ENTRIES, ids=[e.name for e in ENTRIES])
every_form = pytest.mark.parametrize(
    "entry", [*ENTRIES, *FORMS], ids=[*(e.name for e in ENTRIES), *(f"{f.name}-{f.form}" for f in FORMS)]
)


def example(entry, **changes):
    return entry.from_dict({**entry.example, **changes})


def pick(tree, path):
    """The number at `path` of an entry's dictionary."""
    for key in path:
        tree = tree[key]
    return tree


def put(tree, path, value):
    """The dictionary with `value` at `path`."""
    tree = copy.deepcopy(tree)
    pick(tree, path[:-1])[path[-1]] = value
    return tree
