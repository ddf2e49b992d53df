from __future__ import annotations

import gzip
import shutil
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recording_files import (
    FORMATS,
    data,
    motion,
    write_any,
    write_csv_text,
    write_hdf5,
    write_mat5,
    write_mat73,
)

from rtcomp.errors import ConfigError, RecordingError
from rtcomp.recording.reader import parse_map, read


def refusal(path: Path, *arguments: object, **options: object) -> str:
    """The one line with which reading `path` is refused."""
    with pytest.raises(RecordingError) as caught:
        read(path, *arguments, **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)
    return str(caught.value)


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


# What is refused, each in one line


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


def test_a_folder_with_one_recording_stands_for_it(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("about it\n")
    columns = motion(50)
    path = write_any(tmp_path / "Run.CSV", columns)
    recording = read(tmp_path)
    assert recording.path == path
    assert np.array_equal(recording.position, columns["position"])
    write_any(tmp_path / "second.h5", columns)
    assert "a folder with 2 recordings; name one: Run.CSV, second.h5" in refusal(tmp_path)


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


def test_the_name_need_not_say_anything(tmp_path: Path) -> None:
    for name in FORMATS:
        write_any(tmp_path / name, motion(100)).rename(tmp_path / "recording")
        assert len(read(tmp_path / "recording")) == 100


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


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, 1e9])
def test_rates_that_make_no_sense(tmp_path: Path, rate: float) -> None:
    with pytest.raises(ConfigError, match="allowed"):
        read(write_csv_text(tmp_path / "a.csv", motion()), rate_hz=rate)
    with pytest.raises(ConfigError, match="cubic, linear"):
        read(tmp_path / "a.csv", method="magic")


# Sampling


def test_no_time_column_but_a_rate(tmp_path: Path) -> None:
    columns = motion()
    del columns["time"]
    recording = read(write_csv_text(tmp_path / "a.csv", columns), rate_hz=250.0)
    assert recording.rate_hz == 250.0 and recording.time[-1] == 499 / 250.0
    assert "no time" in recording.notes[0]


def test_repeated_times_are_left_out_and_said(tmp_path: Path) -> None:
    columns = {name: np.insert(column, 40, column[40]) for name, column in motion().items()}
    columns["position"][41] = 1.0  # the second row of that time
    recording = read(write_csv_text(tmp_path / "a.csv", columns))
    assert np.array_equal(recording.position, motion()["position"])
    assert recording.notes == ["1 row of a time already seen (first: row 42): left out"]


def test_small_jitter_is_taken_as_even(tmp_path: Path) -> None:
    columns = motion()
    columns["time"] = columns["time"] + 5e-5 * np.random.default_rng(0).uniform(-1, 1, 500)
    recording = read(write_csv_text(tmp_path / "a.csv", columns))
    assert np.array_equal(recording.position, columns["position"])
    assert np.allclose(np.diff(recording.time), 1 / recording.rate_hz, rtol=1e-6)
    assert abs(recording.rate_hz / 1000.0 - 1) < 1e-3
    assert "jitter by" in recording.notes[0]


@pytest.mark.parametrize(("method", "error"), [("cubic", 2e-3), ("linear", 5e-3)])
def test_uneven_rows_become_even(tmp_path: Path, method: str, error: float) -> None:
    at = np.cumsum(np.random.default_rng(3).uniform(0.6e-3, 1.4e-3, 3000))
    columns = {"time": at, "position": np.sin(2 * np.pi * 9 * at), "voltage": np.cos(2 * np.pi * 9 * at)}
    columns["status"] = np.floor(at)
    recording = read(write_csv_text(tmp_path / "a.csv", columns), method=method)
    assert abs(recording.rate_hz / 1000.0 - 1.0) < 0.05
    assert np.allclose(np.diff(recording.time), 1 / recording.rate_hz)
    truth = np.sin(2 * np.pi * 9 * recording.time)
    assert np.max(np.abs(recording.position - truth)) < error
    assert set(recording.columns["status"]) == {0.0, 1.0, 2.0, 3.0} - (set() if at[-1] > 3 else {3.0})
    assert any("resampled from uneven rows" in note for note in recording.notes)


def test_a_lower_rate_does_not_fold_back(tmp_path: Path) -> None:
    time_s = np.arange(20_000) / 1000.0
    slow, fast = np.sin(2 * np.pi * 2.0 * time_s), np.sin(2 * np.pi * 203.0 * time_s)
    path = write_hdf5(
        tmp_path / "a.h5",
        {"time": time_s, "position": slow + fast, "voltage": slow - fast, "learning": 0 * slow},
    )
    recording = read(path, rate_hz=100.0)
    inner = slice(20, -20)
    truth = np.sin(2 * np.pi * 2.0 * recording.time)
    assert recording.rate_hz == 100.0 and len(recording) == 2000
    assert np.max(np.abs(recording.position - truth)[inner]) < 0.01  # 203 Hz would show as 3 Hz, amplitude 1
    assert np.max(np.abs(recording.voltage - truth)[inner]) < 0.01
    assert "low-passed" in recording.notes[0]


