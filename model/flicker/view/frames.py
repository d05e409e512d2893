"""Frames of the viewer: a camera and a choice in, a picture with its map and its numbers out. No browser here.

    renderer = Renderer(load_view("scene.ply"))
    frame = renderer.frame(camera, Choice(overlay="cycles"))
    composed([frame]), list(renderer.numbers(frame))[-1]
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from PIL import Image

from ..chip.scene_cost import SceneCost, packed_for_cost, view_cost
from ..explore.configurations import rtl_configuration, run
from ..explore.evaluate import CLOCK_HZ
from ..explore.machine import Counters, Result
from ..front.view import View
from ..params import RECOMMENDED, RenderConfig
from ..pipeline import Engine, render_view
from ..scene.camera import Camera
from ..scene.gaussians import Scene
from ..scene.metrics import flip, flip_map, psnr
from ..scene.packing import Packing
from .overlays import (
    OF_STAGE,
    OVERLAYS,
    add_legend,
    as_image,
    beside,
    imbalance_map,
    painted,
    spread,
    tile_cycles,
    tile_entries,
    visited_map,
)

KEPT_VIEWS = 2  # full ones: of the camera and of a simulated frame, or of two such
OPACITY = 0.75  # of maps
SIMULATED = {Engine.RTL: "RTL", Engine.CHIP: "chip"}


@dataclass(frozen=True)
class Choice:
    """What a picture shows. engine: RTL and CHIP mean their last frame. config: of golden frames, and of what is simulated next. overlay: of OVERLAYS."""

    engine: Engine = Engine.GOLDEN
    config: RenderConfig = RECOMMENDED
    overlay: str | None = None


@dataclass(eq=False)
class Shot:
    """A simulated frame. engine: RTL or CHIP. image: float (H, W, 3). stats: what stats.json holds."""

    engine: Engine
    camera: Camera
    config: RenderConfig
    image: np.ndarray
    stats: dict[str, Any]


@dataclass(eq=False)
class Frame:
    """A picture.

    camera: its own, of another size than the one asked for where the frame is coarse, of a simulated frame's where that is shown. image: float (H, W, 3).
    overlay: float64 (H, W), NaN where there is nothing; None: none, or none that the engine has. stats: what is known at once. seconds: that it took.
    """

    camera: Camera
    choice: Choice
    coarse: int
    image: np.ndarray
    overlay: np.ndarray | None
    stats: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0


def camera_key(camera: Camera) -> tuple:
    """Equal for cameras that see the same."""
    return camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.position.tobytes(), camera.rotation.tobytes()


def largest(scene: Scene, share: int) -> Scene:
    """1/share of the Gaussians, those with the largest opacity times area across the two longer axes; in the order of the scene."""
    if share == 1:
        return scene
    axes = np.sort(scene.scales, axis=1)
    count = -(-len(scene) // share)
    size = scene.opacities * axes[:, 1] * axes[:, 2]
    keep = np.sort(np.argpartition(size, len(scene) - count)[len(scene) - count :]) if len(scene) else np.zeros(0, np.int64)
    return Scene(scene.means[keep], scene.scales[keep], scene.quats[keep], scene.opacities[keep], scene.sh[keep], antialiased=scene.antialiased)


class Renderer:
    """Frames of one scene. shots: the last simulated frames. Not to be used by two threads at once: the engines' kernels share theirs."""

    def __init__(self, view: View) -> None:
        self.scene, self.name, self.background, self.order = view.scene, view.name, view.background, view.order
        self.shots: dict[Engine, Shot] = {}
        self._views: dict[tuple, View] = {}
        self._parts: dict[int, Scene] = {}
        self._packed: tuple[Scene, Packing] | None = None

    def view(self, camera: Camera, coarse: int = 1) -> View:
        """The view of a camera, kept for the next frames of it; coarse: with fewer Gaussians, not kept."""
        if coarse > 1:
            if coarse not in self._parts:
                self._parts[coarse] = largest(self.scene, coarse)
            return View(camera, self._parts[coarse], name=self.name, background=self.background, order=self.order)
        key = camera_key(camera)
        found = self._views.pop(key, None) or self.fresh(camera)
        self._views[key] = found
        while len(self._views) > KEPT_VIEWS:
            self._views.pop(next(iter(self._views)))
        return found

    def fresh(self, camera: Camera) -> View:
        """The view of a camera with nothing made yet."""
        return View(camera, self.scene, name=self.name, background=self.background, order=self.order)

    def drawn(self, view: View, config: RenderConfig) -> Result:
        """Picture, masks and work of a configuration, bit for bit."""
        configuration = rtl_configuration(config)
        return view.keep(("drawn", configuration.picture_key()), lambda: run(configuration, view))

    def simulated(self, view: View, config: RenderConfig) -> tuple[int, Counters | None]:
        """Cycles and counters of the cycle model."""
        work = self.drawn(view, config).work
        return view.keep(("cycles", config), lambda: rtl_configuration(config).simulate(work))

    def cost(self, camera: Camera) -> SceneCost:
        """What each Gaussian costs and gives in a view on the chip (`chip.scene_cost`), without the cycles of its halves."""
        if self._packed is None:
            self._packed = packed_for_cost(self.scene)
        scene, packing = self._packed
        return self.view(camera).keep("cost", lambda: SceneCost(scene, packing, [view_cost(packing, len(scene), camera, None, self.order)]))

    def frame(self, camera: Camera, choice: Choice, coarse: int = 1) -> Frame:
        """A frame. coarse: divisor of width, height and number of Gaussians; a simulated frame is shown as it is."""
        began = time.perf_counter()
        shot = None
        if choice.engine in SIMULATED:
            shot = self.shots.get(choice.engine)
            if shot is None:
                return Frame(camera, choice, 1, np.zeros((camera.height, camera.width, 3)), None, {"missing": SIMULATED[choice.engine]})
            camera, coarse = shot.camera, 1
        if coarse > 1:
            camera = camera.scaled(max(camera.width // coarse, 1), max(camera.height // coarse, 1))
        view, config = self.view(camera, coarse), shot.config if shot else choice.config
        stats: dict[str, Any]
        if shot is not None:
            image, stats = shot.image, shot.stats
        elif choice.engine is Engine.REFERENCE:
            image, stats = view.reference, {"visible": view.projected.n_visible}
        elif choice.overlay in OF_STAGE:
            result = self.drawn(view, config)
            image, stats = result.image, {"visible": view.projected.n_visible, "subtile_pairs": len(result.lists.entry), "tile_pairs": result.lists.tile_pairs}
        else:
            image, stats = view.keep(("picture", config), lambda: _picture(view, config))
        overlay = None
        if choice.overlay is not None:
            overlay = self._overlay(view, choice, config, image, coarse)
        return Frame(camera, choice, coarse, image, overlay, stats, time.perf_counter() - began)

    def _overlay(self, view: View, choice: Choice, config: RenderConfig, image: np.ndarray, coarse: int) -> np.ndarray | None:
        camera = view.camera
        if choice.overlay == "error":
            return flip_map(image, view.reference)
        if choice.overlay == "entries":
            return spread(tile_entries(view.projected, camera).astype(np.float64), 16, camera)
        if choice.overlay == "cost":
            if coarse > 1:  # takes seconds
                return None
            cost = self.cost(camera)
            seen = cost.views[0].seen
            return np.where(seen >= 0, cost.cycles[seen], np.nan)
        if choice.engine in (Engine.REFERENCE, Engine.CHIP):  # no stage; records and lists of its own
            return None
        work = self.drawn(view, config).work
        if choice.overlay == "visited":
            return visited_map(work, camera)
        if choice.overlay == "imbalance":
            return spread(imbalance_map(work, config), 8, camera)
        counters = self.simulated(view, config)[1]
        return None if counters is None else spread(tile_cycles(work, counters), 16, camera)

    def numbers(self, frame: Frame) -> Iterator[dict[str, str]]:
        """Numbers of a frame for people, more of them with every step: what is known at once, quality, work, cycles."""
        camera, config, stats = frame.camera, frame.choice.config, frame.stats
        found = {"picture": f"{camera.width}x{camera.height}" + (f", {frame.seconds:.2f} s" if frame.seconds >= 0.005 else "")}  # else it was there already
        if frame.coarse > 1:
            found["coarse"] = f"1/{frame.coarse}"
        if "missing" in stats:
            yield found | {"engine": f"no frame of the {stats['missing']} yet: simulate one"}
            return
        simulated = frame.choice.engine in SIMULATED
        if simulated:
            config = self.shots[frame.choice.engine].config
        found["engine"] = frame.choice.engine.value + ("" if frame.choice.engine is Engine.REFERENCE else f", {described(config)}")
        for key, name in (("visible", "Gaussians visible"), ("tile_pairs", "tile entries"), ("subtile_pairs", "sub-tile entries")):
            if stats.get(key) is not None:
                found[name] = f"{stats[key]:,}"
        yield found
        if frame.coarse > 1:
            return
        view = self.view(camera)
        if frame.choice.engine is not Engine.REFERENCE:
            value = psnr(frame.image, view.reference)
            found |= {"PSNR": f"{value:.2f} dB" if math.isfinite(value) else "equal", "FLIP, mean": f"{flip(frame.image, view.reference):.4f}"}
            yield found
        if simulated:
            found |= {"pixel visits": f"{stats['pixel_pairs']:,}", "cycles": f"{stats['cycles']:,}", "frames a second at 1 GHz": _rate(stats["cycles"])}
            found |= {"bottleneck": stats["bottleneck"]} if "bottleneck" in stats else {}
            if frame.choice.engine is Engine.RTL:
                yield found
                wrong = int((self.drawn(view, config).image != frame.image).any(axis=2).sum())
                found["pixels that differ from golden"] = f"{wrong:,}"
            yield found
        elif frame.choice.engine is Engine.GOLDEN:
            totals = self.drawn(view, config).work.totals()
            found |= {"pixel visits": f"{totals['pixels_visited']:,}", "of them contributing": f"{totals['pixels_contributing']:,}"}
            yield found
            cycles, counters = self.simulated(view, config)
            found |= {"cycles (model)": f"{cycles:,}", "frames a second at 1 GHz": _rate(cycles)}
            if counters is not None:
                found["utilisation"] = f"{counters.utilisation:.1%}"
            yield found

    def picked(self, frame: Frame, x: int, y: int) -> dict[str, str]:
        """What lies under pixel (x, y) of a full frame: the map's value, and the Gaussian with the largest weight there with what it costs on the chip."""
        found = {"pixel": f"{x}, {y}"}
        if frame.overlay is not None and frame.choice.overlay is not None:
            value = frame.overlay[y, x]
            found[OVERLAYS[frame.choice.overlay].title] = f"{value:,.3f}".rstrip("0").rstrip(".") if np.isfinite(value) else "-"
        cost = self.cost(frame.camera)
        number = int(cost.views[0].seen[y, x])
        if number < 0:
            return found | {"Gaussian": "none"}
        of = cost.of(number)
        return found | {
            "Gaussian": f"{number:,}", "cycles": f"{of['cycles']:,.1f}", "sub-tile entries": f"{of['entries']:,.0f}", "pixel visits": f"{of['visits']:,.0f}",
            "bytes moved": f"{cost.moved[number]:,.0f}", "blended weight, pixels": f"{of['weight']:,.2f}", "largest weight": f"{of['peak']:.4f}",
            "opacity": f"{of['opacity']:.3f}", "largest scale": f"{of['scale']:.3g}",
        }


def _picture(view: View, config: RenderConfig) -> tuple[np.ndarray, dict[str, Any]]:
    rendered = render_view(view, engine=Engine.GOLDEN, config=config)
    return rendered.image, rendered.stats


def _rate(cycles: int) -> str:
    return f"{CLOCK_HZ / cycles:,.0f}" if cycles else "-"


def described(config: RenderConfig) -> str:
    """A configuration in few words."""
    if config.by_lanes:
        return f"{config.lanes} lanes"
    return f"channels, {config.cat.name.lower()}, {config.precision.name.lower()}, {config.form.name.lower()}"


def composed(frames: Sequence[Frame], size: tuple[int, int], split: float = 0.5, opacity: float = OPACITY) -> Image.Image:
    """One frame, or two beside each other, with maps and legends, at a size (width, height). Equal maps have one scale. split: where the second begins."""
    pictures = []
    for k, frame in enumerate(frames):
        name, shown = frame.choice.overlay, frame.image
        if name is None or frame.overlay is None:
            pictures.append(as_image(shown, size))
            continue
        scale = OVERLAYS[name]
        limits = scale.limits([other.overlay for other in frames if other.choice.overlay == name and other.overlay is not None])
        picture = as_image(painted(np.clip(shown, 0.0, 1.0), frame.overlay, scale, limits, opacity), size)
        add_legend(picture, scale, limits, right=k == 1)
        pictures.append(picture)
    return beside(pictures, split)
