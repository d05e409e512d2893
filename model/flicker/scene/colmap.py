"""A COLMAP sparse model: cameras, images and points, binary (`.bin`) or text (`.txt`).

Positions of pixels count from the picture's corner: the first pixel's centre is at (0.5, 0.5). Poses are world to camera, x right, y down, z forward.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FlickerError, one_line
from .lens import COEFFICIENTS, COLMAP_MODELS, lens_fault
from .pinhole import Camera

PLACES = ("", "sparse/0", "sparse", "colmap/sparse/0", "dense/sparse", "dense/0/sparse")  # of a model in a folder
_NUMBERED = "sparse"  # folder of models 0, 1, ...: that of the least number is taken
SUFFIXES = (".bin", ".txt")  # of its files; with both, the first is read
FILES = tuple(stem + suffix for stem in ("images", "cameras") for suffix in SUFFIXES)


@dataclass(frozen=True)
class ColmapCamera:
    """model: name in `COLMAP_MODELS`. width, height: pixels. parameters: by name, pixels and coefficients of the lens."""

    model: str
    width: int
    height: int
    parameters: dict[str, float]

    @property
    def fx(self) -> float:
        return self.parameters.get("fx", self.parameters.get("f", 0.0))

    @property
    def fy(self) -> float:
        return self.parameters.get("fy", self.fx)

    @property
    def cx(self) -> float:
        return self.parameters["cx"]

    @property
    def cy(self) -> float:
        return self.parameters["cy"]

    @property
    def coefficients(self) -> dict[str, float]:
        """Of the lens, by name."""
        return {name: value for name, value in self.parameters.items() if name in COEFFICIENTS}

    @property
    def fault(self) -> str | None:
        """Why this is no pinhole; None: it is one."""
        return lens_fault(self.model, self.coefficients)


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """name: with forward slashes, also as COLMAP writes it on Windows. quat: float64 (4,), w first, shift: float64 (3,): world to camera."""

    name: str
    camera: int
    quat: np.ndarray
    shift: np.ndarray

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Position float64 (3,) and rotation float64 (3, 3), camera to world, columns right, down, forward. FlickerError for no quaternion."""
        norm = float(np.linalg.norm(self.quat))
        if not (math.isfinite(norm) and norm > 0):
            raise FlickerError("rotation: not a quaternion")
        w, x, y, z = self.quat / norm
        rotation = np.array([  # the transpose of the quaternion's matrix
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ])
        return -rotation @ self.shift, rotation


def find_model(folder: Path) -> Path | None:
    """The model in a folder: in the first of `PLACES` that has one, else that of the least number in `sparse`; None: there is none."""
    found = next((there for place in PLACES if _model(there := folder / place)), None)
    return found or next(iter(numbered(folder / _NUMBERED)), None)


def _model(folder: Path) -> bool:
    return _file(folder, "cameras") is not None and _file(folder, "images") is not None


def numbered(folder: Path) -> list[Path]:
    """The models 0, 1, ... in a folder, by their numbers."""
    try:
        places = [place for place in folder.iterdir() if place.name.isdecimal() and _model(place)]
    except OSError:
        return []
    return sorted(places, key=lambda place: (int(place.name), place.name))


def model_hint(folder: Path) -> str:
    """Names a model that lies deeper in a folder than `find_model` looks, for the end of an error; empty: there is none."""
    for pattern in ("*", "*/*", "*/*/*"):
        for place in sorted(folder.glob(pattern)):
            if place.is_dir() and _model(place):
                return f"; {place} holds a model: give that folder"
    return ""


def data_root(model: Path) -> Path:
    """The folder of the data set that a model belongs to, by the place in which it lies; of a model in another place its own."""
    if model.name.isdecimal() and model.parent.name == _NUMBERED:
        model = model.parent
    if model.name != _NUMBERED:
        return model
    return model.parents[1] if model.parent.name == "colmap" else model.parent


def _file(model: Path, stem: str) -> Path | None:
    return next((path for suffix in SUFFIXES if (path := model / f"{stem}{suffix}").is_file()), None)


def model_file(model: Path, stem: str) -> Path:
    """A file of a model: stem `cameras`, `images` or `points3D`, binary where both are there. FlickerError where there is none."""
    found = _file(model, stem)
    if found is None:
        raise FlickerError(f"{model}: neither {stem}.bin nor {stem}.txt")
    return found