def test_gaps_are_bridged_and_marked(tmp_path: Path) -> None:
    columns = motion(2000)
    kept = np.ones(2000, dtype=bool)
    kept[700:800] = kept[1500] = False
    recording = read(write_csv_text(tmp_path / "a.csv", {n: c[kept] for n, c in columns.items()}))
    assert np.array_equal(np.flatnonzero(recording.columns["gap"]), [*range(700, 800), 1500])
    assert np.array_equal(recording.trusted, kept)
    assert np.allclose(recording.position[kept], columns["position"][kept], rtol=0, atol=1e-12)
    assert "2 gaps, longest 0.101 s at 0.699 s: 101 rows bridged" in recording.notes[-1]


def test_a_jump_in_time_does_not_eat_the_memory(tmp_path: Path) -> None:
    columns = motion()
    columns["time"][250:] += 1e9
    assert "time jumps by 1e+09 s in row 251" in refusal(write_csv_text(tmp_path / "a.csv", columns))


# Outliers


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.integers(60, 1900), min_size=1, max_size=8, unique=True),
    st.sampled_from(["position", "voltage"]),
    st.sampled_from([-1.0, 1.0]),
)
def test_outliers_are_marked_not_dropped(tmp_path: Path, rows: list[int], column: str, sign: float) -> None:
    rows = [row for row in rows if all(abs(row - other) > 6 for other in rows if other != row)]
    columns = motion(2000)
    columns[column][rows] += sign * (5e-5 if column == "position" else 3.0)
    recording = read(write_hdf5(tmp_path / "a.h5", columns))
    assert np.array_equal(recording.columns[column], columns[column])
    assert np.array_equal(np.flatnonzero(recording.columns.get("outlier", np.zeros(1))), sorted(rows))
    assert not rows or any(f"in {column}" in note for note in recording.notes)


def test_steps_and_fast_oscillations_are_no_outliers(tmp_path: Path) -> None:
    columns = motion(4000)
    columns["position"] += 1e-4 * (columns["time"] > 1.5)
    burst = np.exp(-(((columns["time"] - 2.5) / 0.05) ** 2)) * np.sin(2 * np.pi * 90 * columns["time"])
    columns["position"] += 1e-4 * burst
    columns["voltage"] = 5.0 * np.sign(np.sin(2 * np.pi * 7 * columns["time"] + 0.1))
    assert "outlier" not in read(write_hdf5(tmp_path / "a.h5", columns)).columns


# Measured and simulated recordings


def test_heads_yaw() -> None:
    path = data("real/heads-yaw/yaw_sine_to_330s.csv.gz")
    begin = time.perf_counter()
    recording = read(path, {"time": "t_s", "position": "position_rad", "voltage": "effort_measured_Nm"})
    assert time.perf_counter() - begin < 2.0
    assert abs(recording.rate_hz - 1000 / 3) < 0.1 and len(recording) > 100_000
    assert 0 < recording.columns["outlier"].sum() < 300
    assert any("uneven" in note for note in recording.notes)
    assert abs(np.ptp(recording.position) - 0.000599) < 3e-5


def test_emps() -> None:
    path = data("real/emps/DATA_EMPS.mat")
    recording = read(path, {"time": "t", "position": "qm", "voltage": "vir", "reference": "qg"})
    assert recording.rate_hz == 1000.0 and len(recording) == 24841 and recording.notes == []
    assert recording.metadata["kp"] == 160.18
    assert "found 'qg', 'qm', 't', 'vir'" in refusal(path)


def test_servo_pendulum() -> None:
    for path in sorted(data("real/servo-pendulum").glob("*.csv")):
        recording = read(path, {"voltage": "duty"})
        assert 185 <= recording.rate_hz <= 290 and any("uneven" in note for note in recording.notes)
        assert "gap" not in recording.columns and "outlier" not in recording.columns


def test_sealed_cases_are_even_and_nearly_free_of_marks() -> None:
    for path in sorted(data("sealed-dev").glob("*/*.csv.gz")):
        recording = read(path)
        assert recording.rate_hz == 1000.0 and len(recording) == 30_000
        assert recording.columns.get("outlier", np.zeros(1)).sum() <= 60
        assert not any("outliers in position" in note for note in recording.notes)


def test_truncated_copy_of_emps(tmp_path: Path) -> None:
    shutil.copy(data("real/emps/DATA_EMPS.mat"), tmp_path / "a.mat")
    (tmp_path / "a.mat").chmod(0o644)
    with (tmp_path / "a.mat").open("r+b") as file:
        file.truncate(400_000)
    said = refusal(tmp_path / "a.mat", {"time": "t", "position": "qm", "voltage": "vir"})
    assert "truncated" in said and "bytes are missing" in said


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
