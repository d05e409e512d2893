"""What a sweep runs: a YAML file, checked in full before any work starts."""

from __future__ import annotations

import difflib
import hashlib
import json
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from ...cost.area import SYNTHESIS
from ...scene.camera import MAX_SIZE, load_cameras
from ...errors import FlickerError
from ..evaluate import CONFIGURATIONS, get_configuration
from ...toolchain import BUILD

DEMO = "demo"
ORBIT_VIEWS = 8  # flicker.camera.find_cameras
MAX_WORKERS = 1024
# Parts of the package that no result depends on.
_NOT_IN_RESULTS = ("sweep", "stability", "sim", "synth", "cli.py", "pipeline.py", "report")

KEYS = {
    "scenes": "list of scene files, or of mappings with path, cameras, views",
    "views": "list of camera numbers, for every scene without its own",
    "size": "WxH such as 1280x720",
    "configurations": "list of names or patterns (flicker.explore.evaluate.CONFIGURATIONS), or all",
    "cluster": "mapping: workers, or address",
    "out": "folder, relative to the current one",
}
SCENE_KEYS = ("path", "cameras", "views")
CLUSTER_KEYS = ("workers", "address")


@dataclass(frozen=True)
class SceneViews:
    """A scene and its views. path: a file, or `demo`. digest: of the contents of scene and cameras."""

    path: str
    cameras: str | None
    views: tuple[int, ...]
    digest: str

    @property
    def name(self) -> str:
        """File name."""
        return Path(self.path).name


