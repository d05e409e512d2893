"""Families of hard inputs. Each is swept over one parameter, from harmless to extreme; small pictures, seeded.

All steps of a sweep draw from the same random numbers, so that neighbouring steps differ in the parameter only. Configurations start from a case's
projection, front ends from its scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...errors import FlickerError
from ...front.projection import Projected, project
from ...golden.front.setup import MAX_PICTURE
from ...scene.camera import MAX_SIZE, Camera
from ...scene.files import Scene
from ...scene.gaussians import SH_DEGREES

SIZE = 64
DEPTH = 4.0
_C0 = 0.28209479177387814


@dataclass
class Case:
    """One input: what configurations and front ends get and what the reference renders.

    truth: projection that the reference renders when it is not the configurations' own (the input means the same, written well).
    origin: window's first pixel on the screen. scene, screen: what the front ends get, `camera` being a window of `screen`. meant: the scene written
    well, when it is not.
    """

    projected: Projected
    camera: Camera
    scene: Scene
    screen: Camera
    truth: Projected | None = None
    meant: Scene | None = None
    origin: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Family:
    """A family. values: the sweep, harmless first. make: (value, generator) to a case."""

    name: str
    title: str
    parameter: str
    values: tuple[float, ...]
    make: Callable[[float, np.random.Generator], Case]


def _camera(size: int = SIZE, focal: float = SIZE) -> Camera:
    """Looks along +z from the origin; one pixel is DEPTH / focal at the usual depth."""
    return Camera(size, size, focal, focal, np.zeros(3), np.eye(3))


def _about_z(angle: np.ndarray) -> np.ndarray:
    quats = np.zeros((len(angle), 4))
    quats[:, 0], quats[:, 3] = np.cos(angle / 2), np.sin(angle / 2)
    return quats


def _turned(rng: np.random.Generator, n: int) -> np.ndarray:
    quats = rng.normal(size=(n, 4))
    return quats / np.linalg.norm(quats, axis=1, keepdims=True)


def _colours(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.uniform(0.05, 1.0, (n, 3))


def _scene(mean, sigma, angle, depth, opacity, rgb, camera: Camera) -> Scene:
    """Gaussians flat against the view: mean (n, 2) and sigma (n, 2) in pixels, angle of the first axis, depth (n,)."""
    n = len(mean)
    depth = np.broadcast_to(depth, n)
    scale = (depth / camera.fx)[:, None]
    centre = (np.array([camera.width, camera.height]) - 1) / 2
    means = np.concatenate([(mean - centre) * scale, depth[:, None]], axis=1)
    scales = np.concatenate([np.broadcast_to(sigma, (n, 2)) * scale, 1e-4 * scale], axis=1)
    return Scene(means, scales, _about_z(np.broadcast_to(angle, n)), np.broadcast_to(opacity, n), ((np.broadcast_to(rgb, (n, 3)) - 0.5) / _C0)[:, None, :])


def _case(scene: Scene, camera: Camera) -> Case:
    return Case(project(scene, camera), camera, scene, camera)


def _window(scene: Scene, screen: Camera, x0: int) -> Case:
    """The window at (x0, x0) of a screen."""
    return Case(*crop(project(scene, screen), screen, x0, x0), scene, screen, origin=(x0, x0))


def _layers(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.sort(rng.uniform(2.0, 6.0, n))


def _inside(rng: np.random.Generator, n: int, size: int = SIZE) -> np.ndarray:
    return rng.uniform(0, size - 1, (n, 2))


def _thin(ratio: float, rng: np.random.Generator) -> Case:
    n = 60
    camera = _camera()
    short = rng.uniform(0.5, 1.5, n)
    long = short * ratio
    angle = rng.choice((0.25, 0.75), n) * math.pi + rng.normal(0, 0.25, n)
    along = rng.uniform(-1, 1, n) * np.minimum(long, 1000.0)
    mean = _inside(rng, n) + along[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    return _case(_scene(mean, np.stack([long, short], 1), angle, _layers(rng, n), rng.uniform(0.3, 0.95, n), _colours(rng, n), camera), camera)


def _thin_far(distance: float, rng: np.random.Generator) -> Case:
    n = 60
    camera = _camera()
    angle = rng.choice((0.25, 0.75), n) * math.pi + rng.normal(0, 0.25, n)
    mean = _inside(rng, n) + (rng.choice((-1, 1), n) * distance)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    sigma = np.stack([np.full(n, max(distance, 10.0)), rng.uniform(0.5, 1.5, n)], 1)
    return _case(_scene(mean, sigma, angle, _layers(rng, n), rng.uniform(0.5, 0.99, n), _colours(rng, n), camera), camera)


def _far(distance: float, rng: np.random.Generator) -> Case:
    n = 40
    camera = _camera()
    angle = rng.uniform(0, 2 * math.pi, n)
    mean = _inside(rng, n) + distance * np.stack([np.cos(angle), np.sin(angle)], 1)
    sigma = np.full((n, 2), max(distance / 1.5, 6.0)) * rng.uniform(0.8, 1.2, (n, 2))
    return _case(_scene(mean, sigma, rng.uniform(0, math.pi, n), _layers(rng, n), rng.uniform(0.3, 0.9, n), _colours(rng, n), camera), camera)


def _footprint(sigma: float, rng: np.random.Generator) -> Case:
    n = int(np.clip(4000 / max(sigma, 0.5) ** 2, 30, 2000))
    camera = _camera()
    return _case(_scene(_inside(rng, n), np.full((n, 2), sigma), 0.0, _layers(rng, n), rng.uniform(0.2, 0.8, n), _colours(rng, n), camera), camera)


def _faint(level: float, rng: np.random.Generator) -> Case:
    n = 600
    camera = _camera()
    return _case(_scene(_inside(rng, n), rng.uniform(2, 8, (n, 2)), rng.uniform(0, 3, n), _layers(rng, n), level / 255, _colours(rng, n), camera), camera)


def _full(opacity: float, rng: np.random.Generator) -> Case:
    n = 150
    camera = _camera()
    return _case(_scene(_inside(rng, n), rng.uniform(2, 8, (n, 2)), rng.uniform(0, 3, n), _layers(rng, n), opacity, _colours(rng, n), camera), camera)


def crop(projected: Projected, camera: Camera, x0: int, y0: int, size: int = SIZE) -> tuple[Projected, Camera]:
    """The window of `size` pixels at (x0, y0), multiples of 16, as a picture of its own."""
    mean = projected.mean - (x0, y0)
    near = (np.abs(mean - (size - 1) / 2) <= (size - 1) / 2 + projected.circle[:, None] + 16).all(axis=1)
    fields = {k: v[near] for k, v in vars(projected).items()} | {"mean": mean[near]}
    return Projected(**fields), replace(camera, width=size, height=size, cx=camera.cx - x0, cy=camera.cy - y0)


def _screen(x0: float, rng: np.random.Generator) -> Case:
    n = 150
    side = MAX_PICTURE if x0 + SIZE <= MAX_PICTURE else MAX_SIZE
    wide = _camera(side, side)
    mean = _inside(rng, n) + x0
    sigma = rng.uniform(0.6, 4, (n, 2))
    scene = _scene(mean, sigma, rng.uniform(0, 3, n), _layers(rng, n), rng.uniform(0.3, 0.95, n), _colours(rng, n), wide)
    return _window(scene, wide, int(x0))


def _depth_gap(gap: float, rng: np.random.Generator) -> Case:
    """Pairs of overlapping splats of opposite colours; the truth is sorted by float64 depth, scene order where it is equal.

    The camera is turned, so that depths are no float32 numbers; at gap 0 it is not, so that they are equal.
    """
    n = 120
    turn = 0.6 if gap else 0.0
    rotation = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    camera = Camera(SIZE, SIZE, SIZE, SIZE, np.zeros(3), rotation)
    place = np.repeat(_inside(rng, n // 2), 2, axis=0)
    depth = DEPTH + np.arange(n) * gap
    rgb = np.tile([[0.9, 0.1, 0.1], [0.1, 0.2, 0.9]], (n // 2, 1))
    scene = _scene(place, rng.uniform(3, 8, (n, 2)), 0.0, depth, 0.6, rgb, camera)
    shuffle = rng.permutation(n)
    scene = Scene((scene.means @ rotation.T)[shuffle], scene.scales[shuffle], scene.quats[shuffle], scene.opacities[shuffle], scene.sh[shuffle])
    projected = project(scene, camera)
    z = (scene.means.astype(np.float64) @ rotation)[:, 2][projected.index]
    order = np.lexsort((projected.index, z))
    return Case(projected, camera, scene, camera, truth=Projected(**{k: v[order] for k, v in vars(projected).items()}))


def _depth_range(far: float, rng: np.random.Generator) -> Case:
    n = 250
    camera = _camera()
    depth = np.exp(rng.uniform(math.log(0.21), math.log(far), n))
    return _case(_scene(_inside(rng, n), rng.uniform(1, 6, (n, 2)), rng.uniform(0, 3, n), depth, rng.uniform(0.1, 0.6, n), _colours(rng, n), camera), camera)


def _stack(layers: float, rng: np.random.Generator) -> Case:
    n = int(layers)
    camera = _camera(16)
    scene = _scene(
        _inside(rng, n, 16), rng.uniform(0.6, 2.0, (n, 2)), rng.uniform(0, 3, n), _layers(rng, n), rng.uniform(0.005, 0.03, n), _colours(rng, n), camera,
    )
    return _case(scene, camera)


def _singular(ratio: float, rng: np.random.Generator) -> Case:
    n = 80
    camera = _camera()
    scales = np.full((n, 3), 12 * DEPTH / SIZE)
    scales[np.arange(n), rng.integers(0, 3, n)] *= ratio
    half = rng.random(n) < 0.5  # needles: two small axes
    scales[half] = np.sort(scales[half], axis=1)[:, [0, 0, 2]]
    quats = rng.normal(size=(n, 4))
    depth = _layers(rng, n)
    means = np.concatenate([(_inside(rng, n) - 31.5) * (depth / SIZE)[:, None], depth[:, None]], 1)
    scene = Scene(means, scales, quats / np.linalg.norm(quats, axis=1, keepdims=True), rng.uniform(0.3, 0.95, n), (_colours(rng, n)[:, None] - 0.5) / _C0)
    return _case(scene, camera)


def _quaternion(norm: float, rng: np.random.Generator) -> Case:
    n = 100
    camera = _camera()
    quats = rng.normal(size=(n, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    depth = _layers(rng, n)
    means = np.concatenate([(_inside(rng, n) - 31.5) * (depth / SIZE)[:, None], depth[:, None]], 1)
    rest = np.exp(rng.uniform(-3.5, -1, (n, 3))), rng.uniform(0.3, 0.95, n), (_colours(rng, n)[:, None] - 0.5) / _C0
    unit, other = (Scene(means, rest[0], q, *rest[1:]) for q in (quats, quats * norm))
    return Case(project(other, camera), camera, other, camera, project(unit, camera), unit)


def _colour(top: float, rng: np.random.Generator) -> Case:
    n = 100
    camera = _camera()
    rgb = rng.uniform(-top / 2, top, (n, 3))
    return _case(_scene(_inside(rng, n), rng.uniform(2, 8, (n, 2)), rng.uniform(0, 3, n), _layers(rng, n), rng.uniform(0.1, 0.6, n), rgb, camera), camera)


def _inside_gaussian(ratio: float, rng: np.random.Generator) -> Case:
    """Standard deviations `ratio` times the distance: from ratio 1 on the camera is inside."""
    n = 40
    camera = _camera()
    depth = rng.uniform(0.25, 1.0, n)
    quats = rng.normal(size=(n, 4))
    means = np.concatenate([(_inside(rng, n) - 31.5) * (depth / SIZE)[:, None], depth[:, None]], 1)
    scales = ratio * depth[:, None] * np.exp(rng.uniform(-1, 0.5, (n, 3)))
    scene = Scene(means, scales, quats / np.linalg.norm(quats, axis=1, keepdims=True), rng.uniform(0.1, 0.6, n), (_colours(rng, n)[:, None] - 0.5) / _C0)
    return _case(scene, camera)


def _threshold(level: float, rng: np.random.Generator) -> Case:
    """Layers of one opacity before solid Gaussians."""
    n, solid = 300, 40
    camera = _camera()
    depth = np.concatenate([np.sort(rng.uniform(2.0, 4.0, n)), np.sort(rng.uniform(4.0, 6.0, solid))])
    opacity = np.concatenate([np.full(n, level / 255), rng.uniform(0.5, 0.95, solid)])
    scene = _scene(_inside(rng, n + solid), rng.uniform(2, 8, (n + solid, 2)), rng.uniform(0, 3, n + solid), depth, opacity, _colours(rng, n + solid), camera)
    return _case(scene, camera)


def _cluster(extent: float, rng: np.random.Generator) -> Case:
    """One cluster: a part of it in front of the camera, the rest in a cube about the middle of that part; from an extent of 4 on, the camera is in the cube."""
    seen, n = 100, 256
    camera = _camera()
    depth = rng.uniform(2.0, 6.0, seen)
    front = np.concatenate([(_inside(rng, seen) - 31.5) * (depth / SIZE)[:, None], depth[:, None]], 1)
    rest = rng.uniform(-extent, extent, (n - seen, 3)) + (0, 0, DEPTH)
    quats, scales = _turned(rng, n), np.exp(rng.uniform(-3.5, -1.5, (n, 3)))
    return _case(Scene(np.concatenate([front, rest]), scales, quats, rng.uniform(0.1, 0.8, n), (_colours(rng, n)[:, None] - 0.5) / _C0), camera)


def _behind(share: float, rng: np.random.Generator) -> Case:
    """Layers of which a share lies behind the camera, in mirrored places; with all of them nothing is visible."""
    n = 100
    camera = _camera()
    depth, where = _layers(rng, n), rng.permutation(n) < round(share * n)
    scene = _scene(_inside(rng, n), rng.uniform(1.0, 6.0, (n, 2)), rng.uniform(0, 3, n), depth, rng.uniform(0.1, 0.9, n), _colours(rng, n), camera)
    return _case(replace(scene, means=np.where(where[:, None], -scene.means, scene.means)), camera)


def _with_flyaways(distance: float, rng: np.random.Generator, seen: bool) -> Case:
    """Layers, and 40 Gaussians of about their sizes spread evenly in log distance up to `distance`: all of them in the picture, or none."""
    n, away = 600, 40
    camera = _camera()
    scene = _scene(_inside(rng, n), rng.uniform(1.0, 6.0, (n, 2)), rng.uniform(0, 3, n), _layers(rng, n), rng.uniform(0.1, 0.9, n), _colours(rng, n), camera)
    direction = rng.normal(size=(away, 3))
    direction[:, 2] = np.abs(direction[:, 2]) * (1.0 if seen else -1.0)
    if seen:
        direction[:, :2] = rng.uniform(-0.45, 0.45, (away, 2)) * direction[:, 2:]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    far = direction * np.exp(rng.uniform(math.log(8.0), math.log(distance), away))[:, None]
    means = np.concatenate([scene.means, far])
    scales = np.concatenate([scene.scales, np.exp(rng.uniform(-3.5, -1.5, (away, 3)))])
    quats, opacities = np.concatenate([scene.quats, _turned(rng, away)]), np.concatenate([scene.opacities, rng.uniform(0.1, 0.9, away)])
    return _case(Scene(means, scales, quats, opacities, np.concatenate([scene.sh, (_colours(rng, away)[:, None] - 0.5) / _C0])), camera)


def _flyaway(distance: float, rng: np.random.Generator) -> Case:
    """`_with_flyaways` that lie behind the camera."""
    return _with_flyaways(distance, rng, False)


def _flyaway_seen(distance: float, rng: np.random.Generator) -> Case:
    """`_with_flyaways` that lie in the picture, behind the layers."""
    return _with_flyaways(distance, rng, True)


def _one_tile(extent: float, rng: np.random.Generator) -> Case:
    """The 256 Gaussians of a cluster about a point of the only tile, in layers."""
    n = 256
    camera = _camera(16)
    mean = 7.7 + (rng.random((n, 2)) - 0.5) * extent
    scene = _scene(mean, rng.uniform(0.6, 4.0, (n, 2)), rng.uniform(0, 3, n), _layers(rng, n), rng.uniform(0.02, 0.2, n), _colours(rng, n), camera)
    return _case(scene, camera)


def _covering(side: float, rng: np.random.Generator) -> Case:
    """One slanted Gaussian over a square picture, of which the last window is drawn."""
    screen = _camera(int(side), side)
    angle, place = rng.uniform(0.2, 1.3, 1), rng.uniform(0.3, 0.5, (1, 2)) * side
    scene = _scene(place, np.array([[1.0, 0.5]]) * side, angle, DEPTH, 0.9, _colours(rng, 1), screen)
    return _window(scene, screen, int(side) - SIZE)


def _harmonics(top: float, rng: np.random.Generator) -> Case:
    """Spherical harmonics of degree 3 with coefficients up to `top`, seen from many directions."""
    n = 100
    camera = _camera(SIZE, SIZE / 4)
    depth = _layers(rng, n)
    means = np.concatenate([(_inside(rng, n) - 31.5) * (depth / camera.fx)[:, None], depth[:, None]], 1)
    sh = rng.uniform(-top, top, (n, max(SH_DEGREES), 3))
    sh[:, 0] = (_colours(rng, n) - 0.5) / _C0
    quats, scales = _turned(rng, n), np.exp(rng.uniform(-1.5, 0.3, (n, 3)))
    return _case(Scene(means, scales, quats, rng.uniform(0.1, 0.6, n), sh), camera)


FAMILIES: dict[str, Family] = {f.name: f for f in (
    Family("thin", "thin, slanted Gaussians", "axis ratio before dilation", (1, 3, 10, 30, 100, 300, 1000, 3000, 10000), _thin),
    Family("thin_far", "thin, slanted, mean far along the axis", "distance in px", (0, 16, 64, 256, 1024, 4096), _thin_far),
    Family("far_mean", "means far outside the tile", "distance in px", (0, 64, 256, 1024, 4096, 16384, 60000), _far),
    Family("footprint", "footprint", "sigma in px", (3, 1, 0.3, 0.1, 10, 30, 100, 1000, 10000), _footprint),
    Family("faint", "opacity near 1/255", "255 x opacity", (128, 16, 4, 2, 1.5, 1.1, 1.02, 1.001), _faint),
    Family("threshold", "opacity at 1/255", "255 x opacity", (4, 1.1, 1.01, 1.001, 1, 0.999, 0.99, 0.5), _threshold),
    Family("opaque", "opacity up to 1", "opacity", (0.5, 0.9, 0.99, 0.995, 0.999, 1.0), _full),
    Family("screen", "screen coordinates", "first pixel of the window", (0, 1024, 2048, 3776, 8192, 16320), _screen),
    Family("depth_gap", "nearly equal depths", "gap between layers", (0.1, 1e-3, 1e-5, 1e-6, 1e-7, 0.0), _depth_gap),
    Family("depth_range", "depth range from 0.2", "farthest depth", (1, 10, 100, 1e3, 1e4, 1e5), _depth_range),
    Family("layers", "layers in one tile", "splats", (10, 100, 1000, 3000, 10000), _stack),
    Family("singular", "near-singular covariance", "smallest / largest axis", (1, 0.1, 0.01, 1e-3, 1e-4, 1e-6, 1e-12), _singular),
    Family("quaternion", "quaternions not of unit length", "length", (1, 1.001, 1.1, 10, 1e3, 1e6, 1e-3, 1e-6), _quaternion),
    Family("colour", "colours out of range", "largest colour", (1, 2, 10, 100, 1e4, 1e5), _colour),
    Family("sh", "spherical harmonics out of range", "largest coefficient", (0.02, 0.1, 0.3, 1, 3, 10, 100, 1e4), _harmonics),
    Family("inside", "camera inside Gaussians", "sigma / distance", (0.1, 0.3, 1, 3, 10, 30, 100), _inside_gaussian),
    Family("cluster", "camera inside a cluster", "half the cluster's extent", (2, 4, 10, 30, 100, 300, 1e3, 1e4), _cluster),
    Family("behind", "Gaussians behind the camera", "share of them", (0.0, 0.5, 0.9, 0.99, 1.0), _behind),
    Family("flyaway", "Gaussians far away, out of the picture", "largest distance", (10, 100, 1e3, 1e5, 1e6, 1e7), _flyaway),
    Family("flyaway_seen", "Gaussians far away, in the picture", "largest distance", (10, 100, 1e3, 1e5, 1e6, 1e7), _flyaway_seen),
    Family("one_tile", "a whole cluster in one tile", "extent in px", (16, 8, 4, 1, 0.1, 0.01, 0.0), _one_tile),
    Family("covering", "one Gaussian over a whole picture", "side of the picture in px", (64, 256, 1024, 2048, 4096), _covering),
)}


def get_family(name: str) -> Family:
    """The family of a name; FlickerError when there is none."""
    if name not in FAMILIES:
        raise FlickerError(f"unknown family '{name}'; known are {', '.join(FAMILIES)}")
    return FAMILIES[name]
