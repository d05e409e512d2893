"""Photographs of a `transforms.json` without their lenses (`fit.lens`), the principal point in the middle (`flicker undistort`; docs/reference/datasets.md)."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import FlickerError, one_line
from ..output import json_text
from ..scene.colmap import find_model
from ..scene.fields import read_json
from ..scene.image import save_png
from ..scene.lens import FLAGS, FOREIGN
from ..scene.transforms import FROM_OPENGL, NUMBERS, frames_of, splits_of
from .dataset import ply_of, transforms_shot
from .shot import Shot

# Of the file: they say what the new pictures do not have any more, or name the old ones.
_GONE = {"frames", "camera_model", "distortion_params", *NUMBERS, *FLAGS, *FOREIGN}


def undistort(dataset: Path, out: Path, size: int | None = None, progress: Callable[[int, int], None] = lambda done, total: None) -> list[Shot]:
    """Write the photographs as PNG, upright, their masks, and a transforms.json that has no lens any more, into folder `out`, whole or not at all: the
    photographs. size: longer side, larger ones are averaged. Transparent parts are composed over black. Lists of names follow, and the points of
    `ply_file_path` are copied. FlickerError, naming file and field."""
    path = dataset / "transforms.json" if dataset.is_dir() else dataset
    if not path.is_file():
        if not dataset.is_dir():
            raise FlickerError(f"{dataset}: no such file or folder")
        if find_model(dataset) is not None:
            raise FlickerError(f"{dataset}: a COLMAP model, no transforms.json: COLMAP undistorts its own (image_undistorter), flicker fit does so by itself")
        others = ", ".join(sorted(one_line(file.name) for file in dataset.glob("transforms*.json")))
        raise FlickerError(f"{dataset}: no transforms.json" + (f"; give one of its files: {others}" if others else ""))
    data = read_json(path)
    listed = frames_of(path, data)
    splits, ply = splits_of(path, data, listed), ply_of(path, data)
    shots = [transforms_shot(frame, size, exact=True) for frame in listed]
    if not shots:
        raise FlickerError(f"{path}: frames: none")
    names = [shot.path.with_suffix(".png").name for shot in shots]
    if len(set(names)) != len(names):  # of several folders: those stay
        names = ["/".join(shot.path.with_suffix(".png").parts[-len(PurePosixPath(str(shot.camera.img_name)).parts) :]) for shot in shots]
    if len(set(names)) != len(names):
        raise FlickerError(f"{path}: two of its pictures have one name but for the suffix")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise FlickerError(f"{out}: is there already, and not empty")
    place = next(folder for folder in out.absolute().parents if folder.is_dir())
    temporary = place / f".{out.name}.{os.getpid()}"
    try:
        (temporary / "images").mkdir(parents=True)
        frames = []
        for n, (shot, name) in enumerate(zip(shots, names)):
            progress(n, len(shots))
            frames.append(_write(shot, temporary, name))
        progress(len(shots), len(shots))
        kept = {key: value for key, value in data.items() if key not in _GONE}
        kept |= {key: [f"images/{names[n]}" for n in numbers] for key, numbers in splits.items()}
        if ply is not None and ply.is_file():
            shutil.copyfile(ply, temporary / ply.name)
            kept["ply_file_path"] = ply.name
        else:
            kept.pop("ply_file_path", None)
        (temporary / "transforms.json").write_text(json_text(kept | {"frames": frames}))
        out.parent.mkdir(parents=True, exist_ok=True)
        if out.exists():
            out.rmdir()
        temporary.rename(out)
    except OSError as error:
        raise FlickerError(f"{out}: cannot be written ({error.strerror or one_line(error)})") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return shots


def _write(shot: Shot, folder: Path, name: str) -> dict[str, Any]:
    """A photograph and its mask; its frame of the new transforms.json. Raises OSError."""
    camera = shot.camera
    (folder / "images" / name).parent.mkdir(parents=True, exist_ok=True)
    save_png(folder / "images" / name, shot.load())
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.rotation * FROM_OPENGL, camera.position
    frame = {"file_path": f"images/{name}", "w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy, "transform_matrix": pose.tolist()}
    if (counted := shot.counted()) is not None:
        (folder / "masks" / name).parent.mkdir(parents=True, exist_ok=True)
        save_png(folder / "masks" / name, np.repeat(counted[..., None].astype(np.float64), 3, axis=2))
        frame["mask_path"] = f"masks/{name}"
    return frame
