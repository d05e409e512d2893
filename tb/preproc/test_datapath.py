"""Pipelines of the front end against the golden functions they were made from: Gaussians of the demo scene, and numbers from all over their range.

Inputs are noise but in the cycle in which an element is taken, and enables are random. Parameter space: the usual interval of each pipeline, with SLOW=1
all that it can be built for.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numba
import numpy as np
import pytest
from datapath_bench import Bench
from flicker_tb.runner import seed

from flicker.arithmetic.ff import ff_round, ff_value
from flicker.datapath.units import PIPELINES, SCALE_HEADER, SCALE_STEP, degree_sum
from flicker.front.view import DEMO, load_view
from flicker.golden.front import colour, cull, frame, reach, reuse, splat
from flicker.golden.front.frame import cluster_values, lanes_of
from flicker.golden.front.setup import CLUSTER_M, FORMATS, FrameSetup
from flicker.params import Form, SortOrder
from flicker.scene.packed import PackedFormat, PackedScene
from flicker.scene.packing import pack

P, S, C = FORMATS.position, FORMATS.shape, FORMATS.colour
SOME = 1500


def random(stream: int) -> np.random.Generator:
    return np.random.default_rng([seed(), 77, stream])


def wild(rng: np.random.Generator, n: int, M: int, low: int = 1, high: int = 254, positive: bool = False) -> np.ndarray:
    """ff numbers with exponent codes low to high; some zeros."""
    code = rng.integers(0, 1 if positive else 2, n) << (8 + M) | rng.integers(low, high + 1, n) << M | rng.integers(0, 1 << M, n)
    return np.array([ff_value(c, M) for c in np.where(rng.random(n) < 0.02, 0, code).tolist()])


def of(prefix: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Columns (n, k) by name."""
    return {f"{prefix}_{k}": values[:, k] for k in range(values.shape[1])}


@dataclasses.dataclass(eq=False)
class Sample:
    """A packed demo scene, a camera's registers and some of its Gaussians."""

    packed: PackedScene
    setup: FrameSetup
    index: np.ndarray
    lanes: Any
    values: Any


@cache
def demo(form: PackedFormat) -> Sample:
    view = load_view(DEMO, 0, (640, 360))
    packed = pack(view.scene, form).packed
    setup = FrameSetup.of(view.camera)
    index = np.sort(random(1).choice(len(packed), SOME, replace=False))
    return Sample(packed, setup, index, lanes_of(packed), cluster_values(packed, setup))


@cache
def bench(name: str, interval: int = 0) -> Bench:
    return Bench(name, interval)


INTERVALS = {p.module: p.intervals for p in PIPELINES}


def by_interval(*names: str) -> pytest.MarkDecorator:
    """Once for each interval that pipelines can be built for: all the same ones. Slow but the usual one."""
    ((usual, *others),) = {INTERVALS[name] for name in names}
    return pytest.mark.parametrize("interval", [usual, *(pytest.param(n, marks=pytest.mark.slow) for n in others)])


def same(got: dict[str, np.ndarray], want: dict[str, np.ndarray], where: np.ndarray | None = None) -> None:
    assert set(got) == set(want)
    for name in got:
        a, b = (got[name], want[name]) if where is None else (got[name][where], want[name][where])
        bad = np.flatnonzero(a != b)
        assert not len(bad), f"{name}: {len(bad)} of {len(a)} differ, first at {bad[0]}: {a[bad[0]]!r} instead of {b[bad[0]]!r}"


# ---- clusters --------------------------------------------------------------------------------------------


def cluster_registers(setup: FrameSetup) -> dict[str, float]:
    registers = {f"position_{k}": setup.position[k] for k in range(3)}
    registers |= {f"normal_{k}{j}": setup.normal[k, j] for k in range(5) for j in range(3)}
    return registers | {f"offset_{k}": setup.offset[k] for k in range(5)} | {f"reach_{k}": setup.reach[k] for k in range(5)}


