"""Posed photographs: NeRF and nerfstudio `transforms.json`, COLMAP `sparse/0` with `images/`."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FlickerError
from ..scene.camera import Camera
from ..scene.image import load_coverage, load_picture, picture_size
from ..scene.photos import BLACK, PLACES, SUFFIXES, area_average
from .colmap import read_cameras, read_images, read_points

TEST_EVERY = 8  # photographs 0, 8, 16, ... are for testing
LEAST = 3  # photographs: one for testing, two to fit
CENTRE = 0.5  # pixels that the principal point, or a pixel by distortion, may be off
DISTORTIONS = ("k1", "k2", "k3", "k4", "p1", "p2")


@dataclass(frozen=True, eq=False)
class Shot:
    """A photograph and the camera that took it, at the size at which it is used. camera.img_name: its name, as `flicker report` looks for it."""

    camera: Camera
    path: Path

    def load(self, background: tuple[float, float, float] = BLACK) -> np.ndarray:
        """float32 (H, W, 3) in [0, 1], transparent parts over the background."""
        return area_average(load_picture(self.path, background), (self.camera.width, self.camera.height)).astype(np.float32)

    def solid(self) -> np.ndarray | None:
        """bool (H, W): pixels that are not wholly transparent; None for a picture without transparent parts."""
        coverage = load_coverage(self.path)
        return None if coverage is None else area_average(coverage[..., None], (self.camera.width, self.camera.height))[..., 0] > 0.0


@dataclass(frozen=True, eq=False)
class Dataset:
    """fitted, tests: photographs to fit to, and for testing. points: float64 (N, 3), colours: float64 (N, 3) in [0, 1], of COLMAP; None: there are none.
    dropped: points that were left out because they are not finite."""

    fitted: list[Shot]
    tests: list[Shot]
    points: np.ndarray | None = None
    colours: np.ndarray | None = None
    dropped: int = 0


def load_dataset(path: Path, size: int | None = None) -> Dataset:
    """Read cameras and sizes of a folder, or of a `transforms.json`; pictures are opened by `Shot.load`.

    size: longer side of the pictures used, in pixels; larger ones are averaged, none is enlarged. FlickerError, naming file and field.
    """
    points = colours = None
    dropped = 0
    if path.is_file():
        shots = _transforms(path, size)
    elif (path / "transforms.json").is_file():
        shots = _transforms(path / "transforms.json", size)
    elif (path / "sparse" / "0").is_dir():
        shots = _colmap(path, size)
        points, colours = read_points(path / "sparse" / "0" / "points3D.bin")
        good = np.isfinite(points).all(axis=1)
        points, colours, dropped = points[good], colours[good], int((~good).sum())
        if len(points) < 4:
            points = colours = None
    elif path.is_dir():
        raise FlickerError(f"{path}: neither transforms.json nor sparse/0 in this folder")
    else:
        raise FlickerError(f"{path}: no such folder")
    if len(shots) < LEAST:
        raise FlickerError(f"{path}: {len(shots)} photograph{'s' * (len(shots) != 1)}, at least {LEAST} are needed: every {TEST_EVERY}th is for testing")
    return Dataset([s for k, s in enumerate(shots) if k % TEST_EVERY], shots[::TEST_EVERY], points, colours, dropped)


def _shot(where: str, picture: Path, root: Path, size: int | None, width: float | None, height: float | None, centre: tuple[float | None, float | None],
          focal: Any, position: np.ndarray, rotation: np.ndarray) -> Shot:
    """A photograph with its camera. focal: (fx, fy) of a width and height in pixels. root: folder of the dataset."""
    own_width, own_height = picture_size(picture)
    w, h = width or own_width, height or own_height
    for name, value, side in (("cx", centre[0], w), ("cy", centre[1], h)):
        if value is not None and not abs(value - side / 2) <= CENTRE:
            off = f"{abs(value - side / 2):.1f} pixels off the middle, {side / 2:g}"
            raise FlickerError(f"{where}: {name}: {value:g} is {off}: crop the pictures around it, or flicker undistort")
    if abs(h * own_width / w - own_height) > 1.0:
        raise FlickerError(f"{where}: {picture} is {own_width}x{own_height}, not of the shape of the camera's {w:g}x{h:g}")
    shrink = min(1.0, size / max(own_width, own_height)) if size else 1.0
    used = max(1, round(own_width * shrink)), max(1, round(own_height * shrink))
    fx, fy = focal(w, h)
    try:
        camera = Camera(round(w), round(h), fx, fy, position, rotation, name=picture.stem, img_name=_name(picture, root))
        return Shot(camera.scaled(*used), picture)
    except FlickerError as error:
        raise FlickerError(f"{where}: {error}") from None


def _name(picture: Path, root: Path) -> str:
    """Name of a picture in the folder in which `flicker report` looks for it."""
    for folder in (root / place for group in PLACES for place in group):
        if picture.is_relative_to(folder):
            return picture.relative_to(folder).as_posix()
    return picture.name


def _found(where: str, root: Path, name: str) -> Path:
    """A picture by its path, with or without a suffix."""
    path = root / name
    if path.suffix.lower() in SUFFIXES and path.is_file():
        return path
    for suffix in SUFFIXES:
        if (other := path.with_name(path.name + suffix)).is_file():
            return other
    raise FlickerError(f"{where}: no picture {path}")


def _number(where: str, values: dict, key: str) -> float | None:
    value = values.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FlickerError(f"{where}: {key}: not a number")
    return float(value)


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of a transforms.json. where: for messages. data: as it stands in the file; number: its numbers, those of the whole file where it has none;
    picture: file; picture_size: (width, height) in pixels."""

    where: str
    data: dict
    number: dict[str, float | None]
    picture: Path
    picture_size: tuple[int, int]

    def focal(self, w: float, h: float) -> tuple[float, float]:
        """Focal lengths (x, y) of a picture of w x h pixels."""
        angle_x, angle_y = self.number["camera_angle_x"], self.number["camera_angle_y"]
        fx = self.number["fl_x"] or w / 2 / math.tan((angle_x or 0.0) / 2)
        return fx, self.number["fl_y"] or (fx if self.number["fl_x"] or angle_y is None else h / 2 / math.tan(angle_y / 2))

    def pose(self) -> np.ndarray:
        """float64 (3, 4): camera to world, x right, y up, z back. FlickerError."""
        matrix = np.array(self.data.get("transform_matrix"), object)
        if matrix.shape not in ((4, 4), (3, 4)) or not all(isinstance(v, int | float) for v in matrix.flat):
            raise FlickerError(f"{self.where}: transform_matrix: not 4x4 numbers")
        return matrix[:3].astype(np.float64)


