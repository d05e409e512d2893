"""Light of the demo scene, baked into the splats: window, room, candle, two bounces, highlights.

Visibility is found by sorting: for each direction every splat is drawn as a few points into a grid
across that direction, and the next point above a splat in its cell is what a ray from it would hit.
One table of hits serves the soft shadows of the window, ambient occlusion and the bounces.
"""

from __future__ import annotations

import numpy as np

from flicker.scene.demo.splats import dot, mix, step, unit

SUN = unit(np.array([-0.85, -0.45, 0.70]))
SUN_COLOUR = np.array([1.0, 0.86, 0.66]) * 3.9
SUN_SPREAD = 0.10
SKY = unit(np.array([-0.85, -0.5, 0.55]))
CANDLE_COLOUR = np.array([1.0, 0.55, 0.20]) * 0.42
CELL = 0.03
BIAS = 0.045


def sphere(count: int) -> np.ndarray:
    """Even directions (count, 3) on the sphere (Fibonacci)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    phi = np.pi * (3.0 - 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


def sun_directions(count: int) -> np.ndarray:
    """Directions (count, 3) over the disc of the sun."""
    x = unit(np.cross(SUN, [0.0, 0.0, 1.0]))
    y = np.cross(SUN, x)
    k = np.arange(count) + 0.5
    r = SUN_SPREAD * np.sqrt(k / count)
    phi = np.pi * (3.0 - 5.0**0.5) * k
    return unit(SUN + (r * np.cos(phi))[:, None] * x + (r * np.sin(phi))[:, None] * y)


def room(direction: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) of the unseen room: a bright soft window side, a dim warm rest."""
    side = np.clip(dot(direction, SKY), 0.0, 1.0)
    up = 0.5 + 0.5 * direction[:, 2]
    return (np.array([0.25, 0.235, 0.225]) * (0.4 + 0.8 * up)[:, None]
            + np.array([0.80, 0.92, 1.05]) * (side**3)[:, None] * 0.95)


def window_mask(p: np.ndarray) -> np.ndarray:
    """Share (N,) of the sun that the window lets through towards points (N, 3)."""
    x = unit(np.cross([0.0, 0.0, 1.0], SUN))
    y = np.cross(SUN, x)
    u, v = dot(p, x), dot(p, y)
    return _panes(u, v)


def _panes(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    soft = 0.10
    inside = step(-3.6, -3.6 + 2 * soft, u) * step(3.4, 3.4 - 2 * soft, u)
    inside *= step(-2.6, -2.6 + 2 * soft, v) * step(4.5, 4.5 - 2 * soft, v)
    for bar in (-1.95, -0.15, 1.65):
        inside *= 1.0 - 0.85 * step(0.15, 0.07, np.abs(u - bar))
    for bar in (3.05,):
        inside *= 1.0 - 0.85 * step(0.15, 0.07, np.abs(v - bar))
    return inside


def _reflection(direction: np.ndarray, sharp: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) seen in a mirror along `direction`: the room and the window with its cross."""
    x = unit(np.cross([0.0, 0.0, 1.0], SUN))
    y = np.cross(SUN, x)
    ahead = np.maximum(dot(direction, SUN), 1e-3)
    u, v = dot(direction, x) / ahead, dot(direction, y) / ahead
    soft = 2.2 / np.sqrt(sharp)
    pane = step(1.0, 0.0, (np.abs(u) - 0.40) / soft + 0.5) * step(1.0, 0.0, (np.abs(v) - 0.50) / soft + 0.5)
    crisp = np.clip(sharp / 400.0, 0.0, 1.0)
    cross = np.maximum(step(0.075, 0.035, np.abs(u)), step(0.075, 0.035, np.abs(v - 0.1)))
    pane = pane * (1.0 - crisp * 0.8 * cross) * (dot(direction, SUN) > 0.0)
    strength = np.clip(sharp / 250.0, 0.12, 1.0) * 32.0
    below = step(0.1, -0.25, direction[:, 2])
    surroundings = mix(room(direction), (0.16, 0.095, 0.055), below)
    return surroundings + (pane * strength)[:, None] * np.array([1.0, 0.95, 0.86])


def _points(s: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points (M, 3) that stand for the splats in the visibility tables, and their owners (M,)."""
    solid = np.nonzero(s["casts"])[0]
    p, t, n, size = s["p"][solid], s["t"][solid], s["n"][solid], s["size"][solid]
    b = np.cross(n, t)
    steps = np.clip(np.ceil(size[:, :2] * (2.2 / CELL)), 1, 6).astype(np.int64)
    points, owners = [], []
    for along in range(1, 7):
        for across in range(1, 7):
            chosen = np.nonzero((steps[:, 0] == along) & (steps[:, 1] == across))[0]
            if len(chosen) == 0:
                continue
            i, j = np.divmod(np.arange(along * across), across)
            a = ((i + 0.5) / along * 2 - 1) * 1.3
            c = ((j + 0.5) / across * 2 - 1) * 1.3
            at = (p[chosen, None] + (a[:, None] * size[chosen, None, 0:1]) * t[chosen, None]
                  + (c[:, None] * size[chosen, None, 1:2]) * b[chosen, None])
            points.append(at.reshape(-1, 3))
            owners.append(np.repeat(solid[chosen], along * across))
    return np.concatenate(points), np.concatenate(owners)


def hits(s: dict[str, np.ndarray], directions: np.ndarray, two_sided: np.ndarray) -> np.ndarray:
    """Index of the splat hit from every splat along every direction, -1 for none: (D, N) int32."""
    points, owners = _points(s)
    low = s["p"].min(axis=0) - 0.5
    extent = float(np.sqrt(dot(s["p"].max(axis=0) + 0.5 - low, s["p"].max(axis=0) + 0.5 - low)))
    centre = low + 0.5 * extent / 3.0**0.5
    per_row = int(2 * extent / CELL)
    table = np.empty((len(directions), len(s["p"])), np.int32)
    for k, w in enumerate(directions):
        x = unit(np.cross(w, [0.31, 0.17, 0.93]))
        y = np.cross(w, x)

        def key(at: np.ndarray, bias: float) -> np.ndarray:
            rel = at - centre
            cu = np.floor((dot(rel, x) + extent) / CELL).astype(np.int64)
            cv = np.floor((dot(rel, y) + extent) / CELL).astype(np.int64)
            depth = np.floor((dot(rel, w) + extent + bias) * (2.0**20 / (2.0 * extent + 1.0))).astype(np.int64)
            return ((cu * per_row + cv) << 36) + (depth << 16)

        keys = np.sort(key(points, 0.0) + owners)
        facing = dot(s["n"], w)
        away = np.where(two_sided & (facing < 0), -1.0, 1.0)[:, None] * s["n"]
        start = s["p"] + BIAS * away
        wanted = key(start, 0.03)
        nearest = keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)]
        hit = (nearest >= wanted) & (nearest >> 36 == wanted >> 36)
        table[k] = np.where(hit, nearest & 0xFFFF, -1)
    return table


