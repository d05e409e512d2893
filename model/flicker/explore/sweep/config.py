"""What a sweep runs: a YAML file, checked in full before any work starts."""

from __future__ import annotations

import difflib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StrictBool, StrictInt, StrictStr, ValidationError, field_validator, model_validator

from ...errors import FlickerError
from ...front.path_rules import kind_of
from ...front.paths import Asked
from ...front.view import DEMO
from ...params import SortOrder
from ...scene.camera import MAX_SIZE
from ...scene.files import scene_kind
from ...scene.photos import NONE, parse_background
from ...scene.sources import scene_path
from ...toolchain import BUILD
from ..configurations import GROUPS, matching
from ..digest import code_digest, key
from ..points import SIZE, Point, SceneFile, Target

MAX_WORKERS = 1024


@dataclass(frozen=True)
class Sweep:
    """A checked sweep. workers: local processes; None: as many as there are cores, two at most. address: of a Dask scheduler instead."""

    targets: tuple[Target, ...]
    configurations: tuple[str, ...]
    workers: int | None = None
    address: str | None = None
    out: Path = field(default_factory=lambda: BUILD / "sweep")

    @property
    def points(self) -> list[Point]:
        """All points, those of a view together."""
        return [Point(target, name) for target in self.targets for name in self.configurations]

    def description(self) -> dict[str, Any]:
        """What the results stand for: scenes by content, views, sizes, configurations, and the code."""
        return {
            "views": [
                {"scene": t.scene.file, "digest": t.scene.digest, "view": t.view, "size": list(t.size), "looks": t.looks, **t.moved} for t in self.targets
            ],
            "configurations": list(self.configurations),
            "code": code_digest(),
        }

    @property
    def hash(self) -> str:
        """Of all points."""
        return key(*(p.key for p in self.points))[:16]

    @property
    def folder(self) -> Path:
        """Where the table of all results is."""
        return self.out / self.hash

    @property
    def store(self) -> Path:
        """Where results of single points are kept, for other sweeps and reports too."""
        return self.out / "points"


# ---- the file -----------------------------------------------------------------------------------


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid")


Number = Annotated[float, Field(strict=True)]


