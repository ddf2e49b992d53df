from __future__ import annotations

import gc
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from rtcomp.errors import OutputExistsError, RecordingError
from rtcomp.loop.ring import WRITTEN, Ring
from rtcomp.recording.reader import read
from rtcomp.recording.recorder import Recorder

COLUMNS = ["time", "position", "voltage"]
WEIGHTS = 4


@pytest.fixture
def ring() -> Iterator[Ring]:
    made = Ring.create(4096, len(COLUMNS) + WEIGHTS)
    yield made
    made.release()


def write(ring: Ring, begin: int, end: int, rate: float = 1000.0) -> None:
    """Write rows as a loop does: data, then the count."""
    for row in range(begin, end):
        place = ring.rows[row % len(ring.rows)]
        place[:] = (row / rate, 1e-6 * row, -row, *[row] * WEIGHTS)
        ring.header[WRITTEN] += 1


def wait_until_flushed(recorder: Recorder, rows: int) -> None:
    deadline = time.monotonic() + 10.0
    while recorder.rows_flushed < rows:
        assert time.monotonic() < deadline and recorder.alive
        time.sleep(0.005)


def descriptors() -> set[str]:
    gc.collect()  # what an earlier test left for the collector must not vanish between two looks
    return {item.name for item in Path("/proc/self/fd").iterdir()}


def test_everything_is_in_the_file(tmp_path: Path, ring: Ring) -> None:
    metadata = {"rate": 1000.0, "configuration": {"device": {"kind": "simulated"}}, "long": "x" * 100_000,
                "versions": ["1", "2"], "realtime": True}  # fmt: skip
    before = descriptors()
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, metadata, weights_columns=WEIGHTS)
    write(ring, 0, 1000)
    wait_until_flushed(recorder, 1000)
    write(ring, 1000, 3500)
    ring.close()
    summary = recorder.finish()
    assert summary.complete and summary.rows == 3500 and summary.rows_lost == 0 and not summary.problem
    assert recorder.finish() is summary
    assert not recorder.alive
    assert descriptors() == before
    with pytest.raises(ChildProcessError):  # nothing left to reap: no zombie
        os.waitpid(recorder.pid, os.WNOHANG)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["complete"] == 1 and file.attrs["rows_lost"] == 0
        assert file.attrs["ended"] == b"complete"
        assert file.attrs["rate"] == 1000.0
        assert file.attrs["configuration"] == '{"device": {"kind": "simulated"}}'
        assert file["position"].attrs["unit"] == "m" and file["voltage"].attrs["unit"] == "V"
        assert np.array_equal(file["position"][:], 1e-6 * np.arange(3500))
        assert np.allclose(file["weights/time"][:], np.arange(0.0, 3.5, 0.1))
        assert np.array_equal(file["weights/weights"][:, 2], file["weights/time"][:] * 1000)
        end = h5py.h5f.FileID.get_filesize(file.id)
    assert (tmp_path / "run.h5").stat().st_size == end  # the space set aside is given back
    recording = read(tmp_path / "run.h5")
    assert recording.metadata["configuration"] == {"device": {"kind": "simulated"}}
    assert recording.metadata["long"] == "x" * 100_000
    assert recording.rate_hz == 1000.0 and recording.notes == []
    assert recording.weights is not None and recording.weights.shape == (35, WEIGHTS)


def test_rotary_axis_has_its_own_units(tmp_path: Path, ring: Ring) -> None:
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS, axis="rotary")
    ring.close()
    assert recorder.finish().complete
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["position"].attrs["unit"] == "rad"
        assert file["position"].shape == (0,)


