"""Posed photographs: `transforms.json` of NeRF and nerfstudio, NeRF's synthetic scenes, COLMAP models with their pictures (docs/fit.md)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np

from ..errors import FlickerError
from ..scene.colmap import ColmapCamera, find_model, model_file, read_cameras, read_images, read_points
from ..scene.lens import COEFFICIENTS, FLAGS, PERSPECTIVE
from ..scene.photos import PLACES, SUFFIXES
from ..scene.transforms import Frame, photo_name, read_frames
from .shot import Shot, shot_of

TEST_EVERY = 8  # photographs 0, 8, 16, ... are for testing where a data set has no test photographs of its own
LEAST = 3  # photographs: one for testing, two to fit
PICTURES = ("images", "images_2", "images_4", "images_8", "input", "photos")  # folders of a COLMAP data set, the first that is there
MASKS = "masks"  # its folder of masks
_FISHEYE_FLAGS = ("is_fisheye", "fisheye")


@dataclass(frozen=True, eq=False)
class Dataset:
    """fitted, tests: photographs to fit to, and for testing. points: float64 (N, 3), colours: float64 (N, 3) in [0, 1], of COLMAP; None: there are none.
    dropped: points that were left out because they are not finite. notes: lines for the user, on what was chosen and changed."""

    fitted: list[Shot]
    tests: list[Shot]
    points: np.ndarray | None = None
    colours: np.ndarray | None = None
    dropped: int = 0
    notes: list[str] = field(default_factory=list)

    @property
    def shots(self) -> list[Shot]:
        return [*self.fitted, *self.tests]


def load_dataset(path: Path, size: int | None = None, images: str | None = None) -> Dataset:
    """Read cameras and sizes of a folder, or of a `transforms.json`; pictures are opened by `Shot.load`.

    size: longer side of the pictures used, in pixels; larger ones are averaged, none is enlarged. images: folder of the pictures, in the data set or anywhere;
    None: where the data set says. FlickerError, naming file and field.
    """
    root = path.parent if path.is_file() else path
    folder = None if images is None else _folder(root, images)
    points, colours, dropped = None, None, 0
    notes: list[str] = []
    if path.is_file():
        shots = _transforms(path, size, folder)
    elif (path / "transforms.json").is_file():
        shots = _transforms(path / "transforms.json", size, folder)
    elif (path / "transforms_train.json").is_file():
        return _with_tests(path, size, folder)
    elif (model := find_model(path)) is not None:
        folder = folder or next((there for place in PICTURES if (there := path / place).is_dir()), None)
        if folder is None:
            raise FlickerError(f"{path}: none of the folders {', '.join(PICTURES)}: name that of the pictures by --images")
        if folder != path / PICTURES[0]:
            notes.append(f"photographs of {folder}")
        shots = _colmap(model, path, folder, size)
        points, colours, dropped = _points(model)
    elif path.is_dir():
        raise FlickerError(f"{path}: neither transforms.json, transforms_train.json nor a COLMAP model (sparse/0, sparse) in this folder")
    else:
        raise FlickerError(f"{path}: no such folder")
    if len(shots) < LEAST:
        raise FlickerError(f"{path}: {len(shots)} photograph{'s' * (len(shots) != 1)}, at least {LEAST} are needed: every {TEST_EVERY}th is for testing")
    fitted, tests = [s for k, s in enumerate(shots) if k % TEST_EVERY], shots[::TEST_EVERY]
    return Dataset(fitted, tests, points, colours, dropped, notes + _told(root, shots))


def photo_folder(shots: Sequence[Shot]) -> Path | None:
    """The folder in which every photograph has the name of its camera, as `flicker report --photos` wants it; None: there is none, as of pictures with
    a lens."""
    folders = set()
    for shot in shots:
        name = PurePosixPath(str(shot.camera.img_name))
        if shot.lens is not None or shot.path.parts[-len(name.parts) :] != name.parts:
            return None
        folders.add(shot.path.parents[len(name.parts) - 1])
    return folders.pop() if len(folders) == 1 else None


def _with_tests(root: Path, size: int | None, folder: Path | None) -> Dataset:
    """NeRF's synthetic scenes as they are downloaded: `transforms_train.json`, and `transforms_test.json` or, without it, `transforms_val.json`."""
    train = root / "transforms_train.json"
    shots = _transforms(train, size, folder)
    other = next((there for name in ("test", "val") if (there := root / f"transforms_{name}.json").is_file()), None)
    if other is None:
        fitted, tests = [s for k, s in enumerate(shots) if k % TEST_EVERY], shots[::TEST_EVERY]
        notes = [f"no transforms_test.json: every {TEST_EVERY}th photograph of transforms_train.json is for testing"]
    else:
        fitted, tests = shots, _transforms(other, size, folder)
        notes = [f"the photographs of {other.name} are for testing"]
        seen = {shot.path.resolve() for shot in fitted}
        if twice := sum(shot.path.resolve() in seen for shot in tests):
            notes.append(f"{twice} of them are in {train.name}, too: their PSNR is not that of views which the fit has not seen")
    if len(fitted) < LEAST - 1 or not tests:
        raise FlickerError(f"{root}: {len(fitted)} photographs to fit and {len(tests)} for testing, at least {LEAST - 1} and 1 are needed")
    return Dataset(fitted, tests, notes=notes + _told(root, fitted + tests))