def test_cluster_test() -> None:
    s, rng = demo(PackedFormat.CHUNK), random(2)
    table, n = s.packed.table, 300
    low = np.concatenate([table["low"], np.stack([wild(rng, n, CLUSTER_M) for _ in range(3)], 1)]).astype(np.float64)
    high = np.concatenate([table["high"], np.stack([wild(rng, n, CLUSTER_M) for _ in range(3)], 1)]).astype(np.float64)
    sigma = np.concatenate([s.packed.sigma, np.abs(wild(rng, n, CLUSTER_M))]).astype(np.float64)
    keep = np.zeros(len(low), np.bool_)
    cull._cull(low, high, sigma, s.setup.position, s.setup.normal, s.setup.offset, s.setup.reach, keep)
    assert keep[: len(table)].any() and not keep[: len(table)].all()
    got = bench("flk_cluster_test")(cluster_registers(s.setup), **of("low", low), **of("high", high), sigma=sigma)
    same(got, {"keep": keep.astype(np.int64)})


def test_colours_last() -> None:
    """Clusters of the demo scene from positions that move by all shares of the distance, and numbers of all sizes: both answers, and each condition alone
    decides some."""
    s, rng = demo(PackedFormat.CHUNK), random(3)
    table, n = s.packed.table, 6
    position = s.setup.position
    low, high = (np.repeat(table[name].astype(np.float64), n, axis=0) for name in ("low", "high"))
    code = np.repeat(s.packed.slopes.astype(np.int64), n)
    away = np.linalg.norm(np.maximum(np.maximum(low - position, position - high), 0.0), axis=1)
    move = rng.normal(size=low.shape)
    move *= (away * 2.0 ** rng.uniform(-9, -1, len(low)) / np.linalg.norm(move, axis=1))[:, None]
    move[::10] = 0.0
    then = np.array([ff_round(v, CLUSTER_M) for v in (position + move).ravel().tolist()]).reshape(-1, 3)
    code[::7], code[3::7] = rng.integers(0, 64, len(code[::7])), rng.integers(0, 24, len(code[3::7]))
    few = 400
    numbers = lambda: np.stack([wild(rng, few, CLUSTER_M) for _ in range(3)], 1)  # noqa: E731
    low, high, then = (np.concatenate([a, numbers()]) for a in (low, high, then))
    code = np.concatenate([code, rng.integers(0, 64, few)])
    limit = reuse.limit_of(4 / 255)
    last = np.zeros(len(low), np.bool_)
    reuse._last(low, high, code.astype(np.uint8), then, position, limit, last)
    some = last[: -few]
    assert 0.2 < some.mean() < 0.8 and some[::10].all()
    moved, far = ((v**2).sum(axis=1) for v in (then - position, np.maximum(np.maximum(low - then, then - high), 0.0)))  # float64 holds what ff numbers do not
    assert ((moved < 2.0**-120) | (16 * moved < far * 1.001) | ~last).all() and (last & (moved > 2.0**90)).any()
    got = bench("flk_colours_last")(
        {f"position_{k}": position[k] for k in range(3)} | {"limit": limit}, **of("low", low), **of("high", high), **of("then", then), slope=code,
    )
    same(got, {"last": last.astype(np.int64)})


def test_cluster_header() -> None:
    s, h = demo(PackedFormat.CHUNK), demo(PackedFormat.CHUNK).packed.headers
    inputs = of("origin", h["position_low"]) | of("step", h["position_step"]) | of("scale_low", h["scale_low"]) | of("scale_step", h["scale_step"])
    inputs |= of("dc_low", h["dc_low"]) | of("dc_step", h["dc_step"])
    inputs |= {f"sh_step_{d}{k}": h["sh_step"][:, d, k] for d in range(3) for k in range(3)}
    v = s.values
    want = of("low", v.low) | of("step", v.step) | of("scale_low", v.scale_low) | of("scale_step", v.scale_step)
    want |= of("dc_low", v.dc_low) | of("dc_step", v.dc_step)
    want |= {f"sh_step_{d}{k}": v.sh_step[:, d, k] for d in range(3) for k in range(3)}
    same(bench("flk_cluster_header")({f"position_{k}": s.setup.position[k] for k in range(3)}, **inputs), want)


