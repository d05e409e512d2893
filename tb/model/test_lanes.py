"""Lanes in the log domain: every unit against exact arithmetic, masks against the lane itself, traps of the log domain, frames, the command line.

State space: records of any 128 bits and splats made to break masks (axis ratios to 10,000, means thousands of pixels away, footprints of 0.1 pixel to the whole
screen, opacities at 1/255 and 1), several formats. Not covered: RTL, cycles.
"""

from __future__ import annotations

import json
import math
from fractions import Fraction
from types import SimpleNamespace
from zlib import crc32

import numba
import numpy as np
import pytest
from flicker_tb.command import flicker
from flicker_tb.runner import seed
from gen_params import lane_package
from scene_samples import random_scene

from flicker.errors import FlickerError
from flicker.explore.stability import FAMILIES
from flicker.front.binning import bin_boxes
from flicker.front.view import DEMO, View, load_view
from flicker.golden.chip import render_chip
from flicker.golden.front.blend import blend_records
from flicker.golden.front.frame import run_front
from flicker.golden.front.record import RecordKind, decode_records
from flicker.golden.front.to_splat import record_to_splat
from flicker.golden.lanes.formats import FORMATS, LaneFormats, h_by_line, h_lines, h_of, h_table, tables
from flicker.golden.lanes.lane import BLENDED, FINISHED, SKIPPED, blend, colour_bits, log_alpha, pair, transmittance_bits
from flicker.golden.lanes.lists import RecordLists, float_lists, front_lists
from flicker.golden.lanes.mask import place_of, root_up, row_interval, row_mask
from flicker.golden.lanes.render import COUNTS, lane_masks, render_lanes
from flicker.golden.lanes.setup import fields_of, splat_setup, u_of, v_of
from flicker.params import ALPHA_MAX, LANE_COUNTS, Coords, Form, RenderConfig
from flicker.pipeline import Engine, Front, render_view
from flicker.scene.files import save_ply
from flicker.scene.image import load_picture
from flicker.scene.metrics import psnr
from flicker.scene.packing import pack
from flicker.scene.real import REAL_VIEWS, real_scenes

# The default, the narrowest and widest of the search, tables of h and lines.
WIDTHS = (
    FORMATS, LaneFormats(uv=6, log=7, sum=10, mantissa=7, accumulator=10, pieces=2, mask=4, root=4),
    LaneFormats(uv=8, log=8, sum=10, mantissa=7, pieces=0, mask=8, root=8), LaneFormats(log=14, pieces=0, mask=4, root=8),
    LaneFormats(uv=12, guard=6, log=14, sum=20, mantissa=12, accumulator=20, pieces=0, mask=10),
)
by_width = pytest.mark.parametrize("formats", WIDTHS, ids=lambda f: f.name)


def record(x=0, y=0, l0=0, l1=0, l2=0, opacity=255, colour=(512, 256, 1023), negative=False) -> tuple[int, int]:
    """A record as two int64. x, y: fields of 23 bits; l0, l1, l2: codes of 14 bits."""
    value = x | y << 23 | l0 << 46 | l1 << 60 | negative << 74 | l2 << 75 | opacity << 89
    value |= sum(c << 97 + 10 * k for k, c in enumerate(colour))
    low, high = value & (1 << 64) - 1, value >> 64
    return tuple(int(np.uint64(v).view(np.int64)) for v in (low, high))  # type: ignore[return-value]


def shape_code(value: float) -> int:
    """The nearest code of a positive shape number."""
    mantissa, exponent = math.frexp(value)
    return (exponent - 1 + 30 << 9) + round((2 * mantissa - 1) * 512)


def any_bits(rng: np.random.Generator, count: int) -> np.ndarray:
    """int64 (count, 2): random bits, fields of all zeros and all ones among them."""
    words = rng.integers(0, 1 << 64, (count, 2), dtype=np.uint64)
    words[rng.random((count, 2)) < 0.02] = 0
    words[rng.random((count, 2)) < 0.02] = np.uint64((1 << 64) - 1)
    return words.view(np.int64)


def one_subtile(records: np.ndarray) -> RecordLists:
    """All records in the list of the only sub-tile."""
    n = len(records)
    return RecordLists(8, 8, np.ascontiguousarray(records), np.array([0, n]), np.arange(n, dtype=np.int32), 1, 1, n)


