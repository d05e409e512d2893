"""Estimate of a whole frame: cycles of every stage, bytes of every purpose, the bottleneck.

Preprocessing in the configuration that exists as RTL comes from `preprocessing` (its bytes, its cycles within a few per cent); in any other, and rendering
always, it is a model of units that were not built.

Two phases share the memory: preprocessing (cull, project, colour, records and lists to DRAM) and rendering (lists and
records from DRAM, sort, contribution test and blending, pixels to DRAM). A list is complete only when the last
Gaussian has been seen, so the phases of one frame follow each other; with double-buffered lists the rendering of one
frame overlaps the preprocessing of the next. Hence two figures: the interval between frames (the slowest stage, DRAM
being one) and the latency of a single frame. Stages within a phase overlap fully.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from ..errors import FlickerError
from ..front.records import SubtileLists
from ..front.view import View
from ..golden.front.frame import run_front
from ..golden.front.memory import front_memory
from ..params import TILE, Form
from ..pipeline import packed_scene
from ..scene.camera import Camera
from ..scene.clusters import Clusters, build_clusters
from ..scene.memory import CHUNK, MemoryFormat, layout
from ..scene.packed import PackedFormat
from . import constants as c
from . import preprocessing
from .cull import cull
from .delivery import broadcast_cycles, consumed
from .dram import READ, WRITE, DramConfig, Stream, interleave, simulate
from .execute import Addresses, SchemeResult, run_scheme
from .lists import Splats, collect
from .schemes import RECOMMENDED, SCHEMES, Scheme

_GEOMETRY_BASE = 0
_COLOUR_BASE = 1 << 28
_HEADER_BASE = 3 << 28
_FRAME_BASE = 1 << 31
_PACKED = {MemoryFormat.FP16: PackedFormat.FP16, MemoryFormat.FP16_LOCAL: PackedFormat.FP16_LOCAL, MemoryFormat.CHUNK: PackedFormat.CHUNK}


@dataclass(frozen=True)
class ChipConfig:
    """What surrounds the rendering stage.

    cull_shape: "box", "sphere", or "none" (every Gaussian's geometry is read). two_step: colour only for what passes. early_stop: finished
    sub-tiles fetch no further records.
    """

    memory: MemoryFormat = MemoryFormat.CHUNK
    cluster_size: int = c.CLUSTER_SIZE
    cull_shape: str = "box"
    two_step: bool = True
    scheme: Scheme = SCHEMES[RECOMMENDED]
    early_stop: bool = True
    dram: DramConfig = field(default_factory=DramConfig)

    def __post_init__(self) -> None:
        if self.memory.chunked and self.cluster_size != CHUNK:
            raise FlickerError(f"chip: cluster_size must be {CHUNK} with chunks, not {self.cluster_size}")
        if self.cull_shape not in ("box", "sphere", "none"):
            raise FlickerError(f"chip: cull_shape must be box, sphere or none, not {self.cull_shape}")

    @property
    def as_built(self) -> bool:
        """Whether preprocessing is what flk_preprocessing does."""
        return (
            self.memory in _PACKED and self.cluster_size == CHUNK and self.cull_shape == "box" and self.two_step and self.scheme == SCHEMES[RECOMMENDED]
        )


DEFAULT_CHIP = ChipConfig()


@dataclass(eq=False)
class Prepared:
    """A view with its scene in the order of memory: what does not depend on the chip but on the size of clusters; reused between estimates.

    needed: entries of each sub-tile list until it is finished.
    """

    view: View
    clusters: Clusters
    splats: Splats
    needed: np.ndarray
    _built: dict[tuple, preprocessing.Preprocessing] = field(default_factory=dict)

    def preprocessing(self, memory: MemoryFormat, dram: DramConfig) -> preprocessing.Preprocessing:
        """The front end's frame, for a format that it reads; kept."""
        if (memory, dram) not in self._built:
            frame = run_front(packed_scene(self.view, _PACKED[memory]), self.view.camera)
            self._built[memory, dram] = preprocessing.estimate(frame, front_memory(frame), dram)
        return self._built[memory, dram]

    @property
    def lists(self) -> SubtileLists:
        """The sub-tile lists that every scheme must end with."""
        return self.view.lists(Form.FACTORED)


def prepare(view: View, cluster_size: int = c.CLUSTER_SIZE) -> Prepared:
    """Put the scene of a view into the order of memory."""
    scene, clusters = build_clusters(view.scene, cluster_size)
    view = View(view.camera, scene, name=view.name, number=view.number, background=view.background)
    return Prepared(view, clusters, collect(view.projected, view.camera), consumed(view.projected, view.lists(Form.FACTORED)))


@dataclass(frozen=True)
class Stage:
    """Cycles of a stage at the chip's clock, if nothing else held it up."""

    name: str
    phase: str
    cycles: int


@dataclass(frozen=True)
class Purpose:
    """What one purpose moves. used_bytes: needed; moved_bytes: whole bursts. dram_cycles, efficiency: if it had the memory alone."""

    name: str
    phase: str
    used_bytes: int
    moved_bytes: int
    dram_cycles: int
    efficiency: float


@dataclass(frozen=True)
class FrameEstimate:
    """A frame. dram_cycles: (preprocessing, rendering), streams of a phase interleaved. counts, on_chip (bytes): by name."""

    stages: list[Stage]
    purposes: list[Purpose]
    dram_cycles: tuple[int, int]
    counts: dict[str, int]
    on_chip: dict[str, int]

    @property
    def bytes(self) -> int:
        """Bytes moved in a frame."""
        return sum(p.moved_bytes for p in self.purposes)

    def _phases(self) -> dict[str, int]:
        """Cycles of the units in each phase; its stages overlap, but a second pass over the lists follows the first."""
        first = [s.cycles for s in self.stages if s.phase == "preprocessing"]
        second = [s.cycles for s in self.stages if s.phase == "second pass"]
        return {"preprocessing": max(first) + sum(second), "rendering": max(s.cycles for s in self.stages if s.phase == "rendering")}

    @property
    def interval_cycles(self) -> int:
        """Cycles between frames when phases of neighbouring frames overlap."""
        return max(*self._phases().values(), sum(self.dram_cycles))

    @property
    def latency_cycles(self) -> int:
        """Cycles of one frame alone."""
        return sum(max(u, d) for u, d in zip(self._phases().values(), self.dram_cycles))

    @property
    def bottleneck(self) -> str:
        """The stage that sets the interval."""
        if sum(self.dram_cycles) == self.interval_cycles:
            return "DRAM"
        if self._phases()["preprocessing"] == self.interval_cycles:
            return max((s for s in self.stages if s.phase != "rendering"), key=lambda s: s.cycles).name
        return max((s for s in self.stages if s.phase == "rendering"), key=lambda s: s.cycles).name

    @property
    def fps(self) -> float:
        """Frames a second at the chip's clock, from the interval."""
        return c.CLOCK_HZ / self.interval_cycles

    @property
    def latency_fps(self) -> float:
        """Frames a second without overlap of frames."""
        return c.CLOCK_HZ / self.latency_cycles

    def as_dict(self) -> dict:
        """Everything, for JSON."""
        return asdict(self) | {
            "bytes": self.bytes, "interval_cycles": self.interval_cycles, "latency_cycles": self.latency_cycles,
            "bottleneck": self.bottleneck, "fps": self.fps, "latency_fps": self.latency_fps,
        }


def _pixels(camera: Camera) -> Stream:
    """The picture, tile by tile, into a frame buffer that lies row by row."""
    tile_x, tile_y = np.arange(-(-camera.width // TILE)), np.arange(-(-camera.height // TILE))
    y = tile_y[:, None, None] * TILE + np.arange(TILE)
    x = np.broadcast_to(tile_x[None, :, None] * TILE, (len(tile_y), len(tile_x), TILE))
    y = np.broadcast_to(y, x.shape).ravel()
    x = x.ravel()
    inside = y < camera.height
    width = np.minimum(camera.width - x, TILE)
    pitch = -(-camera.width * c.PIXEL_BYTES // c.LINE_BYTES) * c.LINE_BYTES
    return Stream.ranges("pixel write", (_FRAME_BASE + y * pitch + x * c.PIXEL_BYTES)[inside], (width * c.PIXEL_BYTES)[inside], WRITE)


def _parameter_streams(prepared: Prepared, chip: ChipConfig) -> tuple[list[Stream], dict[str, int]]:
    """Headers, geometry and colour; the counts of the cull."""
    clusters, scene = prepared.clusters, prepared.view.scene
    form = layout(chip.memory, scene.sh.shape[1])
    keep = np.ones(len(clusters), bool) if chip.cull_shape == "none" else cull(clusters, prepared.view.camera, chip.cull_shape)
    members = clusters.members(keep)
    passing = prepared.view.projected.index[prepared.splats.projected]  # ascending: the order of memory
    size = np.diff(clusters.start)[keep]
    first = clusters.start[:-1][keep]
    streams = []
    if chip.cull_shape != "none" or chip.memory is not MemoryFormat.FP16:
        streams.append(Stream.span("cluster headers", _HEADER_BASE, len(clusters) * form.header, READ))
    streams.append(Stream.ranges("geometry", _GEOMETRY_BASE + first * form.geometry, size * form.geometry, READ))
    coloured = passing if chip.two_step else members
    streams.append(Stream.items("opacity and colour", _COLOUR_BASE, form.colour, coloured, READ))
    return streams, {
        "Gaussians": len(scene), "clusters": len(clusters), "clusters kept": int(keep.sum()), "geometry read": len(members),
        "visible": prepared.view.projected.n_visible, "colour read": len(coloured), "records": len(passing),
    }


def frame_estimate(
    prepared: Prepared, render_cycles: int, chip: ChipConfig = DEFAULT_CHIP, scheme_result: SchemeResult | None = None,
    subtile_cycles: np.ndarray | None = None,
) -> FrameEstimate:
    """Estimate a frame. render_cycles: of the rendering stage, from its model or the RTL.

    scheme_result: of `run_scheme` with the same scheme on the same view, to save time. subtile_cycles: of a core in each sub-tile, (S,); given, the stage
    "render, broadcast" says what sharing one stream of records among the cores of a tile makes of them.
    """
    if prepared.clusters.size != chip.cluster_size:
        raise FlickerError(f"chip: prepared for clusters of {prepared.clusters.size}, not {chip.cluster_size}")
    result = scheme_result or run_scheme(prepared.splats, chip.scheme, prepared.needed if chip.early_stop else None)
    front, counts = _parameter_streams(prepared, chip)
    records = Stream.span("record write", Addresses().records, len(prepared.splats) * c.RECORD_BYTES, WRITE)
    front += [records] + [s for s in result.streams if s.name not in result.back]
    built = prepared.preprocessing(chip.memory, chip.dram) if chip.as_built else None
    if built is not None:
        front = built.streams(chip.dram)
    back = [s for s in result.streams if s.name in result.back] + [_pixels(prepared.view.camera)]
    coefficients = prepared.view.scene.sh.shape[1]
    cores = c.PREPROCESSING_CORES
    colour = counts["colour read"] * -(-coefficients // c.SH_COEFFICIENTS_PER_CYCLE)
    stages = [Stage("front end", "preprocessing", built.units)] if built is not None else [
        Stage("cull clusters", "preprocessing", -(-counts["clusters"] * c.CLUSTER_TEST_CYCLES // cores)),
        Stage("project", "preprocessing", -(-counts["geometry read"] * c.GEOMETRY_CYCLES // cores)),
        Stage("colour", "preprocessing", -(-colour // cores)),
        Stage("emit list entries", "preprocessing", result.cycles["emit entries"]),
    ]
    stages += [Stage(k, "second pass", result.cycles[k]) for k in ("count entries", "global sort") if k in result.cycles]
    stages += [
        Stage(k, "rendering", result.cycles[k])
        for k in ("chain latency", "sort", "filter by mask", "hand out records") if k in result.cycles
    ]
    stages.append(Stage("render", "rendering", int(render_cycles)))
    if subtile_cycles is not None and chip.scheme.grain > 1:
        cycles = broadcast_cycles(prepared.splats, prepared.needed, subtile_cycles, c.QUEUE_REFERENCES, chip.scheme.grain)
        stages.append(Stage("render, broadcast", "rendering", cycles))
    counts |= {
        "list entries": result.entries, "longest list": result.longest, "sub-tile entries": len(prepared.lists.entry),
        "sub-tile entries needed": int(prepared.needed.sum()), "records fetched": result.fetched, "records from DRAM": result.missed,
    }
    return FrameEstimate(
        stages, [_purpose(s, "preprocessing", chip.dram) for s in front] + [_purpose(s, "rendering", chip.dram) for s in back],
        (built.dram if built is not None else _phase_cycles(front, chip.dram), _phase_cycles(back, chip.dram)), counts, result.on_chip,
    )


def _phase_cycles(streams: Sequence[Stream], config: DramConfig) -> int:
    return simulate(*interleave(streams), config).cycles


def _purpose(stream: Stream, phase: str, config: DramConfig) -> Purpose:
    alone = simulate(stream.burst, stream.kind, config)
    return Purpose(stream.name, phase, stream.used_bytes, stream.moved_bytes, alone.cycles, alone.efficiency)
