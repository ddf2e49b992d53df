"""Write YAML that every reader reads back alike: numbers with a dot and a signed exponent, units behind."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from rtcomp.errors import ConfigError, RtcompError
from rtcomp.yamlfile.load import KeyPath, dotted, parse_yaml

_WIDTH = 100
_SMALL = 4
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*(?: [A-Za-z0-9_./-]+)*")


def dump_yaml(
    path: str | Path | None, data: Mapping[str, Any], comments: Mapping[str, str] | None = None
) -> str:
    """Write `data` as YAML to `path` (to nowhere where it is None) and return the text.

    `comments` puts a remark, usually the unit, behind keys: named in full (``"stage.mass"``) or by the last
    word (``"mass"``). Keys keep their order. Numbers read back exactly; numpy scalars and arrays are written
    as numbers and lists. Small mappings of scalars, and lists, are written in flow style. The file is
    replaced in one step.

    Raises ConfigError for NaN, infinity or a type that YAML files here do not hold.
    """
    text = "".join(f"{line}\n" for line in _mapping(dict(data), (), comments or {}))
    if path is not None:
        write_text(path, text)
    return text


def write_text(path: str | Path, text: str) -> None:
    """Write a text file so that at every moment the old or the new one stands there, complete.

    Raises RtcompError where the file cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        try:
            with temporary.open("w", encoding="utf-8", newline="\n") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RtcompError(f"{path}: cannot be written ({(error.strerror or str(error)).lower()})") from error


def _mapping(data: Mapping[str, Any], at: KeyPath, comments: Mapping[str, str]) -> list[str]:
    lines: list[str] = []
    indent = "  " * len(at)
    for key, raw in data.items():
        here = (*at, str(key))
        value = _plain_python(raw, here)
        comment = comments.get(dotted(here), comments.get(str(key)))
        head = f"{indent}{_text(str(key), as_key=True)}:"
        flow = _flow(value, here, comments)
        room = _WIDTH - len(head) - 1
        if flow is not None and (len(flow) <= room or not isinstance(value, dict | list) or not value):
            lines.append(_commented(f"{head} {flow}", comment))
        elif isinstance(value, dict):
            lines.append(_commented(head, comment))
            lines += _mapping(value, here, comments)
        else:
            lines.append(_commented(head, comment))
            lines += _list(value, here, comments, indent + "  ")
    return lines


def _list(items: list[Any], at: KeyPath, comments: Mapping[str, str], indent: str) -> list[str]:
    if not any(isinstance(item, dict | list) for item in items):
        return _wrapped([_scalar(item, (*at, i)) for i, item in enumerate(items)], indent)
    lines: list[str] = []
    for i, item in enumerate(items):
        here = (*at, i)
        flow = _flow(item, here, comments, most=99)
        if flow is not None and len(indent) + 2 + len(flow) <= _WIDTH:
            lines.append(f"{indent}- {flow}")
        elif isinstance(item, dict):
            depth = len(here)
            inner = [line[2 * depth :] for line in _mapping(item, here, comments)]
            lines += [f"{indent}{'- ' if n == 0 else '  '}{line}" for n, line in enumerate(inner)]
        elif isinstance(item, list):
            inner = _list(item, here, comments, "")
            lines += [f"{indent}{'- ' if n == 0 else '  '}{line}" for n, line in enumerate(inner)]
        else:
            lines.append(f"{indent}- {_scalar(item, here)}")
    return lines


def _wrapped(words: list[str], indent: str) -> list[str]:
    lines, line = [], indent + "["
    for i, word in enumerate(words):
        piece = word + ("]" if i == len(words) - 1 else ",")
        if len(line) + 1 + len(piece) > _WIDTH and line.strip() != "[":
            lines.append(line)
            line = indent + " " + piece
        else:
            line += piece if line.endswith("[") else " " + piece
    return [*lines, line]


def _flow(value: Any, at: KeyPath, comments: Mapping[str, str], most: int = _SMALL) -> str | None:
    """Return `value` in flow style, or None where it is better spread over lines."""
    if isinstance(value, dict):
        if not value:
            return "{}"
        if len(value) > most or (
            most == _SMALL and any(dotted((*at, key)) in comments or key in comments for key in value)
        ):
            return None
        parts = []
        for key, item in value.items():
            inner = _flow(item, (*at, key), comments) if not isinstance(item, dict) else None
            if inner is None:
                return None
            parts.append(f"{_text(str(key), as_key=True)}: {inner}")
        return "{" + ", ".join(parts) + "}"
    if isinstance(value, list):
        if any(isinstance(item, dict | list) for item in value):
            return None
        return "[" + ", ".join(_scalar(item, (*at, i)) for i, item in enumerate(value)) + "]"
    return _scalar(value, at)


def _plain_python(value: Any, at: KeyPath) -> Any:
    """Turn numpy values, tuples and paths inside `value` into what YAML knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain_python(item, (*at, str(key))) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain_python(item, (*at, i)) for i, item in enumerate(value)]
    if isinstance(value, Path):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return _plain_python(value.tolist(), at)
    raise ConfigError(f"{dotted(at)}: a {type(value).__name__} cannot be written to a YAML file")


def _scalar(value: Any, at: KeyPath) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return int.__repr__(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ConfigError(f"{dotted(at)} is {float(value)}; only finite numbers are written to a file")
        mantissa, e, exponent = float.__repr__(value).partition("e")
        return (mantissa if "." in mantissa else mantissa + ".0" * bool(e)) + e + exponent
    return _text(str(value))


def _text(text: str, *, as_key: bool = False) -> str:
    """Write text plainly where all readers take it for text, else in double quotes."""
    if _PLAIN.fullmatch(text) and (as_key or len(text) < _WIDTH):
        word = f"k: {text}"
        if yaml.safe_load(word) == parse_yaml(word).data == {"k": text}:
            return text
    escaped = "".join(_escaped(c) for c in text)
    return f'"{escaped}"'


def _escaped(c: str) -> str:
    if c in '"\\':
        return "\\" + c
    if c.isprintable():
        return c
    code = ord(c)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _commented(line: str, comment: str | None) -> str:
    return f"{line:<30}  # {' '.join(comment.split())}" if comment else line
