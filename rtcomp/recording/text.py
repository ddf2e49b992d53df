"""CSV, plain or gzipped, into a table."""

from __future__ import annotations

import gzip
import io
import itertools
import re
import zlib
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import IO, NamedTuple, cast

import numpy as np

from rtcomp.errors import RecordingError
from rtcomp.recording.table import CSV, Floats, Table, kind_of

_CONTRACT = ("time", "reference", "position", "voltage")
LARGE = 100_000_000
"""Bytes from which on a file is read in pieces."""
CUT = "the last line is cut off in the middle: left out"
_HEADER_LINES, _LINES = 1000, 200_000
_SEPARATORS = ("\t", ";", ",")


def read_text(path: Path, gzipped: bool, only: Collection[str] | None = None) -> Table:
    """Read a CSV file: the header line names the columns, ``#`` begins a comment, separators ``,`` ``;`` tab.

    A large file is read in pieces, and columns that are not in `only` are left out of it. Raises
    RecordingError where it is truncated, has no header line, or holds text for numbers.
    """
    if path.stat().st_size > (LARGE // 8 if gzipped else LARGE):
        table = _in_pieces(path, gzipped, only)
        if table is not None:
            return table
    text = _decode(path, _unpack(path) if gzipped else path.read_bytes())
    lines = text.split("\n")
    head = _head(path, lines)
    body = [line for line in lines[head.rows :] if line.strip() and not line.startswith("#")]
    notes: list[str] = []
    if head.separator == ";" and body and "," in body[0] and "." not in body[0]:
        body = [line.replace(",", ".") for line in body]
        notes.append("decimal commas read as points")
    if body and not text.endswith("\n") and len(_split(body[-1], head.separator)) < len(head.names):
        notes.append(CUT)
        body.pop()
    columns = _numbers(path, head.names, body, head.separator, notes)
    comments = [line.lstrip("# \t").rstrip() for line in lines if line.startswith("#")]
    return Table(columns, {"comments": "\n".join(comments)} if comments else {}, notes)


class _Head(NamedTuple):
    """What stands before the numbers: columns' names, what separates them, lines until the first row."""

    names: list[str]
    separator: str | None
    rows: int


def _head(path: Path, lines: list[str]) -> _Head:
    first = next((i for i, line in enumerate(lines) if line.strip() and not line.startswith("#")), None)
    if first is None:
        raise RecordingError(f"{path}: holds no rows")
    comments = [line.lstrip("# \t").rstrip() for line in lines if line.startswith("#")]
    header, separator = lines[first], _separator(lines[first])
    names = _split(header, separator)
    start = first + 1
    if all(_is_number(name) for name in names):
        names = next((n for c in reversed(comments) if len(n := _split(c, _separator(c))) == len(names)), [])
        start = first
        if not names:
            shown = header.strip()[:60]
            raise RecordingError(f"{path}: no header line names the columns; the first line is {shown!r}")
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise RecordingError(f"{path}: two columns are named {twice!r}")
    return _Head(names, separator, start)


def _in_pieces(path: Path, gzipped: bool, only: Collection[str] | None) -> Table | None:
    """Read a large file of plain numbers; None for anything unusual, which the other way reads or refuses."""
    parts: list[list[Floats]] = []
    try:
        with gzip.open(path, "rb") if gzipped else path.open("rb") as raw:
            start = raw.read(4096)
            if start.startswith((b"\xff\xfe", b"\xfe\xff")) or kind_of(start) != CSV:
                return None
            raw.seek(0)
            with io.TextIOWrapper(cast(IO[bytes], raw), encoding="utf-8-sig", errors="replace") as text:
                lines = [line.rstrip("\n") for line in itertools.islice(text, _HEADER_LINES)]
                head = _head(path, lines)
                kept = [i for i, name in enumerate(head.names) if only is None or name in only]
                if not kept:
                    return None
                comments = [line.lstrip("# \t").rstrip() for line in lines if line.startswith("#")]
                body: Iterable[str] = lines[head.rows :]
                while body := [line for line in body if line.strip() and not line.startswith("#")]:
                    table = np.loadtxt(body, delimiter=head.separator, comments=None, ndmin=2)
                    if table.shape[1] != len(head.names):
                        return None
                    parts.append([np.ascontiguousarray(table[:, i]) for i in kept])
                    body = list(itertools.islice(text, _LINES))
    except (EOFError, OSError, zlib.error, ValueError):
        return None
    columns: dict[str, Floats] = {}
    for position, index in enumerate(kept):
        columns[head.names[index]] = np.concatenate([part[position] for part in parts])
        for part in parts:
            part[position] = np.empty(0)
    return Table(columns, {"comments": "\n".join(comments)} if comments else {})


def _unpack(path: Path) -> bytes:
    try:
        return gzip.decompress(path.read_bytes())
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise RecordingError(f"{path}: is truncated or damaged: {error}") from None


def _decode(path: Path, data: bytes) -> str:
    if not data:
        raise RecordingError(f"{path}: is empty")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").replace("\r\n", "\n")
    if (inside := kind_of(data[:4096])) != CSV:
        raise RecordingError(f"{path}: is not what its name says: inside it looks like {inside}")
    text = data.decode("utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _separator(line: str) -> str | None:
    """Return what separates the fields of `line`; None for blanks."""
    return max((s for s in _SEPARATORS if s in line), key=line.count, default=None)


def _split(line: str, separator: str | None) -> list[str]:
    return [field.strip().strip("\"'").strip() for field in line.strip("\n").split(separator)]


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _numbers(
    path: Path, names: list[str], body: list[str], separator: str | None, notes: list[str]
) -> dict[str, Floats]:
    if not body:
        return {name: np.empty(0) for name in names}
    try:
        table = np.loadtxt(body, delimiter=separator, comments=None, ndmin=2)
    except ValueError:
        return _field_by_field(path, names, body, separator, notes)
    if table.shape[1] != len(names):
        raise RecordingError(f"{path}: the header names {len(names)} columns, row 1 has {table.shape[1]}")
    return {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(names)}


def _field_by_field(
    path: Path, names: list[str], body: list[str], separator: str | None, notes: list[str]
) -> dict[str, Floats]:
    """Read what the fast way refuses: columns of text are left out, text among numbers is refused."""
    rows = [_split(line, separator) for line in body]
    for number, row in enumerate(rows, 1):
        if len(row) != len(names):
            raise RecordingError(
                f"{path}: the header names {len(names)} columns, row {number} has {len(row)}"
            )
    columns: dict[str, Floats] = {}
    for i, name in enumerate(names):
        fields = [row[i] for row in rows]
        bad = next((k for k, field in enumerate(fields) if not _is_number(field)), None)
        if bad is None:
            columns[name] = np.array(fields, dtype=np.float64)
        elif sum(map(_is_number, fields)) * 2 > len(fields) or name in (
            "time",
            "position",
            "voltage",
            "reference",
        ):
            shown = re.sub(r"\s+", " ", fields[bad])[:40]
            raise RecordingError(f"{path}: row {bad + 1}, column {name!r}: {shown!r} is not a number")
        else:
            notes.append(f"column {name!r} holds text: left out")
    return columns
