"""How a view is drawn: an engine with its front end, configuration and memory. The one way from a view to a picture, whatever the engine."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..front.view import View
from ..params import RenderConfig
from ..pipeline import Engine, Front, FrontOptions, Rendered, render_view
from ..progress import Steps
from .dram import DramConfig
from .run import render_on_chip


@dataclass(frozen=True)
class Drawing:
    """front: not of an engine of the whole chip, which has its own. dram: of the chip that is simulated."""

    engine: Engine = Engine.GOLDEN
    config: RenderConfig = RenderConfig()
    front: Front = Front.FLOAT
    options: FrontOptions = FrontOptions()
    dram: DramConfig = field(default_factory=DramConfig)

    def render(self, view: View, *, compare: bool = False, alpha: bool = False, steps: Steps | None = None) -> Rendered:
        """The picture of a view and its statistics. compare: with `psnr_db` against the float64 reference. alpha: with what covers the pixels."""
        if self.engine.whole:
            return render_on_chip(view, self.engine, config=self.config, options=self.options, dram=self.dram, compare=compare, steps=steps)
        return render_view(
            view, engine=self.engine, config=self.config, front=self.front, options=self.options, compare=compare, alpha=alpha, steps=steps,
        )
