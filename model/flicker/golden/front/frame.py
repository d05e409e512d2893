"""The front end of a frame: a packed scene and a camera to what lies in memory before rendering, bit for bit.

    front = run_front(packed, camera)
    lists = front.subtile_lists()          # for the golden rendering stage and the RTL
    picture = front.render_float(...)      # the records blended in float64
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import dataclass, replace
from enum import Enum

import numba
import numpy as np

from ...arithmetic.ff import ff_bits, ff_exp2_fixed, ff_mul, ff_round, ff_sub, ff_to_fixed_round, pick
from ...errors import FlickerError
from ...front.pops import Seen
from ...front.records import SubtileLists
from ...params import SUBTILE, TILE, Form, SortOrder
from ...scene.camera import Camera
from ...scene.packed import PackedFormat, PackedScene, chunk_codes, fp16_bits
from .colour import (
    COEFFICIENT_FRACTION,
    COLOUR_FRACTION,
    COLOUR_LIMIT,
    TERM_INTEGER,
    basis_functions,
    colour_code,
    constant_factor,
    constant_part,
    group_sums,
    half_coefficient,
    term,
)
from .cull import cull
from .reach import Reach, reach_one, reach_tables, steady_one, tiles_of
from .record import RecordKind, Splats, decode_records, encode_mean, encode_shape, fp16_features, fp16_means, to_fp16
from .reuse import COLOUR_BITS, Reuse, Reused, limit_of
from .setup import CLUSTER_M, FORMATS, KEY_BITS, MEAN_FRACTION, FrameSetup, FrontFormats, image_floats
from .splat import conic_one, constants, largest_component, pixels, place_largest, project_one

SCALE_HEADER_FRACTION = 20  # fraction bits of log2 scale's low end and step
SCALE_HEADER_BITS = 27  # of the low end, saturated
SCALE_STEP_BITS = 17  # of the step, saturated, not negative: up to 1/8
SCALE_FRACTION = 12  # of a log2 scale
SCALE_BITS = 20  # of a log2 scale, saturated
KEY_FIRST_EXPONENT = 124  # code of the least depth's exponent: 0.2 is 1.6 times 2^-3
SQUARE_FIRST_EXPONENT = 122  # of the least distance's square: 0.04 is 1.28 times 2^-5
KEY_EXPONENT_BITS = 5  # up to 2^29
OPACITY_LIMIT = 255
FP16_SHARE, CHUNK_SHARE = 255.0, 2.0**24  # what makes a code of an opacity, by format
FP16_STEP = 2.0**-COEFFICIENT_FRACTION  # in place of a header's


class ListKind(str, Enum):
    """What lists a splat in a tile. ELLIPSE: alpha = 1/255, cut by 3 standard deviations an axis. BOX: 3 standard deviations an axis."""

    ELLIPSE = "ellipse"
    BOX = "box"


class Outcome:
    """What became of a Gaussian, in the order of the tests. The last three leave a record; faint ones and those that miss all pixels are in no list."""

    CULLED, NEAR, OUTSIDE, FAINT, MISSED, LISTED = range(6)


OUTCOMES = {
    Outcome.CULLED: "in a culled cluster", Outcome.NEAR: "nearer than 0.2", Outcome.OUTSIDE: "3-sigma box outside the picture",
    Outcome.FAINT: "opacity below 1/510", Outcome.MISSED: "ellipse holds no pixel", Outcome.LISTED: "listed",
}

Outcome_NEAR, Outcome_OUTSIDE, Outcome_FAINT, Outcome_MISSED, Outcome_LISTED = range(1, 6)  # for numba

# What the lanes take from memory, by Gaussian. q: ff numbers of the mean (codes or FP16). s: log2 scale codes (chunks) or FP16 scales. quat: FP16
# quaternion, or (largest, three codes).
Lanes = namedtuple("Lanes", "chunked cluster q s quat opacity dc sh count")
# By cluster. low: of the mean less the camera, step. scale_low, scale_step: fixed point, 20 fraction bits. dc_low: fixed point, 13 of 20 bits are
# fraction. dc_step, sh_step: colour format.
ClusterValues = namedtuple("ClusterValues", "low step scale_low scale_step dc_low dc_step sh_step")


def lanes_of(packed: PackedScene) -> Lanes:
    """The fields of a packed scene as the lanes decode them, all exact."""
    count = (packed.degrees[packed.cluster] + 1) ** 2
    if packed.format is PackedFormat.CHUNK:
        c = chunk_codes(packed)
        return Lanes(
            True, packed.cluster, c.position.astype(np.float64), c.scale.astype(np.float64), c.rotation.astype(np.float64), c.opacity.astype(np.float64),
            c.dc.astype(np.float64), c.sh.astype(np.float32), count,
        )
    b = fp16_bits(packed)
    wide = lambda bits: np.ascontiguousarray(bits).view(np.float16).astype(np.float64)  # noqa: E731
    sh = np.ascontiguousarray(b.sh).view(np.float16).astype(np.float32)
    return Lanes(
        False, packed.cluster, wide(b.mean), wide(b.scale), wide(b.quat), wide(b.opacity), sh[:, 0].astype(np.float64), np.ascontiguousarray(sh[:, 1:]), count,
    )


@numba.njit(cache=True)
def _cluster_values(origin, step, position, dc, sh, M, P, C, fraction, out_low, out_step, out_dc_low, out_dc_step, out_sh):
    for i in range(origin.shape[0]):
        for k in range(3):
            out_low[i, k] = ff_round(ff_sub(origin[i, k], position[k], M), P)
            out_step[i, k] = ff_round(step[i, k], P)
            out_dc_low[i, k] = ff_to_fixed_round(dc[i, k, 0], fraction, fraction + TERM_INTEGER)
            out_dc_step[i, k] = ff_round(dc[i, k, 1], C)
            for d in range(3):
                out_sh[i, d, k] = ff_round(sh[i, d, k], C)


def cluster_values(packed: PackedScene, setup: FrameSetup) -> ClusterValues:
    """What the lanes need of each cluster's header."""
    f, h = setup.formats, packed.headers
    n = len(packed.table)
    low, step, dc_low, dc_step, sh = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3), np.int64), np.empty((n, 3)), np.empty((n, 3, 3))
    fixed, top = np.zeros((2, n, 3), np.int64), 1 << (SCALE_HEADER_BITS - 1)
    limits = ((-top, top - 1), (0, (1 << SCALE_STEP_BITS) - 1))
    if packed.format is PackedFormat.CHUNK:
        wide = {name: image_floats(h[name]) for name in ("position_low", "position_step", "scale_low", "scale_step", "dc_low", "dc_step", "sh_step")}
        origin, given = wide["position_low"], wide["position_step"]
        given_dc, given_sh = np.stack([wide["dc_low"], wide["dc_step"]], axis=2), wide["sh_step"]
        for k, name in enumerate(("scale_low", "scale_step")):
            fixed[k] = np.clip(np.floor(np.ldexp(wide[name], SCALE_HEADER_FRACTION) + 0.5), *limits[k]).astype(np.int64)
    else:
        origin, given = image_floats(h["origin"]), np.ones((n, 3))
        given_dc, given_sh = np.zeros((n, 3, 2)), np.ones((n, 3, 3))
    _cluster_values(origin, given, setup.position, given_dc, given_sh, CLUSTER_M, f.position, f.colour, f.term, low, step, dc_low, dc_step, sh)
    return ClusterValues(low, step, fixed[0], fixed[1], dc_low, dc_step, sh)


