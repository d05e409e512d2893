"""Small data sets of photographs: renderings of a small scene, as a transforms.json or a COLMAP model."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scene_samples as samples
from flicker_tb.runner import seed

from flicker.front.projection import project
from flicker.front.reference import render_with_transmittance
from flicker.scene.camera import Camera, orbit_camera
from flicker.scene.gaussians import Scene
from flicker.scene.image import save_png

WIDTH, HEIGHT, SHOTS = 48, 40, 17


def pose(camera: Camera) -> list:
    matrix = np.eye(4)
    matrix[:3, :3] = camera.rotation * np.array([1, -1, -1])
    matrix[:3, 3] = camera.position
    return matrix.tolist()


def scene_of_shots() -> Scene:
    scene = samples.random_scene(seed(), 120, 1)
    scene.scales *= np.float32(3.0)
    return scene


Views = list[tuple[Camera, np.ndarray]]


def picture_of(scene: Scene, camera: Camera) -> np.ndarray:
    """float64 (H, W, 3), by the reference renderer over black."""
    return render_with_transmittance(project(scene, camera), camera, (0, 0, 0))[0]


def views_around() -> Views:
    """Views all around a small scene."""
    scene = scene_of_shots()
    return [(camera, picture_of(scene, camera)) for camera in (orbit_camera(scene, k, SHOTS, WIDTH, HEIGHT) for k in range(SHOTS))]


def write_transforms(folder: Path, shots: Views, name: str = "transforms.json", place: str = "images", **more: object) -> dict:
    """Pictures r_0.png, ... in the folder `place`, and a file with their frames; more: of the whole file. What the file holds."""
    (folder / place).mkdir(parents=True, exist_ok=True)
    for k, (_, picture) in enumerate(shots):
        save_png(folder / place / f"r_{k}.png", picture)
    data = {
        "camera_angle_x": 2 * math.atan(WIDTH / 2 / shots[0][0].fx),
        "frames": [{"file_path": f"./{place}/r_{k}", "transform_matrix": pose(camera)} for k, (camera, _) in enumerate(shots)],
    } | more
    (folder / name).write_text(json.dumps(data))
    return data


def write_colmap(
    folder: Path, shots: Views, model: int = 1, points: np.ndarray | None = None, lens: Sequence[float] | None = None,
    size: tuple[int, int] = (2 * WIDTH, 2 * HEIGHT), pictures: Sequence[np.ndarray] | None = None,
) -> Path:
    """sparse/0 and images/. model: COLMAP's number of a model; lens: its parameters, those of a pinhole by default; size: the camera's, twice the pictures'.
    pictures: in place of those of the shots."""
    sparse = folder / "sparse" / "0"
    sparse.mkdir(parents=True, exist_ok=True)
    (folder / "images").mkdir(exist_ok=True)
    c = shots[0][0]
    numbers = (2 * c.fx, 2 * c.fy, WIDTH, HEIGHT) if lens is None else lens
    (sparse / "cameras.bin").write_bytes(struct.pack("<QiiQQ", 1, 7, model, *size) + struct.pack(f"<{len(numbers)}d", *numbers))
    data = struct.pack("<Q", len(shots))
    for k, (camera, picture) in enumerate(shots):
        save_png(folder / "images" / f"shot.{k:02}.png", picture if pictures is None else pictures[k])
        m = camera.rotation.T
        w = math.sqrt(max(0.0, 1 + np.trace(m))) / 2
        if w > 1e-3:
            quat = [w, *(np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / (4 * w))]
        else:  # half a turn: its axis is an eigenvector
            values, vectors = np.linalg.eigh((m + m.T) / 2)
            quat = [0.0, *vectors[:, np.argmax(values)]]
        data += struct.pack("<I7dI", k, *quat, *(-m @ camera.position), 7) + f"shot.{k:02}.png".encode() + b"\0" + struct.pack("<Q", 1) + bytes(24)
    (sparse / "images.bin").write_bytes(data)
    points = np.random.default_rng(seed()).uniform(-1, 1, (50, 3)) if points is None else points
    (sparse / "points3D.bin").write_bytes(struct.pack("<Q", len(points)) + b"".join(
        struct.pack("<Q3d3BdQ", k, *p, 255, 0, 51, 0.5, 1) + bytes(8) for k, p in enumerate(points)))
    return folder
