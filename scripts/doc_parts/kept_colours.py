"""`make docs PART=kept_colours`: frames of paths that keep colours: clusters that last, bytes and cycles of a chip with 64 lanes by its models, pictures, in
docs/results/kept_colours.md."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from flicker.chip.dram import DramConfig
from flicker.chip.whole import halves, whole_frame
from flicker.front.paths import Asked, path_of
from flicker.golden.front.cull import cull
from flicker.golden.front.frame import FrontFrame, run_front
from flicker.golden.front.reuse import ColourStore, Reuse
from flicker.golden.front.setup import FrameSetup
from flicker.golden.lanes.lists import front_lists
from flicker.golden.lanes.render import render_lanes
from flicker.markdown import table
from flicker.params import RenderConfig
from flicker.scene.camera import Camera
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedScene
from flicker.scene.packing import pack_file
from flicker.scene.real import REAL_VIEWS, RealView
from flicker.scene.sources import Source, open_scene
from flicker.scene.temporal import TemporalError

from .common import SIZE, Say, folder_of_scenes

CONFIG = RenderConfig(stage="lanes", lanes=64)
FRAMES = 12  # of a path
COUNTED = slice(4, FRAMES)  # of these, behind the first ones, in which all clusters begin together
MODELLED = (5, 8, 11)
TURN = 0.3  # degrees a frame
SIZES = ((1280, 720), (1920, 1080), (2560, 1440))
ONE, TWO, FOUR = Fraction(1, 255), Fraction(2, 255), Fraction(4, 255)


@dataclass(frozen=True)
class Case:
    """A path in a scene at a size. share: of the median distance to the clusters that the cull keeps, that the camera moves a frame, ahead and to the side; of
    `turn` and the motions nothing."""

    motion: str
    tolerance: Fraction
    share: float = 0.0
    size: tuple[int, int] = SIZE


MOTIONS = (
    Case("turns on the spot", Fraction(0)), Case("0.1 % a frame", ONE, 0.001), Case("0.1 % a frame", TWO, 0.001), Case("0.1 % a frame", FOUR, 0.001),
    Case("0.2 % a frame", TWO, 0.002), Case("0.5 % a frame", TWO, 0.005), Case("shake", TWO), Case("walk", TWO),
)
FEW = tuple(case for case in MOTIONS if case.tolerance in (0, TWO) and case.share in (0.0, 0.001))
LARGER = tuple(replace(case, size=size) for size in SIZES[1:] for case in MOTIONS if case.share == 0.001 and case.tolerance == TWO)
CASES = {"flowers": MOTIONS + LARGER, "playbot": MOTIONS, "guitar": FEW, "stpeter": FEW}


def _turned(camera: Camera, degrees: float) -> Camera:
    a = math.radians(degrees)
    about = np.array([[math.cos(a), 0.0, math.sin(a)], [0.0, 1.0, 0.0], [-math.sin(a), 0.0, math.cos(a)]])
    return replace(camera, rotation=camera.rotation @ about)


def cameras(case: Case, source: Source, view: RealView, packed: PackedScene) -> Sequence[Camera]:
    """Those of a case."""
    start = source.cameras[view.number].resized(*case.size)
    if case.motion in ("shake", "walk"):
        return path_of(source, Asked(case.motion, view=view.number, size=case.size, frames=FRAMES))[0]
    if not case.share:
        return [_turned(start, TURN * k) for k in range(FRAMES)]
    kept = cull(packed, FrameSetup.of(start))
    middle = (packed.table["low"] + packed.table["high"])[kept].astype(np.float64) / 2
    step = case.share * float(np.median(np.linalg.norm(middle - start.position, axis=1)))
    along = start.rotation @ np.array([0.3, 0.0, 0.95])
    return [replace(start, position=start.position + step * k * along / np.linalg.norm(along)) for k in range(FRAMES)]


def _colours(front: FrontFrame) -> np.ndarray:
    """int64 (R, 3): codes of the records, in 1/512."""
    return np.ascontiguousarray(front.records).view("<i8")[:, 1, None] >> np.array([33, 43, 53]) & 1023


def rows_of(view: RealView, say: Say) -> Iterator[tuple]:
    source, packed = open_scene(view.path(folder_of_scenes())), pack_file(view.path(folder_of_scenes())).packed
    dram = DramConfig()
    for case in CASES[view.folder]:
        say(f"{view.title}: {case.motion}, {case.tolerance}, {case.size[0]}x{case.size[1]}")
        store, shares, stored, apart, frames, plain_frames = ColourStore(packed), [], [], 0, [], []
        errors, decibels, drift = TemporalError(), [], []
        for number, camera in enumerate(cameras(case, source, view, packed)):
            front = run_front(packed, camera, reuse=Reuse(store, float(case.tolerance)))
            if number < COUNTED.start:
                continue
            assert front.reused is not None
            shares.append(1.0 - front.reused.lasting.mean())
            stored.append(front.reused.stored.mean())
            plain = run_front(packed, camera)
            apart = max(apart, int(np.abs(_colours(front) - _colours(plain)).max()))
            pictures = [render_lanes(front_lists(f)).image() for f in (front, plain)]
            decibels.append(psnr(*pictures))
            change = errors.add(*pictures).change
            if change is not None:
                drift.append(change)
            if number in MODELLED:
                frames.append(whole_frame(*halves(front, CONFIG, dram), dram))
                plain_frames.append(whole_frame(*halves(plain, CONFIG, dram), dram))
        mean = lambda found, what: sum(map(what, found)) / len(found) / 1e6  # noqa: E731
        moved = [mean(found, lambda f: sum(f.bytes.values())) for found in (plain_frames, frames)]
        cycles = [mean(found, lambda f: f.interval) for found in (plain_frames, frames)]
        yield (
            view.title, f"{case.size[0]}x{case.size[1]}", case.motion, str(case.tolerance) if case.tolerance else "0", f"{np.mean(shares):.0%}",
            f"{np.mean(stored):.0%}", f"{mean(frames, lambda f: f.bytes['colour']):.1f} + {mean(frames, lambda f: f.bytes['store']):.1f}",
            f"{moved[0]:.1f}", f"{moved[1]:.1f}", f"{cycles[0]:.3f}", f"{cycles[1]:.3f}", f"{1e9 / (1e6 * cycles[1]):,.0f}",
            f"{apart / 512 * 255:.1f}", _decibel(min(decibels)), _decibel(-10.0 * math.log10(np.mean(drift)) if np.mean(drift) > 0 else math.inf),
        )


def _decibel(value: float) -> str:
    return "equal" if math.isinf(value) else f"{value:.1f}"


def tables(say: Say) -> dict[str, str]:
    rows = [row for view in REAL_VIEWS for row in rows_of(view, say)]
    return {"": table(
        ["view", "picture", "motion", "tolerance", "clusters anew", "stored colours", "colours + store, MB", "MB without", "MB", "M cycles without", "M cycles",
         "frames a second", "differ by, of 255", "dB", "temporal dB"], rows, numbers=True,
    )}
