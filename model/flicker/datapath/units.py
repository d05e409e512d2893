"""The pipelines of the front end: inputs, what the golden model does with them, outputs. Registers of a frame are inputs that all its elements share.

Numbers are those of `FrontFormats`. Pixels are in 1/128 where nothing else is said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..arithmetic.ff import ff_round, ff_sub
from ..golden.front import colour, cull, frame, reach, reuse, splat
from ..golden.front.setup import CLUSTER_M, MAX_PICTURE, MIDDLE_INTEGER, FrontFormats
from ..params import SUBTILE, Form
from ..scene.slopes import CODE_BITS
from .graph import BOOL, Ff, Graph, Int, Operator, Value, retrace

WORD, HALF = Int(0, (1 << 32) - 1), Int(0, (1 << 16) - 1)
SCALE_HEADER = Int(-(1 << frame.SCALE_HEADER_BITS - 1), (1 << frame.SCALE_HEADER_BITS - 1) - 1)  # low end of log2 scales
SCALE_STEP = Int(0, (1 << frame.SCALE_STEP_BITS) - 1)
BANDS = MAX_PICTURE // SUBTILE


def _signed(bits: int) -> Int:
    return Int(-(1 << (bits - 1)), (1 << (bits - 1)) - 1)


def reach_range(formats: FrontFormats) -> Int:
    """Of what is measured from a mean."""
    return _signed(splat.MEAN_INTEGER + formats.mean)


def middle_range(formats: FrontFormats) -> Int:
    """Of the principal point."""
    return _signed(MIDDLE_INTEGER + formats.mean)


def mean_range(formats: FrontFormats) -> Int:
    """What `project_one` may give."""
    far, middle = reach_range(formats), middle_range(formats)
    return Int(far.low + middle.low, far.high + middle.high)


def basis_range(formats: FrontFormats) -> Int:
    """Of the spherical harmonics."""
    return _signed(formats.harmonics + 1)


def term_range(formats: FrontFormats) -> Int:
    """Of what is added to a colour."""
    return _signed(colour.TERM_INTEGER + formats.term)


@dataclass(frozen=True)
class Pipeline:
    """A pipeline. intervals: cycles between two elements that it can be built for, the usual one first. head: what it does, for the comment of the module."""

    module: str
    intervals: tuple[int, ...]
    build: Callable[[FrontFormats], Graph]
    head: str


class _Matrix(list):
    """Nested lists with the indices of an array."""

    def __getitem__(self, index: Any) -> Any:
        return super().__getitem__(index[0])[index[1]] if isinstance(index, tuple) else super().__getitem__(index)


def _symbolic(function: Callable) -> Callable:
    """A plain function of ff operations as retrace wants it."""
    return retrace(type("Kernel", (), {"py_func": staticmethod(function)}))


def _name(values: Any) -> None:
    """Names from the fields of a tuple."""
    for name, value in values._asdict().items():
        if not value.name:
            value.name = name


def cluster_test(formats: FrontFormats) -> Graph:
    g, kind = Graph(), Ff(CLUSTER_M)
    low, high, sigma = g.inputs("low", kind, (3,)), g.inputs("high", kind, (3,)), g.input("sigma", kind)
    position = g.inputs("position", kind, (3,), register=True)
    normal = _Matrix(g.inputs("normal", kind, (5, 3), register=True))
    offset, far = (g.inputs(n, kind, (5,), register=True) for n in ("offset", "reach"))
    g.output("keep", retrace(cull.test_cluster)(low, high, sigma, position, normal, offset, far))
    return g


def colours_last(formats: FrontFormats) -> Graph:
    g, kind = Graph(), Ff(CLUSTER_M)
    low, high, then = (g.inputs(name, kind, (3,)) for name in ("low", "high", "then"))
    code = g.input("slope", Int(0, (1 << CODE_BITS) - 1))
    position, limit = g.inputs("position", kind, (3,), register=True), g.input("limit", kind, register=True)
    g.output("last", retrace(reuse.colours_last)(low, high, code, then, position, limit))
    return g


def cluster_header(formats: FrontFormats) -> Graph:
    """What the lanes need of a cluster's header; `cluster_values` of the golden model."""
    g, kind = Graph(), Ff(CLUSTER_M)
    P, C = formats.position, formats.colour
    origin, step, position = g.inputs("origin", kind, (3,)), g.inputs("step", kind, (3,)), g.inputs("position", kind, (3,), register=True)
    scale_low, scale_step = (g.inputs(n, kind, (3,)) for n in ("scale_low", "scale_step"))
    dc_low, dc_step = (g.inputs(n, kind, (3,)) for n in ("dc_low", "dc_step"))
    sh = g.inputs("sh_step", kind, (3, 3))  # by degree and channel
    for k in range(3):
        g.output(f"low_{k}", _symbolic(lambda a, b: ff_round(ff_sub(a, b, CLUSTER_M), P))(origin[k], position[k]))
        g.output(f"step_{k}", g.ff_round(step[k], P))
        g.output(f"scale_low_{k}", g.to_fixed(scale_low[k], frame.SCALE_HEADER_FRACTION, SCALE_HEADER.bits, True))
        signed = g.to_fixed(scale_step[k], frame.SCALE_HEADER_FRACTION, SCALE_STEP.bits + 1, True)
        g.output(f"scale_step_{k}", g.wire(f"{SCALE_STEP.bits}'({{0}} & ~({{0}} >>> {SCALE_STEP.bits}))", SCALE_STEP, (signed,)))
        g.output(f"dc_low_{k}", g.to_fixed(dc_low[k], formats.term, term_range(formats).bits, True))
        g.output(f"dc_step_{k}", g.ff_round(dc_step[k], C))
        for degree in range(3):
            g.output(f"sh_step_{degree}{k}", g.ff_round(sh[degree][k], C))
    return g


