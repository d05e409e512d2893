"""The demo scene: a still life, made by rules from a seed (docs/reference/demo_scene.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flicker.output import write_atomically, write_text, writing
from flicker.scene.camera import cameras_text
from flicker.scene.demo.splats import Rand, Splats, dot, unit
from flicker.scene.demo.views import EYES, demo_cameras, to_world
from flicker.scene.files import Scene, save_ply

from . import light, plants, still_life, table_things

__all__ = ["demo_cameras", "generate", "write_demo"]

_C0 = 0.28209479177387814
_C1 = 0.4886025119029199
# Coarser than any rounding difference between machines, finer than anything that can be seen.
_GRID = 2.0**-16


def generate(seed: int = 1) -> Scene:
    """The scene: about 59,000 Gaussians with spherical harmonics of degree 1, in decimetres."""
    out = Splats()
    makers = (still_life.wall, still_life.table, still_life.cloth, still_life.vase, table_things.fruit, table_things.bowl,
              table_things.glass, table_things.candle, plants.bouquet, plants.fallen)
    for k, maker in enumerate(makers):
        maker(out, Rand(seed * 64 + k))
    s = out.merged()
    diffuse = light.bake(s, still_life.FLAME)
    sh = _harmonics(s, [light.display(diffuse + light.highlights(s, eye)) for eye in EYES])
    return Scene(
        means=_rounded(to_world(s["p"])),
        scales=_rounded(np.maximum(s["size"], 2.0**-9)),
        quats=_rounded(_quaternions(to_world(s["t"]), to_world(s["n"]))),
        opacities=_rounded(np.clip(s["opacity"], 0.004, 0.995)),
        sh=_rounded(sh),
    )


def write_demo(folder: str | Path, seed: int = 1) -> tuple[Path, Path]:
    """Generate the scene into `folder` (made if missing): paths of demo.ply and cameras.json, both in INRIA layout.

    Raises FlickerError if the folder cannot be written.
    """
    folder = Path(folder)
    scene_path, cameras_path = folder / "demo.ply", folder / "cameras.json"
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    scene = generate(seed)
    write_atomically(scene_path, lambda path: save_ply(scene, path))
    write_text(cameras_path, cameras_text(demo_cameras()))
    return scene_path, cameras_path


def _rounded(x: np.ndarray) -> np.ndarray:
    return (np.round(x / _GRID) * _GRID).astype(np.float32)


def _harmonics(s: dict[str, np.ndarray], colours: list[np.ndarray]) -> np.ndarray:
    """Coefficients (N, 4, 3) that give `colours[0]` at the hero camera and lean towards the others."""
    ways = [to_world(unit(s["p"] - eye)) for eye in EYES]
    a = np.zeros((len(s["p"]), 3, 3)) + 0.02 * np.eye(3)
    b = np.zeros((len(s["p"]), 3, 3))
    for way, colour in zip(ways[1:], colours[1:], strict=True):
        delta = way - ways[0]
        a += delta[:, :, None] * delta[:, None, :]
        b += delta[:, :, None] * (colour - colours[0])[:, None, :]
    # Solved by cofactors of the symmetric matrix: the same operations on every machine.
    rows = [np.cross(a[:, 1], a[:, 2]), np.cross(a[:, 2], a[:, 0]), np.cross(a[:, 0], a[:, 1])]
    det = dot(a[:, 0], rows[0])
    slope = np.stack([dot(b[:, :, c, None][:, :, 0], r) / det for r in rows for c in range(3)], axis=1).reshape(-1, 3, 3)
    slope = np.clip(slope, -0.8, 0.8)
    at_hero = slope[:, 0] * ways[0][:, :1] + slope[:, 1] * ways[0][:, 1:2] + slope[:, 2] * ways[0][:, 2:]
    dc = (colours[0] - 0.5 - at_hero) / _C0
    return np.stack([dc, -slope[:, 1] / _C1, slope[:, 2] / _C1, -slope[:, 0] / _C1], axis=1)


def _quaternions(t: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Quaternions (N, 4), w first and positive, of rotations with columns t, n x t, n."""
    m = np.stack([t, np.cross(n, t), n], axis=2)
    d = np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=1)
    sign = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    size = np.sqrt(np.maximum(1.0 + sign[:, 0] * d[:, :1] + sign[:, 1] * d[:, 1:2] + sign[:, 2] * d[:, 2:], 0.0))
    x, y, z = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 1, 0] + m[:, 0, 1], m[:, 0, 2] + m[:, 2, 0], m[:, 2, 1] + m[:, 1, 2]
    k = np.argmax(size, axis=1)
    s = size[np.arange(len(k)), k]
    rows = [(s * s, x, y, z), (x, s * s, xy, xz), (y, xy, s * s, yz), (z, xz, yz, s * s)]
    q = np.choose(k[None], [np.stack(row) for row in rows]) / s
    q = q * np.where(q[0] < 0, -1.0, 1.0)
    return q.T / np.sqrt(np.maximum((q.T**2).sum(axis=1), 1e-12))[:, None]
