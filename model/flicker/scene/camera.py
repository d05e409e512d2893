"""Pinhole cameras: INRIA `cameras.json`, orbit cameras for scenes without one.

World and camera axes follow COLMAP and the INRIA code: camera x right, y down, z forward. Pixel centres lie on integers, so the middle of a picture
is ((width - 1) / 2, (height - 1) / 2); files count from the picture's corner, half a pixel before the first centre.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FlickerError
from .files import Scene, scene_folders

MAX_SIZE = 16384
_MAX_NUMBER = 1e30  # squares and products of such numbers stay finite in the projection
_KEYS = ("width", "height", "fx", "fy", "position", "rotation")
ORBIT_VIEWS = 8  # of a scene without cameras of its own
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
DEFAULT_UP = "-y"  # of the INRIA code and COLMAP, for upright scenes


@dataclass(frozen=True, eq=False)
class Camera:
    """A view.

    width, height: pixels, 1 to 16384. fx, fy: focal lengths in pixels.
    position: float64 (3,), camera centre in the world.
    rotation: float64 (3, 3), camera to world, columns right, down, forward.
    name: for people. img_name: name of its photograph; None: it has none.
    cx, cy: principal point in pixels, pixel centres on integers; None: the middle of the picture.
    Raises FlickerError, naming the field, when a value makes no camera.
    """

    width: int
    height: int
    fx: float
    fy: float
    position: np.ndarray
    rotation: np.ndarray
    name: str = field(default="")
    img_name: str | None = None
    cx: float = None  # type: ignore[assignment]  # None becomes the middle
    cy: float = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for key in ("width", "height"):
            number = _numbers(getattr(self, key), key, ())
            if not (1 <= number <= MAX_SIZE and number == int(number)):
                raise FlickerError(f"{key}: {number:.12g} is not a whole number from 1 to {MAX_SIZE}")
            object.__setattr__(self, key, int(number))
        for key in ("fx", "fy"):
            number = _numbers(getattr(self, key), key, ())
            if number <= 0:
                raise FlickerError(f"{key}: {number:.12g} is not positive")
            object.__setattr__(self, key, float(number))
        for key, side in (("cx", self.width), ("cy", self.height)):
            given = getattr(self, key)
            object.__setattr__(self, key, 0.5 * (side - 1) if given is None else float(_numbers(given, key, ())))
        object.__setattr__(self, "position", _numbers(self.position, "position", (3,)))
        rotation = _numbers(self.rotation, "rotation", (3, 3))
        if np.abs(rotation).max() > 2 or np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0:
            raise FlickerError("rotation: not a rotation matrix")
        object.__setattr__(self, "rotation", rotation)

    def resized(self, width: int, height: int) -> Camera:
        """The same view at another size: the vertical field of view and the shape of the pixels stay; sideways the picture is cropped or extended.

        The principal point keeps its distance from the middle, in heights of the picture.
        """
        return self._at(width, height, height / self.height, height / self.height)

    def scaled(self, width: int, height: int) -> Camera:
        """The camera of the same picture after it was scaled to another size, each axis by its own factor."""
        return self._at(width, height, width / self.width, height / self.height)

    def _at(self, width: int, height: int, by_x: float, by_y: float) -> Camera:
        cx, cy = 0.5 * (width - 1) + by_x * (self.cx - 0.5 * (self.width - 1)), 0.5 * (height - 1) + by_y * (self.cy - 0.5 * (self.height - 1))
        other = replace(self, width=width, height=height, cx=cx, cy=cy)
        return replace(other, fx=self.fx * by_x, fy=self.fy * by_y)


def _numbers(value: Any, key: str, shape: tuple[int, ...]) -> np.ndarray:
    """float64 array of the given shape, every number finite."""
    what = "a number" if shape == () else f"{'x'.join(map(str, shape))} numbers"
    try:
        array = np.array(value)
        if array.shape != shape or array.dtype.kind not in "iufO":  # integers beyond 64 bits are objects
            raise FlickerError(f"{key}: not {what}")
        array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise FlickerError(f"{key}: not {what}") from None
    if not np.isfinite(array).all():
        raise FlickerError(f"{key}: not finite")
    if (np.abs(array) > _MAX_NUMBER).any():
        raise FlickerError(f"{key}: beyond {_MAX_NUMBER:g}")
    return array


def load_cameras(path: str | Path) -> list[Camera]:
    """Cameras of an INRIA `cameras.json`: a list of objects with img_name, width, height, position, rotation, fx, fy.

    Raises FlickerError naming the file, the index of the camera and the field.
    """
    path = Path(path)
    try:
        entries = json.loads(path.read_bytes())
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise FlickerError(f"{path}: not JSON ({' '.join(str(error).split())})") from None
    if not isinstance(entries, list) or not entries:
        raise FlickerError(f"{path}: not a list of cameras" if entries != [] else f"{path}: no cameras")
    cameras = []
    for i, entry in enumerate(entries):
        where = f"{path}: camera {i}"
        if not isinstance(entry, dict):
            raise FlickerError(f"{where}: not an object")
        for key in _KEYS:
            if key not in entry:
                raise FlickerError(f"{where}: '{key}' is missing")
        img_name = None if entry.get("img_name") is None else str(entry["img_name"])
        try:
            cameras.append(Camera(**{key: entry[key] for key in _KEYS}, name=img_name or str(i), img_name=img_name))
        except FlickerError as error:
            raise FlickerError(f"{where}: {error}") from None
    return cameras


def cameras_text(cameras: Sequence[Camera]) -> str:
    """The text of an INRIA `cameras.json`; a camera without photograph goes by its name."""
    return json.dumps([
        {"id": k, "img_name": c.img_name or c.name, "width": c.width, "height": c.height, "position": c.position.tolist(),
         "rotation": c.rotation.tolist(), "fx": c.fx, "fy": c.fy}
        for k, c in enumerate(cameras)
    ], indent=1) + "\n"


def _box(scene: Scene) -> np.ndarray:
    """Where the scene lies: (3, 2), lowest and highest value an axis, from a sample.

    From the 2 % to the 98 % quantile of the opacity, at most four times the largest median deviation from the median: neither
    floaters nor a far background count.
    """
    sample = slice(None, None, 1 + len(scene) // 65536)
    means = scene.means[sample].astype(np.float64)
    weights = scene.opacities[sample].astype(np.float64)

    def quantiles(x: np.ndarray, *q: float) -> np.ndarray:
        order = np.argsort(x)
        total = np.cumsum(weights[order])
        return x[order[np.searchsorted(total, np.array(q) * total[-1])]]

    low, middle, high = np.array([quantiles(axis, 0.02, 0.5, 0.98) for axis in means.T]).T
    reach = 4.0 * max(quantiles(axis, 0.5)[0] for axis in np.abs(means - middle).T)
    # A lone Gaussian has no extent but its own.
    margin = 2.0 * np.median(scene.scales[sample].max(axis=1))
    low, high = np.maximum(low, middle - reach), np.minimum(high, middle + reach)
    return np.stack([np.minimum(low, (low + high) / 2 - margin), np.maximum(high, (low + high) / 2 + margin)], axis=1)


def _upright(up: str) -> np.ndarray:
    """(3, 3) rotation from the world to axes right, down, forward of the first orbit camera's heading; rows are those axes.

    Right is x, or y where x is up: so y up looks along -z and z up along y, as viewers for such scenes do from the front.
    """
    if up not in UP_AXES:
        raise FlickerError(f"up: '{up}' is not one of {', '.join(UP_AXES)}")
    down = np.eye(3)["xyz".index(up[-1])] * (1.0 if up[0] == "-" else -1.0)
    right = np.eye(3)[1 if up[-1] == "x" else 0]
    return np.stack([right, down, np.cross(right, down)])


def orbit_camera(scene: Scene, view: float = 0, views: int = ORBIT_VIEWS, width: int = 1280, height: int = 720,
                 up: str = DEFAULT_UP, *, elevation: float = 15.0, nearer: float = 1.0) -> Camera:
    """Camera `view` of `views` on a circle around the scene, looking slightly down at its middle.

    view: also between whole numbers. up: the world's axis that points up, one of `UP_AXES`; FlickerError for another. elevation: degrees above the middle.
    nearer: the distance is divided by it; of scenes so small that this would bring them before the nearest depth that is drawn, the lens is longer instead.
    """
    upright = _upright(up)
    low, high = np.sort(upright @ _box(scene), axis=1).T
    centre, half = (low + high) / 2, (high - low) / 2
    across = math.hypot(half[0], half[2])
    tangent = math.tan(math.radians(25.0)) / min(width, height)  # half the field of view across the shorter side
    elevation = math.radians(elevation)
    # The cylinder that the box sweeps, from its middle, in camera axes; it must lie within the picture.
    ring = np.linspace(0.0, 2 * math.pi, 32)
    x, z = across * np.cos(ring), across * np.sin(ring)
    y = np.array([[-half[1]], [half[1]]])
    down = y * math.cos(elevation) - z * math.sin(elevation)
    forward = y * math.sin(elevation) + z * math.cos(elevation)
    fit = np.maximum(np.abs(x) / (tangent * width), np.abs(down) / (tangent * height)) - forward
    distance = 1.1 * float(fit.max())
    # Nothing nearer than 0.2 is drawn: small scenes are seen from farther away through a longer lens.
    zoom = max(1.0, (across + half[1] + 0.4) / distance)
    distance *= zoom
    focal = zoom / (2 * tangent)
    if zoom > 1.0:
        focal *= nearer
    else:
        distance /= nearer
    azimuth = 2 * math.pi * view / views
    back = np.array([
        math.sin(azimuth) * math.cos(elevation), -math.sin(elevation), -math.cos(azimuth) * math.cos(elevation),
    ])
    right = np.array([math.cos(azimuth), 0.0, math.sin(azimuth)])
    return Camera(
        width, height, focal, focal, upright.T @ (centre + distance * back),
        upright.T @ np.stack([right, np.cross(-back, right), -back], axis=1), f"orbit_{view}",
    )


def cameras_beside(path: str | Path) -> Path | None:
    """`cameras.json` that goes with a scene: beside the file; in an unpacked SOG's folder, else beside that folder. None: there is none."""
    return next((file for folder in scene_folders(path) if (file := folder / "cameras.json").exists()), None)


