"""The bouquet: peonies, daisies, larkspur, eucalyptus, grasses; and petals that fell on the table."""

from __future__ import annotations

import numpy as np

from flicker.scene.demo.splats import (
    Rand,
    Splats,
    bezier,
    dot,
    fbm,
    frame,
    mix,
    sample,
    spread,
    srgb,
    step,
    unit,
)
from flicker.scene.demo.still_life import TAU, UP, VASE, ellipsoid

MOUTH = VASE + [0.0, 0.0, 1.50]
HEART = VASE + [0.0, 0.05, 1.85]


def _stem(out: Splats, rand: Rand, top: np.ndarray, colour: str, thickness: float) -> None:
    foot = MOUTH + 0.10 * rand.normal(3) * [1, 1, 0] - [0, 0, 0.1]
    bend = (foot + top) / 2 + [0, 0, 0.22] + 0.06 * rand.normal(3)
    count = int(10 * np.sqrt(dot(top - foot, top - foot)) / 0.4) + 4
    p, along = bezier([foot, bend, top], np.linspace(0, 1, count))
    length = np.sqrt(dot(top - foot, top - foot)) / count
    out.add(p, np.cross(along, [1.0, 0.1, 0]), along, (length * 0.75, thickness, thickness),
            srgb(colour) * (0.8 + 0.3 * rand.uniform(count, 1)), rand.uniform(count, low=0.6, high=1.0), gloss=0.3)


def _blade(out: Splats, rand: Rand, points: list, width: float, count: int, colours: tuple, gloss: float = 0.6,
           face: tuple = (0.0, -0.75, 0.65), low: float = 0.25) -> None:
    """A leaf along a Bezier curve: halves that bend up from a paler mid rib."""
    u = np.mod(rand.uniform(1) + np.arange(count) * 0.7548776662466927, 1.0)
    v = np.mod(rand.uniform(1) + np.arange(count) * 0.5698402909980532, 1.0) * 2 - 1
    p, along = bezier(points, u)
    normal = unit(np.asarray(face) - dot(along, np.broadcast_to(face, along.shape))[:, None] * along)
    side = np.cross(along, normal)
    half = width * np.sqrt(np.clip(u * 4, 0, 1)) * (1 - u**2.2) + 0.003
    p = p + (v * half)[:, None] * side + (0.35 * np.abs(v) * half)[:, None] * normal
    n = unit(normal - (0.55 * np.sign(v))[:, None] * side)
    vein = step(0.16, 0.05, np.abs(v))
    tone = 0.5 + 0.35 * fbm(7 * u, 3 * v, salt=71) + 0.18 * rand.normal(count)
    colour = mix(mix(srgb(colours[0]), srgb(colours[1]), np.clip(tone, 0, 1)), srgb(colours[2]), 0.75 * vein)
    lean = unit(along + (0.45 * np.sign(v) * (np.abs(v) > 0.16))[:, None] * side)
    span = max(width, 0.02)
    long = np.clip(span * rand.uniform(count, low=0.35, high=0.75), 0.018, 0.055)
    out.add(p, n, lean, (long, np.clip(long * 0.28, 0.006, 0.017), 0.003), colour, spread(rand, count, low),
            gloss=gloss, sharp=30.0, through=0.35)


