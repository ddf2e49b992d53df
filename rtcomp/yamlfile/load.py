"""Read a YAML file and remember the line of every key.

Scalars are read as YAML 1.2 and everybody else read them: ``1e-6``, ``1.e-6``, ``+1e3`` and ``1_000`` are
numbers, ``010`` is ten, ``1:30`` and ``2026-11-20`` are text. PyYAML alone follows YAML 1.1 and disagrees.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from rtcomp.errors import ConfigError

KeyPath = tuple[str | int, ...]
"""A key's place in a file, such as ``("stage", "friction", 1, "reach")``."""

_TOO_LARGE = 16 * 2**20
_TOO_MANY = 1_000_000
_DIGITS = r"[0-9]+(?:_[0-9]+)*"
_INT = re.compile(rf"[-+]?{_DIGITS}")
_BASED = re.compile(r"[-+]?0(?:x[0-9a-fA-F]+|o[0-7]+|b[01]+)")
_FLOAT = re.compile(rf"[-+]?(?:{_DIGITS}(?:\.(?:{_DIGITS})?)?|\.{_DIGITS})(?:[eE][-+]?[0-9]+)?")
_WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE", "yes", "Yes", "YES", "on", "On", "ON"), True),
    **dict.fromkeys(("false", "False", "FALSE", "no", "No", "NO", "off", "Off", "OFF"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), float("inf")),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf")),
}


@dataclass(frozen=True)
class YamlFile:
    """What a YAML file holds, and where."""

    data: dict[str, Any]
    """The file's mapping: dicts, lists, text, int, float, bool and None."""
    path: Path
    """The file, as it was named."""
    lines: dict[KeyPath, int] = field(default_factory=dict)
    """Line (from 1) of every key and list item."""
    origins: Mapping[str, YamlFile] = field(default_factory=dict)
    """Where a top-level key's value was read from, if from another file."""

    def line(self, key: KeyPath) -> int:
        """Return the line of `key`, or of the innermost part of it that the file has."""
        while key and key not in self.lines:
            key = key[:-1]
        return self.lines.get(key, 1)

    def at(self, key: KeyPath) -> str:
        """Return where `key` stands, as ``FILE:LINE``."""
        origin = self.origins.get(str(key[0])) if key else None
        return origin.at(key) if origin is not None else f"{self.path}:{self.line(key)}"

    def get(self, key: KeyPath, default: Any = None) -> Any:
        """Return the value at `key`, or `default` where the file has none."""
        value: Any = self.data
        for part in key:
            if not has(value, part):
                return default
            value = value[part]
        return value

    def error(self, key: KeyPath, message: str) -> ConfigError:
        """Make (not raise) the error ``FILE:LINE: key: message`` about the value at `key`."""
        about = f"{dotted(key)}: " if key else ""
        return ConfigError(f"{self.at(key)}: {about}{one_line(message)}")


def load_yaml(path: str | Path) -> YamlFile:
    """Read the YAML file `path`, whose top level must be a mapping.

    Raises ConfigError ``FILE:LINE: ...`` for a file that cannot be read, is no text, is empty, is not YAML,
    holds anything but a mapping, or gives a key twice.
    """
    path = Path(path)
    try:
        if path.is_file() and path.stat().st_size > _TOO_LARGE:
            raise ConfigError(f"{path}: is larger than {_TOO_LARGE >> 20} MB; is it a YAML file?")
        raw = path.read_bytes()
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({(error.strerror or str(error)).lower()})") from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}:{line}: {_what_binary(raw)}; a YAML file is UTF-8 text") from None
    if "\0" in text:
        raise ConfigError(f"{path}:1: {_what_binary(raw)}; a YAML file is UTF-8 text")
    return parse_yaml(text, path)


def parse_yaml(text: str, path: str | Path = "<text>") -> YamlFile:
    """Read YAML from `text`; `path` is only what errors call it. Raises ConfigError as `load_yaml` does."""
    path = Path(path)
    try:
        node = yaml.compose(text, Loader=_Nodes)
    except yaml.MarkedYAMLError as error:
        raise ConfigError(_syntax(path, text, error)) from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        code = f"character {error.character:#x}" if isinstance(error.character, int) else "a character"
        raise ConfigError(f"{path}:{line}: {code} is not allowed in YAML text") from None
    except RecursionError:
        raise ConfigError(f"{path}:1: is nested too deeply to be read") from None
    if node is None or (isinstance(node, yaml.ScalarNode) and _scalar(node) is None):
        raise ConfigError(f"{path}:1: is empty; it must hold keys, such as 'stage:'")
    if not isinstance(node, yaml.MappingNode):
        kind = "a list" if isinstance(node, yaml.SequenceNode) else f"only {_short(node.value)}"
        raise ConfigError(
            f"{path}:{node.start_mark.line + 1}: holds {kind}; it must hold keys, such as 'stage:'"
        )
    walk = _Walk(path)
    try:
        data = walk.value(node, ())
    except RecursionError:
        raise ConfigError(f"{path}:1: is nested too deeply to be read") from None
    return YamlFile(data, path, walk.lines)


