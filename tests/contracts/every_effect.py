"""Every entry of the catalogue, third parties' included, as the contracts are tried on it."""

from __future__ import annotations

import copy

import pytest

from rtcomp import physics

ENTRIES = list(physics.entries())
every = pytest.mark.parametrize("entry", ENTRIES, ids=[e.name for e in ENTRIES])


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
