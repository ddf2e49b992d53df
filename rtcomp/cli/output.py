"""Where results go: nothing is overwritten unasked, and nothing old goes before the new is complete."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

from rtcomp.errors import Interrupted, OutputExistsError, RtcompError

MANIFEST = ".rtcomp-files"
"""Lists, in an output folder, the files that rtcomp wrote, so that `--force` replaces those and no others."""


@contextlib.contextmanager
def prepare_output(path: str | Path, force: bool = False) -> Iterator[Path]:
    """Give a folder to write results to; they stand at `path` when the ``with`` block ends.

    A new or empty folder is written to directly, so that a killed run's recording stands where it was asked
    for. With `force`, an existing one stays as it is until the block has ended well; then the new files take
    the places of the earlier run's, and files that no earlier run wrote stay. If the block fails, what it
    wrote is kept beside `path` under a name ending in ``.failed``, which the error's note tells; an empty
    folder is removed. A run that a signal has ended, and that has results all the same (see Interrupted),
    leaves them at `path`, but never in the place of an earlier run's.

    Raises OutputExistsError for a folder that is not empty (without `force`) or a file, RtcompError for a
    place that cannot be written.
    """
    path = Path(path)
    with _as_rtcomp_error(path):
        if path.exists() and not path.is_dir():
            raise OutputExistsError(f"{path} is a file; --out needs a folder")
        occupied = path.is_dir() and any(path.iterdir())
        if occupied and not force:
            raise OutputExistsError(
                f"{path} exists and is not empty; choose another, or --force to replace it"
            )
        work = path.with_name(f"{path.resolve().name}.new-{os.getpid()}") if occupied else path
        existed = work.is_dir()
        work.mkdir(parents=True, exist_ok=not occupied)
    interrupted: Interrupted | None = None
    try:
        yield work
    except Interrupted as error:
        if occupied or not error.results:
            _keep_failed(work, path, error, existed)
            raise
        error.add_note(f"results up to there are in {path}")
        interrupted = error
    except BaseException as error:
        _keep_failed(work, path, error, existed)
        raise
    with _as_rtcomp_error(path):
        written = sorted(str(file.relative_to(work)) for file in work.rglob("*") if file.is_file())
        (work / MANIFEST).write_text("".join(f"{name}\n" for name in written), encoding="utf-8")
        if occupied:
            _replace(path, work, written)
    if interrupted is not None:
        raise interrupted


@contextlib.contextmanager
def _as_rtcomp_error(path: Path) -> Iterator[None]:
    try:
        yield
    except RtcompError:
        raise
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise RtcompError(f"{path} cannot be written: {reason}") from error


def _replace(path: Path, work: Path, written: list[str]) -> None:
    """Move the files in `work` to `path` in place of those that an earlier run wrote there."""
    manifest = path / MANIFEST
    earlier = manifest.read_text(encoding="utf-8").splitlines() if manifest.is_file() else []
    for name in [*written, MANIFEST]:
        target = path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (work / name).replace(target)
    for name in sorted(set(earlier) - set(written)):
        stale = path / name
        if stale.is_file() and path.resolve() in stale.resolve().parents:
            stale.unlink()
            with contextlib.suppress(OSError):  # the folder holds something else still
                stale.parent.rmdir()
    shutil.rmtree(work)


def _keep_failed(work: Path, path: Path, error: BaseException, existed: bool) -> None:
    try:
        if not any(file.is_file() for file in work.rglob("*")):
            shutil.rmtree(work)
            if existed:
                work.mkdir()
            return
        kept = path.with_name(f"{path.resolve().name}.failed")
        if kept.exists():
            kept = path.with_name(f"{kept.name}-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}")
        work.replace(kept)
    except OSError:
        kept = work
    error.add_note(f"what was written until then is kept in {kept}")
