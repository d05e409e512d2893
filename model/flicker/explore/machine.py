"""What a machine is made of: lists, a mask generator, a rendering stage. The classes that the table of configurations is filled with.

A configuration streams lists (`flicker.front.lists`), asks its generator for masks, draws and counts with its stage:

    result = run(get_configuration("flicker"), view)      # bit-true picture and work
    cycles, counters = result.configuration.simulate(result.work)

How to add a generator or a stage: docs/guide/extending.md.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..cost.area import generator_area
from ..cost.energy import generator_pj
from ..cost.operations import NONE, Operations
from ..errors import FlickerError
from ..front.lists import LISTS
from ..front.records import SubtileLists
from ..front.view import View
from ..golden.masked import render_masked
from ..golden.render import assemble, stream_order
from ..params import CORES, Form, RenderConfig
from ..perf.lanes import LaneCycles
from ..perf.render_stage import StageCycles
from ..perf.work import Work

Counters = StageCycles | LaneCycles


@dataclass
class Masks:
    """What a mask generator says; fields as in `Work`."""

    mask: np.ndarray
    test_cycles: np.ndarray
    evaluations: np.ndarray
    visit: np.ndarray | None = None
    fallen: np.ndarray | None = None


class MaskGenerator(ABC):
    """Says which mini-tiles, or which pixels of them, a splat is sent to. Subclasses are frozen dataclasses: equal fields, equal masks.

    pixels: the masks name single pixels. exact: never leaves out a pixel that the VRU would have blended, proved in docs/reference/mask_bounds.md.
    free: masks for nothing, a bound and no design. precision: formats, for tables. operations: hardware operations per element.
    """

    pixels: bool = False
    free: bool = False

    @property
    def exact(self) -> bool:
        """Whether it provably leaves out no pixel that the VRU would have blended."""
        return False

    @property
    def precision(self) -> str:
        """Number format of the test, for tables."""
        return "-"

    @property
    def operations(self) -> Operations:
        """Hardware operations of an element, for area and energy."""
        return NONE

    @abstractmethod
    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        """Masks of a frame's elements, bit for bit. order, core_start: as in `Work`."""

    def rtl(self) -> dict | None:
        """Fields of `RenderConfig` with which the RTL makes these masks; None where it cannot."""
        return None

    def picture_key(self, stage: RenderingStage) -> object:
        """What of the stage the masks depend on."""
        return None

    def area(self) -> float:
        """GE of one generator: estimate by its operators (`cost.area.generator_area`); RTL says what was synthesised."""
        return generator_area(self.operations)

    def energy_pj(self, work: Work, tested: int) -> float:
        """pJ of a frame. tested: cycles in which the generators of all cores took or tested an element."""
        return tested / self.operations.cycles * generator_pj(self.operations) if self.operations.per_element else 0.0

    def clock_free(self) -> float:
        """Load of clock pins that always toggle in one generator, in inputs of the unit inverter; the estimate by operators has none."""
        return 0.0


