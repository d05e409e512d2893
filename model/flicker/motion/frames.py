"""Frames of a path in their order, made here or by processes beside each other; those of the verilated chip: `on_chip`."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..chip.compare import frame_cost
from ..chip.drawing import Drawing
from ..errors import FlickerError, FlickerWarning
from ..front.pops import Seen, seen_in
from ..front.reference import expected_depth
from ..front.view import View
from ..golden.front.frame import FrontFrame
from ..golden.front.record import RecordKind
from ..golden.front.reuse import ColourStore, Reuse
from ..params import SortOrder
from ..pipeline import Front, golden_front, packed_scene
from ..scene import Scene
from ..scene.camera import Camera
from ..scene.metrics import flip, ssim
from ..scene.sources import read_scene

AHEAD = 2  # frames that wait for their turn, for each process


@dataclass(frozen=True)
class Wanted:
    """What is made of every frame. beside: a second picture. reference: the float64 reference; quality: SSIM and FLIP against it. depth: of the reference.
    cycles: what the frame costs on the chip, by its models. order: what splats are sorted by. pops: what is needed to count them. tolerance: by how much
    colours that are kept from frame to frame may differ, of the drawing's bit-true front end; None: none are kept."""

    drawing: Drawing
    beside: Drawing | None = None
    reference: bool = False
    quality: bool = False
    depth: bool = False
    cycles: bool = False
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    order: SortOrder = SortOrder.DEPTH
    pops: bool = False
    tolerance: float | None = None


@dataclass
class Made:
    """A frame. image, beside: float (H, W, 3), unquantised. reference: float64 (H, W, 3). depth: float64 (H, W). facts: numbers by column. notes: warnings.
    seen: lists of the drawing's front end, for pops."""

    number: int
    image: np.ndarray
    beside: np.ndarray | None
    reference: np.ndarray | None
    depth: np.ndarray | None
    facts: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    seen: Seen | None = None


def _counts(stats: dict[str, Any]) -> dict[str, Any]:
    """Columns that follow from an engine's statistics: what is seen and listed; of a stage that is simulated its cycles."""
    found = {"visible": stats.get("visible"), "tile_entries": stats.get("list_entries", stats.get("tile_pairs")), "subtile_entries": stats.get("subtile_pairs")}
    if "cycles" in stats:
        found["stage_cycles"] = stats["cycles"]
    return found


def seen_by(view: View, drawing: Drawing) -> Seen:
    """What a drawing of a view blends, in its order: of a bit-true front end, whoever computes it, by its golden model."""
    if not drawing.engine.whole and drawing.front is Front.FLOAT:
        return seen_in(view.projected, view.camera)
    options = drawing.options
    packed = packed_scene(view, options.format, options.rechunk)
    return golden_front(view, packed, options.lists, RecordKind.of(drawing.config.form)).seen()


class KeptColours:
    """Colours that frames of a path keep, in their order."""

    def __init__(self, wanted: Wanted) -> None:
        self.wanted = wanted
        self._reuse: Reuse | None = None

    def front(self, view: View) -> FrontFrame | None:
        """The front end of a frame, by the golden model, from which all that is made of the view goes on; None where no colours are kept."""
        drawing, tolerance = self.wanted.drawing, self.wanted.tolerance
        if tolerance is None:
            return None
        packed = packed_scene(view, drawing.options.format, drawing.options.rechunk)
        if self._reuse is None:
            self._reuse = Reuse(ColourStore(packed), tolerance)
        return golden_front(view, packed, drawing.options.lists, RecordKind.of(drawing.config.form), self._reuse)


def make(scene: Scene, wanted: Wanted, number: int, camera: Camera, kept: KeptColours | None = None) -> Made:
    """Frame `number` of a path. kept: of the frames before it."""
    began = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FlickerWarning)
        view = View(camera, scene, number=number, background=wanted.background, order=wanted.order)
        front = None if kept is None else kept.front(view)
        rendered = wanted.drawing.render(view)
        facts = _counts(rendered.stats)
        if front is not None and front.reused is not None:
            facts["kept_colours"] = float(front.reused.stored.mean()) if len(front.reused.stored) else 0.0
        # What stands beside it keeps none.
        other = view if front is None else View(camera, scene, number=number, background=wanted.background, order=wanted.order)
        beside = None if wanted.beside is None else wanted.beside.render(other).image
        reference = view.reference if wanted.reference else None
        if wanted.quality:
            facts |= {"ssim": ssim(rendered.image, view.reference), "flip": flip(rendered.image, view.reference)}
        depth = expected_depth(view.projected, camera) if wanted.depth else None
        if wanted.cycles:
            facts |= frame_cost(view, wanted.drawing)
        seen = seen_by(view, wanted.drawing) if wanted.pops else None
    facts["made_s"] = time.perf_counter() - began
    notes = [str(w.message) for w in caught if issubclass(w.category, FlickerWarning)]
    return Made(number, rendered.image, beside, reference, depth, facts, notes, seen)


# ---- processes ----------------------------------------------------------------------------------

_SCENE: Scene | None = None
_WANTED: Wanted | None = None


def _begin(scene: str | Path, wanted: Wanted, threads: int) -> None:
    """A process of its own: the scene is loaded once. Ctrl-C is for who started it."""
    import numba

    global _SCENE, _WANTED
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    numba.set_num_threads(min(threads, numba.get_num_threads()))
    warnings.simplefilter("ignore")  # said where the scene was opened first
    _SCENE, _WANTED = read_scene(scene), wanted


def _make(number: int, camera: Camera) -> Made:
    assert _SCENE is not None and _WANTED is not None
    return make(_SCENE, _WANTED, number, camera)


def frames(scene: Scene, file: str | Path, cameras: Sequence[Camera], wanted: Wanted, first: int = 0, workers: int = 1) -> Iterator[Made]:
    """Frames `first` to the last one of a path, in order. file: of the scene, for the processes; workers: of them, 1: none, all is made here, as it must be
    where colours are kept."""
    if workers == 1:
        kept = KeptColours(wanted)
        if wanted.tolerance is not None:  # those that are there have left their colours
            for number in range(first):
                kept.front(View(cameras[number], scene, order=wanted.order))
        for number in range(first, len(cameras)):
            yield make(scene, wanted, number, cameras[number], kept)
        return
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), _begin, (file, wanted, max((os.cpu_count() or 1) // workers, 1)),
    )
    waiting: deque[Future[Made]] = deque()
    done = False
    try:
        for number in range(first, len(cameras)):
            waiting.append(pool.submit(_make, number, cameras[number]))
            if len(waiting) >= AHEAD * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
        done = True
    except BrokenProcessPool:
        raise FlickerError("a process that made frames has ended, perhaps for want of memory: --workers 1 takes less") from None
    finally:
        if not done:  # what is under way is of no use
            for child in set(multiprocessing.active_children()) - before:
                child.terminate()
        pool.shutdown(wait=done, cancel_futures=True)
