"""The cameras of a scene: files of several formats by one door, `load_cameras`; orbit cameras for scenes without any.

| what | format | read by |
|---|---|---|
| `cameras.json` | INRIA | `scene.cameras_json` |
| `transforms.json` | NeRF, nerfstudio, instant-ngp | `scene.transforms` |
| `camera_path.json` | nerfstudio's viewer | `scene.camera_path` |
| `sparse/0` | COLMAP, binary or text | `scene.colmap` |

Axes and pixels are those of `scene.pinhole`.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line
from . import camera_path, cameras_json, colmap, transforms
from .cameras_json import cameras_text
from .fields import read_json
from .files import Scene, scene_folders
from .folders import model_folder
from .pinhole import MAX_SIZE, Camera

__all__ = [
    "DEFAULT_UP", "MAX_SIZE", "ORBIT_VIEWS", "UP_AXES", "Camera", "camera_count", "camera_files", "cameras_beside", "cameras_said", "cameras_text",
    "find_cameras", "load_cameras", "no_such_view", "of_colmap", "orbit_camera", "photos_root", "select_view", "stored_cameras",
]

ORBIT_VIEWS = 8  # of a scene without cameras of its own
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
DEFAULT_UP = "-y"  # of the INRIA code and COLMAP, for upright scenes
_LISTS = ("cameras.json", "transforms.json")  # of a folder, before a COLMAP model


def camera_files(path: str | Path) -> list[Path]:
    """The files that `load_cameras` reads of a file or folder, the one that gives the cameras first: itself; of a folder its `cameras.json`, else its
    `transforms.json`, else cameras and images of its COLMAP model, which any of the model's files means too. FlickerError for a folder without any.
    """
    path = Path(path)
    if path.name in colmap.FILES and colmap.find_model(path.parent) == path.parent:
        path = path.parent
    elif not path.is_dir():
        return [path]
    listed = next((file for name in _LISTS if (file := path / name).is_file()), None)
    if listed is not None:
        return [listed]
    model = colmap.find_model(path)
    if model is not None:
        return [colmap.model_file(model, "images"), colmap.model_file(model, "cameras")]
    others = sorted(file.name for file in path.glob("transforms*.json"))
    hint = f"; give one of its files: {', '.join(map(one_line, others))}" if others else ""
    raise FlickerError(f"{path}: a directory without {', '.join(_LISTS)} or a COLMAP model{hint or colmap.model_hint(path)}")


def of_colmap(path: str | Path) -> bool:
    """Whether the cameras of a file or folder are those of a COLMAP model. FlickerError as of `camera_files`."""
    return camera_files(path)[0].name in colmap.FILES


def load_cameras(path: str | Path) -> list[Camera]:
    """The cameras of a file or folder, at least one; the content says the format.

    INRIA `cameras.json`, `transforms.json` of NeRF and nerfstudio, nerfstudio's `camera_path.json`, or a COLMAP model (its folder, the data set's, or one of
    its files), binary or text. Only pinholes: a lens that distorts is refused. FlickerWarning for sizes that the file does not name. FlickerError naming the
    file, the camera and the field.
    """
    file = camera_files(path)[0]
    if file.name in colmap.FILES:
        found = colmap.cameras_of(file.parent)
    else:
        data = read_json(file)
        if isinstance(data, list):
            found = cameras_json.cameras_of(file, data)
        elif isinstance(data, dict) and "frames" in data:
            found = transforms.cameras_of(file, data)
        elif isinstance(data, dict) and camera_path.KEY in data:
            found = camera_path.cameras_of(file, data)
        else:
            raise FlickerError(f"{file}: not a list of cameras, nor has it 'frames' (transforms.json) or '{camera_path.KEY}' (nerfstudio)")
    if not found:
        raise FlickerError(f"{file}: no cameras")
    return found


def photos_root(path: str | Path) -> Path:
    """The folder in and under which the photographs of cameras lie: that of the file; of a COLMAP model the data set's."""
    file = camera_files(path)[0]
    folder = file.parent
    if file.name not in colmap.FILES:
        return folder
    return colmap.data_root(folder)


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
    """`cameras.json` that goes with a scene: beside the file; in an unpacked SOG's folder, else beside that folder; of a PLY in a trainer's
    `point_cloud/iteration_N` at the top of the trainer's folder. None: there is none."""
    trained = model_folder(path)
    folders = [*scene_folders(path), *([] if trained is None else [trained])]
    return next((file for folder in folders if (file := folder / "cameras.json").exists()), None)


def cameras_said(path: str | Path | None, cameras: str | Path | None = None, up: str | None = None) -> str:
    """Where the cameras of `find_cameras` come from, for people. Other files of cameras beside the scene, which are not taken, are named."""
    found = cameras if cameras is not None or path is None else cameras_beside(path)
    if found is not None:
        return str(camera_files(found)[0])
    orbit = f"orbit of {ORBIT_VIEWS}, up {up or DEFAULT_UP}"
    if path is None:
        return orbit
    beside = [file for folder in scene_folders(path) for file in (folder / "transforms.json", folder / "camera_path.json") if file.is_file()]
    beside += [model for folder in scene_folders(path) if (model := colmap.find_model(folder)) is not None]
    return f"{orbit}; not {beside[0]}, which --cameras takes" if beside else f"{orbit}; no cameras.json goes with the scene"


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
        raise no_such_view(n, len(cameras))
    return cameras[n]


def no_such_view(n: int, count: int) -> FlickerError:
    """What is said of a number that is none of `count` cameras."""
    return FlickerError(f"view {n}: " + (f"there are {count} cameras, 0 to {count - 1}" if count != 1 else "there is one camera, 0"))
