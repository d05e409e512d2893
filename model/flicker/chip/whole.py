"""A frame of the chip that exists as RTL: both of its halves, by models that are held to it, and the memory that they share (docs/reference/chip.md)."""

from __future__ import annotations

from dataclasses import dataclass

from ..golden.front.frame import FrontFrame
from ..golden.front.memory import front_memory
from ..params import RenderConfig
from . import constants as c
from . import preprocessing, rendering
from .dram import READ, DramConfig, interleave, simulate
from .preprocessing import Preprocessing, in_order
from .rendering import Rendering
from .tile_lists import TileLists


@dataclass(frozen=True, eq=False)
class WholeFrame:
    """front, back: the halves, each with the memory to itself. dram_cycles: of the DRAM, or of the port before it, for the traffic of
    both, side by side."""

    front: Preprocessing
    back: Rendering
    dram_cycles: int

    @property
    def bytes(self) -> dict[str, int]:
        """That the DRAM moves, by purpose: whole bursts, of the frame buffer fewer than beats of the bus."""
        found = dict(self.front.bytes)
        for stream in self.back.traffic:
            found[stream.name] = found.get(stream.name, 0) + stream.moved_bytes
        return found

    @property
    def latency(self) -> int:
        """Cycles of a frame alone: a list is complete only when the front end has seen all Gaussians."""
        return self.front.cycles + self.back.cycles

    @property
    def interval(self) -> int:
        """Cycles from frame to frame when the front end works on the next one while one is rendered."""
        return max(self.front.cycles, self.back.beside_cycles, self.dram_cycles)

    @property
    def bottleneck(self) -> str:
        """What takes longest by itself."""
        parts = {"front end": self.front.cycles, "rendering": self.back.cycles, "DRAM": self.dram_cycles}
        return max(parts, key=lambda name: parts[name])


def first_half(front: FrontFrame, config: RenderConfig, dram: DramConfig, sorter: bool = True) -> tuple[Preprocessing, TileLists]:
    """The front end of a chip for what it makes of a frame, with the memory to itself, and the lists that it leaves. sorter: False: for an ideal one, which
    costs the bytes of one reading and no time."""
    image, sizes = front_memory(front), config.chip_memories
    tables = TileLists.of(front, image, sizes.sorted_entries if sorter else None, sizes.merge_lines)
    return preprocessing.estimate(front, image, dram, sizes, config.preproc_lanes, config.list_writers, config.preproc_interval), tables


def halves(front: FrontFrame, config: RenderConfig, dram: DramConfig) -> tuple[Preprocessing, Rendering]:
    """Both halves, each with the memory to itself."""
    first, tables = first_half(front, config, dram)
    return first, rendering.estimate(tables, config, dram)


def shared_cycles(front: Preprocessing, back: Rendering, dram: DramConfig) -> int:
    """Of the DRAM or its port for both halves, whose requests take turns: rows are opened and the bus is turned more often than for one after the other."""
    streams = [in_order(front.beats, dram, front.gather), *back.traffic]
    bursts, kinds = interleave(streams, c.DRAM_REQUEST_BURSTS)
    written = int((kinds != READ).sum()) * dram.burst_bytes
    port = dram.port_cycles(len(kinds) * dram.burst_bytes - written, written)
    return max(simulate(bursts, kinds, dram).cycles, port)


def whole_frame(first: Preprocessing, tables: TileLists, config: RenderConfig, dram: DramConfig) -> WholeFrame:
    """A frame of a row of them, of what `first_half` returns."""
    back = rendering.estimate(tables, config, dram, beside=sum(first.bytes.values()))
    return WholeFrame(first, back, shared_cycles(first, back, dram))