def _peony(out: Splats, rand: Rand, at: np.ndarray, face: np.ndarray, radius: float, colours: tuple) -> None:
    """Rings of cupped petals on nested shells, from a closed heart to open outer petals."""
    x, y, z = frame(face)
    turn0 = rand.uniform(1)[0] * TAU
    # petals, radius of the shell, polar angle of the tips, half width of a petal in radians
    rings = ((3, 0.30, 0.15, 1.15), (5, 0.48, 0.45, 0.78), (6, 0.66, 0.74, 0.66), (7, 0.85, 1.04, 0.58),
             (8, 1.02, 1.36, 0.52))
    heart = sample(ellipsoid(at - 0.22 * radius * z, (0.50 * radius, 0.38 * radius), tuple(z)), 60, rand)
    out.add(heart.p, heart.n, heart.du, (0.06, 0.05, 0.02), srgb(colours[0]) * 0.8, 0.97, through=0.2)
    for ring, (petals, shell, opening, spread_angle) in enumerate(rings):
        for k in range(petals):
            turn = turn0 + ring * 1.3 + (k + 0.25 * rand.uniform(1, low=-1)[0]) * TAU / petals
            phase = rand.uniform(2)
            lift = opening + 0.12 * rand.normal(1)[0]

            def petal(uv: np.ndarray, shell: float = shell, turn: float = turn, lift: float = lift,
                      phase: np.ndarray = phase, width: float = spread_angle) -> np.ndarray:
                u, v = uv[:, 0], uv[:, 1] * 2 - 1
                reach = u * (1 - 0.16 * v * v + 0.05 * np.cos(9 * v + 6 * phase[0]) * u)
                polar = 2.35 + (lift - 2.35) * reach
                azimuth = turn + v * width * (0.25 + 0.75 * np.sqrt(np.clip(u, 0, 1)))
                ruffle = 0.045 * u * u * np.sin(7 * v + 6 * phase[1])
                r = radius * shell * (1 + 0.10 * u**3 * (shell > 0.7) - 0.08 * v * v + ruffle)
                s = r * np.sin(polar)
                out_of = np.cos(azimuth)[:, None] * x + np.sin(azimuth)[:, None] * y
                return at + s[:, None] * out_of + (r * np.cos(polar))[:, None] * z

            count = int((13 + 35 * shell) * (radius / 0.43))
            patch = sample(petal, count, rand, lambda q: 0.25 + 0.75 * step(0.25, 0.6, q.uv[:, 0]))
            u, v = patch.uv[:, 0], patch.uv[:, 1] * 2 - 1
            streak = 0.5 + 0.5 * fbm(2 * u, 9 * v + 31 * phase[0], salt=81)
            tone = np.clip(step(0.45, 1.0, u - 0.12 * v * v) + 0.35 * (streak - 0.5) + 0.15 * (phase[1] - 0.5), 0, 1)
            colour = mix(srgb(colours[0]), srgb(colours[1]), tone)
            colour = mix(colour, srgb(colours[2]), 0.45 * step(0.84, 0.98, u))
            edge = u > 0.93
            size = radius / 0.42
            count = len(u)
            long = np.where(edge, 0.020, rand.uniform(count, low=0.034, high=0.060)) * size
            across = np.where(edge, 0.009, rand.uniform(count, low=0.0095, high=0.018)) * size
            normal = np.where((dot(patch.n, z) < 0)[:, None], -patch.n, patch.n)
            out.add(patch.p, normal, np.where(edge[:, None], patch.dv, patch.du), (long, across, 0.004), colour,
                    spread(rand, count, 0.3), gloss=0.25, sharp=20.0, through=0.5)


def _daisy(out: Splats, rand: Rand, at: np.ndarray, face: np.ndarray, radius: float, petals: int = 14) -> None:
    """A daisy: narrow white petals around a yellow dome."""
    x, y, z = frame(face)
    for k in range(petals):
        turn = (k + 0.3 * rand.uniform(1, low=-1)[0]) * TAU / petals
        out_of = np.cos(turn) * x + np.sin(turn) * y
        droop = 0.10 + 0.15 * rand.uniform(1)[0]
        points = [at + 0.16 * radius * out_of, at + 0.6 * radius * (out_of + 0.12 * z), at + radius * (out_of - droop * z)]
        _blade(out, rand, points, 0.155 * radius, 16, ("f2efe6", "ffffff", "e9e4d2"), 0.2, tuple(z), 0.4)
    dome = sample(lambda uv: ellipsoid(at, (0.24 * radius, 0.14 * radius), tuple(z))(uv * [1, 0.5] + [0, 0.5]), 70, rand)
    colour = mix(srgb("c98a12"), srgb("f7cf3a"), rand.uniform(len(dome.p)))
    out.add(dome.p, dome.n, dome.du, (0.014, 0.011, 0.006), colour, spread(rand, len(dome.p), 0.6))


