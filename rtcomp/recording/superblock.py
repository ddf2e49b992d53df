"""The HDF5 superblock's consistency flags, cleared while a recording is being written.

A file open for SWMR writing carries two flags in its superblock; a writer that is killed leaves them set,
and the library then refuses to open the file in the ordinary way ("already open for write, may use
h5clear"), although everything flushed is there and consistent. A recording must open everywhere after any
kill, so its recorder clears the flags itself, each time the library has written them: once when SWMR
starts and once for each new chunk. What the flags were for, keeping a second writer out, is done by a
shared lock on the file instead, which the kernel lifts when the recorder ends in whatever way.

Layout of superblock version 3, 48 bytes at the start of the file (HDF5 File Format Specification 3.0,
II.A): signature (8 bytes), version (8), sizes (9, 10), flags (11), base address (12), extension address
(20), end-of-file address (28), root address (36), checksum (44).
"""

from __future__ import annotations

import os

SIZE = 48
SIGNATURE = b"\x89HDF\r\n\x1a\n"
VERSION, FLAGS, END_OF_FILE, _CHECKSUM = 8, 11, 28, 44
_WORD = 0xFFFFFFFF


def lookup3(data: bytes) -> int:
    """Return Bob Jenkins' lookup3 hash (`hashlittle`, start value 0) of `data`, HDF5's metadata checksum."""
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    if not data:
        return c
    last = (len(data) - 1) // 12 * 12
    for start in range(0, last, 12):
        a, b, c = (_add(x, data, start + i) for x, i in ((a, 0), (b, 4), (c, 8)))
        a, c = ((a - c) & _WORD) ^ _turn(c, 4), (c + b) & _WORD
        b, a = ((b - a) & _WORD) ^ _turn(a, 6), (a + c) & _WORD
        c, b = ((c - b) & _WORD) ^ _turn(b, 8), (b + a) & _WORD
        a, c = ((a - c) & _WORD) ^ _turn(c, 16), (c + b) & _WORD
        b, a = ((b - a) & _WORD) ^ _turn(a, 19), (a + c) & _WORD
        c, b = ((c - b) & _WORD) ^ _turn(b, 4), (b + a) & _WORD
    tail = data[last:].ljust(12, b"\0")
    a, b, c = (_add(x, tail, i) for x, i in ((a, 0), (b, 4), (c, 8)))
    c = ((c ^ b) - _turn(b, 14)) & _WORD
    a = ((a ^ c) - _turn(c, 11)) & _WORD
    b = ((b ^ a) - _turn(a, 25)) & _WORD
    c = ((c ^ b) - _turn(b, 16)) & _WORD
    a = ((a ^ c) - _turn(c, 4)) & _WORD
    b = ((b ^ a) - _turn(a, 14)) & _WORD
    return ((c ^ b) - _turn(b, 24)) & _WORD


def _turn(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & _WORD


def _add(word: int, data: bytes, start: int) -> int:
    return (word + int.from_bytes(data[start : start + 4], "little")) & _WORD


def clear_flags(descriptor: int) -> int:
    """Clear the consistency flags of the HDF5 file behind `descriptor` (open for reading and writing).

    Returns where the file ends by its superblock (bytes). Also grows the file to there where blocks are
    allocated but not yet written, which the library would call truncated. Raises OSError where the disk
    refuses, ValueError where the file is not HDF5 with superblock version 3.
    """
    block = bytearray(os.pread(descriptor, SIZE, 0))
    if len(block) < SIZE or block[:8] != SIGNATURE or block[VERSION] != 3:
        raise ValueError("not an HDF5 file with superblock version 3")
    end = int.from_bytes(block[END_OF_FILE : END_OF_FILE + 8], "little")
    if block[FLAGS]:
        if os.fstat(descriptor).st_size < end:
            os.ftruncate(descriptor, end)
        block[FLAGS] = 0
        block[_CHECKSUM:] = lookup3(bytes(block[:_CHECKSUM])).to_bytes(4, "little")
        os.pwrite(descriptor, bytes(block), 0)
    return end
