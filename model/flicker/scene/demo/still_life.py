"""The room and the things on the table: wall, table, cloth, vase, fruit, wire bowl, tea glass, candle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flicker.scene.demo.light import window_mask
from flicker.scene.demo.splats import (
    Patch,
    Rand,
    Splats,
    dot,
    fbm,
    frame,
    mix,
    noise,
    sample,
    spread,
    srgb,
    step,
    unit,
)
from flicker.scene.demo.views import seen

TAU = 2.0 * np.pi
VASE = np.array([-1.12, 0.25, 0.03])
BOWL = np.array([1.38, 0.30, 0.05])
GLASS = np.array([0.42, -1.12, 0.05])
CANDLE = np.array([2.72, 1.05, 0.0])
FLAME = CANDLE + [0.0, 0.0, 2.22]
UP = np.array([0.0, 0.0, 1.0])


def _front(patch: Patch) -> np.ndarray:
    """Sampling weight: sides that no demo camera faces get few splats."""
    return np.where(seen(patch.p, patch.n), 1.0, 0.18)


def revolve(profile: list, at: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Surface of revolution around z: u is the turn, v runs along the smoothed (radius, height) profile."""
    knots = np.array(profile, float)
    knots = np.concatenate([2 * knots[:1] - knots[1:2], knots, 2 * knots[-1:] - knots[-2:-1]])

    def surface(uv: np.ndarray) -> np.ndarray:
        x = np.clip(uv[:, 1], -0.01, 1.01) * (len(profile) - 1)
        k = np.clip(np.floor(x).astype(np.int64), 0, len(profile) - 2)
        f = (x - k)[:, None]
        a, b, c, d = (knots[k + i] for i in range(4))
        rz = 0.5 * (2 * b + (c - a) * f + (2 * a - 5 * b + 4 * c - d) * f**2 + (3 * b - a - 3 * c + d) * f**3)
        turn = TAU * uv[:, 0]
        return at + np.stack([rz[:, 0] * np.cos(turn), rz[:, 0] * np.sin(turn), rz[:, 1]], axis=1)

    return surface


def ellipsoid(at: np.ndarray, radii: tuple, axis: tuple = (0.0, 0.0, 1.0)) -> Callable[[np.ndarray], np.ndarray]:
    """Ellipsoid with radii across and along `axis`: u is the turn, v runs from one pole to the other."""
    x, y, z = frame(np.array(axis))

    def surface(uv: np.ndarray) -> np.ndarray:
        turn, polar = TAU * uv[:, 0], np.pi * (1.0 - uv[:, 1])
        s = radii[0] * np.sin(polar)
        return (at + (s * np.cos(turn))[:, None] * x + (s * np.sin(turn))[:, None] * y
                + (radii[1] * np.cos(polar))[:, None] * z)

    return surface


def wall(out: Splats, rand: Rand) -> None:
    """A plastered wall with broad brush strokes; its low border meets the table."""
    plane = lambda uv: np.stack([uv[:, 0] * 22 - 11, 3.5 + 0 * uv[:, 0], uv[:, 1] * 7.6 - 0.6], axis=1)  # noqa: E731
    hidden = sample(plane, 760, rand)
    normal = np.array([0.0, -1.0, 0.0])
    colour = srgb("8fa39a")
    out.add(hidden.p + [0, 0.25, 0], normal, UP, (0.48, 0.40, 0.02), colour, 0.97)
    shade = lambda uv: window_mask(plane(uv)) - 0.5  # noqa: E731

    def weight(q: Patch) -> np.ndarray:
        edge = (np.abs(q.gradient(shade)[0]) < 0.25) & (q.p[:, 2] > -0.2)
        return np.where(np.abs(q.p[:, 0]) < 5.8, 1.0, 0.3) + 2.5 * edge

    patch = sample(plane, 4400, rand, weight)
    distance, line = patch.gradient(shade)
    close = np.abs(distance) < 0.3
    x, z = patch.p[:, 0], patch.p[:, 2]
    angle = 1.5 * fbm(0.45 * x, 0.45 * z, salt=11)
    tone = 0.92 + 0.12 * fbm(0.7 * x, 0.7 * z, salt=12) + 0.08 * rand.normal(len(x))
    tint = mix(srgb("8ea5a1"), srgb("b4b49d"), step(-0.6, 0.8, fbm(0.35 * x, 0.5 * z, salt=13)))
    along = np.stack([np.cos(angle), 0 * x, np.sin(angle)], axis=1)
    length = rand.uniform(len(x), low=0.10, high=0.26) * (1.0 + 0.8 * step(5.6, 6.2, np.abs(x)))
    across = length * rand.uniform(len(x), low=0.3, high=0.75)
    across = np.where(close, np.clip(0.4 * np.abs(distance), 0.025, 0.07), across)
    out.add(patch.p, normal, np.where(close[:, None], line, along), (length, across, 0.006),
            tint * tone[:, None], spread(rand, len(x), 0.12))


