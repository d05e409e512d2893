"""Scenes to files, by suffix."""

from __future__ import annotations

from pathlib import Path

import gsply
import numpy as np

from ..errors import FlickerError
from ..progress import Steps
from ..scene.files import save_ply
from ..scene.gaussians import Scene
from ..scene.packed import PackedFormat
from ..scene.packing import pack

COMPRESSED = ".compressed.ply"


def check_suffix(path: Path) -> None:
    """FlickerError for a suffix that is not written."""
    if path.suffix.lower() in (".ply", ".flk"):
        return
    why = ": no writer of SOG is there" if path.suffix.lower() == ".sog" else ""
    raise FlickerError(f"--out: {path}: only .ply, {COMPRESSED} and .flk are written{why}")


def _compressed(scene: Scene) -> bytes:
    """As PlayCanvas compresses a PLY: 16 bytes a Gaussian, its SH beyond degree 0 in 8 bits a number."""
    opacities = np.clip(scene.opacities.astype(np.float64), 2.0**-40, 1.0 - 2.0**-25)
    rest = np.ascontiguousarray(scene.sh[:, 1:]) if scene.sh.shape[1] > 1 else None
    return gsply.compress_to_bytes(gsply.GSData.from_arrays(
        means=scene.means, scales=np.log(scene.scales), quats=scene.quats, opacities=np.log(opacities / (1.0 - opacities)).astype(np.float32),
        sh0=np.ascontiguousarray(scene.sh[:, 0]), shN=rest, format="ply",
    ))


def save(scene: Scene, path: Path, temporary: Path, form: PackedFormat = PackedFormat.CHUNK, steps: Steps | None = None) -> None:
    """Write a scene to `temporary` in the format that the name `path` says; form: of a .flk. Raises FlickerError, OSError."""
    name = path.name.lower()
    if name.endswith(COMPRESSED):
        temporary.write_bytes(_compressed(scene))
    elif name.endswith(".ply"):
        save_ply(scene, temporary)
    else:
        check_suffix(path)
        temporary.write_bytes(pack(scene, form, steps=steps).packed.image())
