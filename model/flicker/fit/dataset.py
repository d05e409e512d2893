"""Posed photographs: `transforms.json` of NeRF and nerfstudio, NeRF's synthetic scenes, COLMAP models with their pictures (docs/reference/datasets.md)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import FlickerError
from ..scene.colmap import PLACES, ColmapCamera, data_root, find_model, model_file, model_hint, numbered, read_cameras, read_images, read_points
from ..scene.fields import read_json, truth
from ..scene.lens import COEFFICIENTS, FLAGS, PERSPECTIVE, foreign_fault
from ..scene.photos import PLACES as PHOTO_PLACES
from ..scene.photos import SUFFIXES
from ..scene.ply import open_ply
from ..scene.transforms import SPLITS, Frame, frames_of, photo_name, read_frames, splits_of
from .lens import FISHEYES
from .shot import Shot, shot_of

TEST_EVERY = 8  # photographs 0, 8, 16, ... are for testing where a data set has no test photographs of its own
LEAST = 3  # photographs: one for testing, two to fit
PICTURES = ("images", "images_2", "images_4", "images_8", "input", "photos")  # folders of a COLMAP data set, the first that is there
MASKS = "masks"  # its folder of masks
_FISHEYE_FLAGS = ("is_fisheye", "fisheye")


@dataclass(frozen=True, eq=False)
class Dataset:
    """fitted, tests: photographs to fit to, and for testing. points: float64 (N, 3), colours: float64 (N, 3) in [0, 1], of COLMAP or a PLY; None: there are
    none. dropped: points that were left out because they are not finite. notes: lines for the user, on what was chosen and changed. points_of: whose points."""

    fitted: list[Shot]
    tests: list[Shot]
    points: np.ndarray | None = None
    colours: np.ndarray | None = None
    dropped: int = 0
    notes: list[str] = field(default_factory=list)
    points_of: str = "COLMAP"

    @property
    def shots(self) -> list[Shot]:
        """All photographs, those to fit to first."""
        return [*self.fitted, *self.tests]


def load_dataset(path: Path, size: int | None = None, images: str | None = None) -> Dataset:
    """Read cameras and sizes of a folder, or of a `transforms.json`; pictures are opened by `Shot.load`.

    size: longer side of the pictures used, in pixels; larger ones are averaged, none is enlarged. images: folder of the pictures, in the data set or anywhere;
    None: where the data set says. FlickerError, naming file and field.
    """
    if path.is_file() or (path / "transforms.json").is_file():
        return _listed(path if path.is_file() else path / "transforms.json", path, size, images)
    if (path / "transforms_train.json").is_file():
        return _with_tests(path, size, _folder(path, images))
    model = find_model(path)
    if model is not None:
        return _of_colmap(model, path, size, images)
    if path.is_dir():
        raise FlickerError(
            f"{path}: neither transforms.json, transforms_train.json nor a COLMAP model ({', '.join(PLACES[1:])}) in this folder{model_hint(path)}"
        )
    raise FlickerError(f"{path}: no such folder")


def _every_eighth(path: Path, shots: list[Shot]) -> tuple[list[Shot], list[Shot]]:
    """Photographs to fit to and for testing of a data set that has no tests of its own. path: as the user named it."""
    if len(shots) < LEAST:
        raise FlickerError(f"{path}: {len(shots)} photograph{'s' * (len(shots) != 1)}, at least {LEAST} are needed: every {TEST_EVERY}th is for testing")
    return [s for k, s in enumerate(shots) if k % TEST_EVERY], shots[::TEST_EVERY]


def _enough(path: Path, fitted: list[Shot], tests: list[Shot]) -> None:
    """FlickerError where a data set with tests of its own has too few photographs."""
    if len(fitted) < LEAST - 1 or not tests:
        raise FlickerError(f"{path}: {len(fitted)} photographs to fit and {len(tests)} for testing, at least {LEAST - 1} and 1 are needed")


def _listed(file: Path, path: Path, size: int | None, images: str | None) -> Dataset:
    """A `transforms.json`, with nerfstudio's lists of the photographs to fit to and for testing where it has them. path: as the user named it."""
    folder = _folder(file.parent, images)
    data = read_json(file)
    frames = frames_of(file, data)
    splits = splits_of(file, data, frames)
    points, colours, dropped = _ply_points(file, data)
    notes = []
    if (ply := ply_of(file, data)) is not None and not ply.is_file():
        notes.append(f"ply_file_path: {ply}: is not there, the start is without its points")
    test_key = next((key for key in ("test_filenames", "val_filenames") if splits.get(key)), None)
    others = {n for key in SPLITS[1:] for n in splits.get(key, ())}
    fit_to = splits.get("train_filenames") or [n for n in range(len(frames)) if n not in others]
    used = set(fit_to) | set(() if test_key is None else splits[test_key])
    shots = {n: transforms_shot(frames[n], size, folder) for n in sorted(used)}
    if test_key is None:
        fitted, tests = _every_eighth(path, [shots[n] for n in fit_to])
    else:
        fitted, tests = [shots[n] for n in fit_to], [shots[n] for n in splits[test_key]]
        _enough(path, fitted, tests)
        notes.append(f"the photographs of {test_key} are for testing")
        if twice := len(set(fit_to) & set(splits[test_key])):
            notes.append(f"{twice} of them are fitted to, too: their PSNR is not that of views which the fit has not seen")
    if len(used) < len(frames):
        lists = " nor ".join(key for key in ("train_filenames", test_key) if key in splits)
        notes.append(f"{len(frames) - len(used)} of {len(frames)} photographs are not used: they are not in {lists}")
    if any(frames[n].number["fisheye_crop_radius"] is not None and shot.crop is None for n, shot in shots.items()):
        notes.append("fisheye_crop_radius: not used: the camera_model is no fisheye")
    return Dataset(fitted, tests, points, colours, dropped, notes + _told(file.parent, [*fitted, *tests]), str(data.get("ply_file_path")))


