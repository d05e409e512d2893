"""What `flicker render` writes of one view, or of every camera (`--view all`): pictures, depth, alpha."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import FlickerError
from .options import writable, writable_folder, write_atomically

if TYPE_CHECKING:
    from ..front.view import View
    from ..pipeline import Rendered

STEMS = {"--out": "view", "--depth": "depth", "--alpha": "alpha"}  # of files in a folder
_NUMBER = re.compile(r"%(0\d+)?d")
DEPTH_STEPS = 65535


@dataclass(frozen=True)
class Files:
    """Where the results of an option go. path: a file; for every camera a folder, or a name with %d; None: not wanted. every: of every camera."""

    option: str
    path: Path | None
    every: bool

    @property
    def _pattern(self) -> Path:
        assert self.path is not None
        return self.path if self.path.suffix.lower() == ".png" else self.path / f"{STEMS[self.option]}_%03d.png"

    def check(self) -> None:
        """FlickerError for what could not be written."""
        if self.path is None:
            return
        if not self.every:
            if self.path.suffix.lower() != ".png":
                raise FlickerError(f"{self.option}: {self.path}: only .png is written")
            writable(self.path, self.option)
        elif self.path.suffix.lower() == ".png":
            if len(_NUMBER.findall(self.path.name)) != 1 or self.path.name.count("%") != 1:
                raise FlickerError(f"{self.option}: {self.path}: with --view all a folder, or a name with a place for the number, such as view_%03d.png")
            writable_folder(self.path.parent, self.option)
        else:
            writable_folder(self.path, self.option)

    def of(self, number: int) -> Path | None:
        """The file of a camera."""
        if self.path is None or not self.every:
            return self.path
        path = self._pattern
        return path.with_name(path.name % number)

    def __str__(self) -> str:
        return str(self._pattern if self.every else self.path)


def check_distinct(files: Sequence[Files]) -> None:
    """FlickerError where two results would be one file."""
    taken: dict[str, str] = {}
    for each in files:
        if each.path is not None:
            each.check()
            if (other := taken.setdefault(str(each), each.option)) != each.option:
                raise FlickerError(f"{each.option}: {each.path}: is the file of {other} too")


def write_pictures(view: View, result: Rendered, out: Path | None, depth: Path | None, alpha: Path | None) -> dict[str, Any]:
    """Write what is wanted of a view: what stats.json says of it."""
    from ..scene.image import save_grey16, save_png

    said: dict[str, Any] = {}
    for path in (out, depth, alpha):
        if path is not None and not path.parent.is_dir():
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise FlickerError(f"{path.parent}: cannot be made ({error.strerror})") from None
    if out is not None:
        write_atomically(out, lambda path: save_png(path, result.image))
    if alpha is not None:
        assert result.alpha is not None
        covered = result.alpha
        write_atomically(alpha, lambda path: save_grey16(path, covered))
        said["alpha"] = {"file": str(alpha), "of": result.stats["engine"], "step": 1 / DEPTH_STEPS}
    if depth is not None:
        values, said["depth"] = depth_values(view)
        said["depth"] = {"file": str(depth)} | said["depth"]
        write_atomically(depth, lambda path: save_grey16(path, values))
    return said


def depth_values(view: View) -> tuple[Any, dict[str, Any]]:
    """Depth of the float64 reference as numbers in [0, 1] for 16 bits, 0 where nothing is, and what its steps mean."""
    import numpy as np

    from ..front.reference import expected_depth

    depth = expected_depth(view.projected, view.camera)
    seen = np.isfinite(depth)
    farthest = float(depth[seen].max()) if seen.any() else 0.0
    about = {
        "of": "float64 reference", "what": "sum of w z over sum of w, z along the camera's axis, in units of the scene", "step": farthest / DEPTH_STEPS,
        "nearest": float(depth[seen].min()) if seen.any() else None, "farthest": farthest if seen.any() else None, "empty": 0,
    }
    # The nearest thing there is keeps a step of its own, so that 0 means nothing.
    values = np.where(seen, np.maximum(np.where(seen, depth, 0.0) / (farthest or 1.0), 1 / DEPTH_STEPS), 0.0)
    return values, about