def adversarial(rng: np.random.Generator, count: int) -> np.ndarray:
    """int64 (count, 2): splats whose edge, or the ridge of a thin one, goes through the sub-tile at (0, 0)."""
    short = np.exp(rng.uniform(np.log(0.1), np.log(1000), count))
    ratio = np.where(rng.random(count) < 0.5, 1, np.exp(rng.uniform(0, np.log(1e4), count)))
    angle = np.where(rng.random(count) < 0.5, rng.choice((0.25, 0.75), count) * np.pi + rng.normal(0, 0.05, count), rng.uniform(0, np.pi, count))
    opacity = rng.choice((1 / 255, 1.5 / 255, 2 / 255, 0.1, 0.5, 0.99, 1.0), count)
    # From a point of the sub-tile to the mean: anywhere along the long axis, and across it as far as the splat reaches, about.
    reach = np.sqrt(2 * np.log(np.maximum(255 * opacity, 1)))
    cos, sin = np.cos(angle), np.sin(angle)
    along = rng.uniform(-1, 1, count) * np.minimum(short * ratio * reach, rng.choice((8, 4096, 60000), count))
    across = rng.choice((-1, 1), count) * np.sqrt(short**2 + 0.3) * reach * rng.uniform(0.7, 1.1, count) * (rng.random(count) < 0.7)
    mean = rng.uniform(-0.5, 7.5, (count, 2)) + np.stack([along * cos - across * sin, along * sin + across * cos], 1)
    a, b = (short * ratio) ** 2, short**2
    xx, xy, yy = a * cos**2 + b * sin**2 + 0.3, (a - b) * cos * sin, a * sin**2 + b * cos**2 + 0.3
    det = a * b + 0.3 * (a + b) + 0.09
    projected = SimpleNamespace(
        mean=mean, conic=np.stack([yy / det, -xy / det, xx / det], 1), cov2d=np.stack([xx, xy, yy], 1), opacity=opacity, rgb=rng.uniform(0, 2.1, (count, 3)),
        spiky=ratio > 3, depth=np.zeros(count),
    )
    return float_lists(projected, one_subtile(np.zeros((0, 2), np.int64))).records  # type: ignore[arg-type]


def nearest(x: Fraction) -> int:
    """Ties upwards."""
    return math.floor(x + Fraction(1, 2))


@by_width
def test_setup_is_exact(formats):
    """Every number of the setup, from records of any bits in any sub-tile, against fractions: products round once, their sum saturates once."""
    rng, t = np.random.default_rng(seed()), tables(formats)
    unit = Fraction(1, 1 << formats.place)
    edge = 32 << formats.place
    cancelled = saturated = 0
    records = np.concatenate([any_bits(rng, 300), adversarial(rng, 300)])
    meant = decode_records(records.view(np.uint8).reshape(-1, 16), RecordKind.FACTORED16)
    for k, (low, high) in enumerate(records.tolist()):
        col, row = (0, 0) if k >= 300 else rng.integers(0, 4096, 2).tolist()
        s = splat_setup(low, high, col, row, t)
        x, y = (Fraction(8 * place) + Fraction(7, 2) - Fraction(int(mean), 128) for place, mean in zip((col, row), meant.mean[k]))
        l0, l1, l2 = (Fraction(float(v)) for v in meant.shape[k])
        assert (Fraction(s.x, 128), Fraction(s.y, 128)) == (x, y)
        assert (s.p, s.q) == (nearest(l0 * x / unit), nearest(l1 * y / unit))
        assert s.w == min(max(s.p + s.q, -edge), edge - 1) and s.z == min(max(nearest(l2 * y / unit), -edge), edge - 1)
        assert (s.s0, s.s1, s.s2) == tuple(nearest(v / 2 / unit) for v in (l0, l1, l2))
        assert s.lo == t.lo[s.opacity] and meant.opacity[k] == s.opacity / 255
        assert [s.red, s.green, s.blue] == [round(512 * c) for c in meant.rgb[k]]
        exact = l0 * x + l1 * y
        if abs(exact) < 31:
            assert abs(s.w * unit - exact) <= unit
            cancelled += abs(s.p) > 2 * edge
        saturated += abs(exact) > 32
    assert cancelled > 10 and saturated > 100


def test_fields_are_those_of_the_stage_of_channels():
    """Both units that read records of 16 bytes read the same numbers."""
    for low, high in any_bits(np.random.default_rng(seed()), 300).tolist():
        f, bits = fields_of(low, high), (low & (1 << 64) - 1) | (high & (1 << 64) - 1) << 64
        s = record_to_splat(bits, RecordKind.FACTORED16, 0, 0)
        assert (s.x.absolute, s.y.absolute) == (f.x, f.y)
        half = [np.uint16(v).view(np.float16) for v in (s.opacity, s.red, s.green, s.blue)]
        assert half == [np.float16(v) for v in (f.opacity / 255, f.red / 512, f.green / 512, f.blue / 512)]