def _folder(root: Path, images: str) -> Path:
    """The folder of pictures that the user names."""
    for folder in (root / images, Path(images)):
        if folder.is_dir():
            return folder
    raise FlickerError(f"--images: {images}: no such folder, neither in {root} nor from here")


def _told(root: Path, shots: Sequence[Shot]) -> list[str]:
    """What a user should know about the photographs."""
    notes, total = [], len(shots)
    bent = [shot for shot in shots if shot.lens is not None]
    if bent:
        kept = min(min(s.lens.new_size[k] / (s.lens.width, s.lens.height)[k] for k in (0, 1)) for s in bent if s.lens is not None)
        models = ", ".join(sorted({shot.lens.model for shot in bent if shot.lens is not None}))
        notes.append(f"{len(bent)} of {total} photographs are undistorted ({models}, principal point in the middle); {kept:.0%} of their sides or more stay")
    stored = "are taken as they are stored: so they have the shape of their cameras, and not as EXIF turns them"
    for turned, text in ((True, "are turned upright, as EXIF says"), (False, stored)):
        if count := sum(shot.turned is turned for shot in shots):
            notes.append(f"{count} of {total} photographs {text}")
    if masked := sum(shot.mask is not None for shot in shots):
        notes.append(f"{masked} of {total} photographs have a mask: black pixels do not count")
    elif dynamic := sum(shot.path.with_name(f"dynamic_mask_{shot.path.stem}.png").is_file() for shot in shots):
        notes.append(f"{dynamic} of {total} photographs have a dynamic_mask_ beside them: not used; a mask_path names a mask that is white where pixels count")
    elif (root / MASKS).is_dir():
        notes.append(f"{root / MASKS}: not used: no photograph has a mask of its name there, nor does a mask_path name one")
    return notes


def _picture(where: str, path: Path) -> Path:
    """A picture by its path, with or without a suffix, or with another one."""
    if path.suffix and path.is_file():
        return path
    for stem in (path.name, path.stem) if path.suffix.lower() in SUFFIXES else (path.name,):
        for other in (path.with_name(stem + case) for suffix in SUFFIXES for case in (suffix, suffix.upper())):
            if other.is_file():
                return other
    raise FlickerError(f"{where}: no picture {path}")


def _name(picture: Path, root: Path) -> str:
    """Name of a picture in the folder in which `flicker report` looks for it."""
    for folder in (root / place for group in PLACES for place in group):
        if picture.is_relative_to(folder):
            return picture.relative_to(folder).as_posix()
    return picture.name


def _zeros(values: object) -> bool:
    return isinstance(values, list) and all(isinstance(value, (int, float)) and value == 0 for value in values)


