"""Families of axes that a trial draws from, each a module of this folder that sets `FAMILY`."""

from __future__ import annotations

import importlib
import pkgutil

from rtcomp.trial.families.family import Family

__all__ = ["FAMILIES", "Family"]


def _found() -> dict[str, Family]:
    modules = (importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__))
    families: list[Family] = [module.FAMILY for module in modules if hasattr(module, "FAMILY")]
    return {family.name: family for family in sorted(families, key=lambda family: family.name)}


FAMILIES: dict[str, Family] = _found()
"""All families, by name."""
