"""`make docs PART=kept_colours`: frames of paths that keep colours: clusters that last, bytes and cycles of a chip with 64 lanes by its models, pictures;
`make docs PART=kept_hardware`: such frames in the verilated chip; `make docs PART=path_hardware`: larger chips beside GSCore; `make docs PART=path_sizes`:
larger pictures; in docs/results/kept_colours.md.

An error: a frame buffer that differs from the golden model's; bytes of the chip that are not the model's, of records and lists by more than `LOOSE`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from flicker.chip.compare import chip_estimates
from flicker.chip.dram import DramConfig, Refresh
from flicker.chip.whole import WholeFrame, first_half, whole_frame
from flicker.chips import chip_of
from flicker.cost.energy import memory_energy
from flicker.errors import FlickerError
from flicker.front.paths import Asked, path_of
from flicker.front.view import load_view
from flicker.golden.chip import render_chip
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
from flicker.sim.chip import ChipSession, build
from flicker.sim.half import MemoryOptions
from flicker.sim.row import RowFrame, back_to_back

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
                frames.append(whole_frame(*first_half(front, CONFIG, dram), CONFIG, dram))
                plain_frames.append(whole_frame(*first_half(plain, CONFIG, dram), CONFIG, dram))
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


ROW = 4  # frames back to back in RTL, the last of a path: the last but one is measured, beside whose rendering the front end works on the last
GSCORE = "gscore-conic"
LOOSE = {"records": 0.02, "lists": 0.002}  # which lines are read again, and whether a list that is read again is left before that, depends on timing
CHUNKS = 24_000  # of a list writer at 1280x720: enough for these views
TURNING, MOVING = (next(case for case in MOTIONS if case.tolerance == t and case.share == s) for t, s in ((0, 0.0), (TWO, 0.001)))
DRAM, WIDER = DramConfig(), DramConfig(interleave_bytes=256)  # the channel changes every 64 bytes, every 256
HARDWARE = (  # folder, path, with kept colours, memories, DRAM
    ("flowers", TURNING, False, "default", DRAM), ("flowers", TURNING, False, "records", DRAM), ("flowers", TURNING, True, "records", DRAM),
    ("flowers", MOVING, True, "records", DRAM),
    ("flowers", TURNING, False, "records", WIDER), ("flowers", TURNING, True, "records", WIDER), ("flowers", MOVING, True, "records", WIDER),
    ("flowers", TURNING, False, "records", replace(WIDER, refresh=Refresh.PER_BANK)),
    ("flowers", MOVING, True, "records", replace(WIDER, refresh=Refresh.PER_BANK)),
    ("playbot", MOVING, True, "records", DRAM), ("playbot", MOVING, True, "records", WIDER),
)
LIMIT = 0.1  # by which the chip model's interval may be off
ROWS_OF = (3, 6)  # of these: what they open rows for


def _one_frame(
    say: Say, view: RealView, case: Case, keeps: bool, config: RenderConfig, dram: DramConfig, count: int = ROW, limit: float = LIMIT,
) -> tuple[RowFrame, WholeFrame]:
    """The last but one of the last `count` frames of a path, in RTL and by the chip model. The frames before those in RTL are of the golden model, whose store
    the chip finds. limit: by which the model's interval may be off."""
    path = view.path(folder_of_scenes())
    source, packed = open_scene(path), pack_file(path).packed
    title = f"{view.title}, {case.motion}" + (f", {case.tolerance or 0}" if keeps else "")
    size = "x".join(map(str, case.size))
    say(f"{title}, {size}: {config.lanes} lanes, memories {config.memories}, refresh {dram.refresh}, channels of {dram.interleave_bytes} bytes")
    views, reuse = cameras(case, source, view, packed), Reuse(ColourStore(packed), float(case.tolerance)) if keeps else None
    for camera in views[:-count] if keeps else ():
        run_front(packed, camera, reuse=reuse)
    with ChipSession(packed, config, memory=MemoryOptions(dram.timing)) as chip:
        store = chip.store(reuse.epsilon, reuse.generation, reuse.store.image().tobytes()) if reuse else None
        row = back_to_back(chip, views[-count:], chunks=CHUNKS * math.prod(case.size) // math.prod(SIZE), store=store)
        for number, (camera, done) in enumerate(zip(views[-count:], row, strict=True)):
            front = run_front(packed, camera, reuse=reuse)
            if not np.array_equal(done.frame.buffer, render_chip(front_lists(front), config).buffer):
                raise FlickerError(f"{title}: frame {number}: the picture differs from the golden model's")
            if number == count - 2:
                model, found = whole_frame(*first_half(front, config, dram), config, dram), done
    for purpose, due in model.bytes.items():
        if abs(due - found.moved[purpose]) > LOOSE.get(purpose, 0.0) * due:
            raise FlickerError(f"{title}: {purpose}: the chip moves {found.moved[purpose]:,} bytes, the chip model {due:,}")
    assert found.interval is not None
    if abs(off := model.interval / found.interval - 1.0) > limit:
        raise FlickerError(f"{title}, {size}: the chip model's interval is {off:+.1%} off")
    return found, model


def _in_hardware(say: Say, folder: str, case: Case, keeps: bool, memories: str, dram: DramConfig) -> tuple[tuple, tuple, list[tuple]]:
    """A row of the first two tables, and of the third."""
    view = next(v for v in REAL_VIEWS if v.folder == folder)
    found, model = _one_frame(say, view, case, keeps, CONFIG.with_(memories=memories), dram)
    kept = str(case.tolerance or 0) if keeps else "-"
    head = (view.title, case.motion, kept, memories, str(dram.interleave_bytes), str(dram.refresh))
    moved, busy = sum(found.moved.values()), {name: clocks / sum(found.spent.values()) for name, clocks in found.spent.items()}
    return (
        (*head, f"{moved / 1e6:.1f}", f"{found.interval:,}", f"{model.interval / found.interval - 1:+.1%}", f"{1e9 / found.interval:,.0f}"),
        (*head, *(f"{share:.1%}" for share in busy.values())),
        _rows_opened(head, found),
    )


def _rows_opened(head: tuple, found: RowFrame) -> list[tuple]:
    """By stream, those first that wait longest."""
    clocks = sum(found.spent.values())
    return [
        (*head, name, f"{bursts:,}", f"{opened:,}", f"{bursts / opened:.1f}", f"{waited / clocks:.1%}")
        for name, (bursts, opened, waited) in sorted(found.rows.items(), key=lambda row: -row[1][2]) if opened
    ]


def hardware_tables(say: Say) -> dict[str, str]:
    for memories in sorted({row[3] for row in HARDWARE}):
        build(CONFIG.with_(memories=memories))
    with ThreadPoolExecutor(2) as pool:  # the simulators run outside of the interpreter's lock
        rows, spent, opened = zip(*pool.map(lambda row: _in_hardware(say, *row), HARDWARE))
    head = ["view", "motion", "tolerance", "memories", "bytes a channel", "refresh"]
    return {
        "cycles": table([*head, "MB", "interval back to back", "model off by", "frames a second"], list(rows), numbers=True),
        "spent": table([*head, "data", "nothing waits", "turns between reads and writes", "refresh", "rows"], list(spent), numbers=True),
        "rows": table([*head, "stream", "bursts", "rows opened", "bursts a row", "waited for rows"], [row for k in ROWS_OF for row in opened[k]], numbers=True),
    }


CHIPS = (  # folder, chip, DRAM
    ("flowers", "wide", DRAM), ("flowers", "wide", WIDER), ("playbot", "wide", DRAM), ("playbot", "wide", replace(WIDER, refresh=Refresh.PER_BANK)),
    ("guitar", "max", DRAM), ("stpeter", "wide", DRAM),
)


def _beside_gscore(say: Say, folder: str, chip: str, dram: DramConfig) -> tuple:
    view = next(v for v in REAL_VIEWS if v.folder == folder)
    found, model = _one_frame(say, view, MOVING, True, chip_of(chip).config, dram)
    rival = chip_estimates(load_view(view.path(folder_of_scenes()), view.number, SIZE), [GSCORE], dram=dram)[GSCORE]["interval_cycles"]
    return (
        view.title, f"`{chip}`", str(dram.interleave_bytes), str(dram.refresh), f"{sum(found.moved.values()) / 1e6:.1f}", f"{found.interval:,}",
        f"{model.interval / found.interval - 1:+.1%}", f"{1e9 / found.interval:,.0f}", f"{rival:,}", f"{rival / found.interval:.2f}",
    )


def chip_tables(say: Say) -> dict[str, str]:
    for chip in sorted({row[1] for row in CHIPS}):
        build(chip_of(chip).config)
    with ThreadPoolExecutor(2) as pool:
        rows = list(pool.map(lambda row: _beside_gscore(say, *row), CHIPS))
    return {"": table(
        ["view", "chip", "bytes a channel", "refresh", "MB", "interval back to back", "model off by", "frames a second", "GSCore's interval",
         "frames over GSCore's"], rows, numbers=True,
    )}


LARGE_CHIP = "wide"


def _at_size(say: Say, size: tuple[int, int]) -> tuple:
    view = REAL_VIEWS[0]
    found, model = _one_frame(say, view, replace(MOVING, size=size), True, chip_of(LARGE_CHIP).config, DRAM, count=3, limit=math.inf)
    moved = sum(found.moved.values())
    return (
        view.title, f"{size[0]}x{size[1]}", f"{moved / 1e6:.1f}", f"{found.interval:,}", f"{model.interval / found.interval - 1:+.1%}",
        f"{1e9 / found.interval:,.0f}", f"{memory_energy(moved)['LPDDR4'] / 1e3:.2f}",
    )


def size_tables(say: Say) -> dict[str, str]:
    build(chip_of(LARGE_CHIP).config)
    with ThreadPoolExecutor(2) as pool:
        rows = list(pool.map(lambda size: _at_size(say, size), SIZES[1:]))
    return {"": table(["view", "picture", "MB", "interval back to back", "model off by", "frames a second", "mJ of the DRAM"], rows, numbers=True)}
