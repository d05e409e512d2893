"""Scenes written to every format that has a writer here, and what the format loses, measured on the file as it reads back.

| suffix | format | written by |
|---|---|---|
| `.ply` | INRIA layout | gsply |
| `.compressed.ply` | PlayCanvas compressed layout, in the order of clusters | `scene.memory` |
| `.spz` | Niantic, version 3 | gsply |
| `.sog` | PlayCanvas SOG, version 2 | `scene.sog_write` |
| `.splat` | 32-byte records, degree 0 | here |
| `.flk` | memory image of the chip, chunk | `scene.packing` |
"""

from __future__ import annotations

import gzip
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import gsply
import numpy as np

from ..errors import FlickerError, FlickerWarning
from .clusters import flyaways, morton_order, reorder
from .files import half_turn, load_scene, save_ply
from .gaussians import SH_C0, Scene, logits
from .memory import chunk_bytes, encode_chunks
from .packing import pack
from .sog_write import save_sog

_RECORD = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])
_FAINT = 0.5 / 255  # opacity below which a code of 8 bits is 0
_FIXED = (1 << 23) - 1  # largest position of SPZ, 24 bits with the sign
_FRACTION = 20  # most fraction bits of it


@dataclass(eq=False)
class Written:
    """What became of a scene in a file. count: its Gaussians. left_out: Gaussians of the scene that are not in it, by reason. losses: largest and mean change
    of a quantity, by its name with the unit; those that are no more than rounding of float32 are not there. notes: what else was lost."""

    count: int
    left_out: dict[str, int] = field(default_factory=dict)
    losses: dict[str, tuple[float, float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def _without_faint(scene: Scene, left_out: dict[str, int]) -> Scene:
    """Formats with 8 bits of opacity cannot hold the faintest; a code of 0 would read back as no Gaussian."""
    seen = scene.opacities >= _FAINT
    if not seen.all():
        left_out["opacity below 1/510, which the format has not"] = int((~seen).sum())
    return reorder(scene, np.flatnonzero(seen))


def _degree(scene: Scene, degree: int) -> Scene:
    """Without harmonics beyond a degree."""
    return replace(scene, sh=scene.sh[:, : (degree + 1) ** 2])


def _ply(scene: Scene, path: Path, left_out: dict[str, int]) -> Scene:
    save_ply(scene, path)
    return scene


def _compressed(scene: Scene, path: Path, left_out: dict[str, int]) -> Scene:
    scene = _without_faint(scene, left_out)
    scene = reorder(scene, morton_order(scene.means))
    path.write_bytes(chunk_bytes(replace(encode_chunks(scene), antialiased=scene.antialiased)))
    return scene


def _spz(scene: Scene, path: Path, left_out: dict[str, int]) -> Scene:
    scene = _without_faint(scene, left_out)
    most = float(np.abs(scene.means).max())
    if most > _FIXED / 2:
        raise FlickerError(f"{scene.path or 'scene'}: a position of {most:.3g}: SPZ holds up to {_FIXED / 2:.3g}; --no-flyaways or --box leaves such out")
    bits = min(_FRACTION, int(math.log2(_FIXED / max(most, 1.0))))
    turned = half_turn(scene)
    gsply.write_spz(path, gsply.GSData.from_arrays(
        means=turned.means, scales=np.log(turned.scales), quats=turned.quats, opacities=logits(turned.opacities).astype(np.float32),
        sh0=np.ascontiguousarray(turned.sh[:, 0]), shN=np.ascontiguousarray(turned.sh[:, 1:]) if turned.sh_degree else None, format="ply",
    ), version=3, fractional_bits=bits)
    if scene.antialiased:
        data = bytearray(gzip.decompress(path.read_bytes()))
        data[14] |= 1  # flags
        path.write_bytes(gzip.compress(bytes(data), mtime=0))
    return scene


def _sog(scene: Scene, path: Path, left_out: dict[str, int]) -> Scene:
    scene = _without_faint(scene, left_out)
    save_sog(scene, path)
    return scene


def _splat(scene: Scene, path: Path, left_out: dict[str, int]) -> Scene:
    scene = _without_faint(scene, left_out)
    data = np.empty(len(scene), _RECORD)
    data["mean"], data["scale"] = scene.means, scene.scales
    data["rgba"][:, :3] = np.rint(np.clip(0.5 + SH_C0 * scene.sh[:, 0].astype(np.float64), 0, 1) * 255)
    data["rgba"][:, 3] = np.rint(scene.opacities.astype(np.float64).clip(0, 1) * 255)
    data["quat"] = np.clip(np.rint(scene.quats.astype(np.float64) * 128 + 128), 0, 255)
    path.write_bytes(data.tobytes())
    return _degree(scene, 0)


def _image(scene: Scene, path: Path, left_out: dict[str, int]) -> Scene:
    packing = pack(replace(scene, rejected={}))
    left_out |= packing.left_out
    path.write_bytes(packing.packed.image())
    return reorder(scene, packing.order)


# Suffix: what writes. It gives the Gaussians of the file, in the file's order, as they were meant; longer suffixes first.
WRITERS: dict[str, Callable[[Scene, Path, dict[str, int]], Scene]] = {
    ".compressed.ply": _compressed, ".ply": _ply, ".spz": _spz, ".sog": _sog, ".splat": _splat, ".flk": _image,
}


def writer_of(path: Path) -> str:
    """The suffix in `WRITERS` that a name has. FlickerError for another."""
    for suffix in WRITERS:
        if path.name.lower().endswith(suffix):
            return suffix
    what = f"unknown suffix '{path.suffix}'" if path.suffix else "no suffix, which says the format"
    raise FlickerError(f"{path}: {what}; written are {', '.join(WRITERS)}")


def write_scene(scene: Scene, path: Path, suffix: str) -> Written:
    """Write a scene to a file in the format of a suffix in `WRITERS`, whatever the file's name; read it back and measure. FlickerError, OSError."""
    left_out: dict[str, int] = {}
    meant = WRITERS[suffix](scene, path, left_out)
    if len(meant) == 0:
        raise FlickerError(f"{scene.path or 'scene'}: no Gaussian that {suffix} can hold")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FlickerWarning)  # of the temporary name, and of conventions that were chosen here
        back = load_scene(path)
    if back.rejected or len(back) != len(meant):
        raise FlickerError(f"{scene.path or 'scene'}: {suffix}: {len(back)} of {len(meant)} Gaussians read back")  # cannot happen; never without a word
    written = Written(len(back), left_out, _losses(meant, back))
    if back.sh_degree < scene.sh_degree:
        written.notes.append(f"harmonics of degree {scene.sh_degree} are cut to {back.sh_degree}")
    if scene.antialiased and not back.antialiased:
        written.notes.append(f"that the scene is to be drawn antialiased: {suffix} has no flag for it")
    return written


def _losses(meant: Scene, back: Scene) -> dict[str, tuple[float, float]]:
    """What changed beyond the rounding of float32."""
    k = min(meant.sh.shape[1], back.sh.shape[1])
    a, b = (np.asarray(s.quats, np.float64) for s in (meant, back))
    cosine = np.abs((a * b).sum(axis=1)) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    changes = {
        "position, units of the scene": (np.abs(meant.means.astype(np.float64) - back.means), 1e-6 * np.abs(meant.means)),
        "size, share": (np.abs(np.exp(np.abs(np.log(meant.scales.astype(np.float64)) - np.log(back.scales))) - 1), 1e-5),
        "rotation, degrees": (np.degrees(2 * np.arccos(np.minimum(cosine, 1.0))), 0.1),
        "opacity": (np.abs(meant.opacities.astype(np.float64) - back.opacities), 1e-6),
        "colour": (SH_C0 * np.abs(meant.sh[:, 0].astype(np.float64) - back.sh[:, 0]), 1e-6),
        "harmonics": (np.abs(meant.sh[:, 1:k].astype(np.float64) - back.sh[:, 1:k]), 1e-6),
    }
    return {name: (float(change.max()), float(change.mean())) for name, (change, least) in changes.items() if (change > least).any()}


@dataclass(frozen=True)
class Selection:
    """Which Gaussians of a scene are kept. box: lowest and highest x, y, z of a mean, inclusive. flyaways: also those far away from most
    (`clusters.flyaways`). degree: of the harmonics, at most."""

    box: tuple[float, ...] | None = None
    flyaways: bool = True
    degree: int = 3

    def of(self, scene: Scene) -> tuple[Scene, dict[str, int]]:
        """The scene's selection, and how many were left out by reason. FlickerError where nothing is left."""
        keep, left_out = np.ones(len(scene), bool), {}
        if not self.flyaways:
            keep = ~flyaways(scene.means)
            left_out["far away from most (flyaways)"] = int((~keep).sum())
        if self.box is not None:
            low, high = np.array(self.box).reshape(2, 3)
            inside = ((scene.means >= low) & (scene.means <= high)).all(axis=1)
            left_out["outside the box"] = int((keep & ~inside).sum())
            keep &= inside
        if not keep.any():
            raise FlickerError(f"{scene.path or 'scene'}: no Gaussian is left: {', '.join(f'{reason}: {n}' for reason, n in left_out.items())}")
        scene = _degree(reorder(scene, np.flatnonzero(keep)), min(self.degree, scene.sh_degree))
        return scene, {reason: n for reason, n in left_out.items() if n}