@dataclass(frozen=True)
class Point:
    """One configuration on one view."""

    scene: SceneViews
    view: int
    configuration: str

    @property
    def key(self) -> str:
        """Name of the point's file: of contents, not of places."""
        return hashlib.sha256(json.dumps([self.scene.name, self.scene.digest, self.view, self.configuration]).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Sweep:
    """A checked sweep. workers: local processes; None: as many as there are cores, two at most. address: of a Dask scheduler instead."""

    scenes: tuple[SceneViews, ...]
    width: int
    height: int
    configurations: tuple[str, ...]
    workers: int | None = None
    address: str | None = None
    out: Path = field(default_factory=lambda: BUILD / "sweep")

    @property
    def points(self) -> list[Point]:
        """All points, those of a view together."""
        return [
            Point(s, view, name)
            for s in self.scenes for view in s.views for name in self.configurations
        ]

    def description(self) -> dict[str, Any]:
        """What the results depend on: scenes by content, views, size, configurations with all their fields, and the code."""
        return {
            "scenes": [{"name": s.name, "digest": s.digest, "views": list(s.views)} for s in self.scenes],
            "size": [self.width, self.height],
            "configurations": {name: asdict(CONFIGURATIONS[name]) for name in self.configurations},
            "code": code_digest(),
        }

    @property
    def hash(self) -> str:
        """Of `description`."""
        return hashlib.sha256(json.dumps(self.description(), sort_keys=True).encode()).hexdigest()[:16]

    @property
    def folder(self) -> Path:
        """Where the results are."""
        return self.out / self.hash


@lru_cache(maxsize=None)
def code_digest() -> str:
    """Hash of the package's code and tables that results depend on, and of the areas of `make synth`."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*")):
        inside = path.relative_to(package)
        if path.suffix in (".py", ".csv") and inside.parts[0] not in _NOT_IN_RESULTS:
            digest.update(str(inside).encode() + b"\0" + path.read_bytes())
    if SYNTHESIS.exists():
        digest.update(SYNTHESIS.read_bytes())
    return digest.hexdigest()[:16]


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


# ---- reading ------------------------------------------------------------------------------------


class _Reader:
    """Takes values out of the parsed file; every message names the file and the key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def fail(self, where: str, message: str) -> FlickerError:
        return FlickerError(f"{self.path}: {where}: {message}")

    def keys(self, value: dict, known, where: str) -> None:
        for key in value:
            if key not in known:
                close = difflib.get_close_matches(str(key), known, 1)
                hint = f"did you mean '{close[0]}'?" if close else f"known are {', '.join(known)}"
                raise FlickerError(f"{self.path}: {where}unknown key '{key}'; {hint}")

    def items(self, value: Any, where: str) -> list:
        if not isinstance(value, list) or not value:
            raise self.fail(where, "expected a list with at least one entry")
        return value

    def views(self, value: Any, where: str) -> tuple[int, ...]:
        views = self.items(value, where)
        for view in views:
            if isinstance(view, bool) or not isinstance(view, int) or view < 0:
                raise self.fail(where, f"expected camera numbers from 0 on, not '{view}'")
        return tuple(dict.fromkeys(views))

    def size(self, value: Any) -> tuple[int, int]:
        parts = str(value).lower().split("x")
        if len(parts) != 2 or not all(p.strip().isdigit() for p in parts):
            raise self.fail("size", f"expected WxH such as 1280x720, not '{value}'")
        width, height = int(parts[0]), int(parts[1])
        if not (1 <= width <= MAX_SIZE and 1 <= height <= MAX_SIZE):
            raise self.fail("size", f"width and height must be 1 to {MAX_SIZE}, not {width}x{height}")
        return width, height

    def file(self, value: Any, where: str) -> Path:
        """A path, relative to the YAML file."""
        if not isinstance(value, str) or not value:
            raise self.fail(where, f"expected a path, not '{value}'")
        path = (self.path.parent / Path(value).expanduser()).resolve()
        if not path.is_file():
            raise self.fail(where, f"{path}: no such file")
        try:
            path.open("rb").close()
        except OSError as error:
            raise self.fail(where, f"{path}: cannot be read ({error.strerror})") from None
        return path

    def scene(self, value: Any, default_views: tuple[int, ...], where: str) -> SceneViews:
        if isinstance(value, str):
            value = {"path": value}
        if not isinstance(value, dict):
            raise self.fail(where, f"expected a path or a mapping, not '{value}'")
        self.keys(value, SCENE_KEYS, f"{where}: ")
        if "path" not in value:
            raise self.fail(where, "path is missing")
        views = self.views(value["views"], f"{where}: views") if "views" in value else default_views
        if value["path"] == DEMO:
            if "cameras" in value:
                raise self.fail(where, "the demo scene has its own cameras")
            from ...scene.demo import demo_cameras

            self._check_views(views, len(demo_cameras()), where)
            return SceneViews(DEMO, None, views, "")
        path = self.file(value["path"], where)
        if not any(path.name.lower().endswith(ending) for ending in (".ply", ".spz", ".sog", ".splat")):
            raise self.fail(where, f"{path}: expected .ply, .spz, .sog or .splat")
        cameras = self.file(value["cameras"], f"{where}: cameras") if value.get("cameras") is not None else None
        digest = _file_digest(path)
        used = cameras if cameras is not None else path.parent / "cameras.json"
        if used.exists():
            self._check_views(views, len(load_cameras(used)), where)
            digest += "-" + _file_digest(used)
        else:
            self._check_views(views, ORBIT_VIEWS, where)
        return SceneViews(str(path), None if cameras is None else str(cameras), views, digest)

    def _check_views(self, views: tuple[int, ...], count: int, where: str) -> None:
        for view in views:
            if view >= count:
                raise self.fail(where, f"view {view}: there are {count} cameras, 0 to {count - 1}")

    def configurations(self, value: Any) -> tuple[str, ...]:
        if value == "all":
            return tuple(CONFIGURATIONS)
        found: list[str] = []
        for name in self.items(value, "configurations"):
            name = str(name)
            matching = [c for c in CONFIGURATIONS if fnmatchcase(c, name)]
            if not matching:
                if any(sign in name for sign in "*?["):
                    raise self.fail("configurations", f"no configuration matches '{name}'")
                try:
                    get_configuration(name)
                except FlickerError as error:
                    raise FlickerError(f"{self.path}: {error}") from None
            found += matching
        return tuple(dict.fromkeys(found))

    def cluster(self, value: Any) -> tuple[int | None, str | None]:
        if not isinstance(value, dict):
            raise self.fail("cluster", f"expected a mapping with {' or '.join(CLUSTER_KEYS)}, not '{value}'")
        self.keys(value, CLUSTER_KEYS, "cluster: ")
        workers, address = value.get("workers"), value.get("address")
        if workers is not None and address is not None:
            raise self.fail("cluster", "give either workers or address")
        if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or not 1 <= workers <= MAX_WORKERS):
            raise self.fail("cluster: workers", f"must be 1 to {MAX_WORKERS}, not '{workers}'")
        if address is not None and not isinstance(address, str):
            raise self.fail("cluster: address", f"expected an address such as tcp://host:8786, not '{address}'")
        return workers, address


def load_sweep(path: str | Path) -> Sweep:
    """Read and check a sweep. FlickerError, naming file and key, for anything that could not be run."""
    path = Path(path)
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
        raise FlickerError(f"{path}: expected a mapping with the keys {', '.join(KEYS)}")
    reader = _Reader(path)
    reader.keys(data, KEYS, "")
    for key in ("scenes", "configurations"):
        if key not in data:
            raise FlickerError(f"{path}: key '{key}' is missing: {KEYS[key]}")
    width, height = reader.size(data.get("size", "1280x720"))
    configurations = reader.configurations(data["configurations"])
    workers, address = reader.cluster(data["cluster"]) if data.get("cluster") is not None else (None, None)
    default_views = reader.views(data.get("views", [0]), "views")
    scenes = tuple(reader.scene(s, default_views, f"scenes[{i}]") for i, s in enumerate(reader.items(data["scenes"], "scenes")))
    seen: set[tuple] = set()
    for s in scenes:
        for view in s.views:
            if (s.name, s.digest, view) in seen:
                raise FlickerError(f"{path}: scenes: view {view} of {s.path} is there twice")
            seen.add((s.name, s.digest, view))
    out = data.get("out")
    if out is not None and (not isinstance(out, str) or not out):
        raise reader.fail("out", f"expected a folder, not '{out}'")
    return Sweep(scenes, width, height, configurations, workers, address, Path(out).expanduser() if out else BUILD / "sweep")