def _covered(p: np.ndarray) -> np.ndarray:
    """True (N,) for points of the table well under the cloth."""
    rel = np.stack([dot(p - CLOTH_MIDDLE, CLOTH_X), dot(p - CLOTH_MIDDLE, CLOTH_Y)], axis=1)
    return (np.abs(rel) < CLOTH_HALF - 0.12).all(axis=1)


def table(out: Splats, rand: Rand) -> None:
    """Walnut boards that run from left to right."""
    plane = lambda uv: np.stack([uv[:, 0] * 19 - 9.5, uv[:, 1] * 7.5 - 4.0, 0 * uv[:, 0]], axis=1)  # noqa: E731
    near = lambda q: np.where((np.abs(q.p[:, 0]) < 4.6) & (q.p[:, 1] > -2.6), 1.0, 0.3)  # noqa: E731
    hidden = sample(plane, 1300, rand)
    out.add(hidden.p - [0, 0, 0.10], UP, (1.0, 0, 0), (0.27, 0.20, 0.02), srgb("6e4a2e"), 0.97)
    patch = sample(plane, 6900, rand, near)
    patch = patch.take(~_covered(patch.p))
    x, y = patch.p[:, 0], patch.p[:, 1]
    board = np.floor((y + 4.4) / 0.93)
    gap = np.abs((y + 4.4) / 0.93 - np.round((y + 4.4) / 0.93)) * 0.93
    warp = y + 0.10 * fbm(0.35 * x + 7.7 * board, 0.8 * y, salt=21)
    grain = noise(0.22 * x + 3.1 * board, 13.0 * warp, salt=22) * 0.6 + noise(0.6 * x, 31.0 * warp, salt=23) * 0.5
    colour = mix(srgb("6e4527"), srgb("b98a58"), step(-0.9, 0.95, grain + 0.45 * noise(board * 1.7, 0 * x, salt=24)))
    colour *= (1.0 - 0.75 * step(0.035, 0.008, gap))[:, None] * (1 + 0.05 * rand.normal(len(x)))[:, None]
    far = 1.0 + 0.6 * step(4.4, 5.2, np.abs(x)) + 0.6 * step(-2.4, -2.9, y)
    length = rand.uniform(len(x), low=0.09, high=0.25) * far
    width = np.where(gap < 0.05, 0.010, rand.uniform(len(x), low=0.018, high=0.042) * far)
    out.add(patch.p, UP, (1.0, 0, 0), (length, width, 0.004), colour, spread(rand, len(x), 0.10),
            gloss=1.0, sharp=18.0)


CLOTH_HALF = np.array([2.75, 1.32])
CLOTH_X, CLOTH_Y, _ = frame(UP, (np.sin(0.20), np.cos(0.20), 0.0))
CLOTH_MIDDLE = np.array([0.12, -0.45, 0.0])


