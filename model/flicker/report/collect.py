"""What the report needs of every view: rows of the configurations, facts for single figures, maps, pictures. Cached by content."""

from __future__ import annotations

import difflib
import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..cost.area import SYNTHESIS
from ..scene.camera import Camera, find_cameras, load_cameras, select_view
from ..chip import frame as chip
from ..chip.execute import run_scheme
from ..cost.energy import memory_energy
from ..errors import FlickerError
from ..explore.evaluate import CONFIGURATIONS, Configuration, Evaluation, ViewData, evaluate, load_view
from ..explore.methods import get_method
from ..perf.work import MINITILE_PIXELS, Work
from ..scene.metrics import flip_map
from ..params import CHANNELS, FAITHFUL, MINITILE, SUBTILE, CatMode, RenderConfig
from ..perf.render_stage import simulate
from ..front.projection import Projected
from ..scene.files import Scene, load_scene

TILE_SIZES = (4, 8, 16, 32)
FIFO_DEPTHS = (1, 2, 4, 8, 16, 32, 64, 128)
ORBIT_VIEWS = 8  # views of a scene without cameras.json
# The paper's baselines with the paper's form, for its own figures.
CONIC_BASELINES = (
    Configuration("no-ctu-32-conic", "no_ctu-conic", "FLICKER without CTU, 32 VRUs, conic"),
    Configuration("no-ctu-64-conic", "no_ctu-conic", "FLICKER without CTU, 64 VRUs, conic", vrus_per_channel=4),
    Configuration("gscore-conic", "gscore-conic", "GSCore: OBB on 8x8 sub-tiles, 64 VRUs, conic", vrus_per_channel=4),
)
MAPPED = ("vanilla", "faithful", "flicker", "lanes")
PICTURED = ("flicker-smooth-fp16-conic", "flicker-smooth-mixed-conic", "flicker-smooth-fp8-conic")
FIFO_SWEPT = "faithful"
CHIP = ("no-ctu-32-conic", "no-ctu-64-conic", "gscore-conic", "faithful", "flicker", "lanes", "lanes-64")
SUFFIXES = (".ply", ".spz", ".sog", ".splat")
_PACKAGE = Path(__file__).resolve().parents[1]
_SOURCES = ("*.py", "golden/*.py", "methods/*.py", "perf/*.py", "chip/*.py", "report/collect.py")
_NOT_SOURCES = ("cli.py", "pipeline.py", "toolchain.py", "command.py", "tables.py", "table.py")


@dataclass(frozen=True)
class Target:
    """A scene file and the number of its camera."""

    path: Path
    view: int = 0

    @property
    def scene(self) -> str:
        """Name of the scene: the file's, without its suffixes."""
        return self.path.name.split(".")[0]

    @property
    def title(self) -> str:
        return f"{self.scene} {self.view}"


@dataclass
class ViewResult:
    """One view. rows, extras, maps, pictures: by name of the configuration.

    rows: as `Evaluation.row`. extras: counts per configuration (`work_counts`). facts: `duplicates`, `fifo`, `chip`. maps: of the
    configurations in `MAPPED`, arrays by name (`heat_maps`). pictures: uint8 (H, W, 3) of `PICTURED`. reference: uint8 (H, W, 3).
    """

    target: Target
    size: tuple[int, int]
    rows: dict[str, dict] = field(default_factory=dict)
    extras: dict[str, dict] = field(default_factory=dict)
    facts: dict[str, dict] = field(default_factory=dict)
    maps: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    pictures: dict[str, np.ndarray] = field(default_factory=dict)
    reference: np.ndarray | None = None


def parse_target(text: str) -> Target:
    """`FILE` or `FILE:VIEW`; FlickerError when the file cannot be a scene or has no such view."""
    path, view = Path(text), 0
    head, colon, tail = text.rpartition(":")
    if colon and tail.isdigit() and not path.exists():
        path, view = Path(head), int(tail)
    if not path.exists():
        raise FlickerError(f"{path}: no such scene")
    if not path.is_file() or not os.access(path, os.R_OK):
        raise FlickerError(f"{path}: not a readable file")
    if path.suffix not in SUFFIXES:
        raise FlickerError(f"{path}: not a scene file ({', '.join(SUFFIXES)})")
    cameras = path.parent / "cameras.json"
    count = len(load_cameras(cameras)) if cameras.exists() else ORBIT_VIEWS
    if view >= count:
        raise FlickerError(f"{path}: view {view}: there are {count} cameras, 0 to {count - 1}")
    return Target(path, view)