@numba.njit
def chunk_scale(code, low, step, M):
    """ff: a scale of a chunk from its code, and low end and step of log2 in fixed point of `SCALE_HEADER_FRACTION` bits."""
    drop = SCALE_HEADER_FRACTION - SCALE_FRACTION
    top = 1 << (SCALE_BITS - 1)
    return ff_exp2_fixed(min(max((low + code * step + (1 << (drop - 1))) >> drop, -top), top - 1), SCALE_FRACTION, M)


@numba.njit
def _scale(chunked, code, low, step, M):
    return chunk_scale(np.int64(code), low, step, M) if chunked else ff_round(code, M)


@numba.njit
def _quaternion(chunked, c, M):
    if not chunked:
        return ff_round(c[0], M), ff_round(c[1], M), ff_round(c[2], M), ff_round(c[3], M)
    a, b, d = 2.0 * c[1] - 1023.0, 2.0 * c[2] - 1023.0, 2.0 * c[3] - 1023.0
    most = largest_component(np.int64(a), np.int64(b), np.int64(d), M)
    return place_largest(np.int64(c[0]), most, ff_round(a, M), ff_round(b, M), ff_round(d, M))


@numba.njit
def project_lane(
    i, lanes, values, view, focal, row_x, row_x_z, row_y, row_y_z, least, limit, middle, antialiased, const, P, S, fraction=MEAN_FRACTION,
):
    """Projection of Gaussian i."""
    c = lanes.cluster[i]
    s = np.empty(3)
    for k in range(3):
        s[k] = _scale(lanes.chunked, lanes.s[i, k], values.scale_low[c, k], values.scale_step[c, k], S)
    w, x, y, z = _quaternion(lanes.chunked, lanes.quat[i], S)
    return project_one(
        values.low[c], values.step[c], lanes.q[i], s, w, x, y, z, view, focal, row_x, row_x_z, row_y, row_y_z, least, limit, middle,
        CHUNK_SHARE if lanes.chunked else FP16_SHARE, antialiased, const, P, S, fraction,
    )


