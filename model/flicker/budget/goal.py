"""What a budget is given in, and what a frame of the whole chip costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..chip.constants import DRAM_BYTES_PER_SECOND
from ..chip.dram import DramConfig
from ..chip.scene_cost import ENTRY_BYTES, VRUS, frame_cost
from ..errors import FlickerError
from ..golden.front.frame import run_front
from ..golden.lanes.lists import front_lists
from ..params import CatMode, RenderConfig
from ..perf.lanes import lane_work, simulate_lanes
from ..progress import Steps
from ..scene.camera import Camera
from ..scene.gaussians import Scene
from ..scene.packed import PackedFormat
from ..scene.packing import pack
from .score import Scores

LANES = RenderConfig(stage="lanes", cat=CatMode.OFF)
_RECORD_BYTES = 32  # 16, written and read once
_GAUSSIAN_BYTES = 12  # geometry in chunks


class Kind(str, Enum):
    """What a budget is given in; values as in `Goal`."""

    KEEP = "keep"
    DB = "db"
    CYCLES = "cycles"
    MBYTES = "mbytes"


@dataclass(frozen=True)
class Goal:
    """kind, value: KEEP: share of the Gaussians, in (0, 1]. DB: least mean PSNR on held-out views. CYCLES: between frames that follow each other, and
    MBYTES: 10^6 bytes of a frame, at most, mean over some held-out views, by the chip's models. FlickerError for an impossible value."""

    kind: Kind
    value: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.value) and self.value > 0 and (self.kind is not Kind.KEEP or self.value <= 1)):
            wanted = "above 0 and at most 1" if self.kind is Kind.KEEP else "a positive number"
            raise FlickerError(f"--{self.kind.value}: {self.value:g} is not {wanted}")

    @property
    def of_chip(self) -> bool:
        """Whether the chip model has to tell whether the goal is met: cycles or bytes."""
        return self.kind in (Kind.CYCLES, Kind.MBYTES)


@dataclass(frozen=True)
class FrameCost:
    """Mean over views. cycles: of the slower half, with channels. lane_cycles: of the stage of lanes alone, if it was asked for. bytes: all of a frame.
    picture_bytes: of its pixels. image_bytes: of the packed scene."""

    cycles: float
    lane_cycles: float | None
    bytes: float
    picture_bytes: float
    image_bytes: int

    def of(self, kind: Kind) -> float:
        """In the unit of a goal's value."""
        return self.cycles if kind is Kind.CYCLES else self.bytes / 1e6

    def fixed(self, kind: Kind) -> float:
        """What no Gaussian has a part in."""
        return 0.0 if kind is Kind.CYCLES else self.picture_bytes / 1e6


def chip_cost(scene: Scene, cameras: Sequence[Camera], form: PackedFormat, steps: Steps | None = None, *, lanes: bool = False) -> FrameCost:
    """A frame of each camera on the chip model, as `flicker cost` counts it, of the scene packed anew. lanes: simulate the other rendering stage, too."""
    steps = steps or Steps()
    packed = pack(scene, form).packed
    cycles, by_lanes, moved, pictures = [], [], [], []
    with steps.bar("frames on the chip model") as report:
        for k, camera in enumerate(cameras):
            report(k, len(cameras))
            front = run_front(packed, camera)
            halves, bytes_ = frame_cost(front, DramConfig())
            cycles.append(max(halves.values()))
            moved.append(sum(bytes_.values()))
            pictures.append(bytes_["frame"])
            if lanes:
                by_lanes.append(simulate_lanes(lane_work(front_lists(front)), LANES, leave=True).cycles)
    return FrameCost(
        float(np.mean(cycles)), float(np.mean(by_lanes)) if lanes else None, float(np.mean(moved)), float(np.mean(pictures)), len(packed.image()),
    )


def price(scores: Scores, kind: Kind, scale: float, coefficients: np.ndarray) -> np.ndarray:
    """float64 (N,): roughly what each Gaussian costs in a frame, in bytes or cycles; 1 for a budget of Gaussians or dB.

    scale: pixels of a frame of the chip over those of the scores' views, by which tiles and pixels grow. coefficients: int64 (N,), of its SH a channel. The
    bytes are those of `flicker cost`: geometry and colour, a record written and read, list entries written and read; the cycles are pixels visited over VRUs
    and the bytes at the memory's peak rate.
    """
    if kind not in (Kind.CYCLES, Kind.MBYTES):
        return np.ones(len(scores.peak))
    seen, tiles = scores.frames / scores.views, scale * scores.tiles / scores.views
    bytes_ = _GAUSSIAN_BYTES + seen * (_RECORD_BYTES + 4.0 + 3.0 * (coefficients - 1)) + 2 * ENTRY_BYTES * tiles
    if kind is Kind.MBYTES:
        return bytes_
    return scale * scores.pixels / scores.views / VRUS + bytes_ / (DRAM_BYTES_PER_SECOND / 1e9)