def ply_of(file: Path, data: dict[str, Any]) -> Path | None:
    """The PLY of points that a `transforms.json` names, there or not; None: it names none. FlickerError."""
    name = data.get("ply_file_path")
    if name is not None and not isinstance(name, str):
        raise FlickerError(f"{file}: ply_file_path: not a text")
    return file.parent / name.replace("\\", "/") if name else None


def _ply_points(file: Path, data: dict[str, Any]) -> tuple[np.ndarray | None, np.ndarray | None, int]:
    """Points and colours of the PLY that `ply_file_path` names, as of `_points`, None where it is not there; grey where it has no
    colours. FlickerError, naming file and field."""
    path = ply_of(file, data)
    if path is None or not path.is_file():
        return None, None, 0
    try:
        ply = open_ply(path)
        ply.require("vertex", ["x", "y", "z"], ("f2", "f4", "f8"), "a float")
        points = ply.numbers("vertex", ["x", "y", "z"], "f8")
        have = {p.name for element in ply.header.elements if element.name == "vertex" for p in element.properties}
        if {"red", "green", "blue"} <= have:
            ply.require("vertex", ["red", "green", "blue"], ("u1",), "uchar")
            colours = ply.numbers("vertex", ["red", "green", "blue"], "f8", False) / 255.0
        else:
            colours = np.full(points.shape, 0.5)
    except OSError as error:
        raise FlickerError(f"{file}: ply_file_path: {path} cannot be read ({error.strerror})") from None
    return _finite(points, colours)


def _of_colmap(model: Path, path: Path, size: int | None, images: str | None) -> Dataset:
    """A COLMAP model and its pictures. path: as the user named it, the model's own folder too."""
    root = data_root(model) if model == path and not any((path / place).is_dir() for place in PICTURES) else path
    if model.is_relative_to(path / "dense"):  # its pictures are beside it
        root = model.parent
    folder, notes = _folder(root, images), []
    if root != path or (model.name.isdecimal() and model.name != "0"):
        notes.append(f"the model of {model}")
    if others := [other for other in numbered(model.parent) if model.name.isdecimal() and other != model]:
        notes.append(f"{', '.join(map(str, others))}: not used; a model is taken by the name of its folder")
    folder = folder or next((there for place in PICTURES if (there := root / place).is_dir()), None)
    if folder is None:
        raise FlickerError(f"{root}: none of the folders {', '.join(PICTURES)}: name that of the pictures by --images")
    if folder != path / PICTURES[0]:
        notes.append(f"photographs of {folder}")
    shots = _colmap(model, root, folder, size)
    fitted, tests = _every_eighth(path, shots)
    return Dataset(fitted, tests, *_points(model), notes + _told(root, shots))


def photo_folder(shots: Sequence[Shot]) -> Path | None:
    """The folder in which every photograph has the name of its camera, as `flicker report --photos` wants it; None: there is none, as of pictures that it
    would read otherwise."""
    folders = set()
    for shot in shots:
        name = PurePosixPath(str(shot.camera.img_name))
        if shot.changed or shot.path.parts[-len(name.parts) :] != name.parts:
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
    _enough(root, fitted, tests)
    return Dataset(fitted, tests, notes=notes + _told(root, fitted + tests))


