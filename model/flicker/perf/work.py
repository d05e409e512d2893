"""What a configuration makes the hardware do: the stream of every sub-tile with its masks, and when pixels finish.

The cycle models start from this; nothing in it depends on timing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np

from ..params import CHANNELS, MINITILE

MINITILE_PIXELS = MINITILE * MINITILE
SPLITS = {"halves": 0x00FF, "checkerboard": 0xA5A5}  # pixels of the first VRU: rows 0 and 1 (the RTL); column + row even


@numba.njit(parallel=True, cache=True)
def _unfinished(start, pixel_finish, alive):
    for s in numba.prange(len(start) - 1):
        for n in range(start[s], start[s + 1]):
            for m in range(4):
                bits = 0
                for k in range(16):
                    bits |= int(n - start[s] <= pixel_finish[s, m * 16 + k]) << k
                alive[n, m] = bits


@dataclass
class Work:
    """Work of one frame. S sub-tiles (row by row, `s = row * cols + col`), E stream elements.

    Stream
        order: int64 (S,), sub-tiles in the order of the cores: core k streams order[core_start[k]:core_start[k + 1]], one
            end-of-sub-tile token behind each. Core k has column k % 2 and row k / 2 of every 16x16 tile.
        core_start: int64 (5,).
        start: int64 (S + 1,), elements of sub-tile s are start[s]:start[s + 1], near to far.
        entry: int32 (E,), splat (row of the projection) of each element.

    Mask generation
        test_cycles: uint8 (E,), cycles that the mask generator is busy with an element (0: no generator, or free).
        evaluations: uint16 (E,), evaluations of the Gaussian weight, or of what stands for it, that the generator makes.
        mask: uint8 (E,), mini-tiles the element is sent to, before finished mini-tiles are filtered; bit m is mini-tile m.
        visit: uint16 (E, 4) or None, pixels of each mini-tile that the VRUs are told to visit, before finished pixels are
            filtered; bit i is pixel i (column i % 4, row i / 4). None: all 16 of every mini-tile in `mask`.

    What the VRUs find
        contributing: uint16 (E, 4), pixels that are visited, unfinished before this element, and have alpha >= 1/255 in
            the VRU's arithmetic; the pair that finishes a pixel is one of them.
        pixel_finish: int32 (S, 64), position in the sub-tile's list (0 is the first element) of the element that finishes pixel
            16 m + i; the list's length when none does. Pixel p is unfinished before element n when n <= pixel_finish[s, p].

    Automatic mode
        fallen: bool (S,), sub-tiles in which it had fallen to Uniform-Sparse.
    """

    cols: int
    rows: int
    order: np.ndarray
    core_start: np.ndarray
    start: np.ndarray
    entry: np.ndarray
    test_cycles: np.ndarray
    evaluations: np.ndarray
    mask: np.ndarray
    visit: np.ndarray | None
    contributing: np.ndarray
    pixel_finish: np.ndarray
    fallen: np.ndarray

    @property
    def elements(self) -> int:
        """Number of stream elements, tokens not counted."""
        return len(self.entry)

    @property
    def subtiles(self) -> int:
        """Number of sub-tiles."""
        return len(self.start) - 1

    def finish(self) -> np.ndarray:
        """int32 (S, 4): position of the element after which all 16 pixels of a mini-tile are finished; list length: never."""
        return self.pixel_finish.reshape(-1, CHANNELS, MINITILE_PIXELS).max(axis=2)

    def contributing_count(self) -> np.ndarray:
        """uint8 (E, 4): number of contributing pixels, 0 to 16."""
        return np.bitwise_count(self.contributing)

    def visit_masks(self) -> np.ndarray:
        """uint16 (E, 4): `visit`, or what stands for it when whole mini-tiles are visited."""
        if self.visit is not None:
            return self.visit
        bits = (self.mask[:, None] >> np.arange(CHANNELS, dtype=np.uint8)) & 1
        return bits.astype(np.uint16) * np.uint16(0xFFFF)

    def unfinished(self) -> np.ndarray:
        """uint16 (E, 4): pixels unfinished before each element."""
        alive = np.empty((self.elements, CHANNELS), np.uint16)
        _unfinished(self.start, self.pixel_finish, alive)
        return alive

    def vru_slots(self, split: str) -> int:
        """Pixel slots of the VRUs over the frame when a mini-tile's two VRUs wait for each other after every element (SPLITS)."""
        visited = self.visit_masks() & self.unfinished()
        first = np.uint16(SPLITS[split])
        cycles = np.maximum(np.bitwise_count(visited & first), np.bitwise_count(visited & ~first))
        return 2 * int(cycles.sum(dtype=np.int64))

    def until_finished(self) -> Work:
        """The same work without the elements that come when all 64 pixels of their sub-tile are finished."""
        length = np.diff(self.start)
        keep_length = np.minimum(self.pixel_finish.max(axis=1) + 1, length)
        place = np.arange(self.elements) - np.repeat(self.start[:-1], length)
        keep = place < np.repeat(keep_length, length)
        elements = {name: getattr(self, name)[keep] for name in ("entry", "test_cycles", "evaluations", "mask", "contributing")}
        visit = None if self.visit is None else self.visit[keep]
        return replace(self, start=np.concatenate(([0], np.cumsum(keep_length))), visit=visit, **elements)

    def totals(self) -> dict[str, int]:
        """Sums over the frame, finished pixels and mini-tiles left out of what VRUs visit."""
        visited = self.visit_masks() & self.unfinished()
        return {
            "elements": self.elements,
            "elements_rejected": int((self.mask == 0).sum()),
            "test_cycles": int(self.test_cycles.sum()),
            "evaluations": int(self.evaluations.sum()),
            "minitiles_masked": int(np.bitwise_count(self.mask).sum()),
            "minitiles_sent": int((visited != 0).sum()),
            "pixels_visited": int(np.bitwise_count(visited).sum()),
            "pixels_contributing": int(np.bitwise_count(self.contributing).sum()),
        }