@numba.njit
def sort_key(by_distance, depth, square, M, bits=KEY_BITS):
    """Key of a splat, `bits` bits: of its depth, or of its distance to the camera, given as the square.

    The code of the depth's ff number less that of 2^-3, saturated, first bits first. Codes keep the order; a step is 2^-19 of a depth with 24 bits, depths
    from 2^29 on share the last key. Of the square the code without its last bit, less that of 2^-5: an exponent of a square is twice the distance's, so that
    a step is 2^-19 of a distance at most, and distances from 2^29.5 on share the last key.
    """
    drop = KEY_EXPONENT_BITS + M - bits
    number = pick(by_distance, ff_bits(square, M) >> 1, ff_bits(max(depth, 0.0), M))
    first = pick(by_distance, SQUARE_FIRST_EXPONENT << (M - 1), KEY_FIRST_EXPONENT << M)
    code = min(max(number - first, 0), (1 << (KEY_EXPONENT_BITS + M)) - 1)
    return code >> drop if drop > 0 else code << -drop


@numba.njit
def depth_key(depth, M, bits=KEY_BITS):
    """`sort_key` of a depth."""
    return sort_key(False, depth, 0.0, M, bits)


@numba.njit
def scaled_opacity(scale, opacity, M, limit=OPACITY_LIMIT):
    """Nearest integer to an opacity, an ff number, times `scale`; at most `limit`."""
    return min(ff_to_fixed_round(ff_mul(scale, opacity, M), 0, 16), limit)


@numba.njit
def opacity_code(chunked, opacity, scale, M):
    """255 times the opacity, to the nearest integer, at most 255; in chunks the code itself. scale: of `project_one`, with an antialiased splat's factor.

    opacity: FP16's number, or the code of a chunk, which as the bits of an FP16 number means 2^-24 of itself.
    """
    return scaled_opacity(scale, opacity / CHUNK_SHARE if chunked else ff_round(opacity, M), M)


