"""Results on disk: one Parquet file per finished point while a sweep runs, one for all when it is complete.

    <out>/<hash>/sweep.json         what the hash stands for
    <out>/<hash>/points/<key>.parquet
    <out>/<hash>/results.parquet    all rows, in the order of the sweep
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ...errors import FlickerError
from .config import Point, Sweep

KEY = "point"  # column with the point's key


def plain(value: Any) -> Any:
    """numpy scalars as Python's."""
    return value.item() if hasattr(value, "item") else value


def write_rows(path: Path, rows: list[dict[str, Any]]) -> None:
    """Rows to a Parquet file, atomically; columns in order of first appearance."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    table = pa.table({name: [plain(row.get(name)) for row in rows] for name in columns})
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        pq.write_table(table, temporary)
        temporary.replace(path)
    except OSError as error:
        raise FlickerError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Rows of a Parquet file."""
    try:
        return pq.ParquetFile(path).read().to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise FlickerError(f"{path}: damaged ({str(error).splitlines()[0]})") from None


class Store:
    """The folder of a sweep. Made, and tried out, before any work starts."""

    def __init__(self, sweep: Sweep) -> None:
        self.sweep, self.folder = sweep, sweep.folder
        self.points = self.folder / "points"
        self.path = self.folder / "results.parquet"
        self.rows: dict[str, dict[str, Any]] = {}
        probe = self.folder / f".probe.{os.getpid()}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            probe.write_bytes(b"")
            probe.unlink()
            (self.folder / "sweep.json").write_text(json.dumps(sweep.description(), indent=2) + "\n")
        except OSError as error:
            raise FlickerError(f"{self.folder}: cannot be written ({error.strerror})") from None
        self._resume()

    def _resume(self) -> None:
        """Take over what earlier runs have finished; a file that cannot be read counts as not finished."""
        wanted = {p.key for p in self.sweep.points}
        for path in [self.path, *sorted(self.points.glob("*.parquet"))]:
            if not path.exists():
                continue
            try:
                rows = read_rows(path)
            except FlickerError:
                path.unlink()
                continue
            self.rows |= {row[KEY]: row for row in rows if row.get(KEY) in wanted}

    def missing(self) -> list[Point]:
        """Points not finished."""
        return [p for p in self.sweep.points if p.key not in self.rows]

    def add(self, point: Point, row: dict[str, Any]) -> bool:
        """Keep the row of a point, unless it is there already."""
        if point.key in self.rows:
            return False
        row = {KEY: point.key, "scene_file": point.scene.name, "scene_digest": point.scene.digest, **row}
        self.points.mkdir(exist_ok=True)
        write_rows(self.points / f"{point.key}.parquet", [row])
        self.rows[point.key] = {name: plain(value) for name, value in row.items()}
        return True

    def ordered(self) -> list[dict[str, Any]]:
        """Rows of finished points, in the order of the sweep."""
        return [self.rows[p.key] for p in self.sweep.points if p.key in self.rows]

    def complete(self) -> None:
        """Put all rows into one file. Only when nothing is missing."""
        if self.points.exists() or not self.path.exists():
            write_rows(self.path, self.ordered())
            shutil.rmtree(self.points, ignore_errors=True)


def load_results(folder: str | Path) -> list[dict[str, Any]]:
    """Rows of a complete sweep, from its folder. FlickerError when it is not complete."""
    path = Path(folder) / "results.parquet"
    if not path.exists():
        raise FlickerError(f"{path}: no such file; the sweep is not complete")
    return read_rows(path)
