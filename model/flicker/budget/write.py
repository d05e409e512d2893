"""Scenes to files, by suffix."""

from __future__ import annotations

from pathlib import Path

import gsply
import numpy as np

from ..errors import FlickerError
from ..progress import Steps
from ..scene.files import half_turn, save_ply
from ..scene.gaussians import Scene, logits
from ..scene.packed import PackedFormat
from ..scene.packing import pack

COMPRESSED = ".compressed.ply"


SUFFIXES = (".ply", COMPRESSED, ".spz", ".flk")
_SPZ_BITS = 23  # of a position, without the sign


def check_suffix(path: Path) -> None:
    """FlickerError for a suffix that is not written."""
    if path.suffix.lower() in SUFFIXES:
        return
    why = ": gsply writes no SOG" if path.suffix.lower() == ".sog" else ""
    raise FlickerError(f"--out: {path}: only {', '.join(SUFFIXES[:-1])} and {SUFFIXES[-1]} are written{why}")


def _data(scene: Scene) -> gsply.GSData:
    """Log scales and logit opacities."""
    opacities = np.maximum(scene.opacities, np.float32(2.0**-40))
    rest = np.ascontiguousarray(scene.sh[:, 1:]) if scene.sh.shape[1] > 1 else None
    return gsply.GSData.from_arrays(
        means=scene.means, scales=np.log(scene.scales), quats=scene.quats, opacities=logits(opacities).astype(np.float32),
        sh0=np.ascontiguousarray(scene.sh[:, 0]), shN=rest, format="ply",
    )


def save(scene: Scene, path: Path, temporary: Path, form: PackedFormat = PackedFormat.CHUNK, steps: Steps | None = None) -> None:
    """Write a scene to `temporary` in the format that the name `path` says; form: of a .flk. Raises FlickerError, OSError."""
    check_suffix(path)
    name = path.name.lower()
    if name.endswith(COMPRESSED):  # as PlayCanvas compresses a PLY
        temporary.write_bytes(gsply.compress_to_bytes(_data(scene)))
    elif name.endswith(".ply"):
        save_ply(scene, temporary)
    elif name.endswith(".spz"):
        reach = float(np.abs(scene.means).max())
        bits = int(np.clip(_SPZ_BITS - 1 - np.floor(np.log2(max(reach, 1e-6))), 0, _SPZ_BITS))
        gsply.write_spz(temporary, _data(half_turn(scene)), fractional_bits=bits)
    else:
        temporary.write_bytes(pack(scene, form, steps=steps).packed.image())