class _Reader:
    """Numbers of a binary file, one after the other."""

    def __init__(self, path: Path) -> None:
        self.path, self.at = path, 0
        try:
            self.data = path.read_bytes()
        except OSError as error:
            raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None

    def take(self, form: str) -> tuple:
        size = struct.calcsize("<" + form)
        self.skip(size)
        return struct.unpack_from("<" + form, self.data, self.at - size)

    def skip(self, size: int) -> None:
        self.at += size
        if self.at > len(self.data):
            raise FlickerError(f"{self.path}: truncated: {len(self.data)} bytes, {self.at} are needed")

    def text(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise FlickerError(f"{self.path}: truncated: a name without end")
        name, self.at = self.data[self.at : end], end + 1
        try:
            return name.decode()
        except UnicodeDecodeError:
            raise FlickerError(f"{self.path}: a name is not UTF-8 ({one_line(name)})") from None

    def end(self) -> None:
        if self.at != len(self.data):
            raise FlickerError(f"{self.path}: {len(self.data) - self.at} bytes after the last entry")


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of a text file with their numbers, from 1, without comments; empty ones too."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError:
        raise FlickerError(f"{path}: not a text file") from None
    for number, line in enumerate(text.splitlines(), 1):
        if not line.lstrip().startswith("#"):
            yield number, line.strip()


def read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Cameras of `cameras.bin` or `cameras.txt` by number, whatever their lens. FlickerError."""
    return _cameras_text(path) if path.suffix == ".txt" else _cameras_binary(path)


def _cameras_binary(path: Path) -> dict[int, ColmapCamera]:
    file, found, names = _Reader(path), {}, list(COLMAP_MODELS)
    for _ in range(file.take("Q")[0]):
        number, model, width, height = file.take("iiQQ")
        if not 0 <= model < len(names):
            raise FlickerError(f"{path}: camera {number}: unknown model {model}")
        keys = COLMAP_MODELS[names[model]]
        if number in found:
            raise FlickerError(f"{path}: camera {number}: is there twice")
        found[number] = ColmapCamera(names[model], width, height, dict(zip(keys, file.take(f"{len(keys)}d"))))
    file.end()
    return found


def _cameras_text(path: Path) -> dict[int, ColmapCamera]:
    found = {}
    for at, line in _lines(path):
        if not line:
            continue
        words = line.split()
        where = f"{path}: line {at}"
        if len(words) < 4:
            raise FlickerError(f"{where}: not a camera: number, model, width, height, parameters")
        if words[1] not in COLMAP_MODELS:
            raise FlickerError(f"{where}: camera {one_line(words[0])}: unknown model {one_line(words[1])}")
        keys = COLMAP_MODELS[words[1]]
        if len(words) != 4 + len(keys):
            raise FlickerError(f"{where}: {len(words) - 4} parameters, {words[1]} has {len(keys)}: {', '.join(keys)}")
        try:
            number, camera = int(words[0]), ColmapCamera(words[1], int(words[2]), int(words[3]), dict(zip(keys, map(float, words[4:]))))
        except ValueError:
            raise FlickerError(f"{where}: not a number among {one_line(' '.join([words[0], *words[2:]]))}") from None
        if number in found:
            raise FlickerError(f"{where}: camera {number}: is there twice")
        found[number] = camera
    return found


def read_images(path: Path) -> list[ColmapImage]:
    """Images of `images.bin` or `images.txt`, sorted by name. FlickerError."""
    found = _images_text(path) if path.suffix == ".txt" else _images_binary(path)
    return sorted(found, key=lambda image: image.name)


def _images_binary(path: Path) -> list[ColmapImage]:
    file, found = _Reader(path), []
    for _ in range(file.take("Q")[0]):
        numbers = file.take("I7dI")
        name = file.text()
        file.skip(24 * file.take("Q")[0])
        found.append(ColmapImage(name.replace("\\", "/"), numbers[8], np.array(numbers[1:5]), np.array(numbers[5:8])))
    file.end()
    return found


def _images_text(path: Path) -> list[ColmapImage]:
    """Two lines an image; the second has its points, and may be empty, or left out."""
    found = []
    points = False  # may come next
    for at, line in _lines(path):
        words = line.split()
        if points and _is_points(words):
            points = False
            continue
        if not words:
            continue
        try:
            _, values, camera, name = int(words[0]), [float(word) for word in words[1:8]], int(words[8]), line.split(None, 9)[9]
        except (ValueError, IndexError):
            raise FlickerError(f"{path}: line {at}: not an image: number, 4 of a quaternion, 3 of a shift, camera, name") from None
        found.append(ColmapImage(name.replace("\\", "/"), camera, np.array(values[:4]), np.array(values[4:])))
        points = True
    return found


def _is_points(words: list[str]) -> bool:
    """Whether this is a line of x, y, number of a point; a line of an image ends in a name."""
    if len(words) % 3:
        return False
    try:
        for word in words[-3:]:
            float(word)
    except ValueError:
        return False
    return True


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Points of `points3D.bin` or `points3D.txt`: positions float64 (N, 3) and colours float64 (N, 3) in [0, 1]. FlickerError."""
    places, colours = _points_text(path) if path.suffix == ".txt" else _points_binary(path)
    return np.array(places, np.float64).reshape(-1, 3), np.array(colours, np.float64).reshape(-1, 3) / 255.0


def _points_binary(path: Path) -> tuple[list, list]:
    file, places, colours = _Reader(path), [], []
    for _ in range(file.take("Q")[0]):
        numbers = file.take("Q3d3BdQ")
        file.skip(8 * numbers[8])
        places.append(numbers[1:4])
        colours.append(numbers[4:7])
    file.end()
    return places, colours


def _points_text(path: Path) -> tuple[list, list]:
    places, colours = [], []
    for at, line in _lines(path):
        if not line:
            continue
        try:
            numbers = [float(word) for word in line.split(None, 7)[1:7]]
        except ValueError:
            numbers = []
        if len(numbers) != 6:
            raise FlickerError(f"{path}: line {at}: not a point: number, x, y, z, red, green, blue, error")
        places.append(numbers[:3])
        colours.append(numbers[3:])
    return places, colours


def cameras_of(model: Path) -> list[Camera]:
    """The images of a model as cameras, sorted by name. FlickerError naming file, image and field, also for a lens that is no pinhole."""
    file, images = model_file(model, "cameras"), model_file(model, "images")
    lenses = read_cameras(file)
    found = []
    for image in read_images(images):
        where = f"{images}: image '{one_line(image.name)}'"
        if image.camera not in lenses:
            raise FlickerError(f"{where}: camera {image.camera} is not in {file.name}")
        lens = lenses[image.camera]
        if lens.fault is not None:
            raise FlickerError(f"{file}: camera {image.camera}: {lens.fault}")
        try:
            position, rotation = image.pose()
            found.append(Camera(
                lens.width, lens.height, lens.fx, lens.fy, position, rotation, Path(image.name).stem, image.name, cx=lens.cx - 0.5, cy=lens.cy - 0.5,
            ))
        except FlickerError as error:
            raise FlickerError(f"{where}: {error}") from None
    return found