def cloth_height(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Height of the cloth above the table at cloth coordinates a (along), b (across)."""
    bend = a + 0.35 * fbm(0.5 * a, 0.5 * b, salt=31)
    fold = np.exp(-(((bend + 0.55 * b - 0.62) / 0.11) ** 2)) * 0.085
    fold += np.exp(-(((bend - 0.4 * b + 1.45) / 0.10) ** 2)) * 0.075
    return 0.020 + 0.022 * (1 + fbm(1.1 * a, 1.1 * b, salt=32)) + fold * step(-0.1, -0.9, b + 0.3 * a)


def cloth(out: Splats, rand: Rand) -> None:
    """A linen runner with indigo stripes, creases and a fringe."""
    ex, ey, (half_a, half_b) = CLOTH_X, CLOTH_Y, CLOTH_HALF

    def at(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        wave = 0.03 * noise(1.3 * a, 0 * a, salt=33)
        return CLOTH_MIDDLE + a[:, None] * ex + (b + wave)[:, None] * ey + cloth_height(a, b)[:, None] * UP

    surface = lambda uv: at((uv[:, 0] * 2 - 1) * half_a, (uv[:, 1] * 2 - 1) * half_b)  # noqa: E731

    def linen(uv: np.ndarray) -> np.ndarray:
        b = np.abs((uv[:, 1] * 2 - 1) * half_b)
        a = np.abs((uv[:, 0] * 2 - 1) * half_a)
        band = lambda x, at, width: step(width + 0.012, width - 0.004, np.abs(x - at))  # noqa: E731
        blue = np.maximum.reduce([band(b, 1.08, 0.075), band(b, 0.93, 0.02), band(b, 0.86, 0.02),
                                  band(a, 2.42, 0.06), band(a, 2.29, 0.018), band(a, 2.22, 0.018)])
        return mix(srgb("f3ead8"), srgb("2a4875"), 0.92 * blue)

    hidden = sample(surface, 1700, rand)
    inside = (np.abs(hidden.uv - 0.5) < [0.485, 0.475]).all(axis=1)
    hidden = hidden.take(inside)
    out.add(hidden.p - [0, 0, 0.018], hidden.n, ex, (0.07, 0.055, 0.008), linen(hidden.uv), 0.95)
    patch = sample(surface, 7300, rand)
    count = len(patch.p)
    a, b = (np.abs(patch.uv * 2 - 1) * [half_a, half_b]).T
    long_stripe, end_stripe = np.abs(b - 0.97) < 0.22, np.abs(a - 2.35) < 0.2
    warp = np.where(long_stripe, True, np.where(end_stripe, False, rand.uniform(count) < 0.6))
    low = np.where(long_stripe | end_stripe, 0.45, 0.15)
    along = np.where(warp[:, None], ex, ey)
    weave = 1.0 + 0.06 * rand.normal(count)
    length = np.where(warp, rand.uniform(count, low=0.045, high=0.085), rand.uniform(count, low=0.030, high=0.055))
    out.add(patch.p, patch.n, along, (length, rand.uniform(count, low=0.009, high=0.014), 0.004),
            linen(patch.uv) * weave[:, None], spread(rand, count, low))
    edge = rand.uniform(520, low=-half_b, high=half_b)
    side = np.where(np.arange(520) % 2 == 0, 1.0, -1.0)
    for part in range(2):
        a = side * (half_a + 0.05 + 0.09 * part)
        direction = unit(side[:, None] * ex + (0.35 * rand.normal(520))[:, None] * ey)
        out.add(at(a, edge + 0.02 * rand.normal(520)) - [0, 0, 0.012], UP, direction, (0.05, 0.008, 0.006),
                srgb("e6dcc6"), rand.uniform(520, low=0.4, high=0.95))


def vase(out: Splats, rand: Rand) -> None:
    """A porcelain vase with cobalt bands, lotus rosettes and a vine."""
    profile = [(0.30, 0.0), (0.36, 0.06), (0.53, 0.30), (0.63, 0.60), (0.60, 0.88), (0.43, 1.12),
               (0.245, 1.30), (0.225, 1.42), (0.33, 1.56)]
    surface = revolve(profile, VASE)

    def ink(uv: np.ndarray) -> np.ndarray:
        """Positive inside the painted pattern, about a distance in decimetres."""
        p = surface(uv) - VASE
        z, turn = p[:, 2], TAU * uv[:, 0]
        band = lambda at, half: half - np.abs(z - at)  # noqa: E731
        f = np.maximum.reduce([band(0.09, 0.035), band(0.165, 0.010), band(0.965, 0.010), band(1.02, 0.022),
                               band(1.53, 0.03), band(1.22, 0.012)])
        cell = np.mod(turn / TAU * 7 + 0.30, 1.0) - 0.5
        dx, dz = cell * TAU / 7 * 0.62, z - 0.60
        r = np.sqrt(dx * dx + dz * dz + 1e-9)
        phi = np.arctan2(dz, dx)
        petal = 0.155 * (0.62 + 0.38 * np.abs(np.cos(4.0 * phi))) - r
        f = np.maximum(f, np.minimum(petal, np.abs(r - 0.075) - 0.012))
        f = np.maximum(f, 0.030 - r)
        vine = np.abs(z - 0.60 - 0.235 * np.cos(7 * turn + 2.1)) * 0.72
        f = np.maximum(f, 0.017 - vine)
        leaf = np.mod(turn / TAU * 28, 1.0) - 0.5
        f = np.maximum(f, 0.030 - np.sqrt((leaf * 0.145) ** 2 + (z - 0.60 - 0.29 * np.cos(7 * turn + 2.1)) ** 2 + 1e-9))
        tongue = np.abs(np.mod(turn / TAU * 22, 1.0) - 0.5)
        flame = 0.20 * (0.42 - tongue) - 0.30 * np.maximum(z - 0.30, 0)
        f = np.maximum(f, np.minimum(flame, z - 0.19) - (z > 0.42))
        f = np.maximum(f, np.minimum(0.10 * (0.40 - tongue) - 0.25 * np.abs(z - 1.12), 0.09 - np.abs(z - 1.12)))
        return f

    def glaze(uv: np.ndarray, p: np.ndarray, f: np.ndarray) -> np.ndarray:
        wash = fbm(9 * p[:, 0], 9 * p[:, 2], 9 * p[:, 1], salt=41)
        blue = mix(srgb("1f3f8f"), srgb("4f7cc0"), step(-0.6, 0.9, wash))
        white = mix(srgb("e6e3da"), srgb("d6dde0"), step(-0.5, 1.0, wash))
        return mix(white, blue, step(-0.006, 0.008, f))

    hidden = sample(surface, 800, rand, _front)
    out.add(hidden.p - 0.03 * hidden.n, hidden.n, UP, (0.055, 0.040, 0.008),
            glaze(hidden.uv, hidden.p, ink(hidden.uv)), 0.97, gloss=1.6, sharp=300.0)
    plain = sample(surface, 2500, rand, _front)
    detail = sample(surface, 9300, rand, _front)
    distance, _ = detail.gradient(ink)
    detail = detail.take(rand.uniform(len(detail.p)) < 0.62 * np.exp(-((distance / 0.035) ** 2)))
    for patch, low in ((plain, 0.12), (detail, 0.3)):
        count = len(patch.p)
        distance, line = patch.gradient(ink)
        close = np.abs(distance) < 0.05
        around = np.cross(UP, patch.n)
        across = np.clip(np.abs(distance) * 0.55, 0.0075, 0.024)
        length = np.where(close, np.clip(across * 3.2, 0.024, 0.06), rand.uniform(count, low=0.03, high=0.07))
        out.add(patch.p, patch.n, np.where(close[:, None], line, around), (length, across, 0.003),
                glaze(patch.uv, patch.p, distance), spread(rand, count, low), gloss=2.0, sharp=420.0)
    lip = np.linspace(0, TAU, 110, endpoint=False)
    ring = np.stack([np.cos(lip), np.sin(lip), 0 * lip], axis=1)
    out.add(VASE + 0.335 * ring + [0, 0, 1.565], ring * 0.5 + UP, np.cross(UP, ring), (0.022, 0.011, 0.011),
            srgb("30508f"), 0.9, gloss=1.0, sharp=420.0)
    throat = sample(revolve([(0.22, 1.38), (0.21, 1.44), (0.31, 1.55)], VASE), 260, rand)
    out.add(throat.p, -throat.n, UP, (0.04, 0.025, 0.006), srgb("c9cfd2"), 0.9)