def known_configurations() -> dict[str, Configuration]:
    """All configurations of the report by name."""
    return CONFIGURATIONS | {c.name: c for c in CONIC_BASELINES}


def check_configurations(names: Sequence[str]) -> list[str]:
    """The names, each once; FlickerError, naming close ones, for an unknown name."""
    known = known_configurations()
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, list(known), 3, 0.3)
            raise FlickerError(f"--configs: unknown configuration '{name}'; close names: {', '.join(close) or 'none'}")
    return list(dict.fromkeys(names))


# -- cache ----------------------------------------------------------------------------------------------------------------------------


def file_digest(path: Path) -> str:
    """Content hash of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def code_digest() -> str:
    """Hash of all modules that results depend on, and of the areas and energies they read."""
    digest = hashlib.sha256()
    sources = sorted({path for pattern in _SOURCES for path in _PACKAGE.glob(pattern)})
    sources += sorted(_PACKAGE.glob("*.csv")) + [path for path in (SYNTHESIS,) if path.exists()]
    for source in sources:
        if source.name not in _NOT_SOURCES:
            digest.update(source.read_bytes())
    return digest.hexdigest()


class Cache:
    """Results in a folder, one pair of files per key: JSON, and arrays where there are any."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FlickerError(f"{folder}: no folder can be made there ({error.strerror})") from None

    def key(self, *parts: str) -> str:
        """Name of a result from all that it depends on."""
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]

    def load(self, key: str) -> tuple[dict, dict[str, np.ndarray]] | None:
        """The stored result; None when there is none, or a damaged one."""
        try:
            data = json.loads((self.folder / f"{key}.json").read_text())
            arrays: dict[str, np.ndarray] = {}
            if data.pop("_arrays"):
                with np.load(self.folder / f"{key}.npz", allow_pickle=False) as stored:
                    arrays = {name: stored[name] for name in stored.files}
            return data, arrays
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def store(self, key: str, data: dict, arrays: dict[str, np.ndarray]) -> None:
        """Write a result: arrays first, JSON last, each put in place whole."""
        try:
            if arrays:
                temporary = self.folder / f".{key}.{os.getpid()}.npz"
                np.savez_compressed(temporary, **arrays)
                temporary.replace(self.folder / f"{key}.npz")
            temporary = self.folder / f".{key}.{os.getpid()}.json"
            temporary.write_text(json.dumps(data | {"_arrays": bool(arrays)}, default=_plain))
            temporary.replace(self.folder / f"{key}.json")
        except OSError as error:
            raise FlickerError(f"{self.folder}: cannot be written ({error.strerror})") from None


