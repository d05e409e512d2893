"""`make docs PART=packing`: memory images of the demo scene and the real ones, and what choices in making chunks are worth, in
docs/results/memory_formats.md."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from flicker.front.view import View
from flicker.markdown import table
from flicker.scene.clusters import reorder
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat, decode
from flicker.scene.packing import CUTS, Packing, Recipe, ShSteps, pack, pack_file

from .common import Say, titled_views

SHARES = (0.0, 0.005, CUTS, 0.05)


def _packings(view: View) -> Iterator[tuple[str, Packing]]:
    """What is compared, by name, made when its turn comes."""
    scene = view.scene
    yield "fp16", pack(scene, PackedFormat.FP16)
    yield "fp16-local", pack(scene, PackedFormat.FP16_LOCAL)
    keeps = scene.path is not None and (kept := pack_file(scene.path)).kept_chunks
    if keeps:
        yield "**chunk**, the file's own", kept
    elif scene.sh_degree > 0:
        for sh in ShSteps:
            if sh is not ShSteps.CHANNEL:
                yield f"chunk, SH steps: {sh.value}", pack(scene, recipe=Recipe(sh=sh))
    for share in SHARES:
        name = f"chunk, {share:.1%} for cuts" if share else "chunk, no cuts"
        yield f"**{name}**" if share == CUTS and not keeps else name, pack(scene, recipe=Recipe(cuts=share))


def _row(title: str, name: str, packing: Packing, references: dict[bytes, np.ndarray], view: View) -> tuple[str, ...]:
    packed = packing.packed
    key = packing.order.tobytes()
    if key not in references:
        references[key] = View(view.camera, reorder(view.scene, packing.order)).reference
    db = psnr(View(view.camera, decode(packed)).reference, references[key])
    size = len(packed.image())
    return (title, name, f"{size / 1e6:.2f}", f"{size / len(packed):.1f}", f"{len(packed.table):,}", f"{len(packed.geometry) - len(packed):,}",
            _decibel(db))


def _alone(view: View) -> list[str]:
    """PSNR with all of what chunks round, then with one kind of value rounded at a time."""
    packing = pack(view.scene)
    source, rounded = reorder(view.scene, packing.order), decode(packing.packed)
    reference = View(view.camera, source).reference
    constant, rest = source.sh.copy(), source.sh.copy()
    constant[:, 0] = rounded.sh[:, 0]
    rest[:, 1:] = 0
    rest[:, 1 : rounded.sh.shape[1]] = rounded.sh[:, 1:]
    changes: list[dict[str, np.ndarray]] = [
        {"means": rounded.means}, {"quats": rounded.quats}, {"scales": rounded.scales}, {"opacities": rounded.opacities}, {"sh": constant}, {"sh": rest},
    ]
    scenes = [rounded, *(replace(source, **change) for change in changes)]
    return [_decibel(psnr(View(view.camera, scene).reference, reference)) for scene in scenes]


def _decibel(value: float) -> str:
    return "equal" if math.isinf(value) else f"{value:.1f}"


def tables(say: Say) -> dict[str, str]:
    rows, alone = [], []
    for title, view in titled_views(say):
        references: dict[bytes, np.ndarray] = {}
        for name, packing in _packings(view):
            say(f"{title}: {name}")
            rows.append(_row(title, name, packing, references, view))
        say(f"{title}: one kind of value at a time")
        alone.append((title, *_alone(view)))
    numbered = partial(table, numbers=True)
    return {
        "alternatives": numbered(["view", "image", "MB", "bytes a Gaussian", "clusters", "slots unused", "float64, dB"], rows),
        "alone": numbered(["view", "all", "positions", "rotations", "scales", "opacities", "constant colours", "other coefficients"], alone),
    }
