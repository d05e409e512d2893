"""Errors over time: how much the error of a picture changes from frame to frame (docs/reference/motion.md).

The error of a frame is its picture minus the float64 reference of the same frame. Both are of the same pose, so what moves in the scene moves in both and
cancels: what is left of the change is the renderer's own.

    measure = TemporalError()
    changes = [measure.add(picture, reference) for picture, reference in frames]      # one frame is kept
    summary = summarise(changes, fps=90)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .metrics import clamped_pair, decibels

JUMP = 8.0 / 255.0  # change of an error in one frame that counts as a jump


@dataclass(frozen=True)
class Change:
    """A frame. mse: of the error, over pixels and channels of pictures clamped to [0, 1]. change: mean square of the error's change since the frame before;
    None of the first frame. jumps: share of pixels of which a channel's error has changed by more than `JUMP`; None of the first frame."""

    mse: float
    change: float | None = None
    jumps: float | None = None

    @property
    def psnr_db(self) -> float:
        """PSNR of the still, dB; inf where the pictures are equal."""
        return decibels(self.mse)

    @property
    def temporal_psnr_db(self) -> float | None:
        """PSNR of the error's change, dB; inf where the error has not changed, None of the first frame."""
        return None if self.change is None else decibels(self.change)


@dataclass(frozen=True)
class TemporalSummary:
    """A sequence. psnr_db, temporal_psnr_db: of the mean squares over all frames, all changes. jumps: mean share of pixels. worst_frame: number of the frame
    whose error has changed most. worst_second: number of the first of the frames of a second in which it has. None where there is no second frame."""

    frames: int
    psnr_db: float
    temporal_psnr_db: float | None = None
    jumps: float | None = None
    worst_frame: int | None = None
    worst_frame_db: float | None = None
    worst_second: int | None = None
    worst_second_db: float | None = None


class TemporalError:
    """Takes frames one after the other and keeps the error of the last one."""

    def __init__(self) -> None:
        self._error: np.ndarray | None = None

    def add(self, image: np.ndarray, reference: np.ndarray) -> Change:
        """The next frame: float (H, W, 3) both, unquantised, clamped to [0, 1] here. ValueError where the shape is not that of the frames before."""
        image, reference = clamped_pair(image, reference)
        error = image - reference
        mse = float(np.mean(np.square(error)))
        before, self._error = self._error, error
        if before is None:
            return Change(mse)
        if before.shape != error.shape:
            raise ValueError(f"frames differ in shape: {before.shape} and {error.shape}")
        change = np.abs(error - before)
        return Change(mse, float(np.mean(np.square(change))), float((change.max(axis=2) > JUMP).mean()))


def summarise(changes: Sequence[Change], fps: float) -> TemporalSummary:
    """Figures of a sequence, one frame at least, shown at `fps`. A sequence of less than a second is its own worst second."""
    squares = [c.change for c in changes[1:] if c.change is not None]
    psnr = decibels(sum(c.mse for c in changes) / len(changes))
    if len(squares) != len(changes) - 1:
        raise ValueError("a frame behind the first has no change")
    if not squares:
        return TemporalSummary(len(changes), psnr)
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    window = min(max(round(fps), 1), len(squares))
    means = (sums[window:] - sums[:-window]) / window
    worst, second = int(np.argmax(squares)), int(np.argmax(means))
    jumps = [c.jumps for c in changes[1:] if c.jumps is not None]
    return TemporalSummary(
        len(changes), psnr, decibels(sums[-1] / len(squares)), sum(jumps) / len(jumps), worst + 1, decibels(squares[worst]), second + 1,
        decibels(max(float(means[second]), 0.0)),
    )