@numba.njit
def colour_lane(i, lanes, values, p, factor, M, w, basis, coefficient, rgb):
    """Colour of Gaussian i into rgb (3,), whole numbers of w.term (13) fraction bits; it may be negative. factor: of the constant function. basis, coefficient:
    (17,) of whole numbers, overwritten."""
    c, count = lanes.cluster[i], lanes.count[i]
    basis[:], coefficient[:] = 0, 0
    degree = 0 if count == 1 else (1 if count == 4 else (2 if count == 9 else 3))
    if degree:
        basis_functions(ff_round(p.d0, M), ff_round(p.d1, M), ff_round(p.d2, M), degree, basis, M, w.direction, w.harmonics)
    drop, half_step = w.harmonics - w.sums, 2.0**-w.coefficient
    for channel in range(3):
        low = pick(lanes.chunked, values.dc_low[c, channel], 1 << (w.term - 1))
        step = pick(lanes.chunked, values.dc_step[c, channel], factor)
        total = constant_part(low, step, ff_round(lanes.dc[i, channel], M), M, w.term)
        for j in range(1, count):
            value = np.float64(lanes.sh[i, j - 1, channel])
            coefficient[j] = np.int64(value) if lanes.chunked else half_coefficient(value, w.coefficient)
        a, b = group_sums(basis[1:5], coefficient[1:5], drop)
        e, f = group_sums(basis[5:9], coefficient[5:9], drop)
        g, h = group_sums(basis[9:13], coefficient[9:13], drop)
        k, l = group_sums(basis[13:17], coefficient[13:17], drop)  # noqa: E741
        sums = (a, b + e + f, g + h + k + l)
        for d in range(degree):
            total += term(sums[d], pick(lanes.chunked, values.sh_step[c, d, channel], half_step), M, w.sums, w.term)
        rgb[channel] = total


@numba.njit(parallel=True, cache=True)
def _splats(
    index, lanes, values, view, focal, row_x, row_x_z, row_y, row_y_z, least, limit, middle, antialiased, const, width, height, by_distance, factor, logs,
    sigmas, cut, inverse, box, conic, P, S, C, w, given, outcome, key, words, unrounded, entries, flags, places, numbers,
):
    """The Gaussians `index` (of kept clusters): their outcome, key, record, number of entries, and what `_entries` needs of them. given: int64 (n,), colours of
    records that are known, -1: to be computed; (0,): none is."""
    cols = (width + TILE - 1) // TILE
    none = np.empty(0, np.int32)
    for j in numba.prange(len(index)):
        i = index[j]
        p = project_lane(i, lanes, values, view, focal, row_x, row_x_z, row_y, row_y_z, least, limit, middle, antialiased, const, P, S, w.mean)
        if p.near:
            outcome[j] = Outcome_NEAR
            continue
        x0, x1 = pixels(p.x, p.radius_x, width, w.mean)
        y0, y1 = pixels(p.y, p.radius_y, height, w.mean)
        if x0 > x1 or y0 > y1:
            outcome[j] = Outcome_OUTSIDE
            continue
        code = opacity_code(lanes.chunked, lanes.opacity[i], p.scale, S)
        steady = steady_one(p, inverse, S)
        r = reach_one(p.x, p.y, p.sx, p.sy, steady, code, box, width, height, logs, sigmas, cut, S, w.mean)
        count = tiles_of(box, p.x, p.y, p.l2, r, cols, S, 0, none, none, w.mean) if code > 0 else 0
        outcome[j] = Outcome_LISTED if count > 0 else (Outcome_MISSED if code > 0 else Outcome_FAINT)
        entries[j] = count
        places[j, 0], places[j, 1], places[j, 2], places[j, 3], places[j, 4], places[j, 5], places[j, 6] = p.x, p.y, r.x0, r.x1, r.y0, r.y1, r.right
        numbers[j, 0], numbers[j, 1], numbers[j, 2], numbers[j, 3] = p.l2, r.i0, r.kappa, r.limit
        key[j] = sort_key(by_distance, p.t2, p.square, P, w.key)
        flags[j, 0] = p.far
        rgb = np.empty(3, np.int64)
        known = given[j] if len(given) else -1
        if known >= 0:
            for k in range(3):
                rgb[k] = (known >> 10 * k & COLOUR_LIMIT) << w.term - COLOUR_FRACTION
        else:
            colour_lane(i, lanes, values, p, factor, C, w, np.empty(17, np.int64), np.empty(17, np.int64), rgb)
        unrounded[j, 0], unrounded[j, 1], unrounded[j, 2] = conic_one(p, S) if conic else (p.l0, p.l1, p.l2)
        unrounded[j, 3] = code / 255.0 if lanes.chunked or antialiased else lanes.opacity[i]
        for k in range(3):
            unrounded[j, 4 + k] = max(rgb[k], 0) / (1 << w.term)
        flags[j, 2] = p.spiky
        if conic:
            words[j, 0], words[j, 1] = p.x, p.y
            continue
        x, y = encode_mean(p.x), encode_mean(p.y)
        low = np.uint64(x) | np.uint64(y) << np.uint64(23)
        l0, l1, l2 = encode_shape(p.l0), encode_shape(abs(p.l1)), encode_shape(p.l2)
        low |= np.uint64(l0) << np.uint64(46)
        low |= np.uint64(l1 & 15) << np.uint64(60)
        high = np.uint64(l1 >> 4) | np.uint64(p.l1 < 0.0) << np.uint64(10) | np.uint64(l2) << np.uint64(11) | np.uint64(code) << np.uint64(25)
        for k in range(3):
            v = colour_code(rgb[k], w.term)
            if v > COLOUR_LIMIT:
                v = COLOUR_LIMIT
                flags[j, 1] = True
            high |= np.uint64(v) << np.uint64(33 + 10 * k)
        high |= np.uint64(p.spiky) << np.uint64(63)
        words[j, 0], words[j, 1] = np.int64(low), np.int64(high)


