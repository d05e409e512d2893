"""What draws the pictures of fits: the engine for GPUs against numba's.

gsplat's kernels need a GPU. Where PyTorch is installed, a blending of the same meaning stands in for them, with PyTorch's own derivatives, which are float32,
behind gsplat's own function where that is installed; where a GPU and gsplat are there too, gsplat itself is compared. How the derivatives of splats become the
sums that `fit.chain` takes is tested everywhere, with central differences of the same blending.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scene_samples as samples
from flicker_tb.command import flicker
from flicker_tb.runner import seed

from flicker.budget.tune import Rates, tune_step
from flicker.errors import FlickerError
from flicker.fit import engines, raster
from flicker.fit.adam import Adam
from flicker.fit.least import LeastSize
from flicker.fit.parameters import LOGIT, Parameters
from flicker.fit.render import backward, render
from flicker.params import ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN
from flicker.scene.camera import Camera

BACKGROUND = (0.3, 0.1, 0.6)


def look(width: int, height: int, focal: float) -> Camera:
    return Camera(width, height, focal, 1.1 * focal, np.array([0.1, -0.2, -3.0]), np.eye(3))


def busy(count: int) -> Parameters:
    """Gaussians that cover each other; the first five are clamped in their middle."""
    scene = samples.random_scene(seed() + 7, count, 1)
    scene.scales *= np.float32(4.0)
    found = Parameters.of(scene)
    found.values[:5, LOGIT] = 6.0
    return found


def blended(
    xp: ModuleType, means: Any, conics: Any, colours: Any, opacities: Any, width: int, height: int, tile: int, offsets: Any, ids: Any, backgrounds: Any,
) -> tuple[Any, Any]:
    """Picture (1, H, W, 3) and alpha (1, H, W, 1) as `gsplat.rasterize_to_pixels` defines them, but for alpha held at 0.99; with NumPy or PyTorch."""
    ends = [*offsets.reshape(-1).tolist()[1:], len(ids)]
    lines = []
    for row in range(offsets.shape[1]):
        tiles = []
        for column in range(offsets.shape[2]):
            t = row * offsets.shape[2] + column
            own = ids[offsets.reshape(-1).tolist()[t] : ends[t]]
            y, x = np.mgrid[row * tile : min(height, (row + 1) * tile), column * tile : min(width, (column + 1) * tile)] + 0.5
            x, y = (xp.asarray(plane.reshape(-1, 1), dtype=means.dtype) for plane in (x, y))
            dx, dy = x - means[0][own, 0], y - means[0][own, 1]
            a, b, c = conics[0][own].T
            energy = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
            alpha = opacities[0][own] * xp.exp(-energy)
            alpha = xp.where(alpha > ALPHA_MAX, ALPHA_MAX, alpha)
            alpha = xp.where((energy >= 0) & (alpha >= ALPHA_MIN), alpha, 0.0)
            after = xp.cumprod(1.0 - alpha, 1)
            before = xp.concatenate([xp.ones_like(x), after[:, :-1]], 1)[:, : len(own)]
            weight = xp.where(after >= TRANSMITTANCE_MIN, alpha * before, 0.0)
            total = weight.sum(1).reshape(-1, 1)
            picture = weight @ colours[0][own] + (1.0 - total) * backgrounds[0]
            tiles.append(xp.concatenate([picture, total], 1).reshape(-1, min(tile, width - column * tile), 4))
        lines.append(xp.concatenate(tiles, 1))
    found = xp.concatenate(lines, 0)[None]
    return found[..., :3], found[..., 3:]


def test_sums_from_derivatives_of_splats() -> None:
    """Central differences of the blending, in float64, in every number of every splat, against the sums of numba's way back."""
    frame = render(busy(9), look(21, 18, 25.0), BACKGROUND)
    weight = np.random.default_rng(seed()).normal(size=(18, 21, 3))
    total, seen = frame.back(weight)
    parts = [
        frame.rows[:, [raster.MX, raster.MY]] + 0.5, frame.rows[:, [raster.HALF_A, raster.MIXED, raster.HALF_C]] * [2, 1, 2],
        frame.rows[:, [raster.RED, raster.GREEN, raster.BLUE]], frame.rows[:, [raster.OPACITY]],
    ]

    def loss() -> float:
        means, conics, colours, opacities = (part[None] for part in parts)
        offsets = frame.start[:-1].reshape(1, 2, 2)
        image, _ = blended(np, means, conics, colours, opacities[..., 0], 21, 18, TILE, offsets, frame.entry, np.array([BACKGROUND]))
        return float((image[0] * weight).sum())

    assert abs(loss() - (frame.image * weight).sum()) < 1e-6
    slopes = []
    for part in parts:
        slope = np.zeros_like(part)
        for place in np.ndindex(*part.shape):
            was, step = part[place], 1e-6
            part[place] = was + step
            up = loss()
            part[place] = was - step
            slope[place] = (up - loss()) / (2 * step)
            part[place] = was
        slopes.append(slope)
    means, conics, colours, opacities = slopes
    found, there = engines.splat_sums(frame.rows, means, conics, colours, opacities[:, 0])
    assert seen.sum() > 5 and np.array_equal(there, seen)
    assert (np.abs(found - total).max(axis=0) < 1e-5 * np.abs(total).max(axis=0)).all()


