"""What memory formats and short depth keys do to the picture."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ..explore.configurations import get_configuration
from ..explore.machine import run
from ..front.projection import Projected
from ..front.reference import render_reference
from ..front.view import View
from ..scene.camera import Camera
from ..scene.clusters import build_clusters
from ..scene.memory import MemoryFormat, layout, through_memory
from ..scene.metrics import psnr
from .constants import CLUSTER_SIZE
from .sorting import quantised_key


@dataclass(frozen=True)
class FormatQuality:
    """PSNR in dB against the float64 reference of the unquantised scene; bytes of the scene and of a Gaussian.

    reference_db: the decoded scene in float64. golden_db: the decoded scene through the hardware's arithmetic.
    """

    form: str
    scene_bytes: int
    gaussian_bytes: int
    reference_db: float
    golden_db: float


def format_quality(view: View, cluster_size: int = CLUSTER_SIZE) -> list[FormatQuality]:
    """Every memory format, after a first row for the scene as loaded (float32)."""
    scene, clusters = build_clusters(view.scene, cluster_size)
    configuration = get_configuration("flicker")
    base = View(view.camera, scene, background=view.background)

    def golden(v: View) -> float:
        return psnr(run(configuration, v).image, base.reference)

    numbers = 11 + 3 * scene.sh.shape[1]
    rows = [FormatQuality("float32", 4 * numbers * len(scene), 4 * numbers, float("inf"), golden(base))]
    for form in MemoryFormat:
        other = View(view.camera, through_memory(scene, form, cluster_size), background=view.background)
        size = layout(form, scene.sh.shape[1])
        rows.append(FormatQuality(
            form.value, size.total(len(scene), len(clusters)), size.geometry + size.colour, psnr(other.reference, base.reference), golden(other),
        ))
    return rows


KEYS = ([("float32", b) for b in (8, 10, 12, 14, 16, 18, 20, 22, 24, 31)] + [("fp16", 15)]
        + [(kind, b) for kind in ("linear", "log") for b in (8, 12, 14, 16, 18, 20, 24)])


def resorted(projected: Projected, key: np.ndarray) -> Projected:
    """The projection in the order of other keys; equal keys in the order of memory."""
    order = np.lexsort([projected.index, key])
    return replace(projected, **{f.name: getattr(projected, f.name)[order] for f in fields(projected)})


def key_quality(projected: Projected, camera: Camera, keys=KEYS) -> list[tuple[str, int, float]]:
    """(kind, bits, PSNR in dB against full keys) in float64; inf when the pictures are equal."""
    reference = render_reference(projected, camera)
    return [
        (kind, bits, psnr(render_reference(resorted(projected, quantised_key(projected.depth, bits, kind)), camera), reference))
        for kind, bits in keys
    ]
