"""How coarse the depth keys of a view are: steps of the keys that what is in view takes (`cull.key_scale`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...scene.camera import Camera
from ...scene.packed import PackedScene, means_and_scales
from ...scene.steps import in_picture
from .cull import cull
from .setup import KEY_BITS, FrameSetup

FEW = 1 << 16  # key steps over nine tenths of the depths in view, below which layers change places: keys of 20 bits lose nothing, of 16 up to 8 dB
_MANY = 1000  # Gaussians in view from which on quantiles say something


@dataclass(frozen=True)
class DepthSteps:
    """Depth keys of a view. step: of a key, units of the scene. nearest, farthest: depths of the kept clusters, which the keys cover. seen: Gaussians in the
    picture. span: depths between the 5 % and the 95 % quantile of these; 0 where none is seen."""

    step: float
    nearest: float
    farthest: float
    seen: int
    span: float

    @staticmethod
    def of(packed: PackedScene, camera: Camera) -> DepthSteps:
        """FlickerError for pictures beyond 4096x4096."""
        culled = cull(packed, FrameSetup.of(camera))
        depth = in_picture(means_and_scales(packed)[0], camera)[1]
        low, high = np.quantile(depth, (0.05, 0.95)) if len(depth) else (0.0, 0.0)
        return DepthSteps(2.0**-culled.key_shift, culled.nearest, culled.farthest, len(depth), float(high - low))

    @property
    def coarse(self) -> bool:
        """The keys cover so much more than what is seen that Gaussians one behind the other get the same."""
        return self.seen >= _MANY and 0 < self.span < FEW * self.step

    @property
    def warning(self) -> str:
        """What is wrong, for people."""
        return (
            f"depth keys of {KEY_BITS} bits cover {self.nearest:.3g} to {self.farthest:.3g}, so that nine tenths of what is in view have "
            f"{self.span / self.step:.2g} steps, fewer than {FEW:,}: what lies close together may be drawn in the "
            "wrong order; leave out Gaussians that are far away (flicker convert --no-flyaways)"
        )

    def as_dict(self) -> dict[str, float]:
        """For statistics."""
        return {"step": self.step, "nearest": self.nearest, "farthest": self.farthest, "span": self.span}