@by_width
def test_lane_arithmetic(formats):
    """La, h, weight and colour against real numbers: each within its roundings."""
    rng, t, f = np.random.default_rng(seed()), tables(formats), formats
    outcomes = {SKIPPED: 0, BLENDED: 0, FINISHED: 0}
    for _ in range(4000):
        u, v = (int(n) for n in rng.integers(-3 << f.uv, 3 << f.uv, 2) * rng.choice((1, 1, 0, 0.1)))
        code, total = int(rng.integers(1, 256)), round(t.s_max * rng.random() ** rng.choice((0.1, 1, 3)))
        la = log_alpha(u, v, t.lo[code], t)
        exact = (u * u + v * v) / 4**f.uv - math.log2(code / 255)
        assert abs(la / 2**f.log - exact) <= 2.0**-f.log
        r = pair(la, total, t)
        outcomes[r.outcome] += 1
        if exact > math.log2(255) + 2.0**-f.log:
            assert r.outcome == SKIPPED
        if r.outcome == SKIPPED:
            assert la > t.limit and r.s_next == total
            continue
        x = -math.log2(ALPHA_MAX) if r.clamped else la / 2**f.log
        assert (r.x, r.s_next) == ((t.x_max, total + t.h_max) if r.clamped else (la << f.sum - f.log, total + t.h[la]))
        assert r.outcome == (BLENDED if r.s_next <= t.s_max else FINISHED)
        weight = 2.0 ** -(x + total / 2**f.sum)
        assert abs(r.mantissa * 2.0 ** -(r.exponent + f.mantissa) / weight - 1) < 1.8 * 2.0**-f.mantissa
        colour, before = int(rng.integers(0, 1024)), int(rng.integers(0, 2 << f.accumulator))
        m, after = blend(before, r.exponent, r.mantissa, colour, t)
        assert after == before + m and m == nearest(Fraction(r.mantissa * colour * 2**f.accumulator, 512 << r.exponent + f.mantissa))
    assert min(outcomes.values()) > 100
    assert blend((4 << f.accumulator) - 1, 0, t.exp2[0], 1023, t)[1] == (4 << f.accumulator) - 1


@by_width
def test_results_of_pixels(formats):
    """T and colours in FP16: T of an untouched pixel is exactly 1, every S within a step of FP16, never subnormal; colours to nearest even."""
    t, f = tables(formats), formats
    assert transmittance_bits(0, t) == 0x3C00
    for total in [*range(0, 40), *np.random.default_rng(seed()).integers(0, t.s_max, 3000).tolist(), t.s_max]:
        bits = transmittance_bits(total, t)
        assert 0x400 <= bits <= 0x3C00
        exact = 2.0 ** -(total / 2**f.sum)
        assert abs(float(np.uint16(bits).view(np.float16)) / exact - 1) < 2.0**-11 + math.log(2) * 2.0**-13 + 1e-9
    for c in np.random.default_rng(seed()).integers(0, 4 << f.accumulator, 500).tolist():
        assert colour_bits(c, t) == np.float16(c / 2.0**f.accumulator).view(np.uint16)


@by_width
def test_clamp_takes_constants(formats):
    """At alpha >= 0.99 La and h are those of 0.99 exactly, whatever stands in the table beside it; La = 0, where h is infinite, is among them."""
    t, unit = tables(formats), 2.0**formats.sum
    assert t.x_max == round(-math.log2(0.99) * unit) and t.h_max == round(-math.log2(0.01) * unit)
    assert t.clamp / 2**formats.log <= -math.log2(0.99) < (t.clamp + 1) / 2**formats.log
    for la in range(t.clamp + 1):
        r = pair(la, 0, t)
        assert (r.clamped, r.x, r.h, r.outcome) == (True, t.x_max, t.h_max, BLENDED)
    first = pair(t.clamp + 1, 0, t)
    assert not first.clamped and first.h < t.h_max and first.x > t.x_max
    assert t.h[t.clamp + 1 :].max() < t.h_max and t.h[t.clamp + 1 :].min() > 0
    frame = render_lanes(one_subtile(np.array([record(opacity=255)])), formats)  # l = 0: alpha is 1 everywhere
    assert frame.total("clamped") == 64
    assert abs(frame.pixels[..., 0].view(np.float16).astype(float) - 0.01).max() < 0.01 * 2.0**-10


