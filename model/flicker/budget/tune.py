"""Fine-tuning of all parameters by gradient, towards pictures of the full scene.

The loss of a view is the logarithm of its mean squared error, pictures clamped to [0, 1]: its mean over views is, but for a factor, the mean PSNR. One view a
step, in random order, Adam on the Gaussians that it shows (`fit`). Rates fall evenly, in logarithms, to a twentieth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fit.adam import Adam
from ..fit.least import LeastSize
from ..fit.loss import LEAST_ERROR, log_error_slope
from ..fit.parameters import LOGIT, QUAT, SCALE, SH, Parameters
from ..fit.render import Draw, backward, render
from ..scene.camera import Camera
from ..scene.metrics import psnr

_MEAN_RATE = 8e-5  # of the scene's extent
_SCALE_RATE, _QUAT_RATE, _LOGIT_RATE, _SH_RATE, _SH_REST = 2.4e-2, 8e-3, 8e-2, 2e-2, 1 / 10
_LAST_RATE = 0.05


@dataclass(frozen=True)
class Rates:
    """Learning rates of the first step. mean: in extents of the scene. rest: of the SH beyond degree 0, as a share of that of degree 0."""

    mean: float = _MEAN_RATE
    scale: float = _SCALE_RATE
    quat: float = _QUAT_RATE
    logit: float = _LOGIT_RATE
    sh: float = _SH_RATE
    rest: float = _SH_REST

    def at(self, done: float, extent: float, columns: int) -> np.ndarray:
        """float32 (columns,) when a share `done` of the steps is made."""
        rates = np.empty(columns)
        rates[:SCALE], rates[SCALE:QUAT], rates[QUAT:LOGIT], rates[LOGIT] = self.mean * extent, self.scale, self.quat, self.logit
        rates[SH:] = self.sh * self.rest
        rates[SH : SH + 3] = self.sh
        return (rates * _LAST_RATE**done).astype(np.float32)


def tune_step(
    parameters: Parameters, moments: Adam, camera: Camera, wanted: np.ndarray, rates: np.ndarray, coefficients: np.ndarray, least: LeastSize,
    draw: Draw = render,
) -> tuple[float, np.ndarray]:
    """One view; parameters and moments change in place. PSNR of the view before, in dB, and Gaussians that have to be taken out: int64 numbers of those with
    a number or a derivative that is not finite; these have not been moved.

    coefficients: int64 (N,), how many SH coefficients a channel each has; the others stay. least: sizes that no Gaussian falls below.
    draw: what makes the view's frame.
    """
    frame = draw(parameters, camera)
    error, slope = log_error_slope(frame.image, wanted)
    found = backward(frame, slope)
    gradient = found.values
    gradient[:, SH:][np.arange((gradient.shape[1] - SH) // 3).repeat(3) >= coefficients[found.index][:, None]] = 0.0
    refused = moments.step(parameters.values, found.index, gradient, rates)
    least.hold(parameters.values, found.index)
    return -10.0 * np.log10(max(error, LEAST_ERROR)), np.union1d(found.index[refused], frame.index[frame.bad])


def quality(parameters: Parameters, cameras: list[Camera], wanted: list[np.ndarray], draw: Draw = render) -> float:
    """Mean PSNR in dB, pictures over black clamped to [0, 1]; inf where all are equal."""
    return float(np.mean([psnr(draw(parameters, camera).image, picture) for camera, picture in zip(cameras, wanted)]))
