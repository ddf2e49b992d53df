from __future__ import annotations

import os
from pathlib import Path

import h5py
import pytest

from rtcomp.recording.superblock import SIZE, clear_flags, lookup3


@pytest.mark.parametrize(
    ("data", "value"),
    [(b"", 0xDEADBEEF), (b"Four score and seven years ago", 0x17770551)],  # from lookup3.c's own self test
)
def test_hash_of_its_author(data: bytes, value: int) -> None:
    assert lookup3(data) == value


@pytest.mark.parametrize("rows", [0, 1, 5000])
def test_hash_is_the_librarys(tmp_path: Path, rows: int) -> None:
    with h5py.File(tmp_path / "a.h5", "w", libver=("v110", "v110")) as file:
        file["x"] = range(rows)
    block = (tmp_path / "a.h5").read_bytes()[:SIZE]
    assert lookup3(block[:44]) == int.from_bytes(block[44:], "little")


def test_cleared_flags_let_a_killed_file_open(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    reader, writer = os.pipe()
    if not (child := os.fork()):
        file = h5py.File(path, "w", libver=("v110", "v110"))
        file.create_dataset("x", (0,), maxshape=(None,))
        file.swmr_mode = True
        file["x"].resize((3,))
        file.flush()
        os.write(writer, b"x")
        os.kill(os.getpid(), 9)
    os.read(reader, 1)
    os.waitpid(child, 0)
    os.close(reader)
    os.close(writer)
    with pytest.raises(OSError, match="already open for write"):
        h5py.File(path)
    descriptor = os.open(path, os.O_RDWR)
    assert clear_flags(descriptor) <= os.fstat(descriptor).st_size
    os.close(descriptor)
    with h5py.File(path) as file:
        assert file["x"].shape == (3,)


def test_what_is_not_hdf5_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(b"time,position\n" * 100)
    descriptor = os.open(path, os.O_RDWR)
    with pytest.raises(ValueError, match="not an HDF5 file"):
        clear_flags(descriptor)
    os.close(descriptor)
    assert path.read_bytes() == b"time,position\n" * 100
