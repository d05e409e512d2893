"""Families of hard inputs that move: what breaks at which speed of the camera. A sequence is broken where the temporal PSNR of its error
(`flicker.scene.temporal`) is below `BROKEN_PSNR`, or more than `BROKEN_JUMPS` of the pixels jump in a frame.

A speed is in pixels a frame: what is `DEPTH` ahead moves by so many across the picture, or would if a camera that goes forward went sideways.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from zlib import crc32

import numba
import numpy as np

from ...errors import FlickerError
from ...front.pops import Seen, pops, seen_in
from ...front.projection import project
from ...front.view import View
from ...markdown import table
from ...output import write_records, write_text
from ...params import SortOrder
from ...scene.camera import Camera
from ...scene.gaussians import Scene
from ...scene.motion import dollied, panned
from ...scene.temporal import Change, TemporalError, summarise
from ..configurations import get_configuration
from ..machine import run
from .families import _C0, DEPTH, SIZE, Case, _camera, _colours, _layers, _scene, _turned
from .front_ends import FRONT_ENDS, Drawer
from .run import BROKEN_PSNR

SPEEDS = (1 / 64, 1 / 16, 1 / 4, 1.0, 4.0, 16.0)
FRAMES = 9
BROKEN_JUMPS = 0.001
MACHINES = (
    "gscore", "no-ctu-32", "faithful", "flicker", "flicker-dense-fp16-factored", "flicker-sparse-fixed-factored", "flicker-auto-fixed-factored", "rows",
    "log-lanes", "image-chunk", "front-chunk-16", "front-fp16-local-16",
)


@dataclass(frozen=True)
class MovingFamily:
    """A scene and a motion. scene: of a generator and the camera that stands in the middle of the path; path: (camera, speed, frames) to its cameras."""

    name: str
    title: str
    scene: Callable[[np.random.Generator, Camera], Scene]
    path: Callable[[Camera, float, int], list[Camera]]


@dataclass(frozen=True)
class MovingPoint:
    """A configuration, or front end, in a family at a speed. Fields as of `TemporalSummary`; inf: equal. pops: pairs that overlap in a pixel and
    change their order, mean of the frames behind the first (`flicker.front.pops`)."""

    family: str
    speed: float
    configuration: str
    psnr_db: float
    temporal_psnr_db: float
    jumps: float
    pops: float = 0.0

    @property
    def broken(self) -> bool:
        """Whether the configuration flickers here."""
        return not (self.temporal_psnr_db >= BROKEN_PSNR and self.jumps <= BROKEN_JUMPS)


def _wide(rng: np.random.Generator, n: int) -> np.ndarray:
    """Places over three pictures beside each other, so that one is in sight of every camera."""
    return rng.uniform((-SIZE, 0.0), (2.0 * SIZE - 1.0, SIZE - 1.0), (n, 2))


def _truck(camera: Camera, speed: float, frames: int) -> list[Camera]:
    """Sideways, the middle of the path at the camera."""
    step = speed * DEPTH / camera.fx
    return [replace(camera, position=camera.position + np.array([(n - frames // 2) * step, 0.0, 0.0])) for n in range(frames)]


def _turn(camera: Camera, speed: float, frames: int) -> list[Camera]:
    """On the spot, the middle of the path at the camera."""
    return panned(panned(camera, -speed, frames // 2 + 1)[-1], speed, frames)


def _forward(camera: Camera, speed: float, frames: int) -> list[Camera]:
    return dollied(camera, speed * DEPTH / camera.fx, 1.0, frames)


def _thin(rng: np.random.Generator, camera: Camera) -> Scene:
    n = 150
    short = rng.uniform(0.5, 1.5, n)
    return _scene(_wide(rng, n), np.stack([30 * short, short], 1), rng.uniform(0, math.pi, n), _layers(rng, n), rng.uniform(0.3, 0.95, n),
                  _colours(rng, n), camera)


def _small(rng: np.random.Generator, camera: Camera) -> Scene:
    n = 1800
    return _scene(_wide(rng, n), rng.uniform(0.3, 1.0, (n, 1)) * np.ones(2), 0.0, _layers(rng, n), rng.uniform(0.4, 0.95, n), _colours(rng, n), camera)


def _through(rng: np.random.Generator, camera: Camera) -> Scene:
    """Round ones along the axis, of half their distance: the camera goes into them and out of them."""
    n = 100
    depth = rng.uniform(0.4, 14.0, n)
    means = np.concatenate([rng.normal(0.0, 0.15, (n, 2)) * depth[:, None], depth[:, None]], 1)
    scales = 0.5 * depth[:, None] * np.exp(rng.uniform(-0.7, 0.3, (n, 3)))
    return Scene(means, scales, _turned(rng, n), rng.uniform(0.1, 0.5, n), (_colours(rng, n)[:, None] - 0.5) / _C0)


def _pairs(rng: np.random.Generator, camera: Camera) -> Scene:
    """Pairs of opposite colours that overlap beside each other at equal depths: to turn on the spot swaps their order."""
    n = 180
    place = np.repeat(_wide(rng, n), 2, axis=0) + np.tile([[-2.0, 0.0], [2.0, 0.0]], (n, 1))
    depth = np.repeat(_layers(rng, n), 2)
    rgb = np.tile([[0.9, 0.1, 0.1], [0.1, 0.2, 0.9]], (n, 1))
    return _scene(place, np.repeat(rng.uniform(3, 6, (n, 2)), 2, axis=0), 0.0, depth, 0.6, rgb, camera)


def _mixed(rng: np.random.Generator, camera: Camera) -> Scene:
    """Sizes and opacities as in captured scenes, and as many layers."""
    n = 4500
    sigma = np.exp(rng.normal(math.log(1.5), 0.8, (n, 2)))
    return _scene(_wide(rng, n), sigma, rng.uniform(0, math.pi, n), _layers(rng, n), rng.uniform(0.02, 0.95, n), _colours(rng, n), camera)


def _edges(rng: np.random.Generator, camera: Camera) -> Scene:
    """Across the left and right edge of the picture, up to 20 pixels inside and out."""
    n = 400
    mean = np.stack([rng.choice((0.0, SIZE - 1.0), n) + rng.uniform(-20, 20, n), rng.uniform(0, SIZE - 1, n)], 1)
    return _scene(mean, rng.uniform(0.6, 6.0, (n, 2)), rng.uniform(0, math.pi, n), _layers(rng, n), rng.uniform(0.2, 0.95, n), _colours(rng, n), camera)


def _clusters(rng: np.random.Generator, camera: Camera) -> Scene:
    """As wide as twelve pictures, in small groups, so that clusters come into the picture and leave it."""
    n, groups = 4608, 72
    centre = np.stack([rng.uniform(-6 * SIZE, 6 * SIZE, groups), rng.uniform(0, SIZE, groups)], 1)
    mean = np.repeat(centre, n // groups, axis=0) + rng.normal(0.0, 6.0, (n, 2))
    return _scene(mean, rng.uniform(0.6, 3.0, (n, 2)), rng.uniform(0, math.pi, n), _layers(rng, n), rng.uniform(0.1, 0.8, n), _colours(rng, n), camera)


MOVING: dict[str, MovingFamily] = {f.name: f for f in (
    MovingFamily("thin_moved", "thin, slanted Gaussians, axis ratio 30, sideways", _thin, _truck),
    MovingFamily("small_moved", "splats of 0.3 to 1 px, sideways", _small, _truck),
    MovingFamily("through", "forward through Gaussians", _through, _forward),
    MovingFamily("swap", "pairs of equal depths, turning on the spot", _pairs, _turn),
    MovingFamily("turned", "a mixed scene, turning on the spot", _mixed, _turn),
    MovingFamily("moved", "a mixed scene, sideways", _mixed, _truck),
    MovingFamily("edge", "across the edges of the picture, sideways", _edges, _truck),
    MovingFamily("culled", "clusters that come into the picture and leave it, turning", _clusters, _turn),
)}


def _drawn(name: str, view: View, by_front: Drawer) -> tuple[np.ndarray, np.ndarray]:
    """A configuration's or front end's picture, and the truth."""
    if name in FRONT_ENDS:
        return by_front(FRONT_ENDS[name])
    with np.errstate(all="ignore"):
        return run(get_configuration(name), view).image, view.reference


def _seen(name: str, view: View, by_front: Drawer) -> Seen:
    """What a configuration or front end that has drawn lists."""
    return by_front.seen(FRONT_ENDS[name]) if name in FRONT_ENDS else view.keep("seen", lambda: seen_in(view.projected, view.camera))


def run_moving(
    families: Sequence[str] | None = None, names: Sequence[str] | None = None, speeds: Sequence[float] = SPEEDS, *, seed: int = 1,
    order: SortOrder = SortOrder.DEPTH, progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[MovingPoint]:
    """Points of families (all) at speeds, in the order of families, speeds and names. order: what splats are sorted by.
    progress: called with (sequences done, in all). FlickerError, before any work, for an unknown family or configuration."""
    for name in families or ():
        if name not in MOVING:
            raise FlickerError(f"unknown family '{name}'; known are {', '.join(MOVING)}")
    names = list(names or MACHINES)
    for name in names:
        if name not in FRONT_ENDS:
            get_configuration(name)
    steps = [(MOVING[name], speed) for name in families or MOVING for speed in speeds]
    found = []
    threads = numba.get_num_threads()
    numba.set_num_threads(1)  # the pictures are too small to share among threads
    try:
        for done, (family, speed) in enumerate(steps):
            progress(done, len(steps))
            middle = _camera()
            scene = family.scene(np.random.default_rng([seed, crc32(family.name.encode())]), middle)
            errors = {name: TemporalError() for name in names}
            changes: dict[str, list[Change]] = {name: [] for name in names}
            before: dict[str, Seen] = {}
            popped = dict.fromkeys(names, 0)
            for camera in family.path(middle, speed, FRAMES):
                projected = project(scene, camera, order)
                view, by_front = View(camera, projected=projected, order=order), Drawer(Case(projected, camera, scene, camera), order)
                for name in names:
                    changes[name].append(errors[name].add(*_drawn(name, view, by_front)))
                    seen = _seen(name, view, by_front)
                    if name in before:
                        popped[name] += pops(before[name], seen).pops
                    before[name] = seen
            for name in names:
                summary = summarise(changes[name], FRAMES)
                assert summary.temporal_psnr_db is not None and summary.jumps is not None
                found.append(MovingPoint(family.name, speed, name, summary.psnr_db, summary.temporal_psnr_db, summary.jumps, popped[name] / (FRAMES - 1)))
    finally:
        numba.set_num_threads(threads)
    progress(len(steps), len(steps))
    return found


def moving_rows(points: Sequence[MovingPoint]) -> tuple[list[str], list[list[str]]]:
    """Heads and rows of a table: a row a configuration, a column a family: the first speed at which it is broken, `-` where it never is; in brackets its lowest
    temporal PSNR, dB, and its largest share of jumps, %."""
    families = list(dict.fromkeys(p.family for p in points))
    rows = []
    for name in dict.fromkeys(p.configuration for p in points):
        cells = []
        for family in families:
            sweep = [p for p in points if (p.family, p.configuration) == (family, name)]
            first = next((f"{p.speed:g}" for p in sweep if p.broken), "-")
            lowest, jumps = min(p.temporal_psnr_db for p in sweep), 100 * max(p.jumps for p in sweep)
            cells.append(f"{first} ({'equal' if math.isinf(lowest) else format(lowest, '.0f')}, {jumps:.2f})")
        rows.append([name, *cells])
    return ["configuration", *families], rows


def moving_table(points: Sequence[MovingPoint]) -> str:
    """`moving_rows` as Markdown."""
    heads, rows = moving_rows(points)
    return table(heads, [[f"`{name}`", *cells] for name, *cells in rows])


def write_moving(points: Sequence[MovingPoint], folder: Path) -> None:
    """`moving.csv`, a line a point, and `moving.md`, the table."""
    write_records(folder / "moving.csv", [], [asdict(p) | {"broken": int(p.broken)} for p in points])
    write_text(folder / "moving.md", moving_table(points) + "\n")
