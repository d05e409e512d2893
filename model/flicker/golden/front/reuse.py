"""Colours that last: what the front end keeps from frame to frame, and how long a cluster may show it, bit for bit (docs/reference/colour_store.md).

A colour depends on the direction from the camera to the Gaussian alone. A cluster's stored colours are those for one position of the camera; from another one
no direction to a point of its box differs by more than asin(|move| / distance), distance from the stored position to the nearest point of the box. So with a
slope of at most s (`scene.slopes`) no colour differs by more than s asin(|move| / distance). Since asin(x) <= 1.0106 x up to 1/4, they may be shown where

    16 |move|^2 < distance^2   and   s^2 |move|^2 < limit distance^2,   limit = (epsilon / 1.0125)^2

in ff numbers of 23 bits, whose rounding is within what 1.0125 is larger. Where the position is the stored one, always. Of numbers that are too large for their
squares, or too small, no side is the smaller one.

The store: 32 beats a cluster, at a multiple of 2048 bytes. Beat 0, the head: position (3 x float32), generation (uint32), 16 bytes of zeros, and a bit for
each of the cluster's Gaussians whose colour is there. Beats 1 to 22, the rows: 12 Gaussians each, 5 bytes a Gaussian: bits 29:0 colour as in a
record, 37:30 opacity code.

A frame, cluster by cluster of those that pass the cull. Its colours last where the head has the frame's generation, a bit at least, and the test holds. Of a
cluster whose colours last, survivors with a bit take their stored colour. All other survivors' colours are computed, with this frame's camera. They are stored
where the cluster's colours do not last, or where the camera is at the stored position; a row is written where it has such a survivor and no stored colour of a
Gaussian that is no survivor now. A head with bits, of any generation, whose colours do not last is written without them before the first row, and the new one
behind the last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np

from ...arithmetic.ff import ff_add, ff_exp2_fixed, ff_ldexp, ff_mul, ff_sub
from ...errors import FlickerError
from ...scene.packed import BEAT, CLUSTER_LIMIT, PackedFormat, PackedScene
from ...scene.slopes import CODE_ONE, CODE_SHIFT
from .setup import CLUSTER_M, FrameSetup, image_floats, rounded

CLUSTER_BEATS = 32  # of the store, a cluster; those behind the rows are not used
ROW = 12  # Gaussians of a row
ROWS = -(-CLUSTER_LIMIT // ROW)
ENTRY_BYTES = 5
COLOUR_BITS = 30
EPSILON_SHARE = 1.0125  # of an angle's sine, and of rounding
EPSILON_LIMIT = 1.0


def limit_of(epsilon: float) -> float:
    """The register that an epsilon becomes, an ff number. FlickerError outside of 0 to 1."""
    if not 0.0 <= epsilon <= EPSILON_LIMIT:
        raise FlickerError(f"colour tolerance: {epsilon:g}, not 0 to {EPSILON_LIMIT:g}")
    return float(rounded((epsilon / EPSILON_SHARE) ** 2, CLUSTER_M))


@numba.njit
def colours_last(low, high, code, then, position, limit):
    """Whether colours for the camera position `then` may be shown from `position`. code: of the cluster's slope; the others ff numbers of 23 bits."""
    M = CLUSTER_M
    x, y, z = ff_sub(then[0], position[0], M), ff_sub(then[1], position[1], M), ff_sub(then[2], position[2], M)
    move = ff_add(ff_add(ff_mul(x, x, M), ff_mul(y, y, M), M), ff_mul(z, z, M), M)
    x = max(max(ff_sub(low[0], then[0], M), ff_sub(then[0], high[0], M)), 0.0)
    y = max(max(ff_sub(low[1], then[1], M), ff_sub(then[1], high[1], M)), 0.0)
    z = max(max(ff_sub(low[2], then[2], M), ff_sub(then[2], high[2], M)), 0.0)
    away = ff_add(ff_add(ff_mul(x, x, M), ff_mul(y, y, M), M), ff_mul(z, z, M), M)
    turned = ff_mul(ff_exp2_fixed((code - CODE_ONE) * 2, CODE_SHIFT, M), move, M)
    within = (ff_ldexp(move, 4, M) < away) & (turned < ff_mul(limit, away, M)) & (0 < code)
    return within | (move <= 0.0)


@numba.njit(cache=True)
def _last(low, high, code, then, position, limit, out):
    for i in range(low.shape[0]):
        out[i] = colours_last(low[i], high[i], np.int64(code[i]), then[i], position, limit)


@dataclass(frozen=True, eq=False)
class Reused:
    """What a frame does with the store. stored: bool (R,), of each record, whether its colour was read. kept: int64 (K,), clusters whose heads are read.

    cleared: of these, whose heads are written without bits. rows_read, rows_written: int64 (n, 2), cluster and row, in order. heads_written: int64 (n,),
    clusters. lasting: of the clusters `kept`, whose colours last.
    """

    stored: np.ndarray
    kept: np.ndarray
    lasting: np.ndarray
    cleared: np.ndarray
    rows_read: np.ndarray
    rows_written: np.ndarray
    heads_written: np.ndarray

    @property
    def read_beats(self) -> int:
        return len(self.kept) + len(self.rows_read)

    @property
    def written_beats(self) -> int:
        return len(self.cleared) + len(self.rows_written) + len(self.heads_written)


