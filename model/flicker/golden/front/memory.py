"""What the front end leaves in memory, byte for byte: records by number, and tile lists."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...params import TILE
from ..lists import ListImage, write_lists
from .frame import FrontFrame

SLOTS_PER_STEP = 16  # the slots of a cluster begin at a multiple of it, and so do its records


@dataclass(eq=False)
class FrontImage:
    """records: uint8 (slots, bytes of a record); written: bool (slots,), records that the frame has. lists: pointers and lines."""

    records: np.ndarray
    written: np.ndarray
    lists: ListImage


def front_memory(frame: FrontFrame, chunks: int | None = None) -> FrontImage:
    """Memory after a frame. chunks: that each list writer may take; None: as many as the busiest one takes."""
    slots = int(frame.packed.first[-1]) + -(-int(frame.packed.counts[-1]) // SLOTS_PER_STEP) * SLOTS_PER_STEP
    records, written = np.zeros((slots, frame.kind.bytes), np.uint8), np.zeros(slots, np.bool_)
    records[frame.number] = frame.records
    written[frame.number] = True
    cols, rows = (-(-n // TILE) for n in (frame.camera.width, frame.camera.height))
    lists = write_lists(frame.entry_splat, frame.entry_tile, frame.entry_mask, frame.key, frame.number, cols, rows, chunks)
    return FrontImage(records, written, lists)
