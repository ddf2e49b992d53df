"""Writing tables: never half a file under its final name, never over another's work."""

from __future__ import annotations

import contextlib
import gzip
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rtcomp.errors import OutputExistsError, RecordingError

Floats = npt.NDArray[np.float64]


@contextlib.contextmanager
def replacing(target: str | os.PathLike[str], force: bool = False) -> Iterator[Path]:
    """Give a temporary name beside `target`; take it over as `target` if the block ends without an error.

    Raises OutputExistsError where `target` exists and `force` is false (also where it came to exist in the
    meantime), RecordingError where its folder does not exist or the disk refuses.
    """
    target = Path(target)
    if target.is_dir():
        raise OutputExistsError(f"{target}: is a folder; name a file")
    if os.path.lexists(target) and not force:
        raise OutputExistsError(f"{target}: exists already; choose another name or use --force")
    if not target.parent.is_dir():
        raise RecordingError(f"{target}: there is no folder {str(target.parent)!r}")
    suffix = ".csv.gz" if target.name.lower().endswith(".csv.gz") else target.suffix
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part{suffix}")
    try:
        yield temporary
        if force:
            temporary.replace(target)
        else:
            take_name(temporary, target)
    except OSError as error:
        if isinstance(error, OutputExistsError):
            raise
        raise RecordingError(f"{target}: cannot be written: {error.strerror or error}") from None
    finally:
        temporary.unlink(missing_ok=True)


def take_name(temporary: Path, target: Path) -> None:
    """Rename without ever replacing: a hard link fails where the name is taken, in one step."""
    try:
        target.hardlink_to(temporary)
    except FileExistsError:
        raise OutputExistsError(f"{target}: exists already; choose another name or use --force") from None
    except OSError:  # a file system without hard links
        if os.path.lexists(target):
            raise OutputExistsError(f"{target}: exists already; choose another name or use --force") from None
        temporary.rename(target)


def write_csv(
    path: str | os.PathLike[str], columns: Mapping[str, npt.ArrayLike], force: bool = False
) -> None:
    """Write `columns` (1-D, of one length) as CSV, or as CSV.gz where `path` ends in ``.gz``.

    The header line names the columns; numbers are the shortest text that reads back as the same float64.
    Raises OutputExistsError where `path` exists and `force` is false, RecordingError where it cannot be
    written, ValueError where the columns differ in length or a name cannot stand in a header line.
    """
    arrays = [np.asarray(column, dtype=np.float64) for column in columns.values()]
    if len({array.shape for array in arrays}) > 1 or any(array.ndim != 1 for array in arrays):
        raise ValueError(f"columns differ in shape: { ({n: np.shape(c) for n, c in columns.items()}) }")
    if unfit := [name for name in columns if not name or set(name) & set(',;\t\n\r"#')]:
        raise ValueError(f"column name {unfit[0]!r} cannot stand in a CSV header")
    rows = zip(*(map(repr, array.tolist()) for array in arrays), strict=True)
    text = "\n".join([",".join(columns), *map(",".join, rows), ""]).encode()
    with replacing(path, force) as temporary:
        if os.fspath(path).lower().endswith(".gz"):
            with temporary.open("wb") as raw, gzip.GzipFile("", "wb", 6, raw, mtime=0) as packed:
                packed.write(text)
        else:
            temporary.write_bytes(text)
