"""Pydantic's errors in this project's words: key, value, what is allowed, and the nearest valid key."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pydantic

from rtcomp.errors import ConfigError
from rtcomp.yamlfile.keys import about, allowed_range, field_at, nearest_choice, nearest_key
from rtcomp.yamlfile.load import KeyPath, dotted, has, one_line

_WANTED = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "string": "text",
    "list": "a list",
    "tuple": "a list",
    "dict": "a mapping of keys",
    "model": "a mapping of keys",
    "model_attributes": "a mapping of keys",
    "dataclass": "a mapping of keys",
    "path": "a path",
    "none_required": "empty",
}
_BOUND = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
    "multiple_of": ("multiple_of", "a multiple of"),
}


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a file."""

    key: KeyPath
    says: str
    """The whole message, without file and line."""
    brief: str
    """A few words, for the tail of a message about several problems."""
    suggests: KeyPath | None = None
    """The valid key that an unknown one was probably meant to be."""


def not_finite(data: Any, at: KeyPath) -> list[Problem]:
    """Find every NaN and infinity in `data`."""
    if isinstance(data, dict):
        return [p for key, item in data.items() for p in not_finite(item, (*at, key))]
    if isinstance(data, list):
        return [p for i, item in enumerate(data) for p in not_finite(item, (*at, i))]
    if isinstance(data, float) and not math.isfinite(data):
        return [_problem(at, f"is {data}; it must be a finite number", f"is {data}")]
    return []


def from_pydantic(
    error: pydantic.ValidationError, model: type[pydantic.BaseModel], data: Any, section: KeyPath
) -> list[Problem]:
    """Turn a validation error of `data` against `model` into problems, likeliest branch of a union only."""
    details = [dict(e) for e in error.errors(include_url=False)]
    placed = [_Placed.of(detail, data) for detail in details]
    problems = [_translate(group, model, section) for group in _choose_branches(placed)]
    suggested = {p.suggests for p in problems if p.suggests is not None}
    missing = {p.key for p in problems if p.brief.endswith(" is missing")}
    return [p for p in problems if not (p.key in missing and p.key in suggested)]


@dataclass(frozen=True)
class _Placed:
    """A pydantic error with its place in the data, apart from the union's branch that reported it."""

    detail: dict[str, Any]
    key: KeyPath
    union: KeyPath | None
    branch: str

    @classmethod
    def of(cls, detail: dict[str, Any], data: Any) -> _Placed:
        key: list[str | int] = []
        union: KeyPath | None = None
        branch = ""
        loc: Sequence[str | int] = detail["loc"]
        for n, part in enumerate(loc):
            if has(data, part):
                data = data[part]
                key.append(part)
            elif detail["type"] == "missing" and n == len(loc) - 1:
                key.append(part)
            elif union is None:
                union, branch = tuple(key), str(part)
        return cls(detail, tuple(key), union, branch)


def _choose_branches(placed: list[_Placed]) -> list[list[_Placed]]:
    """Keep, of each union, the branch that came furthest; errors alone stay alone."""
    unions: dict[KeyPath, dict[str, list[_Placed]]] = {}
    groups: list[list[_Placed]] = []
    for item in placed:
        if item.union is None:
            groups.append([item])
        else:
            unions.setdefault(item.union, {}).setdefault(item.branch, []).append(item)
    for branches in unions.values():
        depth = {name: min(len(item.key) for item in items) for name, items in branches.items()}
        best = max(depth.values())
        ahead = [items for name, items in branches.items() if depth[name] == best]
        # A branch that only wanted another kind of value says less than one that looked inside.
        ahead = [items for items in ahead if not all(_wanted(i.detail) for i in items)] or ahead
        if len(ahead) > 1 and all(len(items) == 1 and _wanted(items[0].detail) for items in ahead):
            groups.append([items[0] for items in ahead])
        else:
            groups += [[item] for item in min(ahead, key=len)]
    return groups