def frames_of(path: Path) -> tuple[dict, list[Frame]]:
    """A transforms.json and its frames, whose pictures are there. FlickerError, naming file and field."""
    try:
        data = json.loads(path.read_bytes())
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise FlickerError(f"{path}: not JSON ({' '.join(str(error).split())})") from None
    frames = data.get("frames") if isinstance(data, dict) else None
    if not isinstance(frames, list):
        raise FlickerError(f"{path}: frames: not a list")
    found = []
    for n, frame in enumerate(frames):
        where = f"{path}: frames[{n}]"
        if not isinstance(frame, dict):
            raise FlickerError(f"{where}: not an object")
        both = data | frame  # a frame may have a lens of its own
        number = {key: _number(where, both, key) for key in ("w", "h", "cx", "cy", "fl_x", "fl_y", "camera_angle_x", "camera_angle_y", *DISTORTIONS)}
        if not isinstance(frame.get("file_path"), str):
            raise FlickerError(f"{where}: file_path: not a text")
        for key in ("w", "h", "fl_x", "fl_y"):
            if (value := number[key]) is not None and value <= 0:
                raise FlickerError(f"{where}: {key}: {value:g} is not positive")
        for key in ("camera_angle_x", "camera_angle_y"):
            if (value := number[key]) is not None and not 0 < value < math.pi:
                raise FlickerError(f"{where}: {key}: {value:g} is not between 0 and pi")
        if number["fl_x"] is None and number["camera_angle_x"] is None:
            raise FlickerError(f"{where}: neither fl_x nor camera_angle_x")
        picture = _found(f"{where}: file_path", path.parent, frame["file_path"])
        found.append(Frame(where, frame, number, picture, picture_size(picture)))
    return data, found


def _transforms(path: Path, size: int | None) -> list[Shot]:
    shots = []
    for frame in frames_of(path)[1]:

        def focal(w: float, h: float, frame: Frame = frame) -> tuple[float, float]:
            fx, fy = frame.focal(w, h)
            _check_lens(frame.where, frame.number, w / 2 / fx, h / 2 / fy, fx)
            return fx, fy

        pose, number = frame.pose(), frame.number
        # Right, up, back to right, down, forward.
        shots.append(_shot(
            frame.where, frame.picture, path.parent, size, number["w"], number["h"], (number["cx"], number["cy"]), focal, pose[:, 3],
            pose[:, :3] * np.array([1.0, -1.0, -1.0]),
        ))
    return shots


def _check_lens(where: str, number: dict[str, float | None], x: float, y: float, focal: float) -> None:
    """FlickerError where distortion moves a corner at the tangents (x, y) by more than `CENTRE` pixels, at worst."""
    r = math.hypot(x, y)
    k1, k2, k3, k4, p1, p2 = (abs(number[key] or 0.0) for key in DISTORTIONS)
    shift = focal * (k1 * r**3 + k2 * r**5 + k3 * r**7 + k4 * r**9 + 3 * (p1 + p2) * r**2)
    if shift > CENTRE:
        key = next(key for key in DISTORTIONS if number[key])
        raise FlickerError(f"{where}: {key}: the lens distorts by up to {shift:.1f} pixels: flicker undistort first")


def _colmap(root: Path, size: int | None) -> list[Shot]:
    model = root / "sparse" / "0"
    cameras = read_cameras(model / "cameras.bin")
    shots = []
    for n, image in enumerate(read_images(model / "images.bin")):
        where = f"{model / 'images.bin'}: image {n} ({image.name})"
        if image.camera not in cameras:
            raise FlickerError(f"{where}: camera {image.camera} is not in cameras.bin")
        c = cameras[image.camera]
        norm = float(np.linalg.norm(image.quat))
        if not (math.isfinite(norm) and norm > 0):
            raise FlickerError(f"{where}: rotation: not a quaternion")
        w, x, y, z = image.quat / norm
        rotation = np.array([  # camera to world: the transpose of the quaternion's matrix
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ])
        shots.append(_shot(
            where, _found(where, root / "images", image.name), root, size, c.width, c.height, (c.cx, c.cy), lambda w, h, c=c: (c.fx, c.fy),
            -rotation @ image.shift, rotation,
        ))
    return shots
