"""Golden model of frames against plain restatements of its rules: pairs, masks, lists, automatic mode.

The arithmetic underneath (fp, formats, functions) is tested in tb/common/test_arithmetic.py. Random splats, seeded by FLICKER_SEED.
"""

from __future__ import annotations

import random
from types import SimpleNamespace

import numpy as np
import pytest
from flicker_tb import splats
from flicker_tb.runner import seed

from flicker.front.records import build_lists
from flicker.golden.cat import DENSE_RECTS, SCRATCH, SPARSE_RECTS, splat_mask, threshold, trace_rect
from flicker.golden.render import COUNTS, minitile, render_golden, stream_order
from flicker.golden.vru import PAIR_FIELDS, pair
from flicker.params import CatMode, Coords, Form, Precision, RenderConfig
from flicker.scene.camera import Camera


def floats(features) -> np.ndarray:
    """Nine FP16 bit patterns as float32 values."""
    return np.array(features, np.uint16).view(np.float16).astype(np.float32)


@pytest.mark.parametrize("form", list(Form))
def test_minitile_is_sixteen_pairs(form):
    """The frame kernel, which shares terms along rows and columns and skips early, blends what 16 single pairs blend."""
    rng = random.Random(seed())
    blended = ended = 0
    for _ in range(60):
        m = rng.randrange(4)
        state = np.zeros((4, 64), np.float32)
        state[0] = 1
        plain = [np.array([1, 0, 0, 0], np.float32) for _ in range(16)]
        done, plain_done = np.zeros(64, bool), [False] * 16
        scratch = [np.empty(s, np.float32) for s in ((2, 4), (2, 4), (16,))]
        for _ in range(40):
            f = floats(splats.mixed(rng, form).features)
            b, e = minitile(f, m, int(form), state, done, *scratch)
            blended, ended = blended + b, ended + e
            for k in range(16):
                if not plain_done[k]:
                    x, y = 4 * (m % 2) + k % 4, 4 * (m // 2) + k // 4
                    plain_done[k] = pair(x, y, f, int(form), plain[k], np.zeros(len(PAIR_FIELDS), np.float32)) == 2
        for k in range(16):
            assert np.array_equal(state[:, 16 * m + k], plain[k], equal_nan=True)
            assert done[16 * m + k] == plain_done[k]
    assert blended > 1000 and ended > 50


@pytest.mark.parametrize("form", list(Form))
@pytest.mark.parametrize("precision", list(Precision))
def test_mask_is_any_leader(form, precision):
    """A mask bit is set exactly if one of the mini-tile's leaders is below the threshold."""
    rng = random.Random(seed())
    e = np.zeros(SCRATCH, np.float32)
    counts = np.zeros(16, int)
    for _ in range(300):
        features = splats.mixed(rng, form).features
        f = floats(features)
        t = threshold(f[5], int(form), int(precision))
        for dense in (True, False):
            leaders = [(4 * (m % 2) + x, 4 * (m // 2) + y, m) for m in range(4) for x, y in (((0, 0), (3, 0), (0, 3), (3, 3)) if dense else ((0, 0), (3, 3)))]
            want = 0
            for x, y, m in leaders:
                want |= int(t > trace_rect((x, x, y, y), features, form, precision).weights[0]) << m
            got = splat_mask(*f[:6], dense, int(form), int(precision), e)
            assert got == want
            counts[got] += 1
    assert (counts > 0).sum() > 8
    assert len(DENSE_RECTS) == 4 and len(SPARSE_RECTS) == 2


def projected(rng: np.random.Generator, n: int, width: int, height: int):
    """Random projected splats, as far as the lists need them, in depth order."""
    mean = rng.uniform((-20, -20), (width + 20, height + 20), (n, 2))
    sigma = np.exp(rng.uniform(-0.5, 3.5, (n, 2)))
    r = rng.uniform(-0.95, 0.95, n)
    xx, yy = sigma[:, 0] ** 2, sigma[:, 1] ** 2
    xy = r * sigma[:, 0] * sigma[:, 1]
    det = xx * yy - xy * xy
    return SimpleNamespace(
        mean=mean, cov2d=np.stack([xx, xy, yy], 1), conic=np.stack([yy / det, -xy / det, xx / det], 1),
        depth=np.sort(rng.uniform(0.3, 90, n)).astype(np.float32), opacity=rng.uniform(0, 1, n), rgb=rng.uniform(0, 1.5, (n, 3)),
        spiky=rng.random(n) < 0.5, radii=3 * sigma,
    )


def camera(width: int, height: int) -> Camera:
    """A camera of which only the size matters."""
    return Camera(width=width, height=height, fx=100.0, fy=100.0, position=np.zeros(3), rotation=np.eye(3))


@pytest.mark.parametrize("width,height", [(64, 48), (37, 21), (8, 8), (1, 1)])
def test_lists(width, height):
    """Every splat whose box holds a pixel centre of a sub-tile is in its list, once, in order; no other is."""
    p = projected(np.random.default_rng(seed()), 200, width, height)
    lists = build_lists(p, camera(width, height), RenderConfig())
    assert lists.cols == -(-width // 8) and lists.rows == -(-height // 8)
    tiles = set()
    for s in range(lists.cols * lists.rows):
        xs = np.arange(8 * (s % lists.cols), min(8 * (s % lists.cols) + 8, width))
        ys = np.arange(8 * (s // lists.cols), min(8 * (s // lists.cols) + 8, height))
        inside = [(abs(v - p.mean[:, k, None]) <= p.radii[:, k, None]).any(axis=1) for k, v in ((0, xs), (1, ys))]
        want = np.flatnonzero(inside[0] & inside[1])
        assert np.array_equal(lists.entry[lists.start[s] : lists.start[s + 1]], want)
        tiles |= {(i, s % lists.cols // 2, s // lists.cols // 2) for i in want}
        for n in range(lists.start[s], lists.start[s + 1]):
            local = p.mean[lists.entry[n]] - (8 * (s % lists.cols), 8 * (s // lists.cols))
            assert np.array_equal(lists.mean[n].view(np.float16), local.astype(np.float16))
    assert lists.tile_pairs == len(tiles)


def test_records():
    """Shape numbers of both forms give back the weight; absolute coordinates round the mean first; nothing overflows silently."""
    p = projected(np.random.default_rng(seed()), 300, 64, 48)
    d = np.random.default_rng(seed() + 1).uniform(-9, 9, (300, 2))
    exact = 0.5 * (p.conic[:, 0] * d[:, 0] ** 2 + p.conic[:, 2] * d[:, 1] ** 2) + p.conic[:, 1] * d[:, 0] * d[:, 1]
    for form in Form:
        lists = build_lists(p, camera(64, 48), RenderConfig(form=form))
        s = lists.gauss[:, 2:5].view(np.float16).astype(float).T
        if form == Form.CONIC:
            weight = s[0] * d[:, 0] ** 2 + s[2] * d[:, 1] ** 2 + s[1] * d[:, 0] * d[:, 1]
        else:
            weight = ((s[0] * d[:, 0] + s[1] * d[:, 1]) ** 2 + (s[2] * d[:, 1]) ** 2) * np.log(2)
        scale = np.abs(p.conic) @ np.array([81, 81, 81])
        assert (np.abs(weight - exact) < 0.002 * scale + 1e-6).all()
    absolute = build_lists(p, camera(64, 48), RenderConfig(coords=Coords.ABSOLUTE))
    s = absolute.cols + 1
    n = absolute.start[s]
    rounded = p.mean[absolute.entry[n]].astype(np.float16)
    assert np.array_equal(absolute.mean[n].view(np.float16), (rounded.astype(float) - 8).astype(np.float16))
    p.rgb[5] = 1e6
    lists = build_lists(p, camera(64, 48), RenderConfig())
    assert lists.adjusted == {"value beyond FP16 clamped": 1}


def test_automatic_mode():
    """Decisions follow the rule of docs/reference/ctu.md, restated; the picture of a sub-tile is that of the mode in force."""
    config = RenderConfig(cat=CatMode.AUTO)
    rng = np.random.default_rng(seed())
    p = projected(rng, 1500, 160, 96)
    p.opacity[:] = np.where(rng.random(1500) < 0.9, 0.01, 0.9)  # most splats contribute little: the test is the bottleneck
    p.spiky[:] = rng.random(1500) < 0.1
    lists = build_lists(p, camera(160, 96), config)
    frame = render_golden(lists, config)
    fixed = {m: render_golden(lists, config.with_(cat=m)) for m in (CatMode.SMOOTH, CatMode.SPARSE)}
    order, starts = stream_order(lists)
    fallen = COUNTS.index("fallen")
    for core in range(4):
        test = sent = 0
        history = [False, False]
        for s in order[starts[core] : starts[core + 1]]:
            assert frame.counts[s, fallen] == history[-2]
            mode = CatMode.SPARSE if history[-2] else CatMode.SMOOTH
            assert np.array_equal(frame.pixels[s], fixed[mode].pixels[s])
            entries = lists.entry[lists.start[s] : lists.start[s + 1]]
            per_tile = np.zeros(4, int)
            for n, i in zip(range(lists.start[s], lists.start[s + 1]), entries):
                f = floats(lists.features(n))
                dense = mode == CatMode.SMOOTH and not p.spiky[i]
                mask = splat_mask(*f[:6], dense, int(config.form), int(config.precision), np.zeros(SCRATCH, np.float32))
                per_tile += [mask >> m & 1 for m in range(4)]
            test += int(np.where(p.spiky[entries], 1, 2).sum()) - test // 4
            sent += 8 * int(per_tile.max()) - sent // 4
            history.append(test > sent)
    assert 0 < frame.total("fallen") < lists.cols * lists.rows


def test_empty_and_repeatable():
    """No splat at all gives black and T = 1; the same input gives the same bits."""
    p = projected(np.random.default_rng(seed()), 300, 64, 48)
    lists = build_lists(p, camera(64, 48), RenderConfig())
    a, b = render_golden(lists, RenderConfig()), render_golden(lists, RenderConfig())
    assert np.array_equal(a.pixels, b.pixels) and a.total("pairs_blended") > 0
    p.mean[:] = -1e4
    empty = render_golden(build_lists(p, camera(64, 48), RenderConfig()), RenderConfig())
    assert (empty.pixels == [0x3C00, 0, 0, 0]).all() and empty.counts.sum() == 0