class PathSection(_Section):
    """A path instead of a still: the options of `flicker path`, a motion or none: the cameras in order."""

    pan: Annotated[Number | None, Field(description="pixels a frame")] = None
    orbit: Annotated[Number | None, Field(description="degrees of the whole path")] = None
    dolly: StrictBool = False
    walk: StrictBool = False
    shake: StrictBool = False
    keyframes: StrictBool = False
    speed: Number | None = None
    ahead: Number | None = None
    seed: StrictInt | None = None
    frames: Annotated[StrictInt | None, Field(ge=1)] = None
    fps: Number = 90.0
    clock: Annotated[Number, Field(description="GHz")] = 1.0
    view: Annotated[StrictInt, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _rules(self) -> PathSection:
        self.kind()
        return self

    def kind(self) -> str | None:
        """Kind of the path, as `front.path_rules.kind_of` reads it."""
        try:
            return kind_of(self.model_dump(), str)
        except FlickerError as error:
            raise ValueError(str(error)) from None

    def asked(self) -> Asked:
        """The path that is asked for."""
        given = {name: value for name in ("speed", "ahead", "seed") if (value := getattr(self, name)) is not None}
        return Asked(self.kind(), self.pan or self.orbit or 0.0, self.view, None, self.frames, self.fps, **given)


def _views(value: Any) -> Any:
    found: list[Any] = []
    for n, view in enumerate(value if isinstance(value, list) else []):
        if isinstance(view, dict):
            try:
                found.append(PathSection.model_validate(view))
            except ValidationError as error:
                raise ValueError(f"entry {n}: {_wrong(error, PathSection)}") from None
        elif isinstance(view, bool) or not isinstance(view, int) or view < 0:
            raise ValueError(f"expected camera numbers from 0 on, or paths, not '{view}'")
        else:
            found.append(view)
    return found if isinstance(value, list) else value


Views = Annotated[list[Any], BeforeValidator(_views), Field(min_length=1)]


class SceneSection(_Section):
    """A scene with settings of its own."""

    path: Annotated[StrictStr, Field(min_length=1, description="scene file, relative to the YAML file, or demo")]
    cameras: Annotated[StrictStr | None, Field(min_length=1, description="cameras instead of those beside the scene")] = None
    views: Annotated[Views | None, Field(description="camera numbers of this scene, or paths")] = None
    up: Annotated[StrictStr | None, Field(description="axis of the scene that points up, for the orbit")] = None
    photos: Annotated[StrictStr | None, Field(min_length=1, description="folder of photographs instead of those beside the cameras, or none")] = None
    background: Annotated[StrictStr, Field(description="black, white or r,g,b from 0 to 1")] = "black"
    order: Annotated[SortOrder, Field(description="depth or distance")] = SortOrder.DEPTH

    @model_validator(mode="before")
    @classmethod
    def _plain_path(cls, value: Any) -> Any:
        return {"path": value} if isinstance(value, str) else value


class ClusterSection(_Section):
    """Where the work is done."""

    workers: Annotated[StrictInt | None, Field(description="processes of this machine")] = None
    address: Annotated[StrictStr | None, Field(description="of a Dask scheduler, such as tcp://host:8786")] = None

    @field_validator("workers")
    @classmethod
    def _some(cls, value: int | None) -> int | None:
        if value is not None and not 1 <= value <= MAX_WORKERS:
            raise ValueError(f"must be 1 to {MAX_WORKERS}, not '{value}'")
        return value

    @model_validator(mode="after")
    def _either(self) -> ClusterSection:
        if self.workers is not None and self.address is not None:
            raise ValueError("give either workers or address")
        return self


class SweepFile(_Section):
    """The YAML file as it is written."""

    scenes: Annotated[list[SceneSection], Field(min_length=1, description="list of scene files, or of mappings with path, cameras, views")]
    configurations: Annotated[
        list[StrictStr] | Literal["all"], Field(description="list of names or patterns (flicker report --list), or all: those of the report"),
    ]
    views: Annotated[Views, Field(description="camera numbers of every scene without its own, or paths")] = [0]
    size: Annotated[StrictStr | None, Field(description="WxH")] = None
    cluster: Annotated[ClusterSection | None, Field(description="workers, or address")] = None
    out: Annotated[StrictStr | None, Field(min_length=1, description="folder, relative to the current one")] = None

    @field_validator("size")
    @classmethod
    def _size(cls, value: str | None) -> str | None:
        if value is None:
            return None
        parts = value.lower().split("x")
        if len(parts) != 2 or not all(p.strip().isdigit() for p in parts):
            raise ValueError(f"expected WxH such as 1280x720, not '{value}'")
        if not all(1 <= int(p) <= MAX_SIZE for p in parts):
            raise ValueError(f"width and height must be 1 to {MAX_SIZE}, not {value}")
        return value


def _place(location: tuple) -> str:
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f": {part}" if text else str(part)
    return text


def _first(path: Path, error: ValidationError) -> FlickerError:
    """The first thing wrong, as one line that names file and key."""
    return FlickerError(f"{path}: {_wrong(error, SweepFile)}")


def _wrong(error: ValidationError, whole: type[_Section]) -> str:
    """The first thing wrong with a section."""
    found = error.errors()[0]
    location = tuple(part for part in found["loc"] if not (isinstance(part, str) and ("[" in part or part == "list")))
    if found["type"] == "extra_forbidden":
        sections: dict[str, type[_Section]] = {"scenes": SceneSection, "cluster": ClusterSection}
        section = sections.get(str(location[0]) if len(location) > 1 else "", whole)
        close = difflib.get_close_matches(str(location[-1]), section.model_fields, 1)
        hint = f"did you mean '{close[0]}'?" if close else f"known are {', '.join(section.model_fields)}"
        where = _place(location[:-1])
        return f"{where + ': ' if where else ''}unknown key '{location[-1]}'; {hint}"
    if found["type"] == "missing":
        field_ = SweepFile.model_fields.get(str(location[-1])) or SceneSection.model_fields[str(location[-1])]
        return f"{_place(location[:-1]) + ': ' if len(location) > 1 else ''}key '{location[-1]}' is missing: {field_.description}"
    message = str(found["msg"]).removeprefix("Value error, ")
    if found["type"] in ("too_short", "list_type"):
        message = "expected a list with at least one entry"
    elif found["type"] != "value_error":
        message = f"{message[0].lower()}{message[1:]}, not '{found['input']}'"
    return f"{_place(location)}: {message}" if location else message


def _parse(path: Path) -> SweepFile:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise FlickerError(f"{path}: not a text file") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}: " if mark else ""
        raise FlickerError(f"{path}: {place}not YAML ({getattr(error, 'problem', None) or 'damaged'})") from None
    if not isinstance(data, dict):
        raise FlickerError(f"{path}: expected a mapping with the keys {', '.join(SweepFile.model_fields)}")
    try:
        return SweepFile.model_validate(data)
    except ValidationError as error:
        raise _first(path, error) from None