def _plain(value):
    """numpy numbers and arrays for JSON."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value)


# -- what is computed -----------------------------------------------------------------------------------------------------------------


def work_counts(work: Work, width: int, height: int) -> dict[str, float]:
    """Totals of the work; `listed_per_pixel`: elements of a pixel's list; `visited_per_pixel`: those a VRU visits before the pixel is
    finished; `imbalance`: busiest channel over the mean of the four, sub-tiles weighted by their work."""
    pixels = width * height
    totals = work.totals()
    slots = _channel_slots(work)
    return totals | {
        "listed_per_pixel": totals["elements"] * SUBTILE * SUBTILE / pixels,
        "visited_per_pixel": totals["pixels_visited"] / pixels,
        "contributing_per_pixel": totals["pixels_contributing"] / pixels,
        "leaders_per_element": totals["evaluations"] / max(totals["elements"], 1),
        "imbalance": float(CHANNELS * slots.max(axis=1).sum() / max(slots.sum(), 1)),
    }


def _channel_slots(work: Work) -> np.ndarray:
    """int64 (S, 4): pixels that each channel visits in each sub-tile."""
    visited = np.bitwise_count(work.visit_masks() & work.unfinished()).astype(np.int64)
    sums = np.concatenate([np.zeros((1, CHANNELS), np.int64), visited.cumsum(axis=0)])
    return sums[work.start[1:]] - sums[work.start[:-1]]


def _pixel_grid(values: np.ndarray, cols: int, rows: int) -> np.ndarray:
    """(S, 4, 16) per pixel of a mini-tile to a picture (8 rows, 8 cols), border included."""
    side = SUBTILE // MINITILE
    grid = values.reshape(rows, cols, side, side, MINITILE, MINITILE)
    return grid.transpose(0, 2, 4, 1, 3, 5).reshape(rows * SUBTILE, cols * SUBTILE)


def heat_maps(evaluation: Evaluation, reference: np.ndarray) -> dict[str, np.ndarray]:
    """`gaussians`: uint16 (H, W), Gaussians that the VRUs visit at each pixel. `cycles`: float32 (rows, cols), cycles between the end of
    a sub-tile and that of the one before it in the same core; absent when the stage gives no
    times or deals sub-tiles out otherwise. `imbalance`: float32 (rows, cols),
    busiest channel over the mean, NaN where nothing is visited. `error`: float32 (H, W), FLIP."""
    work = evaluation.work
    height, width = reference.shape[:2]
    visited = work.visit_masks() & work.unfinished()
    count = np.empty((work.subtiles, CHANNELS, MINITILE_PIXELS), np.uint16)
    for pixel in range(MINITILE_PIXELS):
        bits = (visited >> np.uint16(pixel)) & 1
        sums = np.concatenate([np.zeros((1, CHANNELS), np.int64), bits.cumsum(axis=0, dtype=np.int64)])
        count[:, :, pixel] = np.minimum(sums[work.start[1:]] - sums[work.start[:-1]], 65535)
    slots = _channel_slots(work).astype(np.float64)
    with np.errstate(invalid="ignore"):
        imbalance = np.where(slots.sum(axis=1) > 0, CHANNELS * slots.max(axis=1) / slots.sum(axis=1), np.nan)
    maps = {
        "gaussians": _pixel_grid(count, work.cols, work.rows)[:height, :width],
        "imbalance": imbalance.reshape(work.rows, work.cols).astype(np.float32),
        "error": flip_map(evaluation.image, reference).astype(np.float32),
    }
    end = getattr(evaluation.stage, "subtile_end", None)
    if end is not None and evaluation.configuration.lanes is None:
        cycles = np.zeros(work.subtiles, np.float32)
        for k in range(len(work.core_start) - 1):
            mine = work.order[work.core_start[k] : work.core_start[k + 1]]
            cycles[mine] = np.diff(end[mine], prepend=0)
        maps["cycles"] = cycles.reshape(work.rows, work.cols)
    return maps


def duplicates(projected: Projected, width: int, height: int) -> dict[str, int]:
    """Gaussian-tile pairs of the 3-sigma boxes (per axis) for every tile size; a pair when the box holds a pixel centre of the tile."""
    low = np.ceil(projected.mean - projected.radii)
    high = np.floor(projected.mean + projected.radii)
    limit = np.array([width, height]) - 1
    inside = ((low <= high) & (low <= limit) & (high >= 0)).all(axis=1)
    low = np.clip(low[inside], 0, limit).astype(np.int64)
    high = np.clip(high[inside], 0, limit).astype(np.int64)
    return {str(size): int((high // size - low // size + 1).prod(axis=1).sum()) for size in TILE_SIZES}


def render_config(configuration: Configuration) -> RenderConfig:
    """The rendering stage of a configuration whose method the RTL has, or the RTL's without a test."""
    method = get_method(configuration.method)
    config = method.config or RenderConfig(form=method.form, cat=CatMode.OFF)
    return config.with_(
        fifo_depth=configuration.fifo_depth, ctu_fifo_depth=configuration.ctu_fifo_depth, vrus_per_channel=configuration.vrus_per_channel,
    )


def fifo_sweep(work: Work, configuration: Configuration) -> dict[str, list]:
    """Cycles and CTU stall rate of one configuration's work for every FIFO depth, by the cycle model of the RTL."""
    config = render_config(configuration)
    stages = [simulate(work, config.with_(fifo_depth=depth)) for depth in FIFO_DEPTHS]
    return {
        "depth": list(FIFO_DEPTHS), "cycles": [s.cycles for s in stages], "stall_rate": [s.stall_rate for s in stages],
        "utilisation": [s.utilisation for s in stages],
    }


def chip_estimates(scene: Scene, camera: Camera, render_cycles: dict[str, int]) -> dict[str, dict]:
    """Whole-frame estimates: the same front end, lists and memory (flicker.chip) around the rendering stage of each configuration."""
    config = chip.ChipConfig()
    prepared = chip.prepare(scene, camera, FAITHFUL)
    result = run_scheme(prepared.splats, config.scheme, prepared.needed if config.early_stop else None)
    facts = {}
    for name, cycles in render_cycles.items():
        estimate = chip.frame_estimate(scene, camera, FAITHFUL, cycles, config, prepared=prepared, scheme_result=result)
        facts[name] = {
            "render_cycles": cycles, "interval_cycles": estimate.interval_cycles, "latency_cycles": estimate.latency_cycles,
            "bottleneck": estimate.bottleneck, "dram_bytes": estimate.bytes, "dram_cycles": sum(estimate.dram_cycles),
        }
    return facts


