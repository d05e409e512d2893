"""Results of a sweep: one file per finished point while it runs, one table for all when it is complete.

    <out>/points/<key>.json         a point, by what it depends on (`explore.store`)
    <out>/<hash>/sweep.json         what the hash stands for
    <out>/<hash>/results.parquet    all rows, in the order of the sweep
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ...errors import FlickerError
from ...output import json_text, write_atomically, write_text, writing
from ..points import Point
from ..store import Store, plain
from .config import Sweep

KEY = "point"  # column with the point's key


def write_rows(path: Path, rows: list[dict[str, Any]]) -> None:
    """Rows to a Parquet file, atomically; columns in order of first appearance."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    table = pa.table({name: [row.get(name) for row in rows] for name in columns})
    write_atomically(path, lambda temporary: pq.write_table(table, temporary))


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Rows of a Parquet file."""
    try:
        return pq.ParquetFile(path).read().to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise FlickerError(f"{path}: damaged ({str(error).splitlines()[0]})") from None


class Rows:
    """Rows of a sweep's points, from the store where they are there, and the table that they become."""

    def __init__(self, sweep: Sweep) -> None:
        self.sweep, self.folder = sweep, sweep.folder
        self.path = self.folder / "results.parquet"
        self.store = Store(sweep.store)
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        write_text(self.folder / "sweep.json", json_text(sweep.description()))
        self.rows: dict[str, dict[str, Any]] = {}
        for point in sweep.points:
            if (row := self.store.load(point.key)) is not None:
                self.rows[point.key] = self._labelled(point, row)

    def _labelled(self, point: Point, row: dict[str, Any]) -> dict[str, Any]:
        return {KEY: point.key, "scene_file": point.target.scene.file, "scene_digest": point.target.scene.digest, **row}

    def missing(self) -> list[Point]:
        """Points not finished."""
        return [p for p in self.sweep.points if p.key not in self.rows]

    def add(self, point: Point, row: dict[str, Any]) -> bool:
        """Keep the row of a point, unless it is there already."""
        if point.key in self.rows:
            return False
        self.store.put(point.key, row)
        self.rows[point.key] = self._labelled(point, {name: plain(value) if hasattr(value, "dtype") else value for name, value in row.items()})
        return True

    def ordered(self) -> list[dict[str, Any]]:
        """Rows of finished points, in the order of the sweep."""
        return [self.rows[p.key] for p in self.sweep.points if p.key in self.rows]

    def complete(self) -> None:
        """Put all rows into one file. Only when nothing is missing."""
        write_rows(self.path, self.ordered())


def load_results(folder: str | Path) -> list[dict[str, Any]]:
    """Rows of a complete sweep, from its folder. FlickerError when it is not complete."""
    path = Path(folder) / "results.parquet"
    if not path.exists():
        raise FlickerError(f"{path}: no such file; the sweep is not complete")
    return read_rows(path)
