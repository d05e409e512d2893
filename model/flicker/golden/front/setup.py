"""What the front end takes beside the scene: number formats, and the registers that a camera becomes."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from ...arithmetic.ff import MIN_NORMAL, ff_round
from ...errors import FlickerError
from ...front.projection import DILATION, NEAR, slope_range
from ...params import TILE
from ...scene.camera import Camera

MAX_PICTURE = 4096
MIDDLE_INTEGER = 16  # bits of the principal point in pixels, with its sign
MAX_MIDDLE = (1 << MIDDLE_INTEGER - 1) - 1  # pixels from the first pixel's centre
CLUSTER_M = 23  # mantissa bits of the cluster test: those of the image's own float32
MEAN_FRACTION = 7  # fraction bits of a mean in pixels
KEY_BITS = 24
_RADIUS_MARGIN = 3.0 * np.sqrt(DILATION + np.sqrt(0.1)) + 2.0
_SLACK = 1.0 + 2.0**-14


# What numba functions take of `FrontFormats`: whole numbers' bits.
Widths = namedtuple("Widths", "mean direction harmonics coefficient sums term key")
_RANGES = {"mean": (5, 9), "direction": (8, 15), "harmonics": (8, 15), "coefficient": (8, 15), "sums": (2, 7), "term": (10, 16), "key": (8, 30)}


@dataclass(frozen=True)
class FrontFormats:
    """Bits of the front end's numbers. The RTL is that of the defaults; other formats are for measurements.

    Mantissa bits of the ff numbers. position: from the mean in the world to the mean on the screen and the depth. shape: covariance, shape,
    lists. colour: SH.
    Fraction bits of fixed point. mean: pixels on the screen. direction, harmonics: of the view and of the functions in it. coefficient: of one that was FP16.
    sums: of a degree's products, in units of its coefficients. term: of what is added to a colour. key: bits of the depth key.
    """

    position: int = 19
    shape: int = 11
    colour: int = 11
    mean: int = MEAN_FRACTION
    direction: int = 12
    harmonics: int = 11
    coefficient: int = 11
    sums: int = 5
    term: int = 13
    key: int = KEY_BITS

    def __post_init__(self) -> None:
        for field in fields(self):
            low, high = _RANGES.get(field.name, (10, CLUSTER_M))
            if not low <= (bits := getattr(self, field.name)) <= high:
                raise FlickerError(f"front end: {field.name} must have {low} to {high} bits, not {bits}")

    @property
    def widths(self) -> Widths:
        """Of all that is no ff number."""
        return Widths(*(getattr(self, name) for name in Widths._fields))


FORMATS = FrontFormats()


def rounded(values: ArrayLike, bits: int) -> np.ndarray:
    """float64 array of the nearest ff numbers."""
    array = np.asarray(values, np.float64)
    return np.array([ff_round(v, bits) for v in array.ravel().tolist()]).reshape(array.shape)


def image_floats(values: np.ndarray) -> np.ndarray:
    """float64 of float32 numbers in the image as the front end takes them: subnormal ones are 0."""
    wide = values.astype(np.float64)
    return np.where(np.abs(wide) < MIN_NORMAL, 0.0, wide)


@dataclass(frozen=True, eq=False)
class FrameSetup:
    """The register bundle of a frame. ff numbers are held in float64; the number of mantissa bits stands behind each (C: cluster test, 23).

    width, height: pixels, at most 4096.
    position: (3,) C, of the camera. view: (3, 3) position, world to camera. focal: (2,) position.
    row_x, row_x_z: (3,) shape, fx times the first and third row of `view`. row_y, row_y_z: fy times the second and third.
    least, limit: (2,) shape, the least and the largest tx and ty in the Jacobian. middle: int64 (2,), principal point in 1/128 pixel.
    normal: (5, 3) C, half-spaces of the cull: the near plane, left, right, top, bottom. offset: (5,) C, with the position taken off. reach: (5,) C,
    factor of sigma.
    """

    width: int
    height: int
    position: np.ndarray
    view: np.ndarray
    focal: np.ndarray
    row_x: np.ndarray
    row_x_z: np.ndarray
    row_y: np.ndarray
    row_y_z: np.ndarray
    least: np.ndarray
    limit: np.ndarray
    middle: np.ndarray
    normal: np.ndarray
    offset: np.ndarray
    reach: np.ndarray
    formats: FrontFormats

    @staticmethod
    def of(camera: Camera, formats: FrontFormats = FORMATS) -> FrameSetup:
        """The registers of a camera. FlickerError for pictures that the lists cannot address, and a principal point beyond its register."""
        for side in ("width", "height"):
            if getattr(camera, side) > MAX_PICTURE:
                raise FlickerError(f"{side}: {getattr(camera, side)} is beyond the front end's {MAX_PICTURE}")
        for side in ("cx", "cy"):
            if abs(getattr(camera, side)) > MAX_MIDDLE:
                raise FlickerError(f"{side}: {getattr(camera, side):g} is beyond the front end's {MAX_MIDDLE} pixels")
        view = camera.rotation.T
        least, limit = slope_range(camera).T
        normal, offset, reach = _half_spaces(camera, np.maximum(-least, limit))
        middle = np.floor(np.ldexp(_centre(camera), formats.mean) + 0.5).astype(np.int64)
        p, s = formats.position, formats.shape
        return FrameSetup(
            camera.width, camera.height, rounded(camera.position, CLUSTER_M), rounded(view, p), rounded([camera.fx, camera.fy], p),
            rounded(camera.fx * view[0], s), rounded(camera.fx * view[2], s), rounded(camera.fy * view[1], s), rounded(camera.fy * view[2], s),
            rounded(least, s), rounded(limit, s), middle, rounded(normal, CLUSTER_M), rounded(offset, CLUSTER_M), rounded(reach, CLUSTER_M), formats,
        )


def _centre(camera: Camera) -> list[float]:
    """The principal point as the driver (sw/flk.c) has it: what it is off the middle, added to the middle."""
    return [0.5 * (n - 1) + (c - 0.5 * (n - 1)) for c, n in ((camera.cx, camera.width), (camera.cy, camera.height))]


def _half_spaces(camera: Camera, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals (5, 3) in world axes, offsets (5,), factors of sigma (5,): normal . (mean - position) + offset + factor sigma > 0 for every visible Gaussian.

    limit: (2,), of the magnitude of slopes. As `chip.cull.planes`, with a pixel and a part in 2^14 to spare, which is more than ff numbers of 23 bits lose
    (docs/reference/front_end.md).
    """
    reach = 3.0 * max(camera.fx, camera.fy) * np.sqrt(1.0 + (limit**2).sum())
    normals = [(0.0, 0.0, 1.0)]
    for axis, (f, n, middle) in enumerate(zip((camera.fx, camera.fy), (camera.width, camera.height), _centre(camera))):
        beyond = TILE * -(-n // TILE)
        for sign, depth in ((1.0, middle + _RADIUS_MARGIN), (-1.0, beyond - middle + _RADIUS_MARGIN)):
            normal = [0.0, 0.0, depth]
            normal[axis] = sign * f
            normals.append(tuple(normal))
    offset = np.array([-NEAR * (1.0 - 2.0**-14), 0.0, 0.0, 0.0, 0.0])
    # The near plane's slack grows with sigma too: what is seen far off the axis has a large one.
    factor = np.array([2.0**-14, reach, reach, reach, reach]) * _SLACK
    # Sums in this order and without fused steps, which a matrix product does not promise: the driver (sw/flk.c) gives the same bits.
    x, y, z = np.array(normals).T[:, :, None]
    rotation = camera.rotation
    return x * rotation[:, 0] + y * rotation[:, 1] + z * rotation[:, 2], offset, factor