@by_width
def test_finish_limit(formats):
    """Two layers of 0.99 leave T = 1e-4 and are both blended, as in the reference; what would take T below finishes the pixel unblended."""
    t = tables(formats)
    assert t.s_max == 2 * t.h_max and abs(t.s_max / 2**formats.sum + math.log2(1e-4)) < 2.0**-formats.sum
    for last in (255, 128, 1):
        lists = one_subtile(np.array([record(), record(), record(opacity=last)]))
        frame = render_lanes(lists, formats)
        assert frame.total("blended") == 128 and frame.total("pixels_finished") == 64 and frame.needed[0] == 3
        image = blend_records(lists.splats(), Form.FACTORED, lists.start, lists.entry, 8, 8)
        third = blend_records(lists.splats(), Form.FACTORED, np.array([0, 2]), lists.entry, 8, 8)
        assert np.array_equal(image, third)  # so says float64, too
    # One layer of 0.99 and one of 253/255 clamp alike; 0.99 then 0.98 leaves 2e-4, and a layer of 0.4 more is blended, one of 0.6 is not.
    for opacity, blended in ((round(0.4 * 255), 3), (round(0.6 * 255), 2)):
        frame = render_lanes(one_subtile(np.array([record(), record(opacity=250), record(opacity=opacity)])), formats)
        assert frame.total("blended") == blended * 64


@by_width
def test_opacity_and_limit_share_a_rounding(formats):
    """o = 1/255 passes at its own centre, and nowhere else; code 0 passes nowhere, in no mask."""
    t = tables(formats)
    assert t.lo[1] == t.limit and t.lo[0] > t.limit
    for bit in range(64):
        col, row = place_of(bit)
        for shape in ((3.99, 3.99, 3.99), (1.5, 0.3, 0.2), (1.2345, 1.1, 1.5)):
            l0, l1, l2 = (shape_code(v) for v in shape)
            for negative in (False, True):
                words = record(col << 7, row << 7, l0, l1, l2, opacity=1, negative=negative)
                mask, passes = lane_masks(one_subtile(np.array([words])), formats)
                s = splat_setup(*words, 0, 0, t)
                assert (u_of(s, col, row, t), v_of(s, row, t)) == (0, 0)
                assert int(passes[0]) >> bit & 1 and int(mask[0]) >> bit & 1
                if formats.uv > 6:
                    assert int(passes[0]) == 1 << bit
                mask, passes = lane_masks(one_subtile(np.array([record(col << 7, row << 7, l0, l1, l2, opacity=0, negative=negative)])), formats)
                assert mask[0] == 0 and passes[0] == 0


def test_faint_layers_are_not_biased():
    """1,000 layers of alpha = 1/255 leave T within 1.5 %; with 11 fraction bits it is 12 % off, which is why `sum` has more. Nor does h have a mean error."""
    exact = (254 / 255) ** 1000
    records = np.array([record(opacity=1)] * 1000)

    def left(formats: LaneFormats) -> float:
        return float(render_lanes(one_subtile(records), formats).pixels[0, 0, 0].view(np.float16))

    for formats in (FORMATS, LaneFormats(pieces=0), LaneFormats(uv=12, log=14, sum=20, pieces=0)):
        assert abs(left(formats) / exact - 1) < 0.015
    assert abs(left(LaneFormats(uv=12, log=11, sum=11, pieces=0)) / exact - 1) > 0.1
    t = tables(FORMATS)
    for octave in range(FORMATS.log + 3):
        la = np.arange(max(1 << octave, t.clamp + 1), min(2 << octave, t.limit + 1))
        if len(la):
            h = h_of(la / 2.0**FORMATS.log) * 2.0**FORMATS.sum
            assert abs(t.h[la].sum() / h.sum() - 1) < 3e-4 and abs(t.h[la] / h - 1).max() < 0.006


@pytest.mark.parametrize(("formats", "message"), [
    (LaneFormats(pieces=0), "h by lines only"), (LaneFormats(sum=12), "wants more of them"), (LaneFormats(log=10), "a power of two"),
])
def test_formats_that_the_rtl_lacks(formats: LaneFormats, message: str):
    with pytest.raises(FlickerError, match=message):
        lane_package(formats)


def test_lines_of_h():
    """More pieces come closer to the table; exact multiples of what the circuit does: a table of value and fall, one product, one rounding."""
    error = []
    for pieces in (2, 3, 4, 5):
        f = LaneFormats(pieces=pieces)
        t = tables(f)
        table, lines = h_table(f, t.clamp + 1, t.limit), h_lines(f, t.clamp + 1, t.limit)
        assert all(t.h[la] == h_by_line(la, *lines, f) for la in range(t.clamp + 1, t.limit + 1))
        assert max(a.max() for a in lines) < 1 << f.sum + 5 and min(a.min() for a in lines) >= 0
        error.append(np.abs(t.h - table)[t.clamp + 1 :].max())
    assert all(b < a / 2.5 for a, b in zip(error, error[1:]))