# ---- Gaussians -------------------------------------------------------------------------------------------


def geometry(s: Sample) -> dict[str, np.ndarray]:
    """What a sample's Gaussians are after decoding."""
    n = len(s.index)
    out = np.zeros((n, 10))
    _decoded(s.index, s.lanes, s.values, S, out)
    return of("q", out[:, :3]) | of("s", out[:, 3:6]) | {f"q{c}": out[:, 6 + k] for k, c in enumerate("wxyz")}


@numba.njit
def _decoded(index, lanes, values, M, out):
    for j in range(len(index)):
        i = index[j]
        c = lanes.cluster[i]
        for k in range(3):
            out[j, k] = lanes.q[i, k]
            out[j, 3 + k] = frame._scale(lanes.chunked, lanes.s[i, k], values.scale_low[c, k], values.scale_step[c, k], M)
        out[j, 6], out[j, 7], out[j, 8], out[j, 9] = frame._quaternion(lanes.chunked, lanes.quat[i], M)


@by_interval("flk_geometry_decode")
@pytest.mark.parametrize("form", [PackedFormat.CHUNK, PackedFormat.FP16])
def test_geometry_decode(form: PackedFormat, interval: int) -> None:
    s = demo(form)
    chunked = form is PackedFormat.CHUNK
    words = np.zeros((SOME, 5), np.int64)
    raw = s.packed.geometry[s.packed.slot[s.index]]
    raw = np.ascontiguousarray(raw).view("<u4").reshape(SOME, -1)
    words[:, : raw.shape[1]] = raw
    c = s.packed.cluster[s.index]
    top, most = (SCALE_HEADER.high, SCALE_STEP.high) if chunked else (0, 0)
    inputs = of("word", words) | of("scale_low", np.minimum(s.values.scale_low[c], top)) | of("scale_step", np.minimum(s.values.scale_step[c], most))
    same(bench("flk_geometry_decode", interval)({"chunked": chunked}, **inputs), geometry(s))


FIELDS = splat.Projection._fields


@numba.njit
def _projected(
    low, step, q, s, quat, view, focal, row_x, row_x_z, row_y, row_y_z, least, limit, middle, share, antialiased, by_distance, width, height, const, inverse,
    M, N, C, out, places, conic,
):
    for j in range(len(q)):
        p = splat.project_one(low[j], step[j], q[j], s[j], quat[j, 0], quat[j, 1], quat[j, 2], quat[j, 3], view, focal, row_x, row_x_z, row_y, row_y_z, least,
                              limit, middle, share, antialiased, const, M, N)
        steady = reach.steady_one(p, inverse, N)
        x0, x1 = splat.pixels(p.x, p.radius_x, width)
        y0, y1 = splat.pixels(p.y, p.radius_y, height)
        places[j, 0], places[j, 1], places[j, 2], places[j, 3], places[j, 4] = p.near, x0 > x1 or y0 > y1, p.x, p.y, p.spiky
        places[j, 6] = p.far
        places[j, 5] = frame.sort_key(by_distance, p.t2, p.square, M)
        out[j, 0], out[j, 1], out[j, 2], out[j, 3], out[j, 4] = p.sx, p.sy, p.l0, p.l1, p.l2
        out[j, 5], out[j, 6], out[j, 7] = steady.i0, steady.kappa, steady.lean
        out[j, 11] = p.scale
        out[j, 8], out[j, 9], out[j, 10] = ff_round(p.d0, C), ff_round(p.d1, C), ff_round(p.d2, C)
        conic[j, 0], conic[j, 1], conic[j, 2] = splat.conic_one(p, N)


