"""What is optimised: a scene's Gaussians before activation, as one matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.gaussians import SH_DEGREES, Scene, logits

# Columns of the matrix; the coefficients, three channels each, follow up to its end.
MEAN, SCALE, QUAT, LOGIT, SH = 0, 3, 6, 10, 11


@dataclass(eq=False)
class Parameters:
    """values: float32 (N, 11 + 3 K). Mean, logarithms of the three standard deviations, quaternion (w first, of any length), logit of the opacity,
    K SH coefficients as in `Scene.sh`. antialiased: as in `Scene`."""

    values: np.ndarray
    antialiased: bool = False

    def __len__(self) -> int:
        return len(self.values)

    @property
    def means(self) -> np.ndarray:
        """(N, 3), a view of `values`."""
        return self.values[:, MEAN:SCALE]

    @property
    def log_scales(self) -> np.ndarray:
        """(N, 3), natural logarithms of the standard deviations, a view of `values`."""
        return self.values[:, SCALE:QUAT]

    @property
    def quats(self) -> np.ndarray:
        """(N, 4), w first, of any length, a view of `values`."""
        return self.values[:, QUAT:LOGIT]

    @property
    def logits(self) -> np.ndarray:
        """(N,), logits of the opacities, a view of `values`."""
        return self.values[:, LOGIT]

    @property
    def sh(self) -> np.ndarray:
        """(N, K, 3)."""
        return self.values[:, SH:].reshape(len(self), -1, 3)

    @property
    def degree(self) -> int:
        """Degree of the harmonics, 0 to 3."""
        return SH_DEGREES[self.sh.shape[1]]

    def like(self, values: np.ndarray) -> Parameters:
        """Others that are drawn by the same rules."""
        return Parameters(values, self.antialiased)

    def finite(self) -> np.ndarray:
        """bool (N,): Gaussians all of whose numbers are finite."""
        return np.isfinite(self.values).all(axis=1)

    @classmethod
    def of(cls, scene: Scene) -> Parameters:
        """Parameters of a scene."""
        columns = (scene.means, np.log(scene.scales), scene.quats, logits(scene.opacities)[:, None], scene.sh.reshape(len(scene), -1))
        return cls(np.concatenate(columns, axis=1, dtype=np.float32), scene.antialiased)

    def scene(self) -> Scene:
        """The Gaussians as others see them; those that are not finite, or whose size or opacity float32 cannot hold, are left out."""
        with np.errstate(all="ignore"):
            scales = np.exp(self.log_scales)
            opacities = (1.0 / (1.0 + np.exp(-self.logits.astype(np.float64)))).astype(np.float32)
            norm = np.linalg.norm(self.quats.astype(np.float64), axis=1, keepdims=True)
            quats = self.quats / norm
        good = self.finite() & np.isfinite(scales).all(axis=1) & (scales > 0).all(axis=1) & (opacities > 0) & np.isfinite(quats).all(axis=1)
        return Scene(self.means[good], scales[good], quats[good], opacities[good], self.sh[good], antialiased=self.antialiased)
