"""A path from its cameras to kept frames with figures, in order, with one frame in memory beside those under way."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from ..front.pops import pops
from ..output import write_records
from ..perf.timing import Timing
from ..pipeline import Engine
from ..scene import Scene
from ..scene.camera import Camera
from ..scene.metrics import decibels
from ..scene.temporal import Change, TemporalError, TemporalSummary, summarise
from ..scene.warping import flow, seen_by_both, warping_error
from .frames import Made, Wanted, frames
from .keep import Kept

COLUMNS = (
    "frame", "time_s", "visible", "tile_entries", "subtile_entries", "psnr_db", "temporal_psnr_db", "jumps", "ssim", "flip", "warping_error",
    "warping_error_reference", "pops", "popped", "kept_colours", "cycles", "latency_cycles", "front_cycles", "render_cycles", "stage_cycles", "late", "bytes",
)


@dataclass(frozen=True)
class Beside:
    """What stands right of every picture: another one with its name, and the error of the first against it, times `amplify`; 0: without."""

    name: str
    amplify: float


@dataclass(frozen=True)
class Recording:
    """What is recorded. file: of the scene. fps: frames a second; clock: of the chip, Hz: a frame is late where it takes more cycles than clock / fps.
    temporal: figures against the reference; title: of the first picture."""

    scene: Scene
    file: str | Path
    cameras: Sequence[Camera]
    fps: float
    clock: float
    wanted: Wanted
    title: str
    beside: Beside | None = None

    @property
    def on_chip(self) -> bool:
        """Frames go through the verilated chip."""
        return self.wanted.drawing.engine is Engine.CHIP

    @property
    def slot(self) -> float:
        """Cycles of a frame's slot."""
        return self.clock / self.fps


def eight_bits(image: np.ndarray) -> np.ndarray:
    """uint8 (H, W, 3) of a float picture, clamped to [0, 1]."""
    return np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255.0).astype(np.uint8)


def composed(panels: Sequence[tuple[str, np.ndarray]]) -> np.ndarray:
    """Pictures beside each other, each with its name; uint8 (H, sum of W, 3)."""
    out = Image.fromarray(np.concatenate([eight_bits(image) for _, image in panels], axis=1))
    draw, left = ImageDraw.Draw(out), 0
    for name, image in panels:
        height = max(image.shape[0] // 28, 10)
        box = draw.textbbox((left + height / 2, image.shape[0] - 1.7 * height), name, font_size=height)
        draw.rectangle((box[0] - 3, box[1] - 2, box[2] + 3, box[3] + 2), fill=(0, 0, 0))
        draw.text((left + height / 2, image.shape[0] - 1.7 * height), name, fill=(255, 255, 255), font_size=height)
        left += image.shape[1]
    return np.asarray(out)


class _Figures:
    """Figures that need the frame before."""

    def __init__(self, path: Recording) -> None:
        self.path = path
        self.errors = TemporalError()
        self.before: Made | None = None

    def of(self, made: Made) -> dict[str, Any]:
        found: dict[str, Any] = {}
        before, self.before = self.before, made
        if made.reference is not None:
            found = asdict(self.errors.add(made.image, made.reference))
        if made.depth is not None and made.reference is not None and before is not None:
            assert before.depth is not None and before.reference is not None
            one, two = (self.path.cameras[m.number] for m in (before, made))
            there = flow(before.depth, one, two)
            both = seen_by_both(there, flow(made.depth, two, one))
            found |= {
                "warping_error": warping_error(before.image, made.image, there, both),
                "warping_error_reference": warping_error(before.reference, made.reference, there, both),
            }
        if made.seen is not None and before is not None and before.seen is not None:
            found |= asdict(pops(before.seen, made.seen))
        return found


def _frames(path: Recording, first: int, workers: int) -> Iterator[Made]:
    if path.on_chip:
        from .on_chip import chip_frames

        return chip_frames(path.scene, path.cameras, path.wanted, first)
    return frames(path.scene, path.file, path.cameras, path.wanted, first, workers)


def record(path: Recording, kept: Kept, workers: int, told: Callable[[int], None], noted: Callable[[str], None]) -> None:
    """Make what is missing of a path. told: called with the number of finished frames; noted: with warnings, each kind once."""
    figures, said = _Figures(path), set()
    first = len(kept.rows)
    if first == len(path.cameras):
        return
    # The last frame that is there is made once more: its errors are those of a picture of more than 8 bits, its lists are not kept, and without it the chip has
    # no interval.
    again = first > 0 and (path.wanted.reference or path.wanted.pops or path.on_chip)
    for made in _frames(path, first - again, workers):
        row = {"frame": made.number, "time_s": made.number / path.fps, **figures.of(made), **made.facts}
        if "cycles" in row:
            row["late"] = int(row["cycles"] > path.slot)
        for note in made.notes:
            kind = "".join(c for c in note if not c.isdigit())
            if kind not in said:
                said.add(kind)
                noted(note)
        if made.number < first:
            continue
        panels = [(path.title, made.image)]
        if path.beside is not None:
            other = made.beside if made.beside is not None else made.reference
            assert other is not None
            panels.append((path.beside.name, other))
            if path.beside.amplify:
                error = np.abs(np.clip(made.image, 0.0, 1.0) - np.clip(other, 0.0, 1.0)) * path.beside.amplify
                panels.append((f"error x {path.beside.amplify:g}", error))
        kept.add(row, composed(panels) if len(panels) > 1 else eight_bits(made.image))
        told(len(kept.rows))


def changes_of(rows: Sequence[dict[str, Any]]) -> list[Change]:
    """The temporal figures of kept rows; none where there was no reference."""
    return [Change(row["mse"], row["change"], row["jumps"]) for row in rows if "mse" in row]


def columns_of(row: dict[str, Any]) -> dict[str, Any]:
    """A kept row as the CSV has it: decibels for mean squares, the sum of the bytes; what is not known is empty."""
    found = {name: value for name, value in row.items() if name not in ("mse", "change") and value is not None}
    if "mse" in row:
        found["psnr_db"] = round(decibels(row["mse"]), 4)
        if row["change"] is not None:
            found["temporal_psnr_db"] = round(decibels(row["change"]), 4)
    moved = [value for name, value in row.items() if name.startswith("bytes_")]
    return found | ({"bytes": sum(moved)} if moved else {}) | {"time_s": round(row["time_s"], 6), "made_s": round(row["made_s"], 3)}


def write_stats(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """A CSV file of the frames; columns of `COLUMNS` that no frame has are left out."""
    records = [columns_of(row) for row in rows]
    write_records(path, [name for name in COLUMNS if any(name in record for record in records)], records)


def timing_of(rows: Sequence[dict[str, Any]], slot: float) -> Timing | None:
    """Of kept rows that have cycles; None where no row has."""
    timed = [row for row in rows if "cycles" in row]
    if not timed:
        return None
    found = Timing.of([row["cycles"] for row in timed], slot)
    return replace(found, worst_frame=timed[found.worst_frame]["frame"])


def summary_of(rows: Sequence[dict[str, Any]], fps: float) -> TemporalSummary | None:
    """Temporal figures of kept rows; None where there was no reference."""
    changes = changes_of(rows)
    return summarise(changes, fps) if changes else None


def mean_of(rows: Sequence[dict[str, Any]], name: str) -> float | None:
    """The mean of a column over the frames that have it; None where none does."""
    values = [row[name] for row in rows if row.get(name) is not None]
    return math.fsum(values) / len(values) if values else None
