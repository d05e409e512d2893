"""Which chip a scene needs: every chip of a table on the same views, and the smallest that is fast enough (docs/reference/scene_cost.md).

    found = rates(packing, cameras, chips().values())
    smallest(found, fps=90.0).chip.name

Cycles are those of the chip model (`whole_frame`), of the slowest view; areas those of `make synth`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from ..chips import Chip, chips
from ..cost.area import parts
from ..cost.synth.units import chip_row
from ..golden.front.frame import run_front
from ..params import Form
from ..progress import Steps
from ..scene.camera import Camera
from ..scene.packing import Packing
from .constants import CLOCK_HZ
from .dram import DramConfig
from .whole import first_half, whole_frame


@dataclass(frozen=True)
class Rate:
    """A chip on views. ge: gate equivalents; None: not synthesised. view: the slowest, its place among the cameras. cycles: of it, from frame to frame.
    waits: what sets them, as of `WholeFrame.bottleneck`."""

    chip: Chip
    ge: float | None
    view: int
    cycles: int
    waits: str

    def per_second(self, clock_hz: float = CLOCK_HZ) -> float:
        """Frames a second at a clock; the memory's cycles are those at 1 GHz."""
        return clock_hz / self.cycles

    def summary(self, clock_hz: float) -> dict[str, Any]:
        """As plain numbers."""
        return {
            "chip": self.chip.name, "ge": self.ge, "view": self.view, "interval": self.cycles, "frames_per_second": self.per_second(clock_hz),
            "waits": self.waits,
        }


def rates(packing: Packing, cameras: Sequence[Camera], table: Iterable[Chip], steps: Steps | None = None) -> list[Rate]:
    """Of the chips with records of 16 bytes, smallest first; those without an area last, in the table's order."""
    those = [chip for chip in table if chip.config.form is Form.FACTORED]
    worst: dict[str, tuple[int, int, str]] = {}
    with (steps or Steps()).bar("chips") as report:
        for k, camera in enumerate(cameras):
            front = run_front(packing.packed, camera)
            for n, chip in enumerate(those):
                report(k * len(those) + n, len(cameras) * len(those))
                dram = DramConfig(port_bits=chip.config.port_bits)
                frame = whole_frame(*first_half(front, chip.config, dram), chip.config, dram)
                if chip.name not in worst or frame.interval > worst[chip.name][0]:
                    worst[chip.name] = frame.interval, k, frame.bottleneck
    found = []
    for chip in those:
        cycles, view, waits = worst[chip.name]
        part = parts().get(chip_row(chip)) if chips().get(chip.name) == chip else None  # another of that name is not the one that was synthesised
        found.append(Rate(chip, part.ge if part else None, view, cycles, waits))
    return sorted(found, key=lambda rate: (rate.ge is None, rate.ge or 0.0))


def smallest(found: Sequence[Rate], fps: float, clock_hz: float = CLOCK_HZ) -> Rate | None:
    """The first of `rates` that makes so many frames a second; None: none does."""
    return next((rate for rate in found if rate.per_second(clock_hz) >= fps), None)
