"""What a typed model allows where: its keys, ranges, units, and the nearest valid key to a wrong one."""

from __future__ import annotations

import ast
import difflib
from collections.abc import Iterable
from typing import Any, get_args

import pydantic
from pydantic.fields import FieldInfo

from rtcomp.yamlfile.load import KeyPath

_DEEPEST = 8


def field_at(model: type[pydantic.BaseModel], key: KeyPath) -> FieldInfo | None:
    """Return the model's field for `key`, or None where it has none; a list's items count as its field."""
    models: list[type[pydantic.BaseModel]] = [model]
    found: FieldInfo | None = None
    for part in key:
        if isinstance(part, int):
            continue
        fields = [field for m in models for name, field in _fields(m) if name == part]
        if not fields:
            return None
        found = fields[0]
        models = [m for field in fields for m in _models_in(field.annotation)]
    return found


def about(model: type[pydantic.BaseModel], key: KeyPath) -> str:
    """Return what the field of `key` says of itself, unit first: `` (kg, moving mass)``; or nothing."""
    field = field_at(model, key)
    if field is None:
        return ""
    extra = field.json_schema_extra
    unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
    parts = [part for part in (unit, field.description) if part]
    return f" ({', '.join(parts)})" if parts else ""


def allowed_range(field: FieldInfo | None) -> str:
    """Return the range that the field allows, as ``(0, 10]`` or ``at least 0``, or nothing."""
    if field is None:
        return ""
    bounds: dict[str, Any] = {}
    for constraint in field.metadata:
        for name in ("gt", "ge", "lt", "le"):
            if getattr(constraint, name, None) is not None:
                bounds[name] = getattr(constraint, name)
    low = bounds.get("gt", bounds.get("ge"))
    high = bounds.get("lt", bounds.get("le"))
    if low is not None and high is not None:
        return f"{'(' if 'gt' in bounds else '['}{low:g}, {high:g}{')' if 'lt' in bounds else ']'}"
    if low is not None:
        return f"{'more than' if 'gt' in bounds else 'at least'} {low:g}"
    if high is not None:
        return f"{'less than' if 'lt' in bounds else 'at most'} {high:g}"
    return ""


def nearest_key(model: type[pydantic.BaseModel], wrong: KeyPath) -> tuple[KeyPath | None, list[str]]:
    """Return the valid key most like `wrong`, and the keys that are known in its place.

    Looked for in turn: a like key in the same place, the same key elsewhere, a like key elsewhere.
    """
    last = str(wrong[-1])
    holders: list[type[pydantic.BaseModel]] = [model]
    for part in wrong[:-1]:
        if isinstance(part, int):
            continue
        fields = [field for m in holders for name, field in _fields(m) if name == part]
        holders = [m for field in fields for m in _models_in(field.annotation)]
    known = list(dict.fromkeys(name for m in holders for name, _ in _fields(m)))
    near = _closest(last, known, 0.75)
    if near is not None:
        return (*wrong[:-1], near), known
    everywhere = list(_all_keys(model, (), _DEEPEST))
    names = {str(key[-1]) for key in everywhere}
    elsewhere = _closest(last, names, 0.8)
    weaker = _closest(last, known, 0.55)
    if elsewhere is not None and (weaker is None or _plain(elsewhere) == _plain(last)):
        return min((key for key in everywhere if key[-1] == elsewhere), key=len), known
    return ((*wrong[:-1], weaker) if weaker is not None else None), known


def nearest_choice(value: Any, expected: str) -> str:
    """Return a hint naming the choice most like `value` among pydantic's list of `expected` ones."""
    choices = []
    for word in expected.replace(" or ", ", ").split(", "):
        try:
            choices.append(str(ast.literal_eval(word)))
        except (ValueError, SyntaxError):  # a choice with a comma in it; it is still listed in the message
            continue
    near = _closest(value, choices, 0.6) if isinstance(value, str) else None
    return f"; did you mean {near!r}?" if near is not None and len(choices) > 2 else ""


def _plain(word: str) -> str:
    return word.lower().replace("-", "_")


def _closest(word: str, among: Iterable[str], cutoff: float) -> str | None:
    by_plain = {_plain(name): name for name in among}
    near = difflib.get_close_matches(_plain(word), by_plain, n=1, cutoff=cutoff)
    return by_plain[near[0]] if near else None


def _fields(model: type[pydantic.BaseModel]) -> list[tuple[str, FieldInfo]]:
    return [(field.alias or name, field) for name, field in model.model_fields.items()]


def _models_in(annotation: Any) -> list[type[pydantic.BaseModel]]:
    """Return the models inside an annotation, through unions, lists, mappings and the like."""
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        return [annotation]
    return [m for argument in get_args(annotation) for m in _models_in(argument)]


def _all_keys(model: type[pydantic.BaseModel], at: KeyPath, depth: int) -> Iterable[KeyPath]:
    if depth == 0:
        return
    for name, field in _fields(model):
        yield (*at, name)
        for inner in _models_in(field.annotation):
            yield from _all_keys(inner, (*at, name), depth - 1)
