"""Records as they lie in memory and the sub-tile lists that name them: what the lanes take."""

from __future__ import annotations

from dataclasses import dataclass, field

import numba
import numpy as np

from ...front.projection import Projected
from ...front.records import LOG2E, Bins, SubtileLists
from ...params import Form
from ..front.colour import COLOUR_FRACTION, COLOUR_LIMIT
from ..front.frame import OPACITY_LIMIT, FrontFrame
from ..front.record import RecordKind, Splats, decode_records, encode_mean, encode_shape
from ..front.setup import MEAN_FRACTION

_FAR = 1 << (22 + MEAN_FRACTION)  # 2^22 pixels


@dataclass
class RecordLists:
    """records: int64 (N, 2), bits 63:0 and 127:64 of each record of 16 bytes. The rest as in `SubtileLists`: sub-tile s is column s % cols, row s // cols, and
    sees the records entry[start[s]:start[s + 1]], near to far."""

    width: int
    height: int
    records: np.ndarray
    start: np.ndarray
    entry: np.ndarray
    cols: int
    rows: int
    tile_pairs: int
    adjusted: dict[str, int] = field(default_factory=dict)

    form = Form.FACTORED

    def splats(self) -> Splats:
        """What the records mean."""
        return decode_records(self.records.view(np.uint8).reshape(-1, 16), RecordKind.FACTORED16)


def front_lists(front: FrontFrame) -> RecordLists:
    """Records and lists of the bit-true front end."""
    if front.kind is not RecordKind.FACTORED16:
        raise ValueError(f"lanes take records of 16 bytes, not {front.kind.value}")
    lists = front.subtile_lists()
    records = np.ascontiguousarray(front.records).view(np.int64)
    return RecordLists(lists.width, lists.height, records, lists.start, lists.entry, lists.cols, lists.rows, lists.tile_pairs, lists.adjusted)


@numba.njit(parallel=True, cache=True)
def _encode(mean, conic, cov, opacity, rgb, spiky, words, flags):
    for i in numba.prange(len(mean)):
        place = np.empty(2, np.int64)
        for k in range(2):
            far = np.rint(mean[i, k] * (1 << MEAN_FRACTION))
            flags[i, 0] |= not abs(far) < _FAR
            place[k] = encode_mean(np.int64(min(max(far, 1.0 - _FAR), _FAR - 1.0)))
        # As `front.records` has it: the scaled conic's Cholesky factor, l2 without the cancellation.
        half = 0.5 * LOG2E
        a = np.sqrt(conic[i, 0] * half)
        b = conic[i, 1] * half / a
        l0, l1, l2 = encode_shape(a), encode_shape(abs(b)), encode_shape(np.sqrt(half / cov[i, 2]))
        code = np.int64(min(np.rint(opacity[i] * OPACITY_LIMIT), OPACITY_LIMIT))
        low = np.uint64(place[0]) | np.uint64(place[1]) << np.uint64(23) | np.uint64(l0) << np.uint64(46) | np.uint64(l1 & 15) << np.uint64(60)
        high = np.uint64(l1 >> 4) | np.uint64(b < 0.0) << np.uint64(10) | np.uint64(l2) << np.uint64(11) | np.uint64(code) << np.uint64(25)
        for k in range(3):
            v = min(np.rint(max(rgb[i, k], 0.0) * (1 << COLOUR_FRACTION)), 1.0 + COLOUR_LIMIT)
            flags[i, 1] |= v > COLOUR_LIMIT
            high |= np.uint64(min(np.int64(v), COLOUR_LIMIT)) << np.uint64(33 + 10 * k)
        high |= np.uint64(spiky[i]) << np.uint64(63)
        words[i, 0], words[i, 1] = np.int64(low), np.int64(high)
        flags[i, 2] = code == 0


def float_lists(projected: Projected, lists: SubtileLists | Bins) -> RecordLists:
    """Records of 16 bytes of the float64 projection, every field rounded once, and any kind of its lists."""
    n = len(projected.depth)
    words, flags = np.zeros((n, 2), np.int64), np.zeros((n, 3), np.bool_)
    _encode(
        projected.mean, projected.conic, projected.cov2d, projected.opacity, projected.rgb, np.asarray(projected.spiky, np.bool_), words, flags,
    )
    reasons = ("mean beyond 2^22 pixels", "colour above 2 clipped", "opacity below 1/510")
    adjusted = {reason: int(count) for reason, count in zip(reasons, flags.sum(axis=0)) if count}
    return RecordLists(lists.width, lists.height, words, lists.start, lists.entry, lists.cols, lists.rows, lists.tile_pairs, adjusted)