def _larkspur(out: Splats, rand: Rand, foot: np.ndarray, top: np.ndarray, colours: tuple) -> None:
    """A spire of small florets, buds towards the tip."""
    _stem(out, rand, foot + 0.6 * (top - foot), "5f7a45", 0.010)
    axis = unit(top - foot)
    x, y, _ = frame(axis)
    for k in range(30):
        h = k / 29
        turn = k * 2.39996
        size = 0.14 * (1 - 0.70 * h)
        out_of = np.cos(turn) * x + np.sin(turn) * y
        centre = foot + h * (top - foot) + (0.11 * (1 - 0.75 * h)) * out_of
        fx, fy, fz = frame(out_of + 0.25 * axis + [0, -0.4, 0])
        petals = 5 if h < 0.75 else 3
        for j in range(petals):
            around = np.cos(j * TAU / petals + k) * fx + np.sin(j * TAU / petals + k) * fy
            p = centre + size * np.array([[0.35], [0.75]]) * around
            tone = rand.uniform(2)
            out.add(p, fz + 0.5 * around, around, (size * 0.38, size * 0.22, 0.006),
                    mix(srgb(colours[0]), srgb(colours[1]), tone), rand.uniform(2, low=0.45, high=1.0), through=0.4)
        out.add(centre[None] + 0.01 * fz, fz, fx, (0.012, 0.010, 0.006), srgb("f3ecd8"), 0.8 * (1 - h) + 0.1)


def _eucalyptus(out: Splats, rand: Rand, start: np.ndarray, middle: np.ndarray, end: np.ndarray, pairs: int) -> None:
    """A branch with pairs of round grey-green leaves."""
    p, along = bezier([start, middle, end], np.linspace(0, 1, 34))
    length = np.sqrt(dot(end - start, end - start)) / 30
    out.add(p, np.cross(along, [1.0, 0.2, 0.1]), along, (length, 0.010, 0.010), srgb("7a6a55"),
            rand.uniform(34, low=0.6, high=1.0))
    for k in range(pairs):
        at, direction = bezier([start, middle, end], np.array([0.18 + 0.82 * k / (pairs - 1)]))
        at, direction = at[0], direction[0]
        size = 0.145 * (1 - 0.5 * k / pairs)
        for side in (-1.0, 1.0):
            tilt = rand.normal(3) * 0.35
            out_of = unit(np.cross(direction, [0.1, -1.0, 0.35]) * side + 0.55 * direction + tilt)
            face = unit(np.array([0.0, -0.8, 0.6]) + 0.8 * rand.normal(3))
            _blade(out, rand, [at, at + size * (out_of + 0.12 * UP), at + 2 * size * out_of], size * 0.95, 27,
                   ("5d7a6c", "93ab98", "b4c2ac"), 0.35, tuple(face), 0.45)


PINK = ("b8324a", "ee8a86", "fbd3c4")
CORAL = ("c2472c", "f48d62", "fcd5b0")
CREAM = ("d9a878", "f6e2c4", "fff6e6")