@numba.njit(parallel=True, cache=True)
def _entries(start, places, numbers, box, cols, S, fraction, tile, mask):
    """Entries of the splats that `_splats` left in places and numbers, those of the j-th from place start[j] on."""
    for j in numba.prange(len(start) - 1):
        a, b = places[j], numbers[j]
        tiles_of(box, a[0], a[1], b[0], Reach(a[2], a[3], a[4], a[5], b[1], b[2], b[3], a[6]), cols, S, start[j], tile, mask, fraction)


@dataclass(eq=False)
class FrontFrame:
    """What the front end leaves, in record order (R records, E list entries).

    gaussian: int64 (R,), Gaussians of the packed scene that have a record; not all of them are listed.
    number: int64 (R,), record numbers: record i lies at `number[i]` times the record's size.
    records: uint8 (R, bytes).
    key: uint32 (R,), of depths or distances (`sort_key`). entry_splat: int32 (E,), record of each entry; entry_tile: int32 (E,), row by row; entry_mask: uint8
    (E,), bits 2 row + column of the sub-tiles.
    clusters_kept: of the cluster test. outcomes: Gaussians by what became of them. adjusted: records with a value that did not fit, by reason.
    unrounded: float64 (R, 7), what shape (3), opacity and colour (3) of the records are rounded from; None where the RTL made the frame. reused: what was read
    from the colour store and written to it; None where no colours are kept.
    """

    camera: Camera
    packed: PackedScene
    kind: RecordKind
    clusters_kept: int
    gaussian: np.ndarray
    number: np.ndarray
    records: np.ndarray
    key: np.ndarray
    entry_splat: np.ndarray
    entry_tile: np.ndarray
    entry_mask: np.ndarray
    outcomes: dict[str, int]
    adjusted: dict[str, int]
    unrounded: np.ndarray | None = None
    formats: FrontFormats = FORMATS
    reused: Reused | None = None

    def splats(self) -> Splats:
        """What the records mean. Means are float64 where the format has other than 1/128 pixel."""
        splats = decode_records(self.records, self.kind)
        off = MEAN_FRACTION - self.formats.mean
        return replace(splats, mean=splats.mean * 2.0**off) if off else splats

    def sorted_subtiles(self) -> tuple[np.ndarray, np.ndarray]:
        """start int64 (S + 1,), record int32: records of each sub-tile, row by row, by key, equal keys in record order."""
        cols, rows = (-(-n // SUBTILE) for n in (self.camera.width, self.camera.height))
        order = np.argsort(self.key, kind="stable")
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order))
        by_rank = np.argsort(rank[self.entry_splat], kind="stable")
        tile_cols = -(-self.camera.width // TILE)
        return _subtiles(self.entry_splat[by_rank], self.entry_tile[by_rank], self.entry_mask[by_rank], tile_cols, cols, rows)

    def seen(self) -> Seen:
        """What pops are counted of (`flicker.front.pops`). Not of a frame of the RTL, whose records do not say whose they are."""
        start, entry = self.sorted_subtiles()
        splats, factored = self.splats(), self.kind.form is Form.FACTORED
        s0, s1, s2 = splats.shape.T
        energy = math.log(2.0) * np.stack([s0 * s0, 2.0 * s0 * s1, s1 * s1 + s2 * s2], axis=1) if factored else splats.shape
        order = np.argsort(self.key, kind="stable")
        return Seen.of(self.gaussian, order, splats.mean / (1 << MEAN_FRACTION), energy, splats.opacity, start, entry, self.camera)

    def subtile_lists(self) -> SubtileLists:
        """Lists and splats as the rendering stage takes them."""
        start, entry = self.sorted_subtiles()
        splats = self.splats()
        cols, rows = (-(-n // SUBTILE) for n in (self.camera.width, self.camera.height))
        return SubtileLists(
            self.camera.width, self.camera.height, self.kind.form, fp16_features(splats), splats.spiky, start, entry,
            fp16_means(splats, start, entry, cols), cols, rows, len(self.entry_tile), dict(self.adjusted),
        )


@numba.njit(cache=True)
def _subtiles(splat, tile, mask, tile_cols, cols, rows):
    count = np.zeros(cols * rows + 1, np.int64)
    for turn in range(2):
        if turn == 1:
            start = np.cumsum(count)
            fill = start[:-1].copy()
            entry = np.empty(start[-1], np.int32)
        for e in range(len(tile)):
            for k in range(4):
                if mask[e] >> k & 1:
                    s = (tile[e] // tile_cols * 2 + k // 2) * cols + tile[e] % tile_cols * 2 + k % 2
                    if turn == 0:
                        count[s + 1] += 1
                    else:
                        entry[fill[s]] = splat[e]
                        fill[s] += 1
    return start, entry


def run_front(
    packed: PackedScene, camera: Camera, lists: ListKind = ListKind.ELLIPSE, kind: RecordKind = RecordKind.FACTORED16, formats: FrontFormats = FORMATS,
    order: SortOrder = SortOrder.DEPTH, reuse: Reuse | None = None,
) -> FrontFrame:
    """Cull, project, colour, record and list a packed scene; order: what keys are of; reuse: keep colours, and show those of frames before. FlickerError for
    pictures beyond 4096x4096, and records of 32 bytes with reuse."""
    setup = FrameSetup.of(camera, formats)
    keep = cull(packed, setup)
    if reuse is not None and kind is not RecordKind.FACTORED16:
        raise FlickerError("records of 32 bytes: colours are kept as records of 16 bytes have them")
    lanes, values = lanes_of(packed), cluster_values(packed, setup)
    index = np.flatnonzero(keep[packed.cluster])
    n = len(index)
    given = np.empty(0, np.int64)
    if reuse is not None:
        lasting = reuse.store.lasting(setup, limit_of(reuse.epsilon), reuse.generation)
        given = np.where(reuse.store.there & lasting[packed.cluster], reuse.store.entry & (1 << COLOUR_BITS) - 1, -1)[index]
    outcome, key, words = np.zeros(n, np.int8), np.zeros(n, np.uint32), np.zeros((n, 2), np.int64)
    conic = kind is RecordKind.CONIC32
    unrounded, entries, flags = np.zeros((n, 7)), np.zeros(n, np.int64), np.zeros((n, 3), np.bool_)
    places, numbers = np.zeros((n, 7), np.int64), np.zeros((n, 4))
    registers = (
        setup.view, setup.focal, setup.row_x, setup.row_x_z, setup.row_y, setup.row_y_z, setup.least, setup.limit, setup.middle, packed.antialiased,
        constants(formats), setup.width, setup.height, order is SortOrder.DISTANCE,
    )
    tables, box = reach_tables(formats), lists is ListKind.BOX
    P, S, C = formats.position, formats.shape, formats.colour
    _splats(
        index, lanes, values, *registers, constant_factor(formats), *tables, box, conic, P, S, C, formats.widths, given,
        outcome, key, words, unrounded, entries, flags, places, numbers,
    )
    kept = np.flatnonzero(outcome >= Outcome.FAINT)
    gaussian = index[kept]
    start = np.concatenate([[0], np.cumsum(entries[kept])])
    tile, mask = np.empty(start[-1], np.int32), np.empty(start[-1], np.uint8)
    _entries(start, places[kept], numbers[kept], box, -(-camera.width // TILE), S, formats.mean, tile, mask)
    cluster = packed.cluster[gaussian]
    before = np.searchsorted(cluster, np.arange(len(packed.table)))
    number = packed.first[cluster] + np.arange(len(gaussian)) - before[cluster]
    outcomes = {OUTCOMES[Outcome.CULLED]: len(packed) - n}
    outcomes |= {OUTCOMES[k]: int((outcome == k).sum()) for k in range(1, 6)}
    unrounded = unrounded[kept]
    records, adjusted = _records(kind, words[kept], unrounded, flags[kept])
    reused = None
    if reuse is not None:
        entry = words[kept, 1] >> 33 & (1 << COLOUR_BITS) - 1 | lanes.opacity[gaussian].astype(np.int64) << COLOUR_BITS
        reused = reuse.store.step(setup, keep, lasting, gaussian, entry, reuse.generation)
    return FrontFrame(
        camera, packed, kind, int(keep.sum()), gaussian, number, records, key[kept],
        np.repeat(np.arange(len(kept), dtype=np.int32), entries[kept]), tile, mask, outcomes, adjusted, unrounded, formats, reused,
    )


def _records(kind: RecordKind, words: np.ndarray, unrounded: np.ndarray, flags: np.ndarray) -> tuple[np.ndarray, dict[str, int]]:
    """uint8 (R, bytes) and what did not fit."""
    if kind is RecordKind.FACTORED16:
        adjusted = {"mean beyond 2^22 pixels": int(flags[:, 0].sum()), "colour above 2 clipped": int(flags[:, 1].sum())}
        return np.ascontiguousarray(words).view(np.uint8).reshape(-1, 16), {k: v for k, v in adjusted.items() if v}
    records = np.zeros((len(words), 32), np.uint8)
    records[:, :8] = words.astype("<i4").view(np.uint8)
    beyond = (np.abs(unrounded) > 65504.0).any(axis=1)
    records[:, 8:22] = to_fp16(unrounded).view(np.uint8)
    records[:, 22] = flags[:, 2]
    adjusted = {"mean beyond 2^22 pixels": int(flags[:, 0].sum()), "value beyond FP16 clamped": int(beyond.sum())}
    return records, {k: v for k, v in adjusted.items() if v}
