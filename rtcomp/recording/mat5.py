"""Is a MATLAB 5 file whole? Asked before the library reads it, which crashes on some damaged ones.

A file is a header of 128 bytes and a sequence of elements, each a tag (type, bytes) and data padded to 8
bytes; a matrix is an element made of elements (MAT-File Format, MathWorks, chapter 1). Only the
structure is checked here: that every tag makes sense and that all it promises is there.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator

_HEADER = 128
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of one item of each data type."""
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FIRST_NUMBER, _LAST_NUMBER = 1, 2, 3, 4, 5, 6, 15

Element = tuple[int, bytes]


class Damaged(ValueError):  # noqa: N818  (what is found, said at once by the reader as a RecordingError)
    """The file's structure is broken; the message says how."""


def check(content: bytes) -> None:
    """Check the MATLAB 5 file of this `content`; raise Damaged where it is cut off or makes no sense."""
    if len(content) < _HEADER:
        raise Damaged("it ends within its header")
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise Damaged("its header does not say the order of bytes")
    for kind, data in _elements(content[_HEADER:], order):
        if kind == _COMPRESSED:
            try:
                inside = list(_elements(zlib.decompress(data), order))
            except zlib.error as error:
                raise Damaged(str(error)) from None
        else:
            inside = [(kind, data)]
        for inner_kind, inner in inside:
            if inner_kind != _MATRIX:
                raise Damaged(f"it holds an element of type {inner_kind} where a matrix should be")
            _matrix(inner, order)


def _elements(data: bytes, order: str) -> Iterator[Element]:
    at = 0
    while at < len(data):
        if at + 8 > len(data):
            raise Damaged("it is cut off")
        kind, size = struct.unpack_from(f"{order}II", data, at)
        start, step = at + 8, size if kind == _COMPRESSED else (size + 7) // 8 * 8
        if kind >> 16:  # up to four bytes of data within the tag
            kind, size, start, step = kind & 0xFFFF, kind >> 16, at + 4, 0
            if size > 4:
                raise Damaged("it holds a tag that makes no sense")
        if start + size > len(data):
            raise Damaged(f"it is cut off: {start + size - len(data)} bytes are missing")
        yield kind, data[start : start + size]
        at += 8 + step


def _matrix(data: bytes, order: str) -> None:
    if not data:
        return  # an empty field of a struct
    parts = list(_elements(data, order))
    if len(parts) < 3 or parts[0][0] != _UINT32 or len(parts[0][1]) != 8:
        raise Damaged("it holds a matrix without flags")
    flags = struct.unpack(f"{order}I", parts[0][1][:4])[0]
    kind = flags & 0xFF
    if not 1 <= kind <= 17:
        raise Damaged(f"it holds a matrix of unknown class {kind}")
    if kind > _LAST_NUMBER:
        return  # functions and objects, which are not read
    if parts[1][0] != _INT32 or len(parts[1][1]) < 8 or len(parts[1][1]) % 4:
        raise Damaged("it holds a matrix without dimensions")
    shape = struct.unpack(f"{order}{len(parts[1][1]) // 4}i", parts[1][1])
    if min(shape) < 0:
        raise Damaged(f"it holds a matrix of {' x '.join(map(str, shape))}")
    if parts[2][0] not in (_INT8, _UTF8):
        raise Damaged("it holds a matrix without a name")
    _contents(kind, flags, math.prod(shape), parts[3:], order)


def _contents(kind: int, flags: int, count: int, parts: list[Element], order: str) -> None:
    if kind in (_CELL, _STRUCT, _OBJECT):
        if kind != _CELL:
            head = parts[kind - _STRUCT : kind - _STRUCT + 2]  # an object's class name comes first
            if len(head) < 2 or head[0][0] != _INT32 or len(head[0][1]) != 4 or head[1][0] != _INT8:
                raise Damaged("it holds a struct without field names")
            length = struct.unpack(f"{order}i", head[0][1])[0]
            if length < 1 or len(head[1][1]) % length:
                raise Damaged("it holds a struct whose field names make no sense")
            count *= len(head[1][1]) // length
            parts = parts[kind - _STRUCT + 2 :]
        if len(parts) != count or any(part[0] != _MATRIX for part in parts):
            raise Damaged(f"it holds a cell or struct of {count} parts with {len(parts)}")
        for _, inner in parts:
            _matrix(inner, order)
        return
    wanted = (3 if kind == _SPARSE else 1) + bool(flags & 0x0800)
    if len(parts) != wanted and not (count == 0 and not parts):
        raise Damaged(f"it holds a matrix of {len(parts)} parts instead of {wanted}")
    for data_kind, data in parts:
        if data_kind not in _BYTES or len(data) % _BYTES[data_kind]:
            raise Damaged(f"it holds data of unknown type {data_kind}")
        items = len(data) // _BYTES[data_kind]
        if kind != _SPARSE and items != count and not (data_kind == _UTF8 and items > count):
            raise Damaged(f"it holds a matrix of {count} items with {items}")
