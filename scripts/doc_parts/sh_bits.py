"""`make docs PART=sh_bits`: SH codes of fewer bits: bytes and cycles of frames of a chip with 64 lanes by its models, and pictures, in
docs/results/memory_formats.md."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flicker.budget.sh_bits import choose
from flicker.chip.dram import DramConfig
from flicker.chip.whole import first_half, whole_frame
from flicker.front.view import DEMO, View
from flicker.golden.front.frame import run_front
from flicker.golden.lanes.lists import front_lists
from flicker.golden.lanes.render import render_lanes
from flicker.markdown import table
from flicker.params import RenderConfig
from flicker.scene.metrics import psnr
from flicker.scene.packed import FULL_SH_BITS, SH_BITS, PackedScene
from flicker.scene.packing import Recipe, pack
from flicker.scene.steps import scene_views

from .common import Say, titled_views

CONFIG = RenderConfig(stage="lanes", lanes=64)
LOSSES = (55.0, 50.0, 45.0)  # dB, of bits by cluster


def _packings(view: View) -> Iterator[tuple[str, PackedScene]]:
    """What is compared, 8 bits first."""
    for bits in reversed(SH_BITS):
        yield f"{bits}", pack(view.scene, recipe=Recipe(sh_bits=bits)).packed
    for decibels in LOSSES:
        def chosen(scene, start, decibels=decibels) -> np.ndarray:
            return choose(scene, start, scene_views(scene, scene.path or Path(DEMO)), decibels).bits

        packed = pack(view.scene, recipe=Recipe(sh_bits=chosen)).packed
        mean = (packed.sh_bits * packed.counts).sum() / len(packed)
        yield f"auto, {decibels:.0f} dB ({mean:.1f})", packed


def tables(say: Say) -> dict[str, str]:
    dram, rows = DramConfig(), []
    for title, view in titled_views(say):
        if view.scene.sh_degree == 0:
            continue
        full = None
        for name, packed in _packings(view):
            say(f"{title}: {name}")
            front = run_front(packed, view.camera)
            frame = whole_frame(*first_half(front, CONFIG, dram), CONFIG, dram)
            picture = render_lanes(front_lists(front)).image()
            full = picture if name == f"{FULL_SH_BITS}" else full
            assert full is not None
            rows.append((
                title, name, f"{len(packed.image()) / 1e6:.1f}", f"{frame.bytes['colour'] / 1e6:.2f}", f"{sum(frame.bytes.values()) / 1e6:.1f}",
                f"{frame.interval / 1e6:.3f}", _decibel(psnr(picture, full)), _decibel(psnr(picture, view.reference)),
            ))
    return {"": table(
        ["view", "bits", "image, MB", "colours, MB a frame", "all, MB a frame", "M cycles a frame", "dB to 8 bits", "dB to the reference"], rows, numbers=True,
    )}


def _decibel(value: float) -> str:
    return "equal" if math.isinf(value) else f"{value:.1f}"
