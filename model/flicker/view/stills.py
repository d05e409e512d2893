"""Still pictures and the cameras they were taken from, as `flicker render --cameras` reads them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PIL import Image

from ..output import cannot_write, write_atomically, write_text
from ..scene.camera import Camera, cameras_text, load_cameras


def save(folder: Path, picture: Image.Image, camera: Camera) -> tuple[Path, int]:
    """Write a still picture and add its camera to the folder's `cameras.json`: (the picture's file, number of the camera)."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "cameras.json"
        cameras = load_cameras(path) if path.exists() else []
    except OSError as error:
        raise cannot_write(folder, error) from None
    number = len(cameras)
    still = folder / f"view_{number:03d}.png"
    write_atomically(still, picture.save)
    write_text(path, cameras_text([*cameras, replace(camera, name=still.name, img_name=None)]))
    return still, number
