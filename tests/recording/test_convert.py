from __future__ import annotations

import builtins
import gzip
import json
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from recording_files import data, motion, write_csv_text
from scipy.io import loadmat

from rtcomp.errors import OutputExistsError, RecordingError, RtcompError
from rtcomp.loop.ring import WRITTEN, Ring
from rtcomp.recording.convert import convert
from rtcomp.recording.reader import read
from rtcomp.recording.recorder import Recorder
from rtcomp.recording.writer import replacing, write_csv

READABLE = ["a.csv", "a.csv.gz", "a.mat", "a.h5", "a.hdf5"]
ALL = [*READABLE, "a.parquet", "a.mcap"]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A recording as the program makes it, with weights."""
    ring = Ring.create(4096, 4 + 3)
    metadata = {"rate": 1000.0, "configuration": {"device": {"kind": "simulated"}}, "axis": "rotary"}
    names = ["time", "reference", "position", "voltage"]
    recorder = Recorder.start(tmp_path / "run.h5", ring, names, metadata, weights_columns=3, axis="rotary")
    for row, values in enumerate(zip(*motion(800).values(), strict=True)):
        ring.rows[row] = (*values, row, 2 * row, -row)
        ring.header[WRITTEN] += 1
    ring.close()
    assert recorder.finish().complete
    ring.release()
    return tmp_path / "run.h5"


@pytest.mark.parametrize("name", READABLE)
def test_round_trip_through_every_format(tmp_path: Path, run: Path, name: str) -> None:
    written = convert(run, tmp_path / name)
    again = read(tmp_path / name)
    assert again.rate_hz == 1000.0 and again.columns.keys() == written.columns.keys()
    for column, values in motion(800).items():
        assert np.array_equal(again.columns[column], values)
    if name.startswith("a.csv"):
        assert any("weights are not in a.csv" in note for note in written.notes)
        assert any("metadata is not in a.csv" in note for note in written.notes)
    else:
        assert written.notes == [] and again.notes == []
        assert again.metadata == written.metadata
        assert again.metadata["configuration"] == {"device": {"kind": "simulated"}}
        assert np.array_equal(again.weights, written.weights)  # type: ignore[arg-type]
        assert np.array_equal(again.weights_time, np.arange(8) / 10)  # type: ignore[arg-type]


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    hnp.arrays(np.float64, (2, 30), elements=st.floats(allow_nan=False, allow_infinity=False, width=64)),
    st.sampled_from(READABLE),
)
def test_every_float_comes_back_as_it_was(tmp_path: Path, values: np.ndarray, name: str) -> None:
    columns = {
        "time": np.arange(30) / 500.0,
        "position": np.arange(30.0),
        "voltage": values[0],
        "extra": values[1],
    }
    source = write_csv_text(tmp_path / "source.csv", columns)
    convert(source, tmp_path / name, force=True)
    again = read(tmp_path / name, mark_outliers=False)
    for column in ("voltage", "extra"):
        assert np.array_equal(again.columns[column], columns[column])


def test_chain_through_all_formats(tmp_path: Path, run: Path) -> None:
    step = run
    for i, suffix in enumerate([".mat", ".h5", ".csv.gz", ".h5", ".mat", ".csv"]):
        convert(step, tmp_path / f"{i}{suffix}")
        step = tmp_path / f"{i}{suffix}"
    assert np.array_equal(read(step).position, read(run).position)


def test_mapping_and_rate_travel(tmp_path: Path) -> None:
    columns = motion(2000)
    source = write_csv_text(
        tmp_path / "s.csv", {"t": columns["time"], "qm": columns["position"], "vir": columns["voltage"]}
    )
    mapping = {"time": "t", "position": "qm", "voltage": "vir"}
    convert(source, tmp_path / "a.mat", mapping, rate_hz=500.0)
    content = loadmat(tmp_path / "a.mat")
    assert content["position"].shape == (1000, 1) and read(tmp_path / "a.mat").rate_hz == 500.0


def test_hdf5_is_as_the_format_says(tmp_path: Path, run: Path) -> None:
    convert(run, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["position"].ndim == 1 and file["position"].attrs["unit"] == "rad"
        assert file["weights/weights"].shape == (8, 3)
        assert json.loads(file.attrs["configuration"]) == {"device": {"kind": "simulated"}}


def test_parquet(tmp_path: Path, run: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")
    convert(run, tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert np.array_equal(table["position"].to_numpy(), motion(800)["position"])
    assert table.schema.field("voltage").metadata == {b"unit": b"V"}
    assert json.loads(table.schema.metadata[b"configuration"]) == {"device": {"kind": "simulated"}}


def test_mcap(tmp_path: Path, run: Path) -> None:
    reader = pytest.importorskip("mcap.reader", reason="needs the extra mcap")
    convert(run, tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as file:
        messages = list(reader.make_reader(file).iter_messages(topics=["/recording"]))
    assert len(messages) == 800
    schema, channel, message = messages[500]
    # PlotJuggler picks its parser by the channel's encoding, Foxglove by the schema's.
    assert channel.message_encoding == "json" and schema.encoding == "jsonschema"
    assert message.log_time == 500_000_000
    values = json.loads(message.data)
    assert values == {name: column[500] for name, column in motion(800).items()}
    assert json.loads(schema.data)["properties"].keys() == values.keys()


@pytest.mark.parametrize("name", ALL)
def test_nothing_is_overwritten_unasked(tmp_path: Path, run: Path, name: str) -> None:
    (tmp_path / name).write_text("precious")
    with pytest.raises(OutputExistsError, match="--force"):
        convert(run, tmp_path / name)
    assert (tmp_path / name).read_text() == "precious"
    convert(run, tmp_path / name, force=True)
    assert (tmp_path / name).stat().st_size > 1000
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "run.h5"])


def test_the_source_is_never_overwritten(tmp_path: Path, run: Path) -> None:
    before = run.read_bytes()
    with pytest.raises(OutputExistsError, match="itself"):
        convert(run, run, force=True)
    (tmp_path / "link.h5").symlink_to(run)
    with pytest.raises(OutputExistsError, match="itself"):
        convert(run, tmp_path / "link.h5", force=True)
    assert run.read_bytes() == before


def test_unusable_targets_are_one_clear_line(tmp_path: Path, run: Path) -> None:
    for target, said in (
        (tmp_path / "a.xlsx", "must end in .csv, .csv.gz, .mat"),
        (tmp_path / "a", "must end in"),
        (tmp_path / "none" / "a.csv", "there is no folder"),
    ):
        with pytest.raises(RecordingError, match=said) as caught:
            convert(run, target)
        assert "\n" not in str(caught.value)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(OutputExistsError, match="is a folder"):
        convert(run, tmp_path / "folder.csv", force=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.csv", "run.h5"]


@pytest.mark.parametrize(("name", "module"), [("a.parquet", "pyarrow"), ("a.mcap", "mcap.writer")])
def test_a_missing_extra_is_named(
    tmp_path: Path, run: Path, name: str, module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = builtins.__import__

    def without(wanted: str, *arguments: object, **options: object) -> object:
        if wanted == module:
            raise ImportError(wanted)
        return original(wanted, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RtcompError, match=r"pip install 'rtcomp\["):
        convert(run, tmp_path / name)
    assert not (tmp_path / name).exists()


def test_an_unusable_source_leaves_no_target(tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_text("time,position,voltage\n1,2,3\n")
    with pytest.raises(RecordingError, match="has 1 row;"):
        convert(tmp_path / "s.csv", tmp_path / "a.h5")
    assert [p.name for p in tmp_path.iterdir()] == ["s.csv"]


def test_heads_yaw_to_all(tmp_path: Path) -> None:
    source = data("real/heads-yaw/yaw_sine_to_330s.csv.gz")
    mapping = {"time": "t_s", "position": "position_rad", "voltage": "effort_measured_Nm"}
    whole = convert(source, tmp_path / "a.h5", mapping)
    again = read(tmp_path / "a.h5", mark_outliers=False)
    for name, column in whole.columns.items():
        assert np.array_equal(again.columns[name], column)


# The writer


def test_csv_is_written_quickly_and_read_by_others(tmp_path: Path) -> None:
    columns = {f"c{i}": np.random.default_rng(i).standard_normal(60_000) for i in range(8)}
    begin = time.perf_counter()
    write_csv(tmp_path / "a.csv", columns)
    assert time.perf_counter() - begin < 2.0
    table = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True, max_rows=100)
    assert table.dtype.names == tuple(columns)
    assert np.array_equal(table["c3"], columns["c3"][:100])
    write_csv(tmp_path / "a.csv.gz", columns)
    assert gzip.decompress((tmp_path / "a.csv.gz").read_bytes()) == (tmp_path / "a.csv").read_bytes()


def test_csv_refuses_what_it_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="differ"):
        write_csv(tmp_path / "a.csv", {"a": [1.0], "b": [1.0, 2.0]})
    with pytest.raises(ValueError, match="header"):
        write_csv(tmp_path / "a.csv", {"a,b": [1.0]})
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "a.csv"
    target.write_text("before")
    with pytest.raises(ZeroDivisionError), replacing(target, force=True) as temporary:
        temporary.write_text("half")
        raise ZeroDivisionError
    assert target.read_text() == "before" and len(list(tmp_path.iterdir())) == 1


def test_a_target_that_appears_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "a.csv"
    with pytest.raises(OutputExistsError), replacing(target) as temporary:
        temporary.write_text("mine")
        target.write_text("another's")
    assert target.read_text() == "another's" and len(list(tmp_path.iterdir())) == 1


def test_a_full_disk_leaves_what_was_there(tmp_path: Path) -> None:
    code = (
        "import resource, numpy as np; from rtcomp.recording.writer import write_csv;"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000));"
        f"write_csv({str(tmp_path / 'a.csv')!r}, {{'a': np.arange(1e4)}})"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert said.returncode == 1
    assert said.stderr.strip().split("\n")[-1].endswith("a.csv: cannot be written: File too large")
    assert list(tmp_path.iterdir()) == []