def projected(
    s: Sample, low, step, q, scales, quat, share=frame.CHUNK_SHARE, antialiased=False, by_distance=False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t, inverse = s.setup, reach.reach_tables(FORMATS)[3]
    out, places, conic = np.zeros((len(q), 12)), np.zeros((len(q), 7), np.int64), np.zeros((len(q), 3))
    _projected(low, step, q, scales, quat, t.view, t.focal, t.row_x, t.row_x_z, t.row_y, t.row_y_z, t.least, t.limit, t.middle, share, antialiased,
               by_distance, t.width, t.height, splat.constants(FORMATS), inverse, P, S, C, out, places, conic)
    return out, places, conic


def projection_inputs(s: Sample) -> tuple[np.ndarray, ...]:
    g, c = geometry(s), s.packed.cluster[s.index]
    return (s.values.low[c], s.values.step[c], np.stack([g[f"q_{k}"] for k in range(3)], 1), np.stack([g[f"s_{k}"] for k in range(3)], 1),
            np.stack([g[f"q{k}"] for k in "wxyz"], 1))


@by_interval("flk_projection", "flk_projection_conic")
@pytest.mark.parametrize("order", list(SortOrder), ids=lambda order: order.value)
@pytest.mark.parametrize("features", [False, True], ids=["plain", "features"])
@pytest.mark.parametrize("form", list(Form), ids=lambda form: form.name.lower())
def test_projection(form: Form, features: bool, order: SortOrder, interval: int) -> None:
    """features: of an antialiased scene, with the principal point at some place."""
    by_distance = order is SortOrder.DISTANCE
    s, rng = demo(PackedFormat.CHUNK), random(3)
    chunked = form is Form.CONIC or not features
    if features:
        camera = load_view(DEMO, 0, (640, 360)).camera
        s = dataclasses.replace(s, setup=FrameSetup.of(dataclasses.replace(camera, cx=rng.uniform(-200, 900), cy=rng.uniform(-200, 600))))
    real = [a[: SOME // 2] for a in projection_inputs(s)]
    n = SOME // 2
    triple = lambda M, low, high: np.stack([wild(rng, n, M, low, high) for _ in range(3)], 1)  # noqa: E731
    odd = [triple(P, 110, 140), triple(P, 100, 140), triple(P, 110, 130), np.abs(triple(S, 90, 150))]
    odd.append(np.stack([wild(rng, n, S, 110, 140) for _ in range(4)], 1))
    far = [triple(P, 1, 254), triple(P, 1, 254), triple(P, 1, 254), np.abs(triple(S, 1, 254)), np.stack([wild(rng, n, S) for _ in range(4)], 1)]
    inputs = [np.concatenate(parts) for parts in zip(real, odd, far)]
    share = frame.CHUNK_SHARE if chunked else frame.FP16_SHARE
    out, places, conic = projected(s, *inputs, share, features, by_distance)
    t = s.setup
    registers = {f"view_{i}{j}": t.view[i, j] for i in range(3) for j in range(3)} | {f"focal_{k}": t.focal[k] for k in range(2)}
    for name in ("row_x", "row_x_z", "row_y", "row_y_z"):
        registers |= {f"{name}_{k}": getattr(t, name)[k] for k in range(3)}
    registers |= {f"{name}_{k}": getattr(t, name)[k] for name in ("least", "limit", "middle") for k in range(2)}
    registers |= {"chunked": chunked, "antialiased": features, "by_distance": by_distance}
    registers |= {"width": t.width, "height": t.height}
    low, step, q, scales, quat = inputs
    got = bench("flk_projection" if form is Form.FACTORED else "flk_projection_conic", interval)(
        registers, **of("low", low), **of("step", step), **of("q", q), **of("s", scales), **{f"q{c}": quat[:, k] for k, c in enumerate("wxyz")},
    )
    want = {name: places[:, k] for k, name in enumerate(("near", "outside", "x", "y", "spiky", "key", "far"))}
    want |= {name: out[:, k] for k, name in enumerate(("sx", "sy", "l0", "l1", "l2", "i0", "kappa", "lean"))}
    want |= of("direction", out[:, 8:11]) | {"scale": out[:, 11]}
    if form is Form.CONIC:
        assert (np.abs(conic[places[:, 0] == 0]) < 65504.0).all()  # FP16 holds them
        del want["l0"], want["l1"]
        want |= of("conic", conic)
    near = places[:, 0] == 1
    assert near.any() and not near.all() and places[~near, 1].any() and not places[~near, 1].all()
    key = places[~near, 5]
    assert key.min() < 1 << 21 and (key == (1 << 24) - 1).any() and len(np.unique(key)) > n // 2
    assert (out[:, 11] <= 1.01 * share).all() and (out[:, 11] < 0.9 * share).any() == features
    same(got, want)


# ---- where a splat reaches -------------------------------------------------------------------------------


@numba.njit
def _bounded(x, y, sx, sy, lean, code, box, width, height, logs, sigmas, cut, N, out, limit):
    for j in range(len(x)):
        r = reach.reach_one(x[j], y[j], sx[j], sy[j], reach.Steady(0.0, 0.0, lean[j]), code[j], box, width, height, logs, sigmas, cut, N)
        out[j, 0] = r.x0 > r.x1 or r.y0 > r.y1
        out[j, 1], out[j, 2], out[j, 3], out[j, 4], out[j, 5] = r.x0, r.x1, r.y0, r.y1, r.right
        limit[j] = r.limit


def seen(s: Sample) -> tuple[np.ndarray, np.ndarray]:
    """Projections of the sample that are neither near nor outside."""
    out, places, _ = projected(s, *projection_inputs(s))
    on = (places[:, 0] == 0) & (places[:, 1] == 0)
    return out[on], places[on]


def bounded(s: Sample, box: bool, x, y, sx, sy, lean, code) -> tuple[np.ndarray, np.ndarray]:
    out, limit = np.zeros((len(x), 6), np.int64), np.zeros(len(x))
    logs, sigmas, cut, _ = reach.reach_tables(FORMATS)
    _bounded(x, y, sx, sy, lean, code, box, s.setup.width, s.setup.height, logs, sigmas, cut, S, out, limit)
    return out, limit


@by_interval("flk_splat_bounds")
@pytest.mark.parametrize("box", [False, True])
def test_splat_bounds(box: bool, interval: int) -> None:
    s, rng = demo(PackedFormat.CHUNK), random(4)
    out, places = seen(s)
    n = 500
    x, y = (np.concatenate([places[:, k], rng.integers(-(1 << 29), 1 << 29, n)]) for k in (2, 3))
    sx, sy = (np.concatenate([out[:, k], np.abs(wild(rng, n, S))]) for k in (0, 1))
    lean = np.concatenate([out[:, 7], wild(rng, n, S)])
    chunked = not box
    share = frame.CHUNK_SHARE if chunked else frame.FP16_SHARE
    scale = np.array([ff_round(share * v, S) for v in np.where(rng.random(len(x)) < 0.5, 1.0, rng.random(len(x)))])
    raw = rng.integers(1, 256, len(x)) if chunked else rng.uniform(0, 1, len(x)).astype(np.float16).view(np.uint16).astype(np.int64)
    number = raw.astype(np.float64) if chunked else raw.astype(np.uint16).view(np.float16).astype(np.float64)
    code = np.array([frame.opacity_code(chunked, v, f, S) for v, f in zip(number.tolist(), scale.tolist())])
    if chunked:
        assert np.array_equal(code[scale == frame.CHUNK_SHARE], raw[scale == frame.CHUNK_SHARE])
    want, limit = bounded(s, box, x, y, sx, sy, lean, code)
    registers = {"box": box, "width": s.setup.width, "height": s.setup.height}
    got = bench("flk_splat_bounds", interval)(registers, x=x, y=y, sx=sx, sy=sy, lean=lean, scale=scale, opacity=raw)
    assert np.array_equal(got["code"], code)
    empty = want[:, 0] == 1
    assert empty.any() and not empty.all()
    assert np.array_equal(got["empty"], want[:, 0])
    named = {name: want[:, 1 + k] for k, name in enumerate(("x0", "x1", "y0", "y1", "right"))} | {"limit": limit, "empty": want[:, 0], "code": code}
    same(got, named, ~empty)


@numba.njit
def _bands(band, box, x, y, l2, i0, kappa, r, limit, N, out):
    for j in range(len(x)):
        reached = reach.Reach(r[j, 1], r[j, 2], r[j, 3], r[j, 4], i0[j], kappa[j], limit[j], r[j, 5])
        a, b = reach.band_subtiles(band[j], box, x[j], y[j], l2[j], reached, N)
        out[j, 0], out[j, 1], out[j, 2] = a > b, a, b


@by_interval("flk_splat_band")
@pytest.mark.parametrize("box", [False, True])
def test_splat_band(box: bool, interval: int) -> None:
    s, rng = demo(PackedFormat.CHUNK), random(5)
    out, places = seen(s)
    r, limit = bounded(s, box, places[:, 2], places[:, 3], out[:, 0], out[:, 1], out[:, 7], rng.integers(1, 256, len(out)))
    on = np.repeat(np.flatnonzero(r[:, 0] == 0), 3)
    out, places, r, limit = out[on], places[on], r[on], limit[on]
    low, high = r[:, 3] // 8, r[:, 4] // 8
    band = low + (rng.random(len(on)) * (high - low + 1)).astype(np.int64)
    want = np.zeros((len(on), 3), np.int64)
    l2, i0, kappa = out[:, 4], out[:, 5], out[:, 6]
    _bands(band, box, places[:, 2], places[:, 3], l2, i0, kappa, r, limit, S, want)
    got = bench("flk_splat_band", interval)(
        {"box": box}, band=band, x=places[:, 2], y=places[:, 3], right=r[:, 5], x0=r[:, 1], x1=r[:, 2], y0=r[:, 3], y1=r[:, 4],
        l2=l2, i0=i0, kappa=kappa, limit=limit,
    )
    empty = want[:, 0] == 1
    assert box or empty.any()
    assert np.array_equal(got["empty"], want[:, 0])
    same(got, {"empty": want[:, 0], "first": want[:, 1], "last": want[:, 2]}, ~empty)


# ---- colour ----------------------------------------------------------------------------------------------


@numba.njit
def _basis(d, M, out):
    for j in range(len(d)):
        colour.basis_functions(d[j, 0], d[j, 1], d[j, 2], 3, out[j], M)


@by_interval("flk_colour_basis")
def test_colour_basis(interval: int) -> None:
    s, rng = demo(PackedFormat.CHUNK), random(6)
    d = np.concatenate([seen(s)[0][:, 8:11], np.stack([wild(rng, 300, C) for _ in range(3)], 1)])
    out = np.zeros((len(d), 16), np.int64)
    _basis(d, C, out)
    got = bench("flk_colour_basis", interval)({}, **of("direction", d))
    same(got, {f"basis_{k}": out[:, k] for k in range(1, 16)})


@numba.njit
def _groups(basis, coefficient, first, fourth):
    for j in range(len(basis)):
        for c in range(3):
            first[j, c], fourth[j, c] = colour.group_sums(basis[j], coefficient[j, :, c])


@pytest.mark.parametrize("chunked", [True, False])
def test_colour_group(chunked: bool) -> None:
    rng, n = random(7), 1000
    basis = rng.integers(-2048, 2048, (n, 4))
    basis[:8], basis[8:16] = -2048, 2047
    used = rng.random((n, 4)) < 0.8
    zero = rng.integers(255, 257, n)
    if chunked:
        raw = rng.integers(0, 256, (n, 4, 3))
        value = 2 * raw - zero[:, None, None]
    else:
        half = (rng.normal(size=(n, 4, 3)) * 2.0 ** rng.integers(-14, 6, (n, 4, 3))).astype(np.float16)
        half.view(np.uint16)[rng.random(half.shape) < 0.1] &= 0x83FF  # subnormal numbers
        half[:4], half[4:8] = 65504.0, -65504.0
        raw, value = half.view(np.uint16).astype(np.int64), np.vectorize(colour.half_coefficient)(half.astype(np.float64))
        assert (np.abs(value) == 8191).sum() > 100
    coefficient = np.where(used[:, :, None], value, 0)
    first, fourth = np.zeros((n, 3), np.int64), np.zeros((n, 3), np.int64)
    _groups(basis, coefficient, first, fourth)
    raws = {f"raw_{k}{c}": raw[:, k, c] for k in range(4) for c in range(3)}
    got = bench("flk_colour_group")({"chunked": chunked}, **of("basis", basis), **raws, **of("used", used.astype(np.int64)), zero=zero)
    same(got, of("first", first) | of("fourth", fourth))


@pytest.mark.parametrize("chunked", [True, False])
def test_colour_constant(chunked: bool) -> None:
    rng, n, values = random(8), 1000, demo(PackedFormat.CHUNK).values
    rows = rng.integers(0, len(values.dc_low), n)
    low, step = values.dc_low[rows], values.dc_step[rows]
    low[:9], step[:9] = rng.choice([-(1 << 19), (1 << 19) - 1], (9, 3)), rng.choice([1.0, -1.0], (9, 3))  # saturated terms on top
    dc = rng.integers(0, 256, (n, 3)) if chunked else rng.normal(size=(n, 3)).astype(np.float16).view(np.uint16).astype(np.int64)
    number = dc.astype(np.float64) if chunked else dc.astype(np.uint16).view(np.float16).astype(np.float64)
    want = np.zeros((n, 3), np.int64)
    for place in np.ndindex(n, 3):
        a, b = (low[place], step[place]) if chunked else (4096, colour.constant_factor(FORMATS))
        want[place] = colour.constant_part(a, b, ff_round(float(number[place]), C), C)
    got = bench("flk_colour_constant")({"chunked": chunked}, **of("dc", dc), **of("low", low), **of("step", step))
    same(got, of("constant", want))


@pytest.mark.parametrize("chunked", [True, False])
def test_colour_term(chunked: bool) -> None:
    rng, n, limits = random(9), 1500, degree_sum(FORMATS)
    sums = (rng.normal(size=n) * 2.0 ** rng.integers(0, 22, n)).astype(np.int64).clip(limits.low, limits.high)
    sums[:2] = limits.low, limits.high
    step = wild(rng, n, C, 105, 130)
    want = np.array([colour.term(v, s if chunked else frame.FP16_STEP, C) for v, s in zip(sums.tolist(), step.tolist())])
    assert chunked != ((np.abs(want) < (1 << 19) - 1).all())
    same(bench("flk_colour_term")({"chunked": chunked}, sum=sums, step=step), {"term": want})


def test_units_are_named_in_this_file() -> None:
    """Every pipeline has a test here."""
    assert {p.module for p in PIPELINES} == {f"flk_{name}" for name in (
        "cluster_test", "colours_last", "cluster_header", "geometry_decode", "projection", "projection_conic", "splat_bounds", "splat_band", "colour_basis",
        "colour_group", "colour_constant", "colour_term")}