def bouquet(out: Splats, rand: Rand) -> None:
    """Everything in the vase."""
    toward = np.array([0.0, -0.55, 0.10])
    core = sample(ellipsoid(HEART + [0, 0.12, 0.15], (0.52, 0.50)), 240, rand)
    out.add(core.p, core.n, core.du, (0.09, 0.06, 0.03), srgb("2c3f26"), 0.9)
    for offset, radius, colours in (((-0.34, -0.52, 0.10), 0.42, CORAL), ((0.50, -0.34, 0.30), 0.43, PINK),
                                    ((-0.80, -0.12, 0.52), 0.36, CREAM), ((0.06, -0.22, 0.86), 0.40, CREAM),
                                    ((0.30, -0.58, -0.04), 0.28, CREAM), ((0.78, 0.15, 0.82), 0.33, CORAL),
                                    ((-0.52, 0.12, 1.12), 0.30, PINK)):
        at = HEART + np.array(offset)
        face = unit(unit(at - HEART + [0, 0, 0.15]) + toward)
        _stem(out, rand, at - 0.3 * radius * face, "4f6b3a", 0.018)
        _peony(out, rand, at, face, radius, colours)
    for offset, radius in (((-0.78, -0.42, 0.00), 0.22), ((0.90, -0.30, 0.06), 0.22), ((0.52, -0.12, 1.20), 0.20),
                           ((-1.06, 0.00, 0.98), 0.21), ((-0.14, -0.42, 0.52), 0.17), ((1.16, 0.05, 0.48), 0.19)):
        at = HEART + np.array(offset)
        face = unit(unit(at - HEART) * 0.8 + [0.0, -0.75, 0.25])
        _stem(out, rand, at - 0.02 * face, "5e8043", 0.010)
        _daisy(out, rand, at, face, radius)
    for low, high, colours in (((-0.22, 0.12, 0.75), (-0.40, 0.10, 1.52), ("27358f", "6f86d6")),
                               ((0.30, 0.15, 0.80), (0.52, 0.14, 1.48), ("3b2f8f", "8f7fd8")),
                               ((-0.66, 0.15, 0.60), (-1.08, 0.16, 1.28), ("2b4596", "7fa0de"))):
        _larkspur(out, rand, HEART + np.array(low), HEART + np.array(high), colours)
    branches = (((-0.7, -0.15, 0.75), (-1.50, -0.25, 0.30), 9), ((0.75, -0.05, 0.95), (1.62, -0.12, 0.62), 9),
                ((0.35, -0.55, 0.10), (0.72, -0.72, -0.55), 7), ((-0.45, -0.45, 0.25), (-0.86, -0.70, -0.42), 7),
                ((0.2, 0.2, 1.0), (0.10, 0.25, 1.40), 8))
    for middle, end, pairs in branches:
        _eucalyptus(out, rand, MOUTH, HEART + np.array(middle), HEART + np.array(end), pairs)
    for _ in range(20):
        turn = rand.uniform(1)[0] * TAU
        reach = 0.45 + 0.55 * rand.uniform(1)[0]
        out_of = np.array([np.cos(turn), 0.55 * np.sin(turn) + 0.12, 0.0])
        tip = HEART + reach * out_of + [0, 0, rand.uniform(1, low=-0.45, high=0.75)[0]]
        _blade(out, rand, [HEART + 0.25 * out_of, HEART + 0.62 * reach * out_of + [0, 0, 0.30], tip], 0.085, 56,
               ("2f5a2c", "6e9a48", "a9c47e"), 0.7)
    for k in range(14):
        lean = rand.uniform(1, low=-1.25, high=1.35)[0]
        tip = HEART + [lean, 0.25 * rand.normal(1)[0], 1.55 - 0.45 * abs(lean) - 0.35 * rand.uniform(1)[0]]
        points = [MOUTH, HEART + [0.25 * lean, 0.1, 1.0], tip]
        _blade(out, rand, points, 0.016, 46, ("6f8f4a", "a8bb6a", "c9d08c"), 0.3)
        if k % 2 == 0:
            _seeds(out, rand, points)


def _seeds(out: Splats, rand: Rand, points: list) -> None:
    """An ear of grass on the last third of a stalk."""
    u = np.linspace(0.74, 1.0, 30)
    p, along = bezier(points, u)
    side = np.where(np.arange(30) % 2 == 0, 1.0, -1.0)[:, None] * np.cross(along, [0.1, -1.0, 0.2])
    out.add(p + 0.022 * side, np.cross(along, side), along + 0.5 * side, (0.028, 0.009, 0.008),
            mix(srgb("b99a5c"), srgb("e3cd94"), rand.uniform(30)), rand.uniform(30, low=0.4, high=0.95), through=0.3)


def fallen(out: Splats, rand: Rand) -> None:
    """Petals and leaves on the cloth and the table."""
    for x, y, turn, colours in ((-0.35, -0.72, 0.4, CORAL), (-0.86, -1.02, 2.2, PINK), (0.05, -0.42, 4.0, CORAL),
                                (-2.35, -0.30, 1.2, CREAM), (0.98, -1.45, 5.2, PINK), (1.55, -1.22, 3.3, CREAM),
                                (-2.6, -1.55, 0.1, PINK), (2.35, -0.75, 2.7, CORAL)):
        at = np.array([x, y, 0.085])
        out_of = np.array([np.cos(turn), np.sin(turn), 0.0])
        points = [at, at + 0.10 * out_of - [0, 0, 0.012], at + 0.21 * out_of + [0, 0, 0.075]]
        _blade(out, rand, points, 0.085, 70, colours, 0.25, (0.05, -0.1, 1.0), 0.4)
    for x, y, turn in ((-2.25, -1.28, 2.6), (1.92, -0.55, 5.4), (2.05, -1.30, 0.6)):
        at = np.array([x, y, 0.07])
        out_of = np.array([np.cos(turn), np.sin(turn), 0.0])
        _blade(out, rand, [at, at + 0.22 * out_of + [0, 0, 0.10], at + 0.44 * out_of + [0, 0, 0.01]], 0.095, 110,
               ("2f5a2c", "6e9a48", "a9c47e"), 0.7, (0.0, -0.15, 1.0), 0.35)