def _path(base: Path, text: str, where: str) -> Path:
    """A file or folder of the sweep, relative to the YAML file."""
    path = (base.parent / Path(text).expanduser()).resolve()
    if not path.exists():
        raise FlickerError(f"{base}: {where}: {path}: no such file")
    if not os.access(path, os.R_OK):
        raise FlickerError(f"{base}: {where}: {path}: cannot be read")
    return path


def _scene(base: Path, section: SceneSection, where: str) -> SceneFile:
    try:
        background = parse_background(section.background)
    except FlickerError as error:
        raise FlickerError(f"{base}: {where}: {error}") from None
    cameras = None if section.cameras is None else str(_path(base, section.cameras, f"{where}: cameras"))
    photos = section.photos if section.photos in (None, NONE) else str((base.parent / Path(section.photos).expanduser()).resolve())
    if section.path == DEMO:
        if section.up is not None:
            raise FlickerError(f"{base}: {where}: up: {section.up}: only orbit cameras can be turned, and the demo scene has its own")
        return SceneFile(DEMO, cameras, None, photos, background, section.order)
    path = Path(scene_path(_path(base, section.path, where)))
    try:
        scene_kind(path)
    except FlickerError as error:
        raise FlickerError(f"{base}: {where}: {error}") from None
    return SceneFile(str(path), cameras, section.up, photos, background, section.order)


def load_sweep(path: str | Path) -> Sweep:
    """Read and check a sweep. FlickerError, naming file and key, for anything that could not be run."""
    path = Path(path)
    given = _parse(path)
    width, height = (int(p) for p in given.size.lower().split("x")) if given.size else SIZE
    size = (width, height) if given.size else None
    try:
        names = matching(GROUPS["report"] if given.configurations == "all" else given.configurations)
    except FlickerError as error:
        raise FlickerError(f"{path}: configurations: {error}") from None
    if not names:
        raise FlickerError(f"{path}: configurations: expected a list with at least one entry")
    targets: list[Target] = []
    first_of: dict[tuple, int] = {}  # section in which a target comes first
    for i, section in enumerate(given.scenes):
        where = f"scenes[{i}]"
        scene = _scene(path, section, where)
        for view in section.views if section.views is not None else given.views:
            try:
                moved = isinstance(view, PathSection)
                target = scene.path_target(view.asked(), size, view.clock) if moved else scene.target(view, size)
            except FlickerError as error:
                raise FlickerError(f"{path}: {where}: {error}") from None
            if (same := (scene.file, scene.digest, target.view, target.path, target.clock)) in first_of:
                if i == first_of[same]:
                    continue
                raise FlickerError(f"{path}: scenes: view {target.number} of {scene.path} is there twice")
            first_of[same] = i
            targets.append(target)
    cluster = given.cluster or ClusterSection()
    out = Path(given.out).expanduser() if given.out else BUILD / "sweep"
    return Sweep(tuple(targets), tuple(names), cluster.workers, cluster.address, out)
