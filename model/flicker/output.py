"""Results on disk, put in place whole."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from .errors import FlickerError, one_line


def cannot_write(path: Path, error: OSError) -> FlickerError:
    """What is said of a file that cannot be written, with the system's reason."""
    return FlickerError(f"{path}: cannot be written ({error.strerror or one_line(error)})")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """A block that writes into a file or folder: an OSError in it becomes one line that names `path` and the reason."""
    try:
        yield
    except OSError as error:
        raise cannot_write(path, error) from None


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Call write(temporary path), then put the file in place: no partial results, also after Ctrl-C. FlickerError names file and reason.

    Of a link, the file that it leads to is replaced. Devices and pipes stay what they are and get the content.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        with writing(path), tempfile.TemporaryDirectory() as folder:
            write(Path(folder) / path.name)
            with path.open("wb", buffering=0) as stream:
                stream.write((Path(folder) / path.name).read_bytes())
        return
    place = Path(os.path.realpath(path)) if path.is_symlink() else path
    temporary = place.with_name(f".{place.stem}.{os.getpid()}{place.suffix}")
    try:
        with writing(path):
            write(temporary)
            temporary.replace(place)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """A text file, as `write_atomically` writes."""
    write_atomically(path, lambda temporary: temporary.write_text(text))


def json_text(data: object) -> str:
    """Data as JSON that every reader takes: numbers that are not finite are null. Ends in a line feed."""
    return json.dumps(_finite(data), indent=2, allow_nan=False) + "\n"


def _finite(data: object) -> object:
    if isinstance(data, Mapping):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def write_csv(path: Path, rows: Iterable[Sequence[object]]) -> None:
    """A CSV file of rows, the names of the columns first, as `write_atomically` writes."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write_text(path, text.getvalue())


def write_records(path: Path, columns: Sequence[str], records: Sequence[Mapping[str, object]]) -> None:
    """A CSV file of records, `columns` first, then those that any record has, by first appearance; empty where a record has none."""
    names = list(dict.fromkeys([*columns, *(name for record in records for name in record)]))
    write_csv(path, [names, *([record.get(name, "") for name in names] for record in records)])


def check_folder(folder: Path) -> None:
    """Make the folder; FlickerError when that fails or nothing can be written into it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FlickerError(f"{folder}: no folder can be made there ({error.strerror})") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FlickerError(f"{folder}: not writable")


@contextmanager
def folder_atomically(folder: Path) -> Iterator[Path]:
    """A new folder to write into; its files are put into `folder`, beside what is there, at the end of the block. None are after an error or Ctrl-C."""
    folder = folder.absolute()
    if folder.exists() and not folder.is_dir():
        raise FlickerError(f"{folder}: is not a folder")
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}")
    try:
        with writing(folder):
            temporary.mkdir(parents=True)
        yield temporary
        with writing(folder):
            folder.mkdir(exist_ok=True)
            for path in sorted(temporary.iterdir()):
                path.replace(folder / path.name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
