"""Check what a file holds against a typed model, and say in one line what is wrong and what is allowed."""

from __future__ import annotations

import copy
import json
from typing import Any, TypeVar

import pydantic

from rtcomp.errors import ConfigError
from rtcomp.yamlfile.load import KeyPath, YamlFile, has, one_line
from rtcomp.yamlfile.problems import Problem, from_pydantic, not_finite

M = TypeVar("M", bound=pydantic.BaseModel)
_MISSING = object()


class Section(pydantic.BaseModel):
    """Base of typed sections of a file: unknown keys are errors, values do not change, numbers are finite.

    Give a field its unit with ``Field(description="kg, moving mass")``, or with
    ``Field(json_schema_extra={"unit": "kg"})``; errors state it.
    """

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def validate(model: type[M], file: YamlFile, section: KeyPath = ()) -> M:
    """Check the file's `section` (default: all of it) against `model` and return the model's instance.

    Types are strict: text is not a number and a number is not a truth value, but an integer is a number,
    and a number without a fraction (``1e3``) an integer. NaN and infinity are refused everywhere.

    Raises ConfigError ``FILE:LINE: key is value; what is allowed``; other wrong keys follow in brief.
    """
    data = file.get(section, _MISSING)
    if data is _MISSING:
        raise file.error(section, "is missing") from None
    problems = not_finite(data, section)
    try:
        result = _lenient_integers(model, data)
    except pydantic.ValidationError as error:
        known = {problem.key for problem in problems}
        found = from_pydantic(error, model, data, section)
        problems += [problem for problem in found if problem.key not in known]
    else:
        if not problems:
            return result
    raise _combined(file, problems) from None


def _lenient_integers(model: type[M], data: Any) -> M:
    """Validate strictly, taking floats without a fraction for integers where integers are wanted."""
    try:
        return _strict(model, data)
    except pydantic.ValidationError as error:
        places = [
            e["loc"]
            for e in error.errors(include_url=False)
            if e["type"] in ("int_type", "int_from_float")
            and isinstance(e["input"], float)
            and e["input"].is_integer()
        ]
        if not places:
            raise
    data = copy.deepcopy(data)
    for place in places:
        _make_integer(data, place)
    return _strict(model, data)


def _is_whole(value: Any) -> bool:
    return isinstance(value, float) and value.is_integer()


def _strict(model: type[M], data: Any) -> M:
    # Through JSON, since only there strictness lets text be an enumeration or a path, and a list a tuple.
    return model.model_validate_json(json.dumps(data), strict=True)


def _make_integer(data: Any, place: KeyPath) -> None:
    holder: Any = None
    last: str | int = ""
    for part in place:
        if has(data, part):  # other parts name a branch of a union
            holder, last, data = data, part, data[part]
    if holder is not None and isinstance(data, float):
        holder[last] = int(data)


def _combined(file: YamlFile, problems: list[Problem]) -> ConfigError:
    problems = sorted(problems, key=lambda p: (file.line(p.key), p.says))
    first, rest = problems[0], problems[1:]
    text = f"{file.at(first.key)}: {first.says}"
    if rest:
        others = "; ".join(f"line {file.line(p.key)} {p.brief}" for p in rest[:3])
        text += f" (and {len(rest)} more: {others}{'; ...' if len(rest) > 3 else ''})"
    return ConfigError(one_line(text))
