"""What blends the splats of a picture and finds the way back from its slope: numba on the processor, or gsplat's kernels on a GPU (docs/reference/fit.md).

Projection, colours, lists of tiles and the way from splats to parameters are `render`'s with every engine; so is the choice of what is not finite.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import FlickerError, one_line
from ..params import TILE
from . import raster
from .through import ALL

# From dL/d image (H, W, 3) to sums over pixels, float64 (M, raster.SUMS), and bool (M,), the splats with any.
Back = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
# From rows, start, entry, mask, background of `render.Frame`: fills image, transmittance and used, as `raster.blend`.
Engine = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], Back]


def processor(
    rows: np.ndarray, start: np.ndarray, entry: np.ndarray, mask: np.ndarray, background: np.ndarray, image: np.ndarray, transmittance: np.ndarray,
    used: np.ndarray,
) -> Back:
    """`raster`: numba, in the format of the rows; the same bits with any number of threads."""
    tiles_x = -(-image.shape[1] // TILE)
    raster.blend(rows, start, entry, mask, tiles_x, background, image, transmittance, used)

    def back(slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sums = np.empty((len(entry), raster.SUMS))
        raster.blend_back(rows, start, entry, mask, tiles_x, image, used, np.ascontiguousarray(slope, rows.dtype), sums)
        total, seen = np.zeros((len(rows), raster.SUMS)), np.zeros(len(rows), np.bool_)
        raster.gather(entry, used, sums, total, seen)
        return total, seen

    return back


class Gsplat:
    """`gsplat.rasterize_to_pixels` on our lists: float32; its atomic sums make no two runs the same bits.

    Its rules are `raster`'s but that alpha is held at 0.999, not at 0.99. It knows no masks, and does not tell which entries are used: all are taken for it; a
    splat is seen where a derivative of it is not 0.
    """

    def __init__(self, rasterize: Callable[..., Any] | None = None, device: str = "cuda") -> None:
        """rasterize: instead of gsplat's. FlickerError where that, or a GPU, is not there."""
        try:
            self._torch = importlib.import_module("torch")
            self._rasterize = rasterize or importlib.import_module("gsplat").rasterize_to_pixels
        except ImportError as error:
            raise FlickerError(f"--engine: gsplat: {one_line(error)}; install the package's extra 'gpu' (docs/reference/fit.md)") from None
        if device == "cuda" and not self._torch.cuda.is_available():
            raise FlickerError("--engine: gsplat: PyTorch finds no GPU")
        self._device = device
        try:  # gsplat compiles its kernels when they are used first, and says only then that it cannot
            one = np.ones((1, raster.COLUMNS), np.float32)
            self._draw(one, np.array([0, 1]), np.zeros(1, np.int32), np.zeros(3, np.float32), (1, 1))
        except Exception as error:
            raise FlickerError(f"--engine: gsplat: cannot draw: {one_line(error)}") from None

    def _draw(self, rows: np.ndarray, start: np.ndarray, entry: np.ndarray, background: np.ndarray, shape: tuple[int, int]) -> tuple[Any, Any, list[Any]]:
        """Picture (1, H, W, 3), alpha (1, H, W, 1), and the leaves: means (1, M, 2), conics (1, M, 3), colours (1, M, 3), opacities (1, M)."""
        height, width = shape

        def there(array: np.ndarray, kind: type = np.float32) -> Any:
            return self._torch.from_numpy(np.ascontiguousarray(array, kind)[None]).to(self._device)

        means = rows[:, [raster.MX, raster.MY]] + 0.5  # the centres of its pixels are at halves
        conics = rows[:, [raster.HALF_A, raster.MIXED, raster.HALF_C]] * np.array([2, 1, 2], rows.dtype)
        leaves = [there(part).requires_grad_() for part in (means, conics, rows[:, [raster.RED, raster.GREEN, raster.BLUE]], rows[:, raster.OPACITY])]
        offsets = there(start[:-1].reshape(-(-height // TILE), -(-width // TILE)), np.int32)
        image, alpha = self._rasterize(*leaves, width, height, TILE, offsets, there(entry, np.int32)[0], backgrounds=there(background))
        return image, alpha, leaves

    def __call__(
        self, rows: np.ndarray, start: np.ndarray, entry: np.ndarray, mask: np.ndarray, background: np.ndarray, image: np.ndarray, transmittance: np.ndarray,
        used: np.ndarray,
    ) -> Back:
        assert (mask == ALL).all()  # `engine` sees to it
        drawn, alpha, leaves = self._draw(rows, start, entry, background, transmittance.shape)
        image[:] = drawn[0].detach().cpu().numpy()
        transmittance[:] = 1.0 - alpha[0, ..., 0].detach().cpu().numpy()
        used[:] = True

        def back(slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            given = self._torch.from_numpy(np.ascontiguousarray(slope, np.float32)[None]).to(self._device)
            found = self._torch.autograd.grad(drawn, leaves, given, retain_graph=True)
            means, conics, colours, opacities = (part[0].cpu().numpy().astype(np.float64) for part in found)
            return splat_sums(rows, means, conics, colours, opacities)

        return back


def splat_sums(rows: np.ndarray, means: np.ndarray, conics: np.ndarray, colours: np.ndarray, opacities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What `Back` gives, from derivatives in means (M, 2), conics (M, 3), colours (M, 3) and opacities (M,)."""
    seen = np.asarray(np.concatenate([means, conics, colours, opacities[:, None]], axis=1).any(axis=1))
    row = rows[seen].astype(np.float64)
    a, b, c = 2.0 * row[:, raster.HALF_A], row[:, raster.MIXED], 2.0 * row[:, raster.HALF_C]
    x, y = means[seen].T  # -conic (G_X, G_Y)
    det = a * c - b * b
    total = np.zeros((len(rows), raster.SUMS))
    total[seen, raster.G] = -row[:, raster.OPACITY] * opacities[seen]
    total[seen, raster.G_X], total[seen, raster.G_Y] = (b * y - c * x) / det, (b * x - a * y) / det
    total[seen, raster.G_XX], total[seen, raster.G_XY], total[seen, raster.G_YY] = 2.0 * conics[seen, 0], conics[seen, 1], 2.0 * conics[seen, 2]
    total[seen, raster.D_RED], total[seen, raster.D_GREEN], total[seen, raster.D_BLUE] = colours[seen].T
    return total, seen


class Choice(NamedTuple):
    """make: the engine; FlickerError where it is not there. masks: it draws those of a contribution test."""

    make: Callable[[], Engine]
    masks: bool


ENGINES = {"numba": Choice(lambda: processor, True), "gsplat": Choice(Gsplat, False)}


def engine(name: str, masks: bool) -> Engine:
    """masks: of a contribution test are drawn. FlickerError for a name that is none, and an engine that is not there or draws no masks."""
    if name not in ENGINES:
        raise FlickerError(f"--engine: {name}: none of {', '.join(ENGINES)}")
    if masks and not ENGINES[name].masks:
        raise FlickerError(f"--engine: {name}: draws through no contribution test: leave out --through, or take numba")
    return ENGINES[name].make()
