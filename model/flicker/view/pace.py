"""Which frame is due: coarse ones while something moves, the full one at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

COARSEST = 8


@dataclass
class Pace:
    """A coarse frame of divisor d has 1/d of the width and of the height, and 1/d of the Gaussians, the largest ones.

    rest: seconds without motion, while no frame is made, after which the full frame is due: kernels that run keep the news from coming in.
    budget: seconds that a moving frame may take; the divisor follows it.
    wanted, shown: anything that can be compared. shown_divisor: of what is shown, 1: full.
    """

    rest: float = 0.2
    budget: float = 0.35
    divisor: int = 2
    changed: float = -math.inf  # last motion, or the end of the moving frame that followed
    wanted: object = None
    shown: object = None
    shown_divisor: int = 0

    def ask(self, wanted: object, now: float, moving: bool = True) -> None:
        """Another frame is wanted; at once in full unless something moves."""
        if wanted != self.wanted:
            self.wanted = wanted
            self.changed = now if moving else -math.inf

    def due(self, now: float) -> tuple[int, float]:
        """(divisor of the frame to be made now, 0: none; seconds until the answer changes by itself)."""
        current = self.shown == self.wanted
        if self.wanted is None or current and self.shown_divisor == 1:
            return 0, math.inf
        if now - self.changed >= self.rest:
            return 1, 0.0
        return (0, self.changed + self.rest - now) if current else (self.divisor, 0.0)

    def made(self, what: object, divisor: int, seconds: float, now: float) -> None:
        """A frame was made; the next moving one is coarser or finer by what it took."""
        self.shown, self.shown_divisor = what, divisor
        if self.changed > -math.inf:
            self.changed = now
        if divisor != self.divisor:
            return
        if seconds > self.budget:
            self.divisor = min(2 * self.divisor, COARSEST)
        elif self.divisor > 1 and seconds < self.budget / 6:
            self.divisor //= 2