def _folder(root: Path, images: str | None) -> Path | None:
    """The folder of pictures that the user names; None: none is named."""
    if images is None:
        return None
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
    stored = "are taken as they are stored, not as EXIF turns them: so they have the shape of their cameras"
    for turned, text in ((True, "are turned upright, as EXIF says"), (False, stored)):
        if count := sum(shot.turned is turned for shot in shots):
            notes.append(f"{count} of {total} photographs {text}")
    if cropped := sum(shot.crop is not None for shot in shots):
        notes.append(f"{cropped} of {total} photographs have a fisheye_crop_radius: pixels outside of the circle do not count")
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
    for folder in (root / place for group in PHOTO_PLACES for place in group):
        if picture.is_relative_to(folder):
            return picture.relative_to(folder).as_posix()
    return picture.name


def _zeros(values: object) -> bool:
    return isinstance(values, list) and all(isinstance(value, (int, float)) and value == 0 for value in values)


def _model(frame: Frame) -> str | None:
    """The lens model of a frame; None: none is named. FlickerError for other projections."""
    try:
        flagged = {key: truth(frame.data, key) for key in FLAGS}
    except FlickerError as error:
        raise FlickerError(f"{frame.where}: {error}") from None
    for key in (*FLAGS, *frame.data):
        if (flagged.get(key) and key not in _FISHEYE_FLAGS) or key.startswith("ftheta_"):
            raise FlickerError(f"{frame.where}: {key}: pictures of this projection cannot be undistorted")
    if frame.data.get("distortion_params") is not None and not _zeros(frame.data["distortion_params"]):
        raise FlickerError(f"{frame.where}: distortion_params: not read: coefficients are wanted by their names, k1, k2, ...")
    model = frame.data.get("camera_model")
    if model is not None and not isinstance(model, str):
        raise FlickerError(f"{frame.where}: camera_model: not a text")
    if any(flagged[key] for key in _FISHEYE_FLAGS) and (model is None or model.upper() in PERSPECTIVE):
        return "OPENCV_FISHEYE"
    if (fault := foreign_fault(frame.data)) is not None:
        raise FlickerError(f"{frame.where}: {fault}")
    return model


def transforms_shot(frame: Frame, size: int | None, folder: Path | None = None, exact: bool = False) -> Shot:
    """The photograph of a frame. folder: of the pictures, None: where the frame says. exact: as in `shot_of`."""
    if frame.name is None:
        raise FlickerError(f"{frame.where}: file_path: is missing")
    picture = _picture(f"{frame.where}: file_path", frame.folder / frame.name if folder is None else folder / photo_name(frame.name))
    mask: Path | None = None
    named = frame.data.get("mask_path")
    if named is not None and not isinstance(named, str):
        raise FlickerError(f"{frame.where}: mask_path: not a text")
    if named:
        mask = frame.folder / named.replace("\\", "/")
        if not mask.is_file():
            raise FlickerError(f"{frame.where}: mask_path: no picture {mask}")
    number, model = frame.number, _model(frame)
    crop = number["fisheye_crop_radius"] if model is not None and model.upper() in FISHEYES else None  # of other lenses nerfstudio, too, passes it over
    try:
        pose = frame.pose()
    except FlickerError as error:
        raise FlickerError(f"{frame.where}: {error}") from None
    return shot_of(
        frame.where, picture, _name(picture, frame.folder) if folder is None else picture.relative_to(folder).as_posix(), size, (number["w"], number["h"]),
        frame.focal, (number["cx"], number["cy"]), model, {key: number[key] for key in COEFFICIENTS}, pose, mask, exact, crop=crop,
    )


def _transforms(path: Path, size: int | None, folder: Path | None) -> list[Shot]:
    return [transforms_shot(frame, size, folder) for frame in read_frames(path)]


def _points(model: Path) -> tuple[np.ndarray | None, np.ndarray | None, int]:
    """Points and colours of a model that are finite, and how many are not; None where it has fewer than four."""
    try:
        file = model_file(model, "points3D")
    except FlickerError:  # a model of cameras alone
        return None, None, 0
    return _finite(*read_points(file))


def _finite(points: np.ndarray, colours: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None, int]:
    """Those that are finite, and how many are not; None where there are fewer than four."""
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
            _mask(root, image.name), stored=True,
        ))
    return shots