def bake(s: dict[str, np.ndarray], flame: np.ndarray, sky_count: int = 48, sun_count: int = 24) -> np.ndarray:
    """Diffuse radiance (N, 3) of every splat after two bounces."""
    thin = s["through"] > 0.0
    lit = s["albedo"].sum(axis=1) > 0.0
    albedo = s["albedo"] * (1.0 - 0.7 * s["metal"])[:, None]

    def cosine(w: np.ndarray) -> np.ndarray:
        c = dot(s["n"], w)
        return np.maximum(c, 0.0) + s["through"] * np.maximum(-c, 0.0)

    suns = sun_directions(sun_count)
    shadow = hits(s, suns, thin)
    leaf = np.where(shadow >= 0, 0.45 * s["through"][shadow], 1.0)
    sun = sum(leaf[k] * cosine(w) for k, w in enumerate(suns)) / sun_count * window_mask(s["p"])
    to_flame = flame - s["p"]
    distance = np.sqrt(dot(to_flame, to_flame))
    c = dot(s["n"], to_flame) / np.maximum(distance, 1e-6)
    candle = (np.maximum(c, 0.0) * 0.85 + 0.15) / (0.10 + distance**2)

    around = sphere(sky_count)
    blocked = hits(s, around, thin)
    share = np.stack([cosine(w) for w in around]) * (4.0 / sky_count)
    first = (sun[:, None] * SUN_COLOUR + candle[:, None] * CANDLE_COLOUR)
    ambient = np.zeros_like(albedo)
    for k, w in enumerate(around):
        ambient += (share[k] * (blocked[k] < 0))[:, None] * room(w[None])
    radiance = albedo * (first + ambient)
    for _ in range(2):
        bounce = np.zeros_like(albedo)
        for k in range(sky_count):
            seen = blocked[k]
            bounce += np.where((seen >= 0)[:, None], share[k][:, None] * radiance[seen], 0.0)
        radiance = albedo * (first + ambient + bounce)
    s["open"] = np.clip((share * (blocked < 0)).sum(axis=0) / np.maximum(share.sum(axis=0), 1e-6), 0.0, 1.0)
    return radiance * lit[:, None] + s["glow"]


def highlights(s: dict[str, np.ndarray], view: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) mirrored towards a camera at `view` (3,)."""
    out = unit(view - s["p"])
    n = s["n"]
    c = dot(n, out)
    mirrored = 2.0 * c[:, None] * n - out
    fresnel = 0.045 + 0.955 * np.clip(1.0 - c, 0.0, 1.0) ** 5 * 0.6
    strength = s["gloss"] * np.where(s["metal"] > 0, 0.75, fresnel) * (0.25 + 0.75 * s["open"]) * step(0.0, 0.1, c)
    tint = mix(np.ones(3), s["albedo"], s["metal"])
    return strength[:, None] * tint * _reflection(mirrored, s["sharp"])


def display(radiance: np.ndarray) -> np.ndarray:
    """Picture values in [0, 1]: filmic curve, then the sRGB transfer function."""
    x = np.maximum(radiance, 0.0) * 0.74
    x = np.clip((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)