def _model(frame: Frame) -> str | None:
    """The lens model of a frame; None: none is named. FlickerError for other projections."""
    for key, value in frame.data.items():
        if (value and key in FLAGS and key not in _FISHEYE_FLAGS) or key.startswith("ftheta_"):
            raise FlickerError(f"{frame.where}: {key}: pictures of this projection cannot be undistorted")
    if frame.data.get("distortion_params") is not None and not _zeros(frame.data["distortion_params"]):
        raise FlickerError(f"{frame.where}: distortion_params: not read: coefficients are wanted by their names, k1, k2, ...")
    model = frame.data.get("camera_model")
    if model is not None and not isinstance(model, str):
        raise FlickerError(f"{frame.where}: camera_model: not a text")
    if any(frame.data.get(key) for key in _FISHEYE_FLAGS) and (model is None or model.upper() in PERSPECTIVE):
        return "OPENCV_FISHEYE"
    return model


def transforms_shot(frame: Frame, size: int | None, folder: Path | None = None, exact: bool = False) -> Shot:
    """The photograph of a frame. folder: of the pictures, None: where the frame says. exact: as in `shot_of`."""
    if frame.name is None:
        raise FlickerError(f"{frame.where}: file_path: is missing")
    picture = _picture(f"{frame.where}: file_path", frame.folder / frame.name if folder is None else folder / photo_name(frame.name))
    mask: Path | None = None
    named = frame.data.get("mask_path")
    if named is not None:
        if not isinstance(named, str):
            raise FlickerError(f"{frame.where}: mask_path: not a text")
        mask = frame.folder / named.replace("\\", "/")
        if not mask.is_file():
            raise FlickerError(f"{frame.where}: mask_path: no picture {mask}")
    number = frame.number
    try:
        pose = frame.pose()
    except FlickerError as error:
        raise FlickerError(f"{frame.where}: {error}") from None
    return shot_of(
        frame.where, picture, _name(picture, frame.folder) if folder is None else picture.relative_to(folder).as_posix(), size, (number["w"], number["h"]),
        frame.focal, (number["cx"], number["cy"]), _model(frame), {key: number[key] for key in COEFFICIENTS}, pose, mask, exact,
    )


def _transforms(path: Path, size: int | None, folder: Path | None) -> list[Shot]:
    return [transforms_shot(frame, size, folder) for frame in read_frames(path)]


def _points(model: Path) -> tuple[np.ndarray | None, np.ndarray | None, int]:
    """Points and colours of a model that are finite, and how many are not; None where it has fewer than four."""
    try:
        file = model_file(model, "points3D")
    except FlickerError:  # a model of cameras alone
        return None, None, 0
    points, colours = read_points(file)
    good = np.isfinite(points).all(axis=1)
    dropped = int((~good).sum())
    return (points[good], colours[good], dropped) if good.sum() >= 4 else (None, None, dropped)


def _mask(root: Path, name: str) -> Path | None:
    """COLMAP's mask of a picture: `masks/NAME.png`, or with .png in place of the picture's suffix."""
    path = root / MASKS / name
    return next((there for there in (path.with_name(path.name + ".png"), path.with_suffix(".png")) if there.is_file()), None)


def _focal(camera: ColmapCamera) -> Callable[[float, float], tuple[float, float]]:
    return lambda w, h: (camera.fx, camera.fy)


def _colmap(model: Path, root: Path, folder: Path, size: int | None) -> list[Shot]:
    file, images = model_file(model, "cameras"), model_file(model, "images")
    cameras = read_cameras(file)
    shots = []
    for n, image in enumerate(read_images(images)):
        where = f"{images}: image {n} ({image.name})"
        if image.camera not in cameras:
            raise FlickerError(f"{where}: camera {image.camera} is not in {file.name}")
        c = cameras[image.camera]
        try:
            pose = image.pose()
        except FlickerError as error:
            raise FlickerError(f"{where}: {error}") from None
        picture = _picture(where, folder / image.name)
        shots.append(shot_of(
            where, picture, picture.relative_to(folder).as_posix(), size, (c.width, c.height), _focal(c), (c.cx, c.cy), c.model, c.coefficients, pose,
            _mask(root, image.name),
        ))
    return shots
