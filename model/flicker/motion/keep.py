"""What is there of a path while it is made: a folder with every finished frame and its figures, from which videos are written and --resume goes on."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..errors import FlickerError
from ..explore.digest import code_digest, file_digest, key
from ..output import json_text, write_atomically, write_text, writing
from ..scene.camera import Camera, cameras_text

ABOUT, ROWS, STEM = "path.json", "rows.jsonl", "frame_"
FASTEST = 1  # of PNG's compression: files that are read once


def digest_of(scene: str | Path) -> str:
    """Of a scene's content; of a folder, that of its files."""
    path = Path(scene)
    if path.is_file():
        return file_digest(path)
    return key(*(f"{p.relative_to(path)} {file_digest(p)}" for p in sorted(path.rglob("*")) if p.is_file())) if path.is_dir() else str(scene)


def about(scene: str | Path, cameras: Sequence[Camera], fps: float, settings: dict[str, Any]) -> dict[str, Any]:
    """What a path is, for `path.json`: frames of two that are equal may stand in one video. settings: texts by option."""
    return {
        "scene": str(scene), "scene_digest": digest_of(scene), "frames": len(cameras), "fps": fps, "cameras": key(cameras_text(cameras)), "code": code_digest(),
        **settings,
    }


class Kept:
    """Finished frames of a path in a folder. rows: figures of each. whole: the folder is the result itself, and stays."""

    def __init__(self, folder: Path, whole: bool) -> None:
        self.folder, self.whole = folder, whole
        self.rows: list[dict[str, Any]] = []

    def picture(self, number: int) -> Path:
        """The file of a frame."""
        return self.folder / f"{STEM}{number:05d}.png"

    @property
    def pictures(self) -> list[Path]:
        """Those of finished frames."""
        return [self.picture(n) for n in range(len(self.rows))]

    def begin(self, told: dict[str, Any], resume: bool) -> str | None:
        """Take up what is there, or begin anew; a line for people where frames of an earlier run are there. FlickerError where they are of something else, or
        nothing can be written."""
        there = self.folder / ABOUT
        before = sorted(self.folder.glob(f"{STEM}*.png")) if self.folder.is_dir() else []
        if before and not there.is_file():
            raise FlickerError(f"{self.folder}: has {before[0].name}, which is no frame of a path: name another folder")
        said = None
        if resume and there.is_file():
            try:
                old = json.loads(there.read_text())
            except (OSError, ValueError):
                old = {}
            differs = [name for name in {**old, **told} if old.get(name) != told.get(name)] if isinstance(old, dict) else list(told)
            if differs:
                raise FlickerError(f"{self.folder}: its frames are of another path ({', '.join(sorted(differs))}); without --resume it begins anew")
            self.rows = self._read()
            return f"{self.folder}: goes on after {len(self.rows)} of {told['frames']} frames"
        if resume:
            said = f"{self.folder}: no frames there: begins anew"
        elif before:
            said = f"{self.folder}: {len(before)} frames of an earlier run are overwritten; --resume goes on with them"
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            for path in (*before, self.folder / ROWS):
                path.unlink(missing_ok=True)
        write_text(there, json_text(told))
        return said

    def _read(self) -> list[dict[str, Any]]:
        """Rows of frames whose picture is there; a last line that was not written to its end is none."""
        rows: list[dict[str, Any]] = []
        path = self.folder / ROWS
        for line in path.read_text().splitlines() if path.is_file() else []:
            try:
                row = json.loads(line)
            except ValueError:
                break
            if row.get("frame") != len(rows) or not self.picture(len(rows)).is_file():
                break
            rows.append(row)
        write_text(path, "".join(json.dumps(row) + "\n" for row in rows))
        return rows

    def add(self, row: dict[str, Any], picture: np.ndarray) -> None:
        """The next frame: its figures and its picture, uint8 (H, W, 3)."""
        options = {} if self.whole else {"compress_level": FASTEST}
        write_atomically(self.picture(len(self.rows)), lambda path: Image.fromarray(picture).save(path, format="PNG", **options))
        with writing(self.folder / ROWS), (self.folder / ROWS).open("a") as file:
            file.write(json.dumps(row) + "\n")
        self.rows.append(row)

    def forget(self) -> None:
        """No frame is there: nor is anything else, then, but what a folder had before."""
        for path in (self.folder / ABOUT, self.folder / ROWS):
            path.unlink(missing_ok=True)
        with suppress(OSError):
            self.folder.rmdir()

    def finish(self) -> None:
        """The result is written: frames that are no result go."""
        if not self.whole:
            shutil.rmtree(self.folder, ignore_errors=True)