@by_width
def test_roots_are_never_too_small(formats):
    """For every rest that a row can have, and each row's bound against the largest |u| that passes the lane."""
    t = tables(formats)
    most = int(t.mask_bound.max())
    for rest in [*range(min(most, 3000)), *np.random.default_rng(seed()).integers(0, most, 2000).tolist(), most - 1]:
        assert math.isqrt(rest) <= root_up(rest, t) <= 3 << formats.mask
    for code in range(1, 256):
        top = math.isqrt(max(int(t.bound[code]) - 1, 0))
        assert log_alpha(top, 0, t.lo[code], t) <= t.limit < log_alpha(top + 1, 0, t.lo[code], t)


@numba.njit
def pairs_beyond(t):
    """Pairs of an opacity and a v, with the largest |u| that passes the lane's test: how many, and how many whose row is empty or does not reach that far."""
    pairs = beyond = 0
    for code in range(256):
        u = 1 << t.uv + 2
        for size in range(1 << t.uv + 2):
            while u >= 0 and log_alpha(u, size, t.lo[code], t) > t.limit:
                u -= 1
            if u < 0:
                break
            for v in (size, -size):
                y = v >> t.drop
                least = y if y >= 0 else -1 - y
                rest = t.mask_bound[code] - 1 - least * least
                pairs += 1
                if rest < 0 or u >> t.drop > root_up(rest, t):
                    beyond += 1
    return pairs, beyond


@by_width
def test_radius_holds_every_pair(formats):
    """Steps (i) to (iii) of the proof that masks miss nothing (docs/reference/lanes.md), gone through whole: all opacities, all v, the largest u of each."""
    t = tables(formats)
    pairs, beyond = pairs_beyond(t)
    assert pairs > 1000 << formats.uv and beyond == 0
    assert pairs_beyond(t._replace(mask_bound=t.mask_bound - (1 << 2 * formats.mask - 4)))[1] > 0  # not by a margin that would hold anything


@by_width
def test_masks_miss_nothing(formats):
    """Splats made to break masks, and records of any bits: every pair that the lane's own test passes is in the mask, and few others are."""
    rng = np.random.default_rng(seed())
    passing = masked = 0
    for records, tight in ((adversarial(rng, 40_000), True), (any_bits(rng, 10_000), False)):
        mask, passes = lane_masks(one_subtile(records), formats)
        assert not (passes & ~mask).any()
        if tight:
            passing, masked = (int(np.bitwise_count(m).sum()) for m in (passes, mask))
            partial = (passes != 0) & (passes != np.uint64((1 << 64) - 1))
            assert partial.sum() > 10_000 and (passes == 0).sum() > 1_000
    assert passing > 500_000 and masked < (1.25 if formats.mask == 4 else 1.06) * passing


@by_width
def test_wide_sums_in_masked_pixels(formats):
    """|u| and |v| of masked pixels are below 4, so a lane needs two bits before the point, and a saturated w or z masks nothing."""
    t, seen = tables(formats), 0
    rng = np.random.default_rng(seed())
    for low, high in np.concatenate([adversarial(rng, 400), any_bits(rng, 400)]).tolist():
        s = splat_setup(low, high, 0, 0, t)
        mask = row_mask(s, t)
        if s.w in (t.top, -t.top - 1) or s.z in (t.top, -t.top - 1):
            assert mask == 0
            seen += 1
        for bit in range(64):
            col, row = place_of(bit)
            if mask >> bit & 1:
                assert max(abs(u_of(s, col, row, t)), abs(v_of(s, row, t))) < 4 << formats.uv
                assert row_interval(s, row, t).radius >= 0
    assert seen > 100