class ColourStore:
    """Colours of a scene in chunks from frame to frame. position: float64 (C, 3), ff numbers; generation: int64 (C,); there: bool (N,); entry: int64 (N,), bits
    37:0 of a row's entries. As memory of zeros at first, which no frame's generation is."""

    def __init__(self, packed: PackedScene) -> None:
        if packed.format is not PackedFormat.CHUNK:
            raise FlickerError(f"{packed.path or 'scene'}: format: {packed.format.value}: colours are kept of chunks alone")
        self.packed = packed
        clusters, gaussians = len(packed.table), len(packed)
        self.position, self.generation = np.zeros((clusters, 3)), np.zeros(clusters, np.int64)
        self.there, self.entry = np.zeros(gaussians, np.bool_), np.zeros(gaussians, np.int64)

    @cached_property
    def _row(self) -> np.ndarray:
        """int64 (N,): row of each Gaussian, numbered through all clusters."""
        within = np.arange(len(self.packed)) - self.packed.start[self.packed.cluster]
        return self.packed.cluster * ROWS + within // ROW

    def lasting(self, setup: FrameSetup, limit: float, generation: int) -> np.ndarray:
        """bool (C,): clusters whose colours last in a frame of this camera."""
        table, packed = self.packed.table, self.packed
        found = np.zeros(len(table), np.bool_)
        _last(image_floats(table["low"]), image_floats(table["high"]), packed.slopes, self.position, setup.position, limit, found)
        some = np.logical_or.reduceat(self.there, packed.start[:-1])
        return found & some & (self.generation == generation)

    def step(
        self, setup: FrameSetup, kept: np.ndarray, lasting: np.ndarray, gaussian: np.ndarray, entry: np.ndarray, generation: int,
    ) -> Reused:
        """What a frame reads and writes; the store is that behind it. kept: bool (C,), of the cull. lasting: `lasting` before the frame. gaussian: int64 (R,),
        survivors; entry: int64 (R,), their bits."""
        packed, rows = self.packed, len(self.packed.table) * ROWS
        valid = self.there & lasting[packed.cluster]
        alive = np.zeros(len(packed), np.bool_)
        alive[gaussian] = True
        storing = kept & (~lasting | (self.position == setup.position).all(axis=1))
        has = lambda flags: np.bincount(self._row[flags], minlength=rows) > 0  # noqa: E731
        read = has(alive & valid)
        written = has(alive & ~valid) & ~has(valid & ~alive) & np.repeat(storing, ROWS)
        heads = written.reshape(-1, ROWS).any(axis=1)
        cleared = kept & ~lasting & np.logical_or.reduceat(self.there, packed.start[:-1])
        stored = valid[gaussian]
        into = written[self._row]
        self.entry[gaussian[into[gaussian]]] = entry[into[gaussian]]
        self.entry[into & ~alive] = 0
        fresh = np.repeat(cleared | heads & ~lasting, packed.counts)
        self.there = np.where(fresh, False, self.there) | into & alive
        self.position[cleared | heads] = setup.position
        self.generation[cleared | heads] = generation
        split = lambda flags: np.stack(np.divmod(np.flatnonzero(flags), ROWS), axis=1)  # noqa: E731
        of = np.flatnonzero(kept)
        return Reused(stored, of, lasting[of], np.flatnonzero(cleared), split(read & np.repeat(kept, ROWS)), split(written), np.flatnonzero(heads))

    @property
    def bytes(self) -> int:
        """Of the region in memory."""
        return len(self.packed.table) * CLUSTER_BEATS * BEAT

    def image(self) -> np.ndarray:
        """uint8: the region in memory."""
        clusters = len(self.packed.table)
        out = np.zeros((clusters, CLUSTER_BEATS, BEAT), np.uint8)
        out[:, 0, :12] = self.position.astype("<f4").view(np.uint8).reshape(clusters, 12)
        out[:, 0, 12:16] = self.generation.astype("<u4")[:, None].view(np.uint8)
        slot = np.arange(len(self.packed)) - self.packed.start[self.packed.cluster]
        bits, entries = np.zeros((clusters, CLUSTER_LIMIT), np.bool_), np.zeros((clusters, ROWS * ROW), "<i8")
        bits[self.packed.cluster, slot], entries[self.packed.cluster, slot] = self.there, self.entry
        out[:, 0, 32:] = np.packbits(bits, axis=1, bitorder="little")
        rows = np.ascontiguousarray(entries.view(np.uint8).reshape(clusters, ROWS, ROW, 8)[..., :ENTRY_BYTES]).reshape(clusters, ROWS, -1)
        out[:, 1 : 1 + ROWS, : ROW * ENTRY_BYTES] = rows
        return out.reshape(-1)


@dataclass(frozen=True, eq=False)
class Reuse:
    """That a frame keeps and shows colours. epsilon: by which a channel may differ, of a colour of 1. generation: 1 to 2^32 - 1; colours of another one are
    none."""

    store: ColourStore
    epsilon: float
    generation: int = 1