def dotted(key: KeyPath) -> str:
    """Write a key's place for people: ``stage.friction[1].reach``."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return one_line(text)


def has(value: Any, part: str | int) -> bool:
    """Say whether `value` is a mapping with the key, or a list with the index, `part`."""
    if isinstance(value, dict):
        return part in value
    return isinstance(value, list) and isinstance(part, int) and 0 <= part < len(value)


def one_line(text: str) -> str:
    """Fold `text` into one line."""
    return " ".join(text.split())


class _Nodes(yaml.SafeLoader):
    """PyYAML's parser without its YAML 1.1 guesses: every scalar stays text, with its style."""

    yaml_implicit_resolvers: dict[str, Any] = {}


class _Walk:
    """Turns nodes into data, noting lines."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines: dict[KeyPath, int] = {}
        self.count = 0

    def value(self, node: yaml.Node, at: KeyPath) -> Any:
        self.count += 1
        if self.count > _TOO_MANY:
            raise self.error(node, f"holds more than {_TOO_MANY} values (aliases that repeat themselves?)")
        kind = {yaml.ScalarNode: "str", yaml.SequenceNode: "seq", yaml.MappingNode: "map"}[type(node)]
        if node.tag not in (f"tag:yaml.org,2002:{kind}", "!"):
            raise self.error(node, f"tag {_short(node.tag)} is not supported; write the plain value")
        if isinstance(node, yaml.MappingNode):
            return self.mapping(node, at)
        if isinstance(node, yaml.SequenceNode):
            items = []
            for index, item in enumerate(node.value):
                self.lines[(*at, index)] = item.start_mark.line + 1
                items.append(self.value(item, (*at, index)))
            return items
        assert isinstance(node, yaml.ScalarNode)
        return _scalar(node)

    def mapping(self, node: yaml.MappingNode, at: KeyPath) -> dict[str, Any]:
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise self.error(key_node, "a key must be a plain word")
            key, line = str(key_node.value), key_node.start_mark.line + 1
            here = (*at, key)
            if key == "<<" and key_node.style is None:
                raise self.error(key_node, "merge keys (<<) are not supported; write the keys out")
            if key in data:
                first = self.lines[here]
                where = f"in lines {first} and {line}" if first != line else f"in line {line}"
                raise self.error(key_node, f"{dotted(here)} is given twice, {where}; remove one")
            self.lines[here] = line
            data[key] = self.value(value_node, here)
        return data

    def error(self, node: yaml.Node, message: str) -> ConfigError:
        return ConfigError(f"{self.path}:{node.start_mark.line + 1}: {one_line(message)}")


def _scalar(node: yaml.ScalarNode) -> Any:
    text = str(node.value)
    if node.style is not None:  # quoted, literal or folded: text, whatever it looks like
        return text
    if text in _WORDS:
        return _WORDS[text]
    try:
        if _INT.fullmatch(text):
            return int(text)
        if _BASED.fullmatch(text):
            return int(text, 0)
    except ValueError:  # Python reads integers of at most 4300 digits
        return float(text)
    return float(text) if _FLOAT.fullmatch(text) else text


def _syntax(path: Path, text: str, error: yaml.MarkedYAMLError) -> str:
    mark = error.problem_mark or error.context_mark
    line = mark.line + 1 if mark else 1
    lines = text.split("\n")
    shown = lines[line - 1] if line <= len(lines) else ""
    problem = one_line(f"{error.problem or error.context}")
    if "\t" in shown[: len(shown) - len(shown.lstrip())] or r"'\t'" in problem:
        problem = "a tab stands where YAML wants spaces; replace it by spaces"
    elif "single document" in f"{error.context} {problem}":
        problem = "a second document ('---') begins; a file holds one"
    return f"{path}:{line}: is not YAML: {problem}"


def _what_binary(raw: bytes) -> str:
    if raw.startswith(b"\x89HDF"):
        return "is an HDF5 file, a recording perhaps"
    if raw.startswith(b"\x1f\x8b"):
        return "is a gzip file"
    return "is a binary file"


def _short(value: object) -> str:
    text = one_line(repr(value))
    return text if len(text) <= 60 else text[:57] + "..."
