"""Output folders: nothing is overwritten unasked, nothing is lost when a run fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtcomp.cli.output import MANIFEST, prepare_output
from rtcomp.errors import DeviceError, OutputExistsError, RtcompError


def listing(folder: Path) -> dict[str, str]:
    """Return every file below `folder` with its text, without the manifest."""
    files = (file for file in folder.rglob("*") if file.is_file() and file.name != MANIFEST)
    return {str(file.relative_to(folder)): file.read_text() for file in files}


def write(path: Path, text: str, force: bool = False) -> None:
    with prepare_output(path, force) as folder:
        (folder / "recording.h5").write_text(text)
        (folder / "figures").mkdir(exist_ok=True)
        (folder / "figures" / f"{text}.svg").write_text(text)


def test_a_new_folder_is_made_with_its_parents_and_used_at_once(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    with prepare_output(out) as folder:
        assert folder == out  # a run that is killed leaves its recording where it was asked for
        (folder / "x").write_text("1")
    assert listing(tmp_path) == {"a/b/x": "1"}


def test_an_empty_folder_may_be_there(tmp_path: Path) -> None:
    write(tmp_path, "one")
    assert set(listing(tmp_path)) == {"recording.h5", "figures/one.svg"}


def test_an_occupied_folder_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputExistsError, match="exists and is not empty"):
        write(tmp_path, "one")
    assert listing(tmp_path) == {"mine.txt": "mine"}


def test_a_file_in_its_place_is_refused_even_with_force(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.write_text("mine")
    for force in (False, True):
        with pytest.raises(OutputExistsError, match="is a file"):
            write(out, "one", force)
    assert out.read_text() == "mine"


def test_force_replaces_the_earlier_runs_files_and_no_others(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "one")
    (out / "notes.txt").write_text("mine")
    (out / "figures" / "mine.svg").write_text("mine")
    write(out, "two", force=True)
    assert listing(tmp_path) == {
        "out/recording.h5": "two",
        "out/figures/two.svg": "two",
        "out/notes.txt": "mine",
        "out/figures/mine.svg": "mine",
    }


def test_the_old_results_stand_until_the_new_are_complete(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "one")
    with prepare_output(out, force=True) as folder:
        (folder / "recording.h5").write_text("two")
        assert listing(out) == {"recording.h5": "one", "figures/one.svg": "one"}
    assert listing(tmp_path) == {"out/recording.h5": "two"}


@pytest.mark.parametrize("error", [DeviceError("the drive is gone"), KeyboardInterrupt()])
@pytest.mark.parametrize("occupied", [False, True])
def test_what_a_failed_run_wrote_is_kept_under_a_clear_name(
    tmp_path: Path, error: BaseException, occupied: bool
) -> None:
    out = tmp_path / "out"
    if occupied:
        write(out, "one")
    with pytest.raises(type(error)) as caught, prepare_output(out, force=occupied) as folder:
        (folder / "recording.h5").write_text("half")
        raise error
    assert caught.value.__notes__[-1] == f"what was written until then is kept in {out}.failed"
    assert (tmp_path / "out.failed" / "recording.h5").read_text() == "half"
    kept = {k: v for k, v in listing(tmp_path).items() if not k.startswith("out.failed")}
    assert kept == ({"out/recording.h5": "one", "out/figures/one.svg": "one"} if occupied else {})


def test_a_second_failure_does_not_overwrite_the_first(tmp_path: Path) -> None:
    for n in range(2):
        with pytest.raises(DeviceError), prepare_output(tmp_path / "out") as folder:
            (folder / "x").write_text(str(n))
            raise DeviceError("gone")
    assert sorted(listing(tmp_path).values()) == ["0", "1"]


@pytest.mark.parametrize("there", [False, True])
def test_a_run_that_fails_before_it_wrote_anything_leaves_no_trace(tmp_path: Path, there: bool) -> None:
    out = tmp_path / "out"
    if there:
        out.mkdir()
    with pytest.raises(DeviceError) as caught, prepare_output(out) as folder:
        (folder / "figures").mkdir()
        raise DeviceError("no such port")
    assert not hasattr(caught.value, "__notes__")
    assert [p.name for p in tmp_path.iterdir()] == (["out"] if there else [])
    assert not there or list(out.iterdir()) == []


def test_a_place_that_cannot_be_written_is_one_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RtcompError, match="cannot be written: not a directory"):
        write(tmp_path / "file" / "out", "one")


def test_the_manifest_cannot_reach_outside(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "one")
    (tmp_path / "precious").write_text("mine")
    (out / MANIFEST).write_text(f"../precious\n{tmp_path}/precious\nrecording.h5\n")
    write(out, "two", force=True)
    assert (tmp_path / "precious").read_text() == "mine"