class RenderingStage(ABC):
    """Draws what the masks let through, and says how long it takes and what it costs. Subclasses are frozen dataclasses.

    form: of VRU and record. vrus: of the whole stage. accumulator: fraction bits of the colour accumulators, 0: FP16. idealised: its cycles are a
    closed form. assumed: what else its figures rest on, in few words, for tables. lists_of_rtl: kinds of lists that it is fed with where it is RTL.
    """

    form: Form
    accumulator: int = 0
    idealised: bool = False
    assumed: ClassVar[tuple[str, ...]] = ()
    lists_of_rtl: ClassVar[tuple[str, ...]] = ("subtile",)

    @property
    @abstractmethod
    def vrus(self) -> int:
        """VRUs or lanes of the whole stage."""

    def rtl(self) -> dict | None:
        """Fields of `RenderConfig` that make the RTL this stage; None where it cannot."""
        return None

    def draw(self, lists: SubtileLists, order: np.ndarray, masks: Masks) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels, contributing pixels, finish positions, bit for bit (`golden.masked.render_masked`)."""
        return render_masked(lists, order, masks.mask, masks.visit, self.accumulator)

    @abstractmethod
    def simulate(self, work: Work, generator: MaskGenerator) -> tuple[int, Counters | None]:
        """Cycles of a frame and, where the stage is modelled cycle by cycle, its counters."""

    @abstractmethod
    def area_parts(self, generator: MaskGenerator) -> dict[str, float]:
        """GE by part, generators included."""

    @abstractmethod
    def energy(self, work: Work, cycles: int, counters: Any, generator: MaskGenerator) -> dict[str, float]:
        """Microjoules of a frame by part, generators included."""

    def utilisation(self, counters: Any) -> float:
        """Share of the cycles in which a VRU works."""
        return counters.utilisation


@dataclass(frozen=True)
class Configuration:
    """A machine.

    name: unique, lower case. title: for tables. family: `baseline`, `flicker`, `exact`, `rows`, `lanes` or `oracle`. lists: a kind of `front.lists.LISTS`.
    stop: the rest of a list is not streamed once all pixels of its sub-tile are finished; idealised, known at once.
    """

    name: str
    title: str
    family: str
    generator: MaskGenerator
    stage: RenderingStage
    lists: str = "subtile"
    stop: bool = False

    def __post_init__(self) -> None:
        if self.lists not in LISTS:
            raise FlickerError(f"configuration {self.name}: lists '{self.lists}' are not one of {', '.join(LISTS)}")

    @property
    def form(self) -> Form:
        """Form of the Gaussian weight: the stage's."""
        return self.stage.form

    @property
    def vrus(self) -> int:
        """VRUs or lanes of the whole stage."""
        return self.stage.vrus

    @property
    def render_config(self) -> RenderConfig | None:
        """The RTL that does the same; None where there is none."""
        generator, stage = self.generator.rtl(), self.stage.rtl()
        if generator is None or stage is None or self.lists not in self.stage.lists_of_rtl or self.stop:
            return None
        return RenderConfig(**generator, **stage)

    def rtl_parameters(self) -> dict[str, int] | None:
        """Module parameters of `flk_render_stage`, if the RTL has this configuration."""
        return None if self.render_config is None else self.render_config.rtl_parameters()

    @property
    def model_only(self) -> bool:
        """No RTL exists."""
        return self.render_config is None

    def picture_key(self) -> tuple:
        """Configurations with equal keys draw the same picture with the same work (before `stop`)."""
        return self.lists, self.form, self.generator, self.generator.picture_key(self.stage), self.stage.accumulator

    def simulate(self, work: Work) -> tuple[int, Counters | None]:
        """Cycles of the rendering stage and its counters. work: of `run`, without what `stop` leaves out."""
        return self.stage.simulate(work, self.generator)

    def area_parts(self) -> dict[str, float]:
        """GE of the rendering stage by part."""
        return self.stage.area_parts(self.generator)

    def area(self) -> float:
        """GE of the rendering stage."""
        return sum(self.area_parts().values())

    def energy(self, work: Work, cycles: int, counters: Counters | None) -> dict[str, float]:
        """Microjoules of a frame in the rendering stage, by part."""
        return self.stage.energy(work, cycles, counters, self.generator)


@dataclass
class Result:
    """What a configuration gives in a view: image float32 (H, W, 3), unquantised, rounded as the hardware does; its work; its lists."""

    configuration: Configuration
    image: np.ndarray
    work: Work
    lists: SubtileLists


def run(configuration: Configuration, view: View) -> Result:
    """Masks, picture (over the view's background) and work of a configuration in a view."""
    lists = view.lists(configuration.form, configuration.lists)
    order, core_start = stream_order(lists)
    masks = configuration.generator.masks(view, lists, order, core_start, configuration.stage)
    pixels, contributing, pixel_finish = configuration.stage.draw(lists, order, masks)
    fallen = np.zeros(lists.cols * lists.rows, bool) if masks.fallen is None else masks.fallen
    work = Work(
        lists.cols, lists.rows, order, core_start, lists.start, lists.entry, masks.test_cycles, masks.evaluations, masks.mask,
        masks.visit, contributing, pixel_finish, fallen,
    )
    return Result(configuration, assemble(lists, pixels, view.background), work.until_finished() if configuration.stop else work, lists)


def subtile_cycles(work: Work, counters: Counters) -> np.ndarray:
    """int64 (S,): cycles between the end of a sub-tile and that of the one before it in the same core; 0 for one that is not streamed."""
    cycles = np.zeros(work.subtiles, np.int64)
    for k in range(CORES):
        mine = work.order[work.core_start[k] : work.core_start[k + 1]]
        mine = mine[counters.subtile_end[mine] > 0]
        cycles[mine] = np.diff(counters.subtile_end[mine], prepend=0)
    return cycles
