"""Recordings that are refused, each in one line: values, columns, files that are none, damaged files."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recording_files import FORMATS, motion, refusal, write_any, write_csv_text

from rtcomp.errors import RecordingError
from rtcomp.recording.reader import read


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["time", "position", "voltage", "reference"])
def test_what_is_not_finite(tmp_path: Path, name: str, value: float, column: str) -> None:
    columns = motion(100)
    columns[column][[41, 60, 61]] = value
    said = refusal(write_any(tmp_path / name, columns))
    assert (
        f"{column} is {'NaN' if np.isnan(value) else 'infinite'} in row 42" in said and "3 of its 100" in said
    )


@pytest.mark.parametrize("name", FORMATS)
def test_constant_position_time_that_goes_back_and_few_rows(tmp_path: Path, name: str) -> None:
    columns = motion(100)
    assert "constant (0.003 in all 100" in refusal(
        write_any(tmp_path / f"1{name}", columns | {"position": np.full(100, 0.003)})
    )
    back = columns["time"].copy()
    back[50:] -= 0.02
    assert "time goes back in row 51, from 0.049 s to 0.03 s" in refusal(
        write_any(tmp_path / f"2{name}", columns | {"time": back})
    )
    assert "has 5 rows; at least 16" in refusal(write_any(tmp_path / f"3{name}", motion(5)))
    assert "time is 1 s in every row" in refusal(
        write_any(tmp_path / f"4{name}", columns | {"time": np.ones(100)})
    )


@pytest.mark.parametrize("name", FORMATS)
def test_missing_columns_are_named_beside_those_found(tmp_path: Path, name: str) -> None:
    columns = motion(100)
    del columns["voltage"]
    said = refusal(write_any(tmp_path / name, columns))
    found = said.partition("no column 'voltage'; found ")[2]
    assert all(f"'{column}'" in found for column in columns)
    assert "--map voltage=COLUMN" in said


def test_text_that_is_not_numbers(tmp_path: Path) -> None:
    path = write_csv_text(tmp_path / "a.csv", motion(100))
    lines = path.read_text().split("\n")
    fields = lines[33].split(",")
    lines[33] = ",".join([*fields[:2], "12.5mm", fields[3]])
    path.write_text("\n".join(lines))
    assert "row 33, column 'position': '12.5mm' is not a number" in refusal(path)
    lines[33] = ",".join(fields[:3])
    path.write_text("\n".join(lines))
    assert "the header names 4 columns, row 33 has 3" in refusal(path)
    path.write_text("\n".join(lines[1:30]))
    assert "no header line" in refusal(path)
    path.write_text("time,position,time\n1,2,3\n")
    assert "two columns are named 'time'" in refusal(path)


def test_a_folder_without_a_recording_says_what_it_holds(tmp_path: Path) -> None:
    assert "it is empty" in refusal(tmp_path)
    for k in range(9):
        (tmp_path / f"{k}.txt~").write_text("x")
    line = refusal(tmp_path)
    assert "without a recording" in line and "it holds 0.txt~" in line and line.endswith("7.txt~ and 1 more")


def test_missing_empty_and_folders(tmp_path: Path) -> None:
    assert "no such file" in refusal(tmp_path / "a.csv")
    assert "is a folder" in refusal(tmp_path)
    for name, content, said in (
        ("a.csv", b"", "is empty"),
        ("a.h5", b"", "is empty"),
        ("b.csv", b"# only a comment\n", "holds no rows"),
        ("a.csv.gz", gzip.compress(b""), "is empty"),
    ):
        (tmp_path / name).write_bytes(content)
        assert said in refusal(tmp_path / name)
    (tmp_path / "c.csv").write_text("time,position,voltage\n")
    assert "has 0 rows" in refusal(tmp_path / "c.csv")


@pytest.mark.parametrize(
    ("really", "name", "said"),
    [
        ("a.csv", "b.h5", "looks like CSV text"),
        ("a.csv", "b.mat", "looks like CSV text"),
        ("a.csv", "b.csv.gz", "looks like CSV text"),
        ("a.h5", "b.csv", "looks like an HDF5 file"),
        ("a.mat", "b.csv", "looks like a MATLAB 5 file"),
        ("a.mat", "b.h5", "looks like a MATLAB 5 file"),
        ("a.csv.gz", "b.csv", "looks like a gzip file"),
        ("a.csv.gz", "b.mat", "looks like a gzip file"),
    ],
)
def test_a_file_that_is_not_what_its_name_says(tmp_path: Path, really: str, name: str, said: str) -> None:
    write_any(tmp_path / really, motion(100)).rename(tmp_path / name)
    assert said in refusal(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"PK\x03\x04" + bytes(200), "a ZIP archive"),
        (b"PAR1" + bytes(200), "a Parquet file"),
        (b"\x89PNG\r\n" + bytes(200), "a PNG picture"),
        (bytes(range(256)), "binary data"),
    ],
)
@pytest.mark.parametrize("name", ["a.csv", "a", "a.mat", "a.h5"])
def test_strangers_are_named(tmp_path: Path, content: bytes, said: str, name: str) -> None:
    (tmp_path / name).write_bytes(content)
    assert said in refusal(tmp_path / name)
    (tmp_path / "b.csv.gz").write_bytes(gzip.compress(content))
    assert said in refusal(tmp_path / "b.csv.gz")


@pytest.mark.parametrize("name", ["a.csv.gz", "a.mat", "a.73.mat", "a.h5"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_truncated_files(tmp_path: Path, name: str, share: float) -> None:
    path = write_any(tmp_path / name, motion(3000))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    said = refusal(path)
    assert "truncated or damaged" in said or "no column" in said  # a MAT 5 file may end between two variables


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(["a.csv", "a.csv.gz", "a.mat", "a.73.mat", "a.h5"]), st.integers(0, 10**9))
def test_a_cut_at_any_byte_is_one_clear_line_or_a_recording(tmp_path: Path, name: str, cut: int) -> None:
    whole = write_any(tmp_path / name, motion(200)).read_bytes()
    (tmp_path / name).write_bytes(whole[: cut % len(whole)])
    try:
        recording = read(tmp_path / name)
    except RecordingError as error:
        assert "\n" not in str(error)
    else:
        assert np.array_equal(recording.position, motion(200)["position"][: len(recording)])
        assert name == "a.csv" or len(recording) == 200


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(["a.csv", "a.csv.gz", "a.mat"]), st.integers(0, 10**9), st.integers(0, 255))
def test_a_wrong_byte_is_one_clear_line_or_a_recording(tmp_path: Path, name: str, at: int, byte: int) -> None:
    content = bytearray(write_any(tmp_path / name, motion(100)).read_bytes())
    content[at % len(content)] = byte
    (tmp_path / name).write_bytes(content)
    try:
        assert np.isfinite(read(tmp_path / name).position).all()
    except RecordingError as error:
        assert "\n" not in str(error)
