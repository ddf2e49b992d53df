"""Recordings that are read: every format, separators, names of columns, files of other programs."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from recording_files import (
    FORMATS,
    motion,
    refusal,
    write_any,
    write_csv_text,
    write_hdf5,
    write_mat5,
    write_mat73,
)

from rtcomp.errors import ConfigError
from rtcomp.recording.reader import parse_map, read


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_numbers(tmp_path: Path, name: str) -> None:
    columns = motion()
    recording = read(write_any(tmp_path / name, columns))
    assert recording.rate_hz == 1000.0 and recording.notes == [] and len(recording) == 500
    for key, column in columns.items():
        assert np.array_equal(recording.columns[key], column)
    assert recording.reference is not None and recording.trusted.all()


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_separators_line_ends_and_comments(tmp_path: Path, separator: str, end: str) -> None:
    columns = motion(50)
    path = write_csv_text(tmp_path / "a.csv", columns, separator, end)
    text = path.read_bytes().decode().split(end)
    text[:0] = ["# rig: left bench", "#", ""]
    text[10:10] = ["# a remark between rows", ""]
    path.write_bytes(("\ufeff" + end.join(text)).encode())
    recording = read(path)
    assert np.array_equal(recording.position, columns["position"])
    assert "rig: left bench" in recording.metadata["comments"]


def test_header_in_a_comment_as_numpy_writes_it(tmp_path: Path) -> None:
    columns = motion(50)
    np.savetxt(
        tmp_path / "a.csv", np.column_stack([*columns.values()]), delimiter=",", header=",".join(columns)
    )
    assert np.allclose(read(tmp_path / "a.csv").voltage, columns["voltage"])


def test_quoted_header_decimal_commas_and_utf16(tmp_path: Path) -> None:
    columns = motion(50)
    lines = ['"time";"position";"voltage"']
    lines += [
        ";".join(f"{v:.17g}".replace(".", ",") for v in row)
        for row in zip(columns["time"], columns["position"], columns["voltage"], strict=True)
    ]
    (tmp_path / "a.csv").write_bytes("\r\n".join(lines).encode("utf-16"))
    recording = read(tmp_path / "a.csv")
    assert np.array_equal(recording.position, columns["position"])
    assert any("decimal commas" in note for note in recording.notes)


def test_a_column_of_text_does_not_stand_in_the_way(tmp_path: Path) -> None:
    columns = motion(40)
    lines = ["time,state,position,voltage"]
    lines += [f"{t},run,{p},{v}" for t, _, p, v in zip(*columns.values(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    recording = read(tmp_path / "a.csv")
    assert "state" not in recording.columns
    assert recording.notes == ["column 'state' holds text: left out"]


def test_a_last_line_cut_in_the_middle_is_left_out(tmp_path: Path) -> None:
    path = write_csv_text(tmp_path / "a.csv", motion(100))
    path.write_bytes(path.read_bytes()[:-45])
    recording = read(path)
    assert len(recording) == 99 and "cut off" in recording.notes[0]


def test_columns_are_mapped_by_name(tmp_path: Path) -> None:
    columns = motion()
    path = write_csv_text(
        tmp_path / "a.csv", {"t": columns["time"], "qm": columns["position"], "vir": columns["voltage"]}
    )
    recording = read(path, parse_map(["time=t", "position = qm", "voltage=vir"]))
    assert set(recording.columns) == {"time", "position", "voltage"}
    assert np.array_equal(recording.position, columns["position"])
    assert "found 't', 'qm', 'vir'" in refusal(path)
    assert "--map time=COLUMN" in refusal(path)
    assert "did you mean 'qm'" in refusal(path, {"position": "q"})


@pytest.mark.parametrize("item", ["position", "=qm", "position="])
def test_a_mapping_of_another_form_is_refused(item: str) -> None:
    with pytest.raises(ConfigError, match="position=qm"):
        parse_map([item])
    with pytest.raises(ConfigError, match="twice"):
        parse_map(["a=b", "a=c"])


@pytest.mark.parametrize("kind", ["5", "7.3 rows", "7.3 columns"])
def test_nested_structs_of_matlab(tmp_path: Path, kind: str) -> None:
    columns = motion()
    tree = {
        "log": {"t": columns["time"], "axis": {"qm": columns["position"]}, "rig": "left bench", "kp": 160.18},
        "vir": columns["voltage"],
        "other": {"t": np.arange(7.0)},
    }
    path = tmp_path / "a.mat"
    if kind == "5":
        write_mat5(path, tree)  # type: ignore[arg-type]
    else:
        write_mat73(path, tree, "row" if kind.endswith("rows") else "column")
    recording = read(path, {"time": "log.t", "position": "qm", "voltage": "vir"})
    assert np.array_equal(recording.position, columns["position"])
    assert recording.metadata == {"log.rig": "left bench", "log.kp": 160.18}
    assert any("'other.t' has 7 rows" in note for note in recording.notes)


def test_a_folder_with_one_recording_stands_for_it(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("about it\n")
    columns = motion(50)
    path = write_any(tmp_path / "Run.CSV", columns)
    recording = read(tmp_path)
    assert recording.path == path
    assert np.array_equal(recording.position, columns["position"])
    write_any(tmp_path / "second.h5", columns)
    assert "a folder with 2 recordings; name one: Run.CSV, second.h5" in refusal(tmp_path)


def test_the_name_need_not_say_anything(tmp_path: Path) -> None:
    for name in FORMATS:
        write_any(tmp_path / name, motion(100)).rename(tmp_path / "recording")
        assert len(read(tmp_path / "recording")) == 100


def test_hdf5_that_another_program_is_writing(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w", libver="latest") as file:
        for name, column in motion().items():
            file.create_dataset(name, data=column, maxshape=(None,), chunks=(256,))
        file.swmr_mode = True
        file.flush()
        shutil.copy(path, tmp_path / "killed.h5")
    assert len(read(path)) == len(read(tmp_path / "killed.h5")) == 500


def test_hdf5_of_others_with_attributes(tmp_path: Path) -> None:
    path = write_hdf5(tmp_path / "a.h5", motion(), rig="left", setup={"a": [1, 2]})
    with h5py.File(path, "a") as file:
        file["deep/er/current"] = np.arange(500.0)
    recording = read(path)
    assert recording.metadata == {"rig": "left", "setup": {"a": [1, 2]}}
    assert recording.columns["current"][-1] == 499.0