def plain(lists: RecordLists, s: int, formats: LaneFormats) -> np.ndarray:
    """uint16 (64, 4): sub-tile s by the lane alone, no masks, every pair one after the other."""
    t = tables(formats)
    total, colour, done = [0] * 64, [[0, 0, 0] for _ in range(64)], [False] * 64
    for i in lists.entry[lists.start[s] : lists.start[s + 1]]:
        f = splat_setup(*lists.records[i].tolist(), s % lists.cols, s // lists.cols, t)
        for bit in range(64):
            col, row = place_of(bit)
            r = pair(log_alpha(u_of(f, col, row, t), v_of(f, row, t), f.lo, t), total[bit], t)
            if done[bit] or r.outcome == SKIPPED:
                continue
            if r.outcome == FINISHED:
                done[bit] = True
                continue
            total[bit] = r.s_next
            colour[bit] = [blend(c, r.exponent, r.mantissa, k, t)[1] for c, k in zip(colour[bit], (f.red, f.green, f.blue))]
    return np.array([[transmittance_bits(a, t), *(colour_bits(c, t) for c in b)] for a, b in zip(total, colour)], np.uint16)


@pytest.fixture(scope="module")
def demo() -> View:
    return load_view(DEMO, 0, (320, 180))


@pytest.fixture(scope="module")
def demo_lists(demo) -> RecordLists:
    return float_lists(demo.projected, demo.lists(Form.FACTORED))


@pytest.mark.parametrize("formats", [pytest.param(f, id=f.name, marks=[pytest.mark.slow] * (f is not FORMATS)) for f in WIDTHS])
def test_frames_are_pairs(formats, demo_lists):
    """A frame's kernel, with masks and early exit, gives what every pair gives alone; records of any bits, too."""
    rng = np.random.default_rng(seed())
    frame = render_lanes(demo_lists, formats)
    full = np.flatnonzero(np.diff(demo_lists.start) > 50)
    for s in rng.choice(full, 6, replace=False):
        assert np.array_equal(frame.pixels[s], plain(demo_lists, s, formats))
    wild = one_subtile(np.concatenate([any_bits(rng, 200), adversarial(rng, 200)])[rng.permutation(400)])
    assert np.array_equal(render_lanes(wild, formats).pixels[0], plain(wild, 0, formats))
    assert 0 < frame.total("skipped") < 0.2 * frame.total("visited")
    assert frame.total("visited") == frame.total("skipped") + frame.total("blended") + frame.total("pixels_finished")
    stopped = frame.needed < np.diff(demo_lists.start)
    assert stopped.any() and (frame.counts[stopped, COUNTS.index("pixels_finished")] == 64).all()
    assert np.array_equal(frame.counts[:, COUNTS.index("splats")], frame.needed)
    ones = np.bitwise_count(lane_masks(demo_lists, formats)[0]).astype(int)
    for s, (first, needed) in enumerate(zip(demo_lists.start, frame.needed)):
        taken = ones[first : first + needed]
        assert [frame.counts[s, COUNTS.index(name)] for name in ("empty", "masked")] == [(taken == 0).sum(), taken.sum()]


def test_absurd_records_are_finite():
    """Any 128 bits are a record: pixels are finite, T in (0, 1], colours at most 4, in every sub-tile that a picture can have."""
    rng = np.random.default_rng(seed())
    n, cols = 3000, 4096
    records = any_bits(rng, n)
    box = np.array([[k % cols, k % cols + 1, 0, 1] for k in rng.integers(0, cols, n)], np.int32)
    start, entry = bin_boxes(box, cols, 1)
    frame = render_lanes(RecordLists(8 * cols, 8, records, start, entry, cols, 1, n))
    values = frame.pixels.view(np.float16).astype(float)
    assert np.isfinite(values).all() and (values[..., 0] > 0).all() and (values[..., 0] <= 1).all() and values.min() >= 0 and values.max() <= 4
    assert frame.total("blended") > 1000
    empty = render_lanes(RecordLists(64, 8, np.zeros((0, 2), np.int64), np.zeros(9, np.int64), np.zeros(0, np.int32), 8, 1, 0))
    assert (empty.pixels == [0x3C00, 0, 0, 0]).all() and empty.counts.sum() == 0
    zeros = one_subtile(np.array([record(opacity=255, colour=(0, 0, 0)), record(x=(1 << 23) - 1, y=1 << 22, l0=511, l2=511)]))
    assert np.isfinite(render_lanes(zeros).image()).all()  # exponent code 0 is a zero, whatever the mantissa


@pytest.mark.parametrize("family,least", [("layers", 55), ("faint", 67), ("opaque", 67), ("thin", 67), ("thin_far", 67), ("far_mean", 67), ("footprint", 67)])
def test_stability(family, least):
    """At every step, against the same records in float64: what the lanes' arithmetic costs."""
    for value in FAMILIES[family].values:
        case = FAMILIES[family].make(value, np.random.default_rng([1, crc32(family.encode())]))
        lists = float_lists(case.projected, View(case.camera, projected=case.projected).lists(Form.FACTORED))
        with np.errstate(all="ignore"):
            truth = blend_records(lists.splats(), Form.FACTORED, lists.start, lists.entry, lists.width, lists.height)
        frame = render_lanes(lists)
        mask, passes = lane_masks(lists)
        assert not (passes & ~mask).any()
        assert frame.total("blended") > 0 and psnr(frame.image(), truth) >= least, value


def test_records_of_the_projection(demo, demo_lists):
    """Each field is the float64 number, rounded once; what does not fit is counted."""
    p, s = demo.projected, demo_lists.splats()
    assert np.abs(s.mean / 128 - p.mean)[np.abs(p.mean).max(axis=1) < 4000].max() <= 0.5 / 128 + 1e-12
    half = 0.5 * 1.4426950408889634
    l0 = np.sqrt(p.conic[:, 0] * half)
    exact = np.stack([l0, p.conic[:, 1] * half / l0, np.sqrt(half / p.cov2d[:, 2])], 1)
    assert (np.abs(s.shape - exact) <= 2.0**-10 * np.abs(exact) + 2.0**-29).all()
    assert np.abs(s.opacity - p.opacity).max() <= 0.5 / 255 + 1e-9 and np.abs(s.rgb - np.clip(p.rgb, 0, 1023 / 512)).max() <= 0.5 / 512 + 1e-9
    assert np.array_equal(s.spiky, p.spiky)
    changed = SimpleNamespace(**vars(p))
    changed.mean, changed.rgb, changed.opacity = p.mean.copy(), p.rgb.copy(), p.opacity.copy()
    changed.mean[0], changed.rgb[1], changed.opacity[2] = 1e9, 5.0, 0.001
    lists = float_lists(changed, demo.lists(Form.FACTORED))
    assert lists.adjusted == {"mean beyond 2^22 pixels": 1, "colour above 2 clipped": 1, "opacity below 1/510": 1}
    s = lists.splats()
    assert s.mean[0].max() / 128 <= 2**22 and s.rgb[1].max() == 1023 / 512 and s.opacity[2] == 0


def test_front_end_records(demo):
    """Records of the bit-true front end go to the lanes as they are; 32-byte ones do not."""
    packed = pack(demo.scene).packed
    front = run_front(packed, demo.camera)
    lists = front_lists(front)
    s = front.splats()
    assert np.array_equal(lists.splats().mean, s.mean) and np.array_equal(lists.splats().rgb, s.rgb)
    image = render_lanes(lists).image()
    assert psnr(image, blend_records(s, Form.FACTORED, lists.start, lists.entry, 320, 180)) > 67
    chip = render_chip(lists, RenderConfig(stage="lanes"))
    assert np.abs(chip.buffer[:180, : 3 * 320].reshape(180, 320, 3) / 255 - np.clip(image, 0, 1)).max() < 0.51 / 255
    with pytest.raises(ValueError, match="16 bytes"):
        front_lists(run_front(packed, demo.camera, kind=RecordKind.CONIC32))


@pytest.mark.slow
@pytest.mark.skipif(real_scenes() is None, reason="FLICKER_SCENES is not set")
@pytest.mark.parametrize("real", REAL_VIEWS, ids=lambda v: v.title)
def test_real_views(real):
    """At least 65 dB from records of 16 bytes, and no pixel missed."""
    folder = real_scenes()
    assert folder is not None
    view = load_view(real.path(folder), real.number, (1280, 720))
    stats = render_view(view, config=RenderConfig(stage="lanes"), compare=True).stats
    assert stats["psnr_db"] >= 65
    mask, passes = lane_masks(float_lists(view.projected, view.lists(Form.FACTORED)))
    assert not (passes & ~mask).any()


def test_refused():
    """Widths, numbers of lanes and what lanes cannot do: one clear line."""
    for name, value, message in (
        ("uv", 5, "uv must be 6 to 13"), ("log", 18, "log must be 7 to 14"), ("sum", 8, "sum must be 9 to 24"), ("mask", 10, "mask must be 4 to 9"),
        ("root", 5, "root must be even"), ("mantissa", 13, "mantissa must be"), ("guard", 4, "guard must be 5"),
    ):
        with pytest.raises(FlickerError, match=f"lanes: {message}"):
            LaneFormats(**{name: value})
    for changes, message in (
        ({"lanes": 48}, "lanes must be 16, 32, 64 or 128 with cores 4, not 48"), ({"cores": 3}, "cores must be 1, 2 or 4, not 3"),
        ({"cores": 1, "lanes": 64}, "lanes must be 4, 8, 16 or 32 with cores 1, not 64"),
        ({"stage": "channels", "cores": 1}, "cores must be 4 with stage channels, not 1"),
    ):
        with pytest.raises(FlickerError, match=message):
            RenderConfig(**{"stage": "lanes"} | changes)
    for changes in ({"form": Form.CONIC}, {"coords": Coords.ABSOLUTE}):
        with pytest.raises(FlickerError, match="stage lanes takes records of 16 bytes"):
            RenderConfig(stage="lanes", **changes)
    with pytest.raises(FlickerError, match="stage must be one of channels, lanes"):
        RenderConfig(stage="lane")
    for changes, message in (
        ({"in_width": 3}, "in_width must be 1 or 2, not 3"), ({"slots": 1}, "slots must be 2 to 64"), ({"fifo_depth": 65}, "fifo_depth must be 2 to 64"),
        ({"delivered": 3}, "delivered must be 1 or 2, not 3"),
    ):
        with pytest.raises(FlickerError, match=message):
            RenderConfig(stage="lanes", **changes)
    with pytest.raises(FlickerError, match="delivered must be 1 with stage channels, not 2"):
        RenderConfig(delivered=2)
    assert RenderConfig(stage="lanes", delivered=2).chip_parameters()["InWidth"] == 2 and "InWidth" not in RenderConfig(stage="lanes").chip_parameters()


def test_engines(demo):
    """The golden engine with float64 and bit-true front ends; the reference has no lanes."""
    config = RenderConfig(stage="lanes", lanes=64)
    float_, golden = (render_view(demo, config=config, front=front, compare=True) for front in (Front.FLOAT, Front.GOLDEN))
    assert float_.stats["psnr_db"] > 53 and golden.stats["psnr_db"] > 53 and not np.array_equal(float_.image, golden.image)
    assert golden.stats["records"] == "factored-16" and "records" not in float_.stats
    with pytest.raises(FlickerError, match="not for engine reference"):
        render_view(demo, engine=Engine.REFERENCE, config=config)


def test_command(tmp_path):
    """`--stage lanes` writes picture and counts; the number of lanes changes only the least cycles; what does not go with it is refused in one line."""
    save_ply(random_scene(1), tmp_path / "scene.ply")

    def run(*args) -> dict:
        done = flicker("render", tmp_path / "scene.ply", "--size", "96x64", "--out", tmp_path / "p.png", "--stats", tmp_path / "s.json", *args)
        assert done.returncode == 0, done.stderr
        return json.loads((tmp_path / "s.json").read_text()) | {"picture": load_picture(tmp_path / "p.png"), "text": " ".join(done.stdout.split())}

    found = {n: run("--stage", "lanes", "--lanes", n) for n in LANE_COUNTS}
    visited = found[32]["lanes"]["visited"]
    assert found[32]["stage"] == "lanes" and found[32]["pixel_pairs"] == visited > found[32]["lanes"]["blended"] > 0
    for n, stats in found.items():
        assert np.array_equal(stats["picture"], found[32]["picture"]) and stats["lanes"]["least_cycles"] == -(-visited // n)
        assert stats["lanes"] | {"lanes": 0, "least_cycles": 0} == found[32]["lanes"] | {"lanes": 0, "least_cycles": 0}
    assert f"{visited:,}" in found[32]["text"] and found[32]["formats"] == FORMATS.name
    assert run()["lanes"]["lanes"] == 32 and run("--lanes", "64")["stage"] == "lanes" and run("--cores", "1", "--lanes", "8")["lanes"]["lanes"] == 8
    assert all(run(*args)["stage"] == "channels" for args in (("--stage", "channels"), ("--cat", "off"), ("--faithful",), ("--form", "conic")))
    chip, golden = run("--stage", "lanes", "--engine", "chip-golden"), run("--stage", "lanes", "--front", "golden")
    assert chip["lanes"]["visited"] == golden["lanes"]["visited"] and np.array_equal(chip["picture"], golden["picture"])
    for args, named in (
        (("--stage", "channels", "--lanes", "32"), "--lanes: for --stage lanes only"), (("--lanes", "32", "--cat", "off"), "--cat"),
        (("--stage", "lanes", "--lanes", "33"), "lanes must be 16, 32, 64 or 128 with cores 4, not 33"),
        (("--cores", "1", "--lanes", "33"), "lanes must be 4, 8, 16 or 32 with cores 1, not 33"), (("--cores", "3"), "cores must be 1, 2 or 4, not 3"),
        (("--stage", "channels", "--cores", "1"), "--cores: for --stage lanes only"),
        (("--stage", "lanes", "--engine", "reference"), "not for --engine reference"),
        (("--stage", "lanes", "--cat", "off", "--precision", "fp8"), "--cat, --precision"),
        (("--stage", "lanes", "--form", "conic"), "--form conic"), (("--stage", "lanes", "--faithful"), "--faithful"),
        (("--stage", "lanes", "--coords", "absolute"), "--coords"), (("--stage", "lanes", "--fifo-depth", "1"), "fifo_depth must be 2 to 64"),
    ):
        done = flicker("render", tmp_path / "none.ply", "--size", "96x64", *args)  # before any work, so the file is not looked for
        assert done.returncode == 2 and done.stderr.count("\n") == 1 and named in done.stderr, done.stderr
