"""Fruit, the wire bowl, the tea glass with its steam, and the candle."""

from __future__ import annotations

import numpy as np

from flicker.scene.demo.splats import Rand, Splats, dot, fbm, frame, mix, sample, spread, srgb, step, unit
from flicker.scene.demo.still_life import BOWL, CANDLE, FLAME, GLASS, TAU, UP, _front, ellipsoid, revolve


def _fruit(out: Splats, rand: Rand, at: np.ndarray, radii: tuple, axis: tuple, skin: tuple, count: int,
           gloss: float) -> None:
    """One citrus fruit: pored skin, darker around the stalk, splats along the meridians."""
    surface = ellipsoid(at, radii, axis)
    hidden = sample(surface, count // 9, rand, _front)
    out.add(hidden.p - 0.02 * hidden.n, hidden.n, hidden.dv, (0.055, 0.05, 0.01),
            0.45 * srgb(skin[0]) + 0.55 * srgb(skin[1]), 0.97)
    patch = sample(surface, count, rand, _front)
    p = patch.p
    pores = fbm(24 * p[:, 0], 24 * p[:, 1], 24 * p[:, 2], 2, salt=51)
    broad = fbm(3 * p[:, 0], 3 * p[:, 1], 3 * p[:, 2], 2, salt=52)
    colour = mix(srgb(skin[0]), srgb(skin[1]), step(-1.5, 1.5, broad + 0.2 * pores))
    pole = step(0.10, 0.0, 1.0 - patch.uv[:, 1])
    colour = mix(colour, srgb(skin[2]), 0.7 * pole)
    bump = np.stack([fbm(24 * p[:, 0] + 5, 24 * p[:, 1], 24 * p[:, 2], 1, salt=53 + k) for k in range(3)], axis=1)
    length = rand.uniform(len(p), low=0.030, high=0.06)
    out.add(p, patch.n + 0.03 * bump, patch.dv, (length, rand.uniform(len(p), low=0.012, high=0.024), 0.004), colour,
            spread(rand, len(p), 0.2), gloss=gloss, sharp=60.0)
    end = at + radii[1] * unit(np.array(axis)) * 0.99
    green = end + 0.028 * rand.normal(14, 3)
    out.add(green, unit(np.array(axis)), rand.normal(14, 3), (0.016, 0.009, 0.006), srgb("56622f"), 0.85)


ORANGE = ("d96a12", "f39a2b", "b9842c")
LEMON = ("e3b416", "f6d848", "a8a638")


def fruit(out: Splats, rand: Rand) -> None:
    """Oranges and lemons in the bowl, a lemon and an opened orange on the cloth."""
    base = BOWL + [0, 0, 0.12]
    for offset, axis in (((-0.36, -0.26, 0.36), (-0.4, -0.6, 0.75)), ((0.34, -0.34, 0.37), (0.5, -0.75, 0.5)),
                         ((0.42, 0.32, 0.37), (0.2, 0.3, 1.0)), ((-0.26, 0.40, 0.37), (0, 0, 1.0)),
                         ((0.02, -0.02, 0.83), (0.15, -0.55, 0.9))):
        _fruit(out, rand, base + np.array(offset), (0.355, 0.345), axis, ORANGE, 560, 1.5)
    _fruit(out, rand, base + [0.50, -0.02, 0.80], (0.21, 0.30), (0.85, -0.35, 0.35), LEMON, 380, 1.5)
    _fruit(out, rand, base + [-0.50, 0.10, 0.76], (0.21, 0.30), (-0.6, -0.6, 0.45), LEMON, 380, 1.5)
    _fruit(out, rand, np.array([-0.42, -1.44, 0.29]), (0.215, 0.315), (0.92, -0.35, 0.10), LEMON, 580, 1.5)
    _half(out, rand, np.array([-1.42, -1.32, 0.36]), unit(np.array([0.42, -0.80, 0.52])), 0.33)
    _half(out, rand, np.array([-2.02, -0.92, 0.20]), unit(np.array([0.05, -0.12, 1.0])), 0.30, thick=0.05)


def _half(out: Splats, rand: Rand, at: np.ndarray, face: np.ndarray, radius: float, thick: float = 0.0) -> None:
    """Half an orange (or a slice of thickness `thick`) with its cut towards `face`."""
    x, y, z = frame(face)
    if thick:
        side = sample(lambda uv: at + radius * (np.cos(TAU * uv[:, :1]) * x + np.sin(TAU * uv[:, :1]) * y)
                      - thick * uv[:, 1:] * z, 260, rand)
        out.add(side.p, side.p - at, side.du, (0.035, 0.012, 0.008), srgb("e5801c"), spread(rand, len(side.p), 0.5),
                gloss=0.8)
    else:
        shell = sample(lambda uv: ellipsoid(at, (radius, radius), tuple(-face))(uv * [1, 0.5] + [0, 0.5]), 500, rand)
        out.add(shell.p, shell.p - at, shell.du, (0.045, 0.018, 0.008),
                mix(srgb("d96a12"), srgb("f09a2f"), rand.uniform(len(shell.p))), spread(rand, len(shell.p), 0.5),
                gloss=1.0, sharp=60.0)
    disc = sample(lambda uv: at + radius * uv[:, 1:] * (np.cos(TAU * uv[:, :1]) * x + np.sin(TAU * uv[:, :1]) * y),
                  1150, rand)
    rel = disc.p - at
    r = np.sqrt(dot(rel, rel)) / radius
    turn = np.arctan2(dot(rel, y), dot(rel, x))
    wedge = np.abs(np.mod(turn / TAU * 10 + 0.3, 1.0) - 0.5)
    skin = step(0.045, 0.015, (0.5 - wedge) * TAU / 10 * r) * (r > 0.08)
    juice = mix(srgb("ee8a18"), srgb("ffc04a"), rand.uniform(len(r)) ** 2)
    colour = mix(juice, srgb("f8d79a"), np.maximum.reduce([skin, step(0.82, 0.87, r), step(0.13, 0.09, r)]))
    colour = mix(colour, srgb("e07a15"), step(0.945, 0.965, r))
    rim = r > 0.84
    radial = unit(rel + 1e-6 * x)
    long = np.where(rim[:, None], np.cross(z, radial), radial)
    length = np.where(rim, 0.03, rand.uniform(len(r), low=0.016, high=0.034))
    out.add(disc.p + 0.004 * z, z, long, (length, 0.0075, 0.004), colour, spread(rand, len(r), 0.35),
            gloss=0.7, sharp=90.0, through=0.12)
    out.add(disc.p[::5] - 0.02 * z, z, x, (0.035, 0.03, 0.006), srgb("f0a03a"), 0.95)


def _wire(out: Splats, points: np.ndarray, thickness: float, rand: Rand, colour: str = "c8794a") -> None:
    """A round copper wire through points (N, 3): thin Gaussians in two sheets that face outwards and up."""
    along = points[1:] - points[:-1]
    length = np.sqrt(dot(along, along))
    centre = (points[1:] + points[:-1]) / 2
    outward = centre - (BOWL + [0, 0, 0.75])
    for tilt in (outward, UP - [0.3, 0.9, 0.0]):
        n = np.broadcast_to(tilt, centre.shape)
        out.add(centre, n - dot(n, unit(along))[:, None] * unit(along), along, (length * 0.55, thickness, thickness * 0.8),
                srgb(colour), rand.uniform(len(centre), low=0.55, high=1.0), gloss=1.0, sharp=120.0, metal=1.0)


def bowl(out: Splats, rand: Rand) -> None:
    """A bowl of copper wire: ribs, rings and a foot."""
    profile = np.array([(0.42, 0.06), (0.72, 0.13), (0.93, 0.34), (1.02, 0.66)])
    v = np.linspace(0, 1, 14)[:, None]
    a, b, c, d = profile
    rib = (1 - v) ** 3 * a + 3 * v * (1 - v) ** 2 * b + 3 * v**2 * (1 - v) * c + v**3 * d
    for turn in np.arange(30) / 30 * TAU:
        out_of = np.array([np.cos(turn), np.sin(turn), 0.0])
        _wire(out, BOWL + rib[:, :1] * out_of + rib[:, 1:] * UP, 0.0085, rand)
    for radius, height, thickness in ((1.02, 0.66, 0.017), (0.88, 0.36, 0.010), (0.42, 0.06, 0.014), (0.50, 0.0, 0.018)):
        turn = np.linspace(0, TAU, int(90 * radius) + 12)[:, None]
        circle = np.concatenate([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        _wire(out, BOWL + radius * circle + [0, 0, height], thickness, rand)


def glass(out: Splats, rand: Rand) -> None:
    """A glass of tea: liquid, clear wall, rim and streaks of light, a bright patch on the cloth, steam."""
    wall_at = revolve([(0.235, 0.0), (0.25, 0.15), (0.275, 0.40), (0.30, 0.74)], GLASS)
    tea = revolve([(0.0, 0.075), (0.21, 0.085), (0.235, 0.25), (0.262, 0.50)], GLASS)
    body = sample(tea, 800, rand)
    deep = (body.p[:, 2] - GLASS[2]) / 0.5
    lit = dot(body.n, unit(np.array([0.75, 0.35, -0.2])))
    glow = mix(srgb("8a2f08"), srgb("f2912a"), step(-0.5, 0.9, lit) * (1 - 0.55 * deep))
    glow = glow * (0.55 + 0.25 * rand.uniform(len(deep), 1))
    out.add(body.p, body.n, UP, (rand.uniform(len(deep), low=0.03, high=0.06), 0.02, 0.006), srgb("40180a"),
            spread(rand, len(deep), 0.15), glow=glow, gloss=0.4, sharp=200.0, casts=False)
    top = sample(revolve([(0.0, 0.50), (0.131, 0.50), (0.262, 0.50)], GLASS), 300, rand)
    out.add(top.p, UP, (1.0, 0.2, 0), (0.03, 0.016, 0.004), srgb("7a3410"), spread(rand, len(top.p), 0.3),
            glow=srgb("b0561a") * 0.5, gloss=1.0, sharp=200.0, casts=False)
    clear = sample(wall_at, 620, rand)
    out.add(clear.p, clear.n, UP, (0.07, 0.02, 0.004), srgb("20282a"), rand.uniform(len(clear.p), low=0.05, high=0.13),
            gloss=1.1, sharp=420.0, casts=False)
    for radius, height, shine in ((0.30, 0.74, 0.75), (0.262, 0.502, 0.35), (0.232, 0.012, 0.45), (0.225, 0.06, 0.30)):
        turn = np.arange(64) / 64 * TAU
        ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        lightness = shine * (0.25 + 0.75 * np.clip(-ring[:, 0] * 0.8 - ring[:, 1] * 0.4 + 0.3, 0, 1))
        out.add(GLASS + radius * ring + [0, 0, height], ring, np.cross(UP, ring), (0.020, 0.0085, 0.007), (0.0, 0.0, 0.0),
                0.75, glow=lightness[:, None] * np.array([1.0, 0.97, 0.9]), gloss=1.0, sharp=400.0, casts=False)
    for turn, width, shine in ((3.75, 0.016, 1.5), (3.98, 0.008, 0.9), (5.6, 0.010, 0.5), (3.3, 0.009, 0.35)):
        v = np.linspace(0.12, 0.92, 16)
        streak = wall_at(np.stack([np.full(16, turn / TAU), v], axis=1))
        out_of = (streak - GLASS) * [1.0, 1.0, 0.0]
        out.add(streak + 0.004 * unit(out_of), out_of, UP, (0.030, width, 0.004), (0.0, 0.0, 0.0),
                rand.uniform(16, low=0.3, high=0.7), glow=shine * np.array([1.0, 0.97, 0.9]), casts=False)
    spot = GLASS + [0.50, 0.33, 0.045] + rand.normal(90, 3) * [0.15, 0.09, 0.0]
    out.add(spot, UP, (0.8, 0.5, 0), (0.10, 0.035, 0.01), (0.0, 0.0, 0.0), rand.uniform(90, low=0.05, high=0.16),
            glow=srgb("f6a53c") * 0.95, casts=False)
    for strand in range(4):
        t = np.linspace(0, 1, 60)
        sway = (0.03 + 0.26 * t) * np.sin(6.0 * t + 1.1 * strand + 0.4) * (0.65 + 0.35 * np.cos(7 * t + strand))
        path = GLASS + np.stack([sway + 0.04 * strand - 0.06, 0.12 * np.sin(3 * t + 2 * strand), 0.55 + 1.35 * t], axis=1)
        along = np.gradient(path, axis=0)
        thin = 0.012 + 0.050 * t
        out.add(path, (0.0, -1.0, 0.2), along, (0.075, thin, thin), (0.0, 0.0, 0.0),
                0.10 * np.clip(3 * t, 0, 1) * (1 - t) ** 0.8 + 0.006, glow=np.array([0.78, 0.78, 0.74]), casts=False)


def candle(out: Splats, rand: Rand) -> None:
    """A wax candle in a brass stick, its flame and the glow in the air."""
    stick = revolve([(0.44, 0.0), (0.43, 0.05), (0.30, 0.09), (0.10, 0.17), (0.06, 0.34), (0.11, 0.46), (0.06, 0.58),
                     (0.055, 0.82), (0.12, 0.92), (0.20, 0.98), (0.155, 1.02)], CANDLE)
    for count, inset, size in ((260, 0.02, 0.04), (950, 0.0, 0.0)):
        patch = sample(stick, count, rand, _front)
        n = len(patch.p)
        long = size or rand.uniform(n, low=0.02, high=0.05)
        across = size * 0.7 or rand.uniform(n, low=0.008, high=0.014)
        out.add(patch.p - inset * patch.n, patch.n, patch.du, (long, across, 0.004),
                mix(srgb("9a6f2a"), srgb("caa04c"), rand.uniform(n)), 0.97 if size else spread(rand, n, 0.25),
                gloss=1.0, sharp=70.0, metal=1.0)
    wax = revolve([(0.125, 0.98), (0.12, 1.3), (0.118, 1.7), (0.112, 1.96), (0.07, 1.985), (0.0, 1.965)], CANDLE)
    for count, inset in ((90, 0.02), (560, 0.0)):
        patch = sample(wax, count, rand, _front)
        warm = step(1.15, 2.0, patch.p[:, 2])
        tip = patch.uv[:, 1] > 0.55
        size = (np.where(tip, 0.016, 0.055), np.where(tip, 0.012, 0.02), 0.006)
        out.add(patch.p - inset * patch.n, patch.n, patch.dv, size, srgb("efe3c4"),
                0.96 if inset else spread(rand, len(warm), 0.2), glow=(warm**3)[:, None] * srgb("ff9a3c") * 0.55,
                gloss=0.5, sharp=30.0)
    wick = CANDLE + np.array([[0, 0, 2.0], [0.004, 0, 2.03]])
    out.add(wick, (0, -1.0, 0), UP, (0.025, 0.008, 0.008), srgb("1c1410"), 0.95)
    h = np.linspace(0, 1, 34)
    shape = 0.046 * np.sqrt(np.maximum(h, 0.02)) * (1 - h) ** 0.75 * 1.9
    for radius, colour, shine, opacity in ((1.0, "ff8c1e", 1.7, 0.32), (0.66, "ffc65a", 3.0, 0.5),
                                           (0.36, "fff0bf", 5.0, 0.75)):
        centre = np.stack([0.006 * np.sin(5 * h), 0 * h - 0.02 * (1 - radius), -0.20 + (0.36 * radius + 0.03) * h], axis=1)
        width = shape * radius + 0.004
        out.add(FLAME + centre, (0, -1.0, 0), UP, (0.030, width, width), (0.0, 0.0, 0.0), opacity,
                glow=srgb(colour) * shine, casts=False)
    for size, opacity in ((0.10, 0.18), (0.20, 0.13), (0.38, 0.10), (0.75, 0.07)):
        out.add(FLAME[None] + [[0, -size, -0.06]], (0, -1.0, 0), UP, (size, size, size), (0.0, 0.0, 0.0), opacity,
                glow=srgb("ffae55") * 1.25, casts=False)
