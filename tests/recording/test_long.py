"""What is read piece by piece comes out as if it had been read at once."""

from __future__ import annotations

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_files import motion, write_csv_text, write_hdf5

from rtcomp.errors import RecordingError
from rtcomp.recording import containers, pieces, reader, text
from rtcomp.recording.outliers import outliers
from rtcomp.recording.pieces import bridged, sample, steps
from rtcomp.recording.reader import load, read
from rtcomp.recording.sampling import examine, resample

OURS = ("time", "position", "voltage", "reference")


@pytest.fixture()
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces so small that every file here is a long one."""
    monkeypatch.setattr(pieces, "PIECE", 97)
    monkeypatch.setattr(text, "LARGE", 0)
    monkeypatch.setattr(text, "_HEADER_LINES", 9)
    monkeypatch.setattr(text, "_LINES", 31)
    monkeypatch.setattr(containers, "LONG", 100)


@given(st.integers(2, 40), st.integers(1, 12))
def test_steps_are_all_the_differences(rows: int, size: int) -> None:
    column = np.random.default_rng(rows).standard_normal(rows)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pieces, "PIECE", size)
        found = list(steps(column))
    assert np.array_equal(np.concatenate([part for _, part in found]), np.diff(column))
    assert [first for first, _ in found] == list(range(0, rows - 1, size))


def test_a_long_column_is_sampled_from_end_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "STRETCH", 10)
    column = np.arange(1000.0)
    parts = sample(column)
    assert len(parts) == 16 and parts[0][0] == 0 and parts[-1][-1] == 999
    assert sample(column[:100])[0] is not None and len(sample(column[:100])) == 1


def test_outliers_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    signal = motion(3000)["position"]
    signal[[5, 96, 97, 98, 1500, 2999]] += 3e-5
    whole = outliers(signal)
    assert whole.sum() >= 5
    monkeypatch.setattr(pieces, "PIECE", 97)
    assert np.array_equal(outliers(signal), whole)


@pytest.mark.parametrize("spoil", ["nothing", "gap", "jitter"])
def test_sampling_and_resampling_are_the_same(monkeypatch: pytest.MonkeyPatch, spoil: str) -> None:
    columns = motion(2000)
    if spoil == "gap":
        columns = {k: np.delete(v, slice(700, 760)) for k, v in columns.items()}
    elif spoil == "jitter":
        columns["time"] = columns["time"] + 3e-4 * np.random.default_rng(1).uniform(size=2000)
    whole = examine(columns["time"])
    even = resample(columns, 730.0, whole)
    monkeypatch.setattr(pieces, "PIECE", 97)
    found = examine(columns["time"])
    assert (found.rate_hz, found.jitter) == (whole.rate_hz, whole.jitter)
    assert np.array_equal(found.gaps, whole.gaps) and bool(len(whole.gaps)) == (spoil == "gap")
    for name, column in resample(columns, 730.0, found).items():
        assert column == pytest.approx(even[name], rel=1e-12, abs=1e-15)


@settings(max_examples=50)
@given(st.lists(st.booleans(), min_size=2, max_size=40).filter(any))
def test_bridges_are_straight_lines(good: list[bool]) -> None:
    trusted = np.array(good)
    column = np.random.default_rng(len(good)).standard_normal(trusted.size)
    rows = np.arange(trusted.size)
    assert bridged(column, trusted) == pytest.approx(np.interp(rows, rows[trusted], column[trusted]))


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_text_is_the_same(small: None, tmp_path: Path, name: str, separator: str) -> None:
    columns = motion(200)
    path = write_csv_text(tmp_path / name, columns, separator)
    table = text._in_pieces(path, name.endswith("gz"), None)
    assert table is not None
    for key, column in columns.items():
        assert np.array_equal(table.columns[key], column)


def test_text_with_remarks_and_a_header_in_a_comment(small: None, tmp_path: Path) -> None:
    columns = motion(100)
    lines = write_csv_text(tmp_path / "a.csv", columns).read_text().splitlines()
    lines[0] = f"# {lines[0]}"
    lines[:0] = ["# rig: left bench", ""]
    lines[60:60] = ["", "# a remark between rows"]
    (tmp_path / "a.csv").write_text("\r\n".join(lines) + "\r\n")
    table = text._in_pieces(tmp_path / "a.csv", False, None)
    assert table is not None and "rig: left bench" in table.metadata["comments"]
    assert np.array_equal(table.columns["position"], columns["position"])


def unusual(path: Path) -> dict[str, Path]:
    """Files that only the other way of reading understands, or refuses."""
    columns = motion(100)
    whole = write_csv_text(path / "whole.csv", columns).read_text()
    lines = whole.splitlines()
    changed = {
        "words": [lines[0] + ",mode", *(line + ",on" for line in lines[1:])],
        "commas": [line.replace(",", ";").replace(".", ",") for line in lines],
        "broken": [*lines[:50], "a,b,c,d", *lines[50:]],
        "ragged": [*lines[:50], lines[50] + ",1", *lines[51:]],
        "cut": [*lines[:-1], lines[-1][: lines[-1].index(",") + 3]],
        "blank": ["", ""],
    }
    files = {}
    for name, new in changed.items():
        files[name] = path / f"{name}.csv"
        files[name].write_text("\n".join(new) + ("" if name == "cut" else "\n"))
    files["utf-16"] = path / "wide.csv"
    files["utf-16"].write_bytes(whole.encode("utf-16"))
    files["half"] = path / "half.csv.gz"
    files["half"].write_bytes(gzip.compress(whole.encode())[:-400])
    return files


def read_or_said(path: Path) -> tuple[dict[str, np.ndarray] | None, object]:
    try:
        recording = read(path)
    except RecordingError as error:
        return None, str(error)
    return recording.columns, recording.notes


def test_what_is_unusual_is_read_or_refused_as_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = unusual(tmp_path)
    expected = {name: read_or_said(path) for name, path in files.items()}
    monkeypatch.setattr(text, "LARGE", 0)
    monkeypatch.setattr(text, "_LINES", 31)
    monkeypatch.setattr(text, "_HEADER_LINES", 9)
    for name, path in files.items():
        columns, said = read_or_said(path)
        assert said == expected[name][1], name
        if columns is not None:
            assert columns.keys() == expected[name][0].keys()  # type: ignore[union-attr]
            assert all(np.array_equal(columns[k], expected[name][0][k]) for k in columns)  # type: ignore[index]


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", "a.h5"])
def test_columns_that_nobody_asked_for_stay_in_the_file(small: None, tmp_path: Path, name: str) -> None:
    columns = motion(300) | {"temperature": np.linspace(20, 21, 300), "qm": np.arange(300.0)}
    path = tmp_path / name
    if name.endswith("h5"):
        write_hdf5(path, columns)
    else:
        write_csv_text(path, columns)
    assert "temperature" not in load(path, OURS).columns
    assert set(read(path, only=OURS).columns) - {"outlier"} == set(OURS)
    assert np.array_equal(read(path, {"position": "qm"}, only=OURS).position, columns["qm"])
    assert "temperature" in read(path).columns


def test_what_is_missing_is_said_with_all_that_is_there(small: None, tmp_path: Path) -> None:
    columns = {k: v for k, v in motion(300).items() if k != "voltage"} | {"u": np.arange(300.0)}
    for path in (write_csv_text(tmp_path / "a.csv", columns), write_hdf5(tmp_path / "a.h5", columns)):
        with pytest.raises(RecordingError, match=r"no column 'voltage'.*'u'"):
            read(path, only=OURS)
        with pytest.raises(RecordingError, match=r"no column 'w' for voltage.*'u'"):
            read(path, {"voltage": "w"}, only=OURS)
        assert np.array_equal(read(path, {"voltage": "u"}, only=OURS).voltage, columns["u"])


def test_a_path_inside_a_file_names_a_column_too(small: None, tmp_path: Path) -> None:
    columns = motion(300)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, column in columns.items():
            file[f"log/{name}"] = column
        file["log/motor/position"] = 2 * columns["position"]
    recording = read(tmp_path / "log.h5", {"position": "log.motor.position"}, only=OURS)
    assert np.array_equal(recording.position, 2 * columns["position"])


def test_time_that_goes_back_or_repeats_is_found_in_any_piece(small: None, tmp_path: Path) -> None:
    columns = motion(300)
    columns["time"][250] = columns["time"][249]
    recording = reader.read(write_csv_text(tmp_path / "a.csv", columns))
    assert any("first: row 251" in note for note in recording.notes)
    columns["time"][250] = columns["time"][200]
    with pytest.raises(RecordingError, match="goes back in row 251"):
        reader.read(write_csv_text(tmp_path / "a.csv", columns))