def stored_cameras(path: str | Path | None, cameras: str | Path | None = None, up: str | None = None) -> list[Camera] | None:
    """The cameras that come from a file: the one given, else `cameras_beside` the scene. None: there is none, the orbit is used.

    path: of the scene, which is not opened. up: as in `find_cameras`.
    """
    if up is not None:
        _upright(up)
    if cameras is None and path is not None:
        cameras = cameras_beside(path)
    if cameras is None:
        return None
    if up is not None:
        raise FlickerError(f"up: {up}: only orbit cameras can be turned, but the cameras come from {cameras}")
    return load_cameras(cameras)


def camera_count(path: str | Path | None, cameras: str | Path | None = None, up: str | None = None) -> int:
    """How many cameras `find_cameras` would give, without the scene; FlickerError as there."""
    stored = stored_cameras(path, cameras, up)
    return ORBIT_VIEWS if stored is None else len(stored)


def find_cameras(scene: Scene, cameras: str | Path | None = None, up: str | None = None) -> list[Camera]:
    """The cameras of a scene: the file given, else `cameras_beside` it, else `ORBIT_VIEWS` orbit cameras.

    up: the world's axis that points up, for the orbit (None: `DEFAULT_UP`). FlickerError where there are cameras, which it could not turn.
    """
    stored = stored_cameras(scene.path, cameras, up)
    return [orbit_camera(scene, view, up=up or DEFAULT_UP) for view in range(ORBIT_VIEWS)] if stored is None else stored


def select_view(cameras: list[Camera], n: int) -> Camera:
    """Camera n, counted from 0; FlickerError when there is none."""
    if not 0 <= n < len(cameras):
        raise FlickerError(f"view {n}: there are {len(cameras)} cameras, 0 to {len(cameras) - 1}")
    return cameras[n]
