"""`make docs PART=record_cache`: lines that the record cache reads for whole lists, by its size, by what it replaces and by the order of the tiles,
in docs/results/delivery.md."""

from __future__ import annotations

import numba
import numpy as np

from flicker.chip.rendering import cache_lookup
from flicker.golden.delivery import LINE_BYTES
from flicker.golden.front.frame import FrontFrame, run_front
from flicker.golden.walk import BAND, borders, tile_walk
from flicker.markdown import table
from flicker.params import TILE
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat

from .common import Say, titled_views

DEFAULT = (1024, 4)  # lines, ways
SIZES = ((512, 4), (1024, 2), DEFAULT, (1024, 8), (1536, 6), (2048, 4))


@numba.njit(cache=True)
def _lines(line, tile, until, sets, ways):
    """Lines read. tile: of each lookup, number in the walk; until: tiles after it for which the line is wanted."""
    held = np.full((sets, ways), -1, np.int64)
    marks = np.zeros((sets, ways), np.int64)
    turn = np.zeros(sets, np.int64)
    n = 0
    for k in range(len(line)):
        n += cache_lookup(line[k], tile[k], until[k], held, marks, turn, ways)
    return n


def _walks(cols: int, rows: int) -> dict[str, np.ndarray]:
    """Numbers of tiles, row by row in the picture, in the order in which they are taken."""
    y, x = np.divmod(np.arange(cols * rows), cols)
    spread = lambda v: sum((v >> b & 1) << 2 * b for b in range(8))  # noqa: E731

    def walk(band: int) -> np.ndarray:
        wx, wy = tile_walk(-(-cols // 2), rows, band)
        return (wx + cols * wy)[wx < cols]

    return {
        "row by row": np.arange(cols * rows),
        "row by row, from the left and from the right in turn": np.lexsort((np.where(y % 2, -x, x), y)),
        "Z curve": np.argsort(spread(x) | spread(y) << 1, kind="stable"),
        **{f"`tile_walk`, bands of {h} rows" + (" (the chip)" if h == BAND else ""): walk(h) for h in (2, 4, 8, 16)},
    }


def _wanted(tile: np.ndarray, mask: np.ndarray, cols: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Of each entry the number of its tile in the chip's walk, and for how many tiles after it the cache keeps its line."""
    x, y = tile_walk(-(-cols // 2), rows)
    place = np.empty((rows, x.max() + 1), np.int64)
    place[y, x] = np.arange(len(x))
    at = place[tile // cols, tile % cols]
    touching = borders(-(-cols // 2), rows)[at]
    return at, np.where(mask & touching[:, 1], 2, np.where(mask & touching[:, 0], 1, -1))


def sorted_entries(front: FrontFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Record number, tile and mask of every list entry, lists sorted."""
    number = front.number[front.entry_splat]
    order = np.lexsort((number, front.key[front.entry_splat], front.entry_tile))
    return number[order], front.entry_tile[order].astype(np.int64), front.entry_mask[order]


def tables(say: Say) -> dict[str, str]:
    sizes: dict[tuple[int, int, bool], list[str]] = {(*key, wanted): [] for key in SIZES for wanted in (False, True)}
    walks: dict[str, list[str]] = {}
    titles = []
    for title, view in titled_views(say):
        front = run_front(packed_scene(view, PackedFormat.CHUNK), view.camera)
        number, tile, mask = sorted_entries(front)
        per_line = LINE_BYTES // front.kind.bytes
        cores = np.bitwise_count(front.entry_mask).mean()
        titles.append(f"{title}: {len(number):,} entries, {cores:.2f} cores each, {len(np.unique(number // per_line)):,} lines")
        cols, rows = (-(-n // TILE) for n in (view.camera.width, view.camera.height))
        for name, walk in _walks(cols, rows).items():
            order = np.argsort(np.argsort(walk)[tile], kind="stable")
            line = number[order] // per_line
            never = np.full(len(line), -1)
            walks.setdefault(name, []).append(f"{_lines(line, never, never, DEFAULT[0] // DEFAULT[1], DEFAULT[1]):,}")
            if name.endswith("(the chip)"):
                at, until = _wanted(tile[order], mask[order], cols, rows)
                for lines, ways, wanted in sizes:
                    sizes[lines, ways, wanted].append(f"{_lines(line, *((at, until) if wanted else (never, never)), lines // ways, ways):,}")
    return {
        "sizes": table(
            ["lines", "ways", "replaced", *titles],
            [[f"{lines:,}", str(ways), "wanted no more" if wanted else "oldest", *cells] for (lines, ways, wanted), cells in sizes.items()],
        ),
        "walks": table(["tiles", *titles], [[name, *cells] for name, cells in walks.items()]),
    }
