"""The scene as everything else sees it: Gaussians with activated values."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SH_C0 = 0.28209479177387814  # of the constant harmonic: 1 / (2 sqrt(pi))
SH_DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # coefficients a channel: degree


def logits(opacities: np.ndarray) -> np.ndarray:
    """float64, as files and fits hold opacities: log(o / (1 - o)). Those above 1 - 2^-25, which none is the logit of, as that."""
    o = np.minimum(opacities.astype(np.float64), 1.0 - 2.0**-25)
    return np.log(o / (1.0 - o))


@dataclass(eq=False)
class Scene:
    """N Gaussians, values activated; contiguous float32 arrays.

    means: (N, 3). scales: (N, 3), standard deviations, > 0. quats: (N, 4), unit, w first. opacities: (N,), in (0, 1].
    sh: (N, K, 3), K = (degree + 1)^2 coefficients a colour, constant term first, order and signs of the INRIA code.
    antialiased: trained for the antialiased rendering of Mip-Splatting: a splat's opacity is multiplied by the square root of the ratio of the determinants
    of its covariance on the screen before and after dilation.
    path: the file or folder. rejected: Gaussians of the file that were left out, by reason.
    """

    means: np.ndarray
    scales: np.ndarray
    quats: np.ndarray
    opacities: np.ndarray
    sh: np.ndarray
    path: Path | None = None
    rejected: dict[str, int] = field(default_factory=dict)
    antialiased: bool = False

    def __post_init__(self) -> None:
        for name in ("means", "scales", "quats", "opacities", "sh"):
            setattr(self, name, np.ascontiguousarray(getattr(self, name), np.float32))

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        """Degree of the harmonics, 0 to 3."""
        return SH_DEGREES[self.sh.shape[1]]