# -- collecting -----------------------------------------------------------------------------------------------------------------------


class _View:
    """A view, loaded when the first thing is computed."""

    def __init__(self, target: Target, size: tuple[int, int]) -> None:
        self.target, self.size = target, size
        self._data: ViewData | None = None

    @property
    def data(self) -> ViewData:
        if self._data is None:
            self._data = load_view(self.target.path, self.target.view, *self.size)
        return self._data


def list_kind(name: str) -> tuple[str, str]:
    """What the lists of a configuration depend on."""
    method = get_method(known_configurations()[name].method)
    return method.lists, method.form.name


def collect(
    targets: Sequence[Target], names: Sequence[str], size: tuple[int, int], folder: Path,
    progress: Callable[[int, int, str], None] = lambda done, total, text: None,
) -> list[ViewResult]:
    """Everything for the report, from the cache where it is there. progress: called with (done, in all, what is next)."""
    cache = Cache(folder)
    code = code_digest()
    known = known_configurations()
    # Few lists in memory; one method's configurations one after the other.
    order = sorted(names, key=lambda n: (list_kind(n), get_method(known[n].method).name, names.index(n)))
    steps = len(targets) * (len(names) + 2)
    done = 0
    views = []
    for target in targets:
        view = _View(target, size)
        base = code, file_digest(target.path), _cameras_digest(target), f"{target.scene} {target.view} {size[0]}x{size[1]}"
        found = ViewResult(target, size)
        kind = None
        for name in order:
            progress(done, steps, f"{target.title}: {name}")
            key = cache.key(*base, repr(known[name]))
            stored = cache.load(key)
            if stored is None:
                if list_kind(name) != kind:
                    view.data.methods_view.drop()
                    kind = list_kind(name)
                stored = _run(view.data, known[name])
                cache.store(key, *stored)
            data, arrays = stored
            found.rows[name], found.extras[name] = data["row"], data["extra"]
            if "fifo" in data:
                found.facts["fifo"] = data["fifo"]
            if "picture" in arrays:
                found.pictures[name] = arrays.pop("picture")
            if arrays:
                found.maps[name] = arrays
            done += 1
        progress(done, steps, f"{target.title}: lists")
        key = cache.key(*base, "view")
        stored = cache.load(key)
        if stored is None:
            data = view.data
            pairs = duplicates(data.projected, *size) | {"visible": data.projected.n_visible, "spiky": int(data.projected.spiky.sum())}
            stored = {"duplicates": pairs}, {"reference": _bytes(data.reference)}
            cache.store(key, *stored)
        found.facts["duplicates"], found.reference = stored[0]["duplicates"], stored[1]["reference"]
        done += 1
        progress(done, steps, f"{target.title}: chip")
        cycles = {name: int(found.rows[name]["cycles"]) for name in CHIP if name in found.rows}
        if cycles:
            key = cache.key(*base, "chip", json.dumps(cycles))
            stored = cache.load(key)
            if stored is None:
                camera = select_view(find_cameras(scene := load_scene(target.path)), target.view).resized(*size)
                stored = {"chip": chip_estimates(scene, camera, cycles)}, {}
                cache.store(key, *stored)
            found.facts["chip"] = {
                name: fact | {"energy_uj": found.rows[name]["energy_uj"] + sum(memory_energy(fact["dram_bytes"]).values())}
                for name, fact in stored[0]["chip"].items()
            }
        done += 1
        found.rows = {name: found.rows[name] for name in names}
        views.append(found)
    progress(done, steps, "done")
    return views


def _run(data: ViewData, configuration: Configuration) -> tuple[dict, dict[str, np.ndarray]]:
    result = evaluate(data, configuration)
    stored = {"row": result.row, "extra": work_counts(result.work, data.camera.width, data.camera.height)}
    arrays: dict[str, np.ndarray] = {}
    if configuration.name in MAPPED:
        arrays |= heat_maps(result, data.reference)
    if configuration.name in PICTURED:
        arrays["picture"] = _bytes(result.image)
    if configuration.name == FIFO_SWEPT:
        stored["fifo"] = fifo_sweep(result.work, configuration)
    return stored, arrays


def _bytes(image: np.ndarray) -> np.ndarray:
    """A float picture as uint8 (H, W, 3)."""
    return np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 255.0).astype(np.uint8)


def _cameras_digest(target: Target) -> str:
    cameras = target.path.parent / "cameras.json"
    return file_digest(cameras) if cameras.exists() else "orbit"