def _wanted(detail: Mapping[str, Any]) -> str | None:
    """Return the kind of value that was wanted, where the error is about the kind."""
    name = str(detail["type"])
    for ending in ("_type", "_parsing", "_from_float"):
        if name.endswith(ending):
            return _WANTED.get(name.removesuffix(ending))
    return _WANTED.get(name)


def _translate(group: list[_Placed], model: type[pydantic.BaseModel], section: KeyPath) -> Problem:
    detail, inner = group[0].detail, group[0].key
    key = (*section, *inner)
    kind = str(detail["type"])
    context: Mapping[str, Any] = detail.get("ctx") or {}
    behind = about(model, inner)
    value = _shown(detail.get("input"))
    if kind == "missing":
        return _problem(key, f"is missing{behind}", "is missing")
    if kind == "extra_forbidden":
        return _unknown(model, section, inner)
    wanted = [w for w in (_wanted(item.detail) for item in group) if w]
    if wanted:
        wants = " or ".join(dict.fromkeys(wanted))
        return _problem(key, f"is {value}; it must be {wants}{behind}", f"is {value}")
    if kind == "finite_number":
        return _problem(key, f"is {value}; it must be a finite number{behind}", f"is {value}")
    if kind in _BOUND:
        name, words = _BOUND[kind]
        allowed = allowed_range(field_at(model, inner)) or f"{words} {context[name]:g}"
        return _problem(key, f"is {value}; allowed is {allowed}{behind}", f"is {value}")
    if kind in ("literal_error", "enum"):
        hint = nearest_choice(detail.get("input"), str(context["expected"]))
        return _problem(key, f"is {value}; allowed is {context['expected']}{hint}", f"is {value}")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        name = str(context["discriminator"]).strip("'")
        if kind == "union_tag_not_found":
            return _problem((*key, name), "is missing", "is missing")
        hint = nearest_choice(context["tag"], str(context["expected_tags"]))
        says = f"is {context['tag']!r}; allowed is {context['expected_tags']}{hint}"
        return _problem((*key, name), says, f"is {context['tag']!r}")
    if kind in ("too_short", "too_long"):
        bound = (
            f"at least {context['min_length']}" if kind == "too_short" else f"at most {context['max_length']}"
        )
        count = context.get("actual_length")
        return _problem(key, f"has {count} entries; it must have {bound}", f"has {count} entries")
    if kind in ("value_error", "assertion_error"):
        cause = context.get("error")
        message = one_line(str(cause if cause is not None else detail["msg"]))
        message = message.removeprefix(f"{key[-1]}: ") if key else message
        if isinstance(cause, ConfigError):
            key = (*key, *cause.key)
        return Problem(key, f"{dotted(key)}: {message}" if key else message, dotted(key) or message)
    message = one_line(str(detail["msg"]))
    return _problem(key, f"is {value}; {message[:1].lower()}{message[1:]}", f"is {value}")


def _unknown(model: type[pydantic.BaseModel], section: KeyPath, inner: KeyPath) -> Problem:
    key = (*section, *inner)
    brief = f"unknown key {dotted(key)}"
    near, known = nearest_key(model, inner)
    if near is not None:
        meant = (*section, *near)
        return Problem(
            key,
            f"unknown key {dotted(key)}; did you mean {dotted(meant)}?",
            f"unknown key {dotted(key)}",
            meant,
        )
    hint = f"; known here are {', '.join(known)}" if known else ""
    return Problem(key, brief + hint, brief)


def _problem(key: KeyPath, says: str, brief: str) -> Problem:
    name = dotted(key) or "the file"
    return Problem(key, f"{name} {says}", f"{name} {brief}")


def _shown(value: Any) -> str:
    if value is None:
        return "empty"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:g}"
    text = one_line(repr(value))
    return text if len(text) <= 60 else text[:57] + "..."