def test_it_is_readable_while_it_grows_and_has_one_writer(tmp_path: Path, ring: Ring) -> None:
    path = tmp_path / "run.h5"
    recorder = Recorder.start(path, ring, COLUMNS, {}, weights_columns=WEIGHTS)
    write(ring, 0, 500)
    wait_until_flushed(recorder, 500)
    with h5py.File(path, "r", swmr=True) as live:
        for end in (1000, 3000, 6000):  # through several chunks, each of which rewrites the superblock
            for begin in range(live["time"].shape[0], end, 500):
                write(ring, begin, begin + 500)
                wait_until_flushed(recorder, begin + 500)
            live["time"].refresh()
            assert np.array_equal(live["time"][:], np.arange(end) / 1000.0)
    for begin in range(6000, 10_000, 40):  # readers at whatever moment of the writing
        write(ring, begin, begin + 40)
        recording = read(path)
        assert 6000 <= len(recording) <= begin + 40
        assert np.array_equal(recording.voltage, -np.arange(len(recording)))
        assert any("has no end" in note for note in recording.notes)
    with pytest.raises(OSError, match="lock"):
        h5py.File(path, "r+")
    ring.close()
    assert recorder.finish().complete
    assert read(path).notes == []


def test_what_is_known_only_later_is_filled_in(tmp_path: Path, ring: Ring) -> None:
    path = tmp_path / "run.h5"
    names = ["scheduling_class", "priority", "unasked"]
    recorder = Recorder.start(path, ring, COLUMNS, {}, weights_columns=WEIGHTS, later=names)
    assert read_attributes(path)["priority"] == b"unknown"
    recorder.fill({"scheduling_class": "SCHED_FIFO"})
    write(ring, 0, 100)
    wait_until_flushed(recorder, 100)
    time.sleep(0.1)
    assert read_attributes(path)["scheduling_class"] == b"SCHED_FIFO"  # on disk before any end
    with pytest.raises(ValueError, match="not announced"):
        recorder.fill({"speed": "1"})
    recorder.fill({"priority": "80" + "x" * 100})
    ring.close()
    assert recorder.finish().complete
    recorder.fill({"priority": "99"})  # too late, but no harm
    attributes = read_attributes(path)
    assert attributes["priority"] == ("80" + "x" * 62).encode() and attributes["unasked"] == b"unknown"


def read_attributes(path: Path) -> dict[str, object]:
    with h5py.File(path, "r", swmr=True) as file:
        return dict(file.attrs)


def test_a_stopped_recorder_costs_rows_not_the_loop(tmp_path: Path, ring: Ring) -> None:
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS)
    write(ring, 0, 100)
    wait_until_flushed(recorder, 100)
    os.kill(recorder.pid, signal.SIGSTOP)
    time.sleep(0.05)
    write(ring, 100, 10_000)
    os.kill(recorder.pid, signal.SIGCONT)
    ring.close()
    summary = recorder.finish()
    assert summary.ended == "complete" and not summary.complete
    assert summary.rows + summary.rows_lost == 10_000
    assert abs(summary.rows - 100 - 4096) <= 1
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["rows_lost"] == summary.rows_lost
        assert file["voltage"][-1] == -9999 and file["voltage"][99] == -99
    recording = read(tmp_path / "run.h5")
    assert len(recording) == 10_000
    assert int(recording.columns["gap"].sum()) == summary.rows_lost
    assert any("lost" in note for note in recording.notes)


def test_an_error_in_the_loop_is_marked(tmp_path: Path, ring: Ring) -> None:
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS)
    write(ring, 0, 50)
    ring.close(2)
    summary = recorder.finish()
    assert summary.ended == "error" and not summary.complete and summary.rows == 50
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["complete"] == 0 and file.attrs["ended"] == b"error"


def test_finish_closes_a_ring_left_open(tmp_path: Path, ring: Ring) -> None:
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS)
    write(ring, 0, 50)
    summary = recorder.finish()
    assert summary.ended == "error" and summary.rows == 50


def test_a_recorder_that_hangs_is_ended(tmp_path: Path, ring: Ring) -> None:
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS)
    write(ring, 0, 200)
    wait_until_flushed(recorder, 200)
    os.kill(recorder.pid, signal.SIGSTOP)
    write(ring, 200, 300)
    ring.close()
    summary = recorder.finish(timeout=0.2)
    assert summary.ended == "recorder died" and summary.rows == 200 and summary.rows_lost == 100
    assert not recorder.alive
    assert len(read(tmp_path / "run.h5")) == 200