def geometry_decode(formats: FrontFormats) -> Graph:
    """Geometry of a Gaussian as it lies in the image: three words of a chunk, or five of FP16."""
    g = Graph()
    P, S = formats.position, formats.shape
    chunked, words = g.input("chunked", BOOL, register=True), g.inputs("word", WORD, (5,))
    low, step = g.inputs("scale_low", SCALE_HEADER, (3,)), g.inputs("scale_step", SCALE_STEP, (3,))
    halves = [g.slice(words[k // 2], 16 * (k % 2), 16) for k in range(10)]
    codes = [g.slice(words[0], at, bits) for at, bits in ((21, 11), (11, 10), (0, 11))]
    for k in range(3):
        g.output(f"q_{k}", g.pick(chunked, g.from_fixed(codes[k], 0, P), g.from_fp16(halves[k], P)))
    scales = [g.slice(words[2], at, bits) for at, bits in ((21, 11), (11, 10), (0, 11))]
    for k in range(3):
        chunk = retrace(frame.chunk_scale)(scales[k], low[k], step[k], S)
        g.output(f"s_{k}", g.pick(chunked, chunk, g.from_fp16(halves[3 + k], S)))
    a, b, d = (2 * g.slice(words[1], at, 10) - 1023 for at in (20, 10, 0))
    most = retrace(splat.largest_component)(a, b, d, S)
    rest = [g.from_fixed(v, 0, S) for v in (a, b, d)]
    quat = retrace(splat.place_largest)(g.slice(words[1], 30, 2), most, *rest)
    for k, name in enumerate("wxyz"):
        g.output(f"q{name}", g.pick(chunked, quat[k], g.from_fp16(halves[6 + k], S)))
    return g


def projection(formats: FrontFormats, form: Form = Form.FACTORED) -> Graph:
    """form: of the shape that records get. Lists take l2 with either."""
    g = Graph()
    P, S = formats.position, formats.shape
    low, step = g.inputs("low", Ff(P), (3,)), g.inputs("step", Ff(P), (3,))
    q, s = g.inputs("q", Ff(P), (3,)), g.inputs("s", Ff(S), (3,))
    quat = [g.input(n, Ff(S)) for n in ("qw", "qx", "qy", "qz")]
    view, focal = _Matrix(g.inputs("view", Ff(P), (3, 3), register=True)), g.inputs("focal", Ff(P), (2,), register=True)
    rows = [g.inputs(n, Ff(S), (3,), register=True) for n in ("row_x", "row_x_z", "row_y", "row_y_z")]
    least, limit = (g.inputs(n, Ff(S), (2,), register=True) for n in ("least", "limit"))
    middle = g.inputs("middle", middle_range(formats), (2,), register=True)
    width, height = (g.input(n, Int(1, MAX_PICTURE), register=True) for n in ("width", "height"))
    chunked, antialiased, by_distance = (g.input(n, BOOL, register=True) for n in ("chunked", "antialiased", "by_distance"))
    share = g.pick(chunked, g.number(frame.CHUNK_SHARE, S), g.number(frame.FP16_SHARE, S))
    const = splat.constants(formats).tolist()
    p = retrace(splat.project_one)(low, step, q, s, *quat, view, focal, *rows, least, limit, middle, share, antialiased, const, P, S, formats.mean)
    _name(p)
    x0, x1 = retrace(splat.pixels)(p.x, p.radius_x, width, formats.mean)
    y0, y1 = retrace(splat.pixels)(p.y, p.radius_y, height, formats.mean)
    steady = retrace(reach.steady_one)(p, reach.reach_tables(formats)[3], S)
    _name(steady)
    g.output("near", p.near)
    g.output("outside", (x0 > x1) | (y0 > y1))
    factored = ("l0", "l1") if form == Form.FACTORED else ()
    for name in ("far", "x", "y", "sx", "sy", *factored, "l2", "spiky", "scale"):
        g.output(name, getattr(p, name))
    if form == Form.CONIC:
        for k, value in enumerate(retrace(splat.conic_one)(p, S)):
            g.output(f"conic_{k}", value)
    for name, value in steady._asdict().items():
        g.output(name, value)
    g.output("key", retrace(frame.sort_key)(by_distance, p.t2, p.square, P, formats.key))
    for k, value in enumerate((p.d0, p.d1, p.d2)):
        g.output(f"direction_{k}", g.ff_round(value, formats.colour))
    return g


def projection_conic(formats: FrontFormats) -> Graph:
    return projection(formats, Form.CONIC)


def bounds(formats: FrontFormats) -> Graph:
    """Where a splat of a known opacity reaches."""
    g, S = Graph(), formats.shape
    x, y = (g.input(n, mean_range(formats)) for n in ("x", "y"))
    sx, sy, lean, scale = (g.input(n, Ff(S)) for n in ("sx", "sy", "lean", "scale"))
    box = g.input("box", BOOL, register=True)
    opacity = g.input("opacity", HALF, late=True)  # FP16; the code of a chunk is taken as its bits, too
    width, height = (g.input(n, Int(1, MAX_PICTURE), register=True) for n in ("width", "height"))
    logs, sigmas, cut, _ = reach.reach_tables(formats)
    tables = [g.table(n, t, S) for n, t in (("log", logs), ("sigmas", sigmas), ("cut", cut))]
    zero = g.number(0.0, S)
    # The sign is that of an opacity: positive.
    half = g.wire("{0} & 16'h7fff", HALF, (opacity,))
    code = retrace(frame.scaled_opacity)(scale, g.from_fp16(half, S), S)
    code = g.wire("8'({0})", Int(0, 255), (code,))
    r = retrace(reach.reach_one)(x, y, sx, sy, reach.Steady(zero, zero, lean), code, box, width, height, *tables, S, formats.mean)
    g.output("empty", (r.x0 > r.x1) | (r.y0 > r.y1))
    for name in ("x0", "x1", "y0", "y1"):  # in the picture, if it is not empty
        g.output(name, _bits(g, getattr(r, name)))
    g.output("limit", r.limit)
    g.output("right", r.right)
    g.output("code", code)
    return g


def band(formats: FrontFormats) -> Graph:
    """Sub-tiles of a band that a splat enters."""
    g, S = Graph(), formats.shape
    number, box = g.input("band", Int(0, BANDS - 1)), g.input("box", BOOL, register=True)
    x, y = (g.input(n, mean_range(formats)) for n in ("x", "y"))
    right = g.input("right", reach_range(formats), late=True)
    pixel = Int(0, MAX_PICTURE - 1)
    x0, x1, y0, y1 = (g.input(n, pixel) for n in ("x0", "x1", "y0", "y1"))
    l2, i0, kappa, limit = (g.input(n, Ff(S)) for n in ("l2", "i0", "kappa", "limit"))
    r = reach.Reach(x0, x1, y0, y1, i0, kappa, limit, right)
    a, b = retrace(reach.band_columns)(number, box, x, y, l2, r, S, formats.mean)
    g.output("empty", a > b)
    # A band that is not empty begins and ends in the picture.
    for name, column in (("first", a), ("last", b)):
        g.output(name, g.wire("9'({0} >>> 3)", Int(0, 511), (column,)))
    return g


def _bits(g: Graph, value: Value) -> Value:
    """The low 12 bits of an integer, unsigned."""
    return g.wire("12'({0})", Int(0, 4095), (value,))


def colour_basis(formats: FrontFormats) -> Graph:
    """Spherical harmonics in a direction, which comes out of a memory."""
    g, C = Graph(), formats.colour
    d = g.inputs("direction", Ff(C), (3,), late=True)
    out: list[Any] = [None] * 16
    retrace(colour.basis_functions)(*d, 3, out, C, formats.direction, formats.harmonics)
    for k in range(1, 16):
        g.output(f"basis_{k}", out[k])
    return g


def _coefficient(g: Graph, fraction: int, chunked: Value, used: Value, raw: Value, zero: Value) -> Value:
    """A coefficient as it stands in the image, as a whole number. `flk_coefficient` has the default's bits."""
    top = (1 << (colour.COEFFICIENT_INTEGER + fraction - 1)) - 1
    operator = Operator("flk_coefficient", ports=("chunked_i", "used_i", "raw_i", "zero_i", "y_o"), clocked=False)
    return g.make(Int(-top, top), operator, (chunked, used, raw, zero))


def colour_group(formats: FrontFormats) -> Graph:
    """Four coefficients of three channels times their functions."""
    g = Graph()
    chunked = g.input("chunked", BOOL, register=True)
    basis = g.inputs("basis", basis_range(formats), (4,))
    raw = g.inputs("raw", HALF, (4, 3))  # code of a chunk, or FP16
    zero = g.input("zero", Int(0, 511), late=True)
    used = g.inputs("used", BOOL, (4,))
    for c in range(3):
        coefficient = [_coefficient(g, formats.coefficient, chunked, used[k], raw[k][c], zero) for k in range(4)]
        first, fourth = retrace(colour.group_sums)(basis, coefficient, formats.harmonics - formats.sums)
        g.output(f"first_{c}", first)
        g.output(f"fourth_{c}", fourth)
    return g


def colour_constant(formats: FrontFormats) -> Graph:
    """The constant part of the colour."""
    g, C = Graph(), formats.colour
    chunked = g.input("chunked", BOOL, register=True)
    dc = g.inputs("dc", HALF, (3,))
    low, step = g.inputs("low", term_range(formats), (3,), late=True), g.inputs("step", Ff(C), (3,), late=True)
    for k in range(3):
        code = g.pick(chunked, g.from_fixed(g.slice(dc[k], 0, 8), 0, C), g.from_fp16(dc[k], C))
        a, b = g.pick(chunked, low[k], 1 << (formats.term - 1)), g.pick(chunked, step[k], colour.constant_factor(formats))
        g.output(f"constant_{k}", retrace(colour.constant_part)(a, b, code, C, formats.term))
    return g


def colour_term(formats: FrontFormats) -> Graph:
    """What a degree adds to a channel."""
    g, C = Graph(), formats.colour
    chunked = g.input("chunked", BOOL, register=True)
    sum_, step = g.input("sum", degree_sum(formats)), g.input("step", Ff(C), late=True)
    g.output("term", retrace(colour.term)(sum_, g.pick(chunked, step, 2.0**-formats.coefficient), C, formats.sums, formats.term))
    return g


def group_ranges(formats: FrontFormats) -> tuple[Int, Int]:
    """What a group's sum of three products and its fourth may be."""
    outputs = colour_group(formats).outputs
    return outputs["first_0"].range, outputs["fourth_0"].range


def degree_sum(formats: FrontFormats) -> Int:
    """Of two groups."""
    first, fourth = group_ranges(formats)
    return Int(2 * (first.low + fourth.low), 2 * (first.high + fourth.high))


def constant_range(formats: FrontFormats) -> Int:
    """Of a colour's constant part."""
    one = term_range(formats)
    return Int(2 * one.low, 2 * one.high)

PIPELINES = [
    Pipeline("flk_cluster_test", (16,), cluster_test, "Cluster test: keep, and the nearest and farthest depth of the box."),
    Pipeline("flk_colours_last", (16,), colours_last, "Whether a cluster's stored colours may be shown."),
    Pipeline("flk_cluster_header", (4,), cluster_header, "Header of a cluster to the numbers that the lanes take."),
    Pipeline("flk_geometry_decode", (2, 4), geometry_decode, "Geometry of a Gaussian from the image."),
    Pipeline("flk_projection", (2, 4), projection, "Projection of a Gaussian: mean, shape, key, what its bounds need."),
    Pipeline(
        "flk_projection_conic", (2, 4), projection_conic,
        "Projection of a Gaussian for records in conic form: mean, a / 2, b, c / 2, key, what its bounds need.",
    ),
    Pipeline("flk_splat_bounds", (2, 4), bounds, "Opacity code and bounds of a splat."),
    Pipeline("flk_splat_band", (1, 2), band, "Sub-tiles of a band of 8 pixel rows that a splat enters."),
    Pipeline("flk_colour_basis", (2, 4), colour_basis, "Spherical harmonics in a direction."),
    Pipeline("flk_colour_group", (1,), colour_group, "Four products of basis and coefficient for three channels: the sum of the first three, and the fourth."),
    Pipeline("flk_colour_constant", (1,), colour_constant, "Constant part of a colour, three channels."),
    Pipeline("flk_colour_term", (1,), colour_term, "What a degree of spherical harmonics adds to a channel: its sum of products times the cluster's step."),
]