@pytest.fixture
def rasterize(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """`blended` with PyTorch; where gsplat is installed, behind gsplat's own function, which looks at what it is given."""
    torch = pytest.importorskip("torch", reason="PyTorch is not installed: the extra gpu")
    torch.set_num_threads(1)
    try:
        import gsplat.cuda._wrapper as wrapper
    except ImportError:
        return partial(blended, torch)

    def kernel(
        means: Any, conics: Any, colours: Any, opacities: Any, backgrounds: Any, masks: Any, width: int, height: int, tile: int, offsets: Any, ids: Any,
        absgrad: bool,
    ) -> tuple[Any, Any]:
        assert masks is None and offsets.dtype == ids.dtype == torch.int32 and means.dtype == backgrounds.dtype == torch.float32
        return blended(torch, means, conics, colours, opacities, width, height, tile, offsets, ids, backgrounds)

    monkeypatch.setattr(wrapper, "_RasterizeToPixels", SimpleNamespace(apply=kernel))
    return wrapper.rasterize_to_pixels


def compare(engine: engines.Engine, parameters: Parameters, camera: Camera, off: float) -> None:
    """Picture, transmittance and derivatives against numba's. off: how far picture and transmittance may be."""
    weight = np.random.default_rng(seed()).normal(size=(camera.height, camera.width, 3))
    ours, theirs = (render(parameters, camera, BACKGROUND, precision=np.float32, engine=of) for of in (engines.processor, engine))
    assert np.abs(ours.image - theirs.image).max() < off and np.abs(ours.transmittance - theirs.transmittance).max() < off
    assert theirs.used.all() and ours.transmittance.min() < 1e-2 < ours.transmittance.max()
    wanted, found = backward(ours, weight), backward(theirs, weight)
    assert set(found.index) <= set(wanted.index) and len(found.index) > 0.9 * len(wanted.index)
    rest = ~np.isin(wanted.index, found.index)
    largest = np.abs(wanted.values).max(axis=0)
    assert not wanted.values[rest].any()
    assert (np.abs(found.values - wanted.values[~rest]) <= 1e-3 * largest + 1e-6).all()
    assert np.allclose(found.screen, wanted.screen[~rest], atol=1e-3 * np.abs(wanted.screen).max())


def test_gsplat_with_a_blending_that_stands_in(rasterize) -> None:
    engine = engines.Gsplat(rasterize, "cpu")
    compare(engine, busy(60), look(45, 37, 40.0), 2e-5)
    nothing = busy(3)
    nothing.values[:, 2] = -10.0  # behind the camera
    frame = render(nothing, look(45, 37, 40.0), BACKGROUND, engine=engine)
    assert np.allclose(frame.image, BACKGROUND) and (frame.transmittance == 1).all()
    assert not len(backward(frame, np.ones((37, 45, 3))).index)


def test_gsplat_on_a_gpu() -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed: the extra gpu")
    pytest.importorskip("gsplat", reason="gsplat is not installed: the extra gpu")
    if not torch.cuda.is_available():
        pytest.skip("no GPU")
    parameters = busy(60)
    parameters.values[:, LOGIT] = np.minimum(parameters.values[:, LOGIT], 4.5)  # opacity 0.989: neither engine holds alpha
    compare(engines.Gsplat(), parameters, look(45, 37, 40.0), 1e-4)


def test_tuning_with_a_blending_that_stands_in(rasterize) -> None:
    """A scene is tuned as with numba, and one whose numbers are not finite is told, not trained on."""
    engine = engines.Gsplat(rasterize, "cpu")
    camera, wanted = look(45, 37, 40.0), render(busy(60), look(45, 37, 40.0)).image
    rates, coefficients = Rates().at(0.0, 1.0, 23), np.full(60, 4)
    ends, told = [], []
    for draw in (partial(render, precision=np.float32), partial(render, precision=np.float32, engine=engine)):
        parameters = busy(60)
        parameters.values[:, :3] += np.random.default_rng(seed()).normal(0, 0.02, (60, 3)).astype(np.float32)
        parameters.values[7, LOGIT] = np.nan
        moments = Adam.of(parameters.values)
        steps = [tune_step(parameters, moments, camera, wanted, rates, coefficients, LeastSize(0.0, [camera]), draw) for _ in range(20)]
        ends.append([decibels for decibels, _ in steps])
        told.append([broken.tolist() for _, broken in steps])
        assert np.isnan(parameters.values).sum() == 1
    assert told[0] == told[1] == [[7]] * 20
    assert ends[0][-1] > ends[0][0] + 3 and np.allclose(ends[0], ends[1], atol=0.1)


def test_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = flicker("budget", "demo", "-o", tmp_path / "small.ply", "--keep", "0.5", "--engine", "gsplat", "--through", "faithful")
    line = "--engine: gsplat: draws through no contribution test: leave out --through, or take numba"
    assert result.returncode == 2 and result.stderr.strip().splitlines() == [f"flicker: {line}"]
    with pytest.raises(FlickerError, match="--engine: cuda: none of numba, gsplat"):
        engines.engine("cuda", False)
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(FlickerError, match="--engine: gsplat: .*torch.*; install the package's extra 'gpu'"):
        engines.engine("gsplat", False)


def test_kernels_that_do_not_compile() -> None:
    pytest.importorskip("torch", reason="PyTorch is not installed: the extra gpu")

    def broken(*_: object, **__: object) -> None:
        raise AttributeError("'NoneType' object has no attribute 'rasterize_to_pixels_3dgs_fwd'")

    with pytest.raises(FlickerError, match="--engine: gsplat: cannot draw: 'NoneType' object"):
        engines.Gsplat(broken, "cpu")