def test_it_loads_no_compiler_and_says_nothing(tmp_path: Path, ring: Ring) -> None:
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS)
    assert "llvm" not in Path(f"/proc/{recorder.pid}/maps").read_text()
    assert b"rtcomp.recording.recorder" in Path(f"/proc/{recorder.pid}/cmdline").read_bytes()
    ring.close()
    recorder.finish()
    code = "import rtcomp.recording.recorder, sys; print({'numba', 'h5py'} & set(sys.modules))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (said.stdout, said.stderr) == ("set()\n", "")


def test_by_hand_it_says_one_line() -> None:
    command = [sys.executable, "-m", "rtcomp.recording.recorder_process"]
    said = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert said.returncode == 2 and said.stderr == "error: the recorder is started by a run, not by hand\n"


def test_full_disk_ends_the_recording_in_order(tmp_path: Path, ring: Ring) -> None:
    recorder = Recorder.start(tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS)
    resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
    for begin in range(0, 100_000, 1000):
        write(ring, begin, begin + 1000)
        while ring.waiting > 500 and recorder.alive:
            time.sleep(0.001)
    assert not recorder.alive
    ring.close()
    summary = recorder.finish()
    assert "File too large" in summary.problem and "\n" not in summary.problem
    assert not summary.complete and summary.rows > 5000 and summary.rows + summary.rows_lost == 100_000
    with h5py.File(tmp_path / "run.h5") as file:
        assert file.attrs["complete"] == 0 and file.attrs["ended"].startswith(b"stopped")
    recording = read(tmp_path / "run.h5")
    assert len(recording) == summary.rows
    assert np.array_equal(recording.voltage, -np.arange(summary.rows))


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_disk_full_from_the_start_is_said_at_once(tmp_path: Path, ring: Ring, overwrite: bool) -> None:
    if overwrite:
        (tmp_path / "run.h5").write_text("the last run")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))
    try:
        with pytest.raises(RecordingError, match="cannot be made: File too large") as caught:
            Recorder.start(
                tmp_path / "run.h5", ring, COLUMNS, {}, weights_columns=WEIGHTS, overwrite=overwrite
            )
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "\n" not in str(caught.value)
    left = [item.read_text() for item in tmp_path.iterdir()]
    assert left == (["the last run"] if overwrite else [])


@pytest.mark.parametrize("where", ["missing/run.h5", "file/run.h5"])
def test_unwritable_paths_are_one_clear_line(tmp_path: Path, ring: Ring, where: str) -> None:
    (tmp_path / "file").write_text("")
    before = descriptors()
    with pytest.raises(
        RecordingError, match=r"run\.h5: the recording cannot be made: (No such|Not a dir)"
    ) as c:
        Recorder.start(tmp_path / where, ring, COLUMNS, {}, weights_columns=WEIGHTS)
    assert "\n" not in str(c.value)
    assert descriptors() == before


def test_nothing_is_overwritten_unasked(tmp_path: Path, ring: Ring) -> None:
    path = tmp_path / "run.h5"
    path.write_text("precious")
    with pytest.raises(OutputExistsError, match="--force"):
        Recorder.start(path, ring, COLUMNS, {}, weights_columns=WEIGHTS)
    assert path.read_text() == "precious"
    recorder = Recorder.start(path, ring, COLUMNS, {}, weights_columns=WEIGHTS, overwrite=True)
    ring.close()
    assert recorder.finish().complete


@pytest.mark.parametrize(
    "change",
    [
        {"columns": ["time", "position"]},
        {"columns": ["position", "time", "voltage"]},
        {"columns": ["time", "time", "voltage"]},
        {"flush_s": 0.2},
        {"flush_s": 0.0},
        {"metadata": {"complete": 1}},
        {"metadata": {"priority": 1}, "later": ["priority"]},
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, ring: Ring, change: dict[str, object]) -> None:
    arguments = {"columns": COLUMNS, "metadata": {}, "weights_columns": WEIGHTS} | change
    with pytest.raises(ValueError):
        Recorder.start(tmp_path / "run.h5", ring, **arguments)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []
