"""Distance between pictures."""

from __future__ import annotations

import hashlib
import math
from functools import lru_cache, wraps

import numpy as np
from scipy.ndimage import correlate1d
from skimage.metrics import structural_similarity

# Pixels per degree of visual angle: a 3840 pixels wide, 0.7 m wide monitor seen from 0.7 m, the default of Andersson et al. (2020).
PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * math.pi / 180


def _remembered(keep: int):
    """Keep the last results of a slow function by the content of its pictures: many configurations draw the same one."""

    def digest(argument: np.ndarray | float) -> bytes | float:
        if not isinstance(argument, np.ndarray):
            return argument
        return hashlib.blake2b(np.ascontiguousarray(argument).data, digest_size=16).digest() + f"{argument.shape}{argument.dtype}".encode()

    def decorate(function):
        results: dict[tuple, object] = {}

        @wraps(function)
        def wrapper(*arguments):
            key = tuple(digest(a) for a in arguments)
            if key not in results:
                if len(results) >= keep:
                    results.pop(next(iter(results)))
                results[key] = function(*arguments)
            return results[key]

        return wrapper

    return decorate


def clamped_pair(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two pictures of one shape as float64, clamped to [0, 1]. ValueError where they differ in shape."""
    if a.shape != b.shape:
        raise ValueError(f"pictures differ in shape: {a.shape} and {b.shape}")
    return np.clip(np.asarray(a, np.float64), 0.0, 1.0), np.clip(np.asarray(b, np.float64), 0.0, 1.0)


def decibels(mean_square: float) -> float:
    """PSNR of a mean square error against a peak of 1, dB; inf for 0."""
    return math.inf if mean_square == 0.0 else -10.0 * math.log10(mean_square)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB of two unquantised pictures, clamped to [0, 1]; inf when they are equal."""
    a, b = clamped_pair(a, b)
    return decibels(float(np.mean((a - b) ** 2)))


@_remembered(256)
def ssim(a: np.ndarray, b: np.ndarray, counted: np.ndarray | None = None) -> float:
    """Structural similarity of two pictures (H, W, 3), clamped to [0, 1].

    Wang et al. (2004): Gaussian window of sigma 1.5, population covariance; mean over pixels and channels, but for the five at each border.
    counted: bool (H, W), pixels that count; the others are black in both pictures, and no part of the mean. NaN where none counts.
    """
    a, b = clamped_pair(a, b)
    kind = {"data_range": 1.0, "channel_axis": 2, "gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    if counted is None:
        return float(structural_similarity(a, b, **kind))
    shown = counted[..., None]
    values = structural_similarity(a * shown, b * shown, full=True, **kind)[1][5:-5, 5:-5][counted[5:-5, 5:-5]]
    return float(values.mean()) if values.size else math.nan


# -- FLIP ------------------------------------------------------------------------------------------------------------------------------
# Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild: "FLIP: A Difference Evaluator for Alternating Images", HPG 2020.
# Section numbers are the paper's.

_QC, _PC, _PT = 0.7, 0.4, 0.95        # exponent, fraction of the largest error, its new place (Sec. 4.1.3)
_FEATURE_WIDTH, _QF = 0.082, 0.5      # width of an edge in degrees, exponent of feature differences (Sec. 4.2, 4.3)
_CONTRAST = {                         # (a1, b1), (a2, b2) of the contrast sensitivity functions of Y, Cx and Cz (Table 1)
    "y": ((1.0, 0.0047),), "cx": ((1.0, 0.0053),), "cz": ((34.1, 0.04), (13.5, 0.025)),
}
_RGB_TO_XYZ = np.array([              # sRGB primaries, D65
    [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
    [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
    [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
])
_XYZ_TO_RGB = np.linalg.inv(_RGB_TO_XYZ)
_WHITE = _RGB_TO_XYZ.sum(axis=1)


def _linear(srgb: np.ndarray) -> np.ndarray:
    return np.where(srgb > 0.04045, ((srgb + 0.055) / 1.055) ** 2.4, srgb / 12.92)


def _opponent(srgb: np.ndarray) -> np.ndarray:
    """sRGB to the linear opponent space YCxCz, (H, W, 3)."""
    x, y, z = np.moveaxis(_linear(srgb) @ _RGB_TO_XYZ.T / _WHITE, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], -1)


def _opponent_to_linear(ycxcz: np.ndarray) -> np.ndarray:
    y = (ycxcz[..., 0] + 16) / 116
    xyz = np.stack([y + ycxcz[..., 1] / 500, y, y - ycxcz[..., 2] / 200], -1) * _WHITE
    return xyz @ _XYZ_TO_RGB.T


def _hunt_lab(linear: np.ndarray) -> np.ndarray:
    """Linear RGB to CIE L*a*b* with the chroma scaled by the lightness (Hunt effect, Sec. 4.1.2)."""
    t = linear @ _RGB_TO_XYZ.T / _WHITE
    delta = 6 / 29
    x, y, z = np.moveaxis(np.where(t > delta**3, np.cbrt(t), t / (3 * delta**2) + 4 / 29), -1, 0)
    lightness = 116 * y - 16
    return np.stack([lightness, 0.01 * lightness * 500 * (x - y), 0.01 * lightness * 200 * (y - z)], -1)


def _hyab(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    d = a - b
    return np.abs(d[..., 0]) + np.hypot(d[..., 1], d[..., 2])


def _largest_colour_error() -> float:
    """Distance of green and blue, the largest two colours of sRGB can have here, to the power of qc."""
    return float(_hyab(_hunt_lab(np.array([0.0, 1.0, 0.0])), _hunt_lab(np.array([0.0, 0.0, 1.0])))) ** _QC


@lru_cache(maxsize=8)
def _contrast_kernels(pixels_per_degree: float) -> dict[str, list[tuple[float, np.ndarray]]]:
    """Per channel, Gaussians as (share of the sum, 1D kernel of sum 1): the filters are sums of separable ones."""
    widest = max(b for terms in _CONTRAST.values() for _, b in terms)
    radius = math.ceil(3 * math.sqrt(widest / (2 * math.pi**2)) * pixels_per_degree)
    x2 = (np.arange(-radius, radius + 1) / pixels_per_degree) ** 2
    kernels = {}
    for channel, terms in _CONTRAST.items():
        lines = [np.exp(-(math.pi**2) * x2 / b) for _, b in terms]
        weights = [a * math.sqrt(math.pi / b) * line.sum() ** 2 for (a, b), line in zip(terms, lines)]
        kernels[channel] = [(w / sum(weights), line / line.sum()) for w, line in zip(weights, lines)]
    return kernels


def _contrast_filtered(ycxcz: np.ndarray, pixels_per_degree: float) -> np.ndarray:
    """What an observer sees at this distance, as linear RGB in [0, 1] (Sec. 4.1.1); the border is repeated."""
    out = np.zeros_like(ycxcz)
    for index, terms in enumerate(_contrast_kernels(pixels_per_degree).values()):
        for weight, line in terms:
            rows = correlate1d(ycxcz[..., index], line, axis=1, mode="nearest")
            out[..., index] += weight * correlate1d(rows, line, axis=0, mode="nearest")
    return np.clip(_opponent_to_linear(out), 0.0, 1.0)


def _features(y: np.ndarray, pixels_per_degree: float) -> tuple[np.ndarray, np.ndarray]:
    """Strength of edges and of points at every pixel of a luminance in [0, 1] (Sec. 4.2)."""
    sd = 0.5 * _FEATURE_WIDTH * pixels_per_degree
    radius = math.ceil(3 * sd)
    x = np.arange(-radius, radius + 1, dtype=np.float64)
    smooth = np.exp(-(x**2) / (2 * sd**2))
    strengths = []
    for line in (-x * smooth, (x**2 / sd**2 - 1) * smooth):
        line = np.where(line < 0, line / -line[line < 0].sum(), line / line[line > 0].sum())
        across = smooth / smooth.sum()
        gx = correlate1d(correlate1d(y, line, axis=1, mode="nearest"), across, axis=0, mode="nearest")
        gy = correlate1d(correlate1d(y, line, axis=0, mode="nearest"), across, axis=1, mode="nearest")
        strengths.append(np.hypot(gx, gy))
    return strengths[0], strengths[1]


def _seen(picture: np.ndarray, pixels_per_degree: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colours as an observer sees them (Hunt-adjusted L*a*b*), edges and points of a picture in [0, 1]."""
    opponent = _opponent(picture)
    colours = _hunt_lab(_contrast_filtered(opponent, pixels_per_degree))
    return colours, *_features((opponent[..., 0] + 16) / 116, pixels_per_degree)


_seen_reference = _remembered(2)(_seen)


def flip_map(image: np.ndarray, reference: np.ndarray, pixels_per_degree: float = PIXELS_PER_DEGREE) -> np.ndarray:
    """LDR-FLIP at every pixel, (H, W) in [0, 1], of two sRGB pictures (H, W, 3), clamped to [0, 1] (Andersson et al. 2020)."""
    image, reference = clamped_pair(image, reference)
    colours_a, edges_a, points_a = _seen(image, pixels_per_degree)
    colours_b, edges_b, points_b = _seen_reference(reference, pixels_per_degree)
    colour = _hyab(colours_a, colours_b) ** _QC
    largest = _largest_colour_error()
    knee = _PC * largest
    colour = np.where(colour < knee, _PT / knee * colour, _PT + (colour - knee) / (largest - knee) * (1 - _PT))
    feature = (np.maximum(np.abs(edges_a - edges_b), np.abs(points_a - points_b)) / math.sqrt(2)) ** _QF
    return np.clip(colour, 0.0, 1.0) ** (1 - np.clip(feature, 0.0, 1.0))


@_remembered(256)
def flip(image: np.ndarray, reference: np.ndarray, pixels_per_degree: float = PIXELS_PER_DEGREE) -> float:
    """Mean of `flip_map`: 0 for equal pictures, 1 at most."""
    return float(flip_map(image, reference, pixels_per_degree).mean())
