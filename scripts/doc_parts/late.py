"""`make docs PART=late`: how long frames of a path take, and which of them miss their slot; what enormous Gaussians near the camera do.
In docs/results/motion.md.

The real views at 1280x720, 90 Hz, the chip with lanes by the models that are held to its RTL. Results are kept in build/late, so that Ctrl-C loses a sequence
at most.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from flicker.chip.compare import frame_cost
from flicker.chip.drawing import Drawing
from flicker.explore.digest import code_digest, file_digest, key
from flicker.explore.store import Store
from flicker.front.ahead import distance_ahead
from flicker.front.paths import AHEAD_M, Asked, path_of
from flicker.front.projection import project
from flicker.front.view import View
from flicker.markdown import table
from flicker.params import RECOMMENDED
from flicker.perf.timing import Timing
from flicker.pipeline import Engine
from flicker.scene.camera import Camera
from flicker.scene.gaussians import Scene
from flicker.scene.real import REAL_VIEWS, RealView
from flicker.scene.sources import open_scene
from flicker.toolchain import BUILD

from .common import SIZE, Say, folder_of_scenes

FRAMES, FPS = 30, 90.0
MOTIONS = {"walk": Asked("walk", size=SIZE, frames=FRAMES, fps=FPS), "shake": Asked("shake", size=SIZE, frames=FRAMES, fps=FPS)}
RATES, CLOCKS = (72.0, 90.0, 120.0), (1.0, 0.5, 0.1)  # Hz, GHz
CHIP = Drawing(Engine.CHIP_GOLDEN, RECOMMENDED)
# Enormous Gaussians: how many, opacity of each. They stand a metre before the first camera, about a metre wide; several are scattered half a metre about.
GIANTS = {"the scene alone": (0, 0.0), "one, opacity 0.1": (1, 0.1), "one, opacity 0.99": (1, 0.99), "100, opacity 0.02": (100, 0.02)}
GIANT_M, SCATTER_M = 1.0, 0.5
SEEN = (0, 10, 20, 29)  # frames of the walk
FIGURES = ("cycles", "latency_cycles", "front_cycles", "render_cycles")


def _costs(scene: Scene, cameras: Sequence[Camera], numbers: Iterable[int], say: Say, title: str) -> list[dict[str, int]]:
    found = []
    for n in numbers:
        say(f"{title}: frame {n + 1} of {len(cameras)}")
        cost = frame_cost(View(cameras[n], scene), CHIP)
        found.append({name: cost[name] for name in FIGURES} | {"bytes": sum(v for name, v in cost.items() if name.startswith("bytes_"))})
    return found


def with_giants(scene: Scene, camera: Camera, unit: float, count: int, opacity: float) -> Scene:
    """The scene and so many grey Gaussians before a camera, not of a file any more, so that it is packed anew. unit: of the scene, in a metre."""
    rng = np.random.default_rng(1)
    places = camera.position + unit * (camera.rotation[:, 2] + (SCATTER_M * rng.normal(size=(count, 3)) if count > 1 else np.zeros((count, 3))))
    add = {
        "means": places, "scales": np.full((count, 3), GIANT_M * unit), "quats": np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        "opacities": np.full(count, opacity), "sh": np.zeros((count, *scene.sh.shape[1:])),
    }
    return replace(scene, path=None, **{name: np.concatenate([getattr(scene, name), value]) for name, value in add.items()})


def _sequence(view: RealView, asked: Asked, giants: tuple[int, float] | None, say: Say, title: str) -> list[dict[str, int]]:
    """Costs of the frames of a path, out of the store where they are there. giants: count and opacity; frames `SEEN`; None: as the file is, all frames."""
    file, asked = view.path(folder_of_scenes()), replace(asked, view=view.number)
    store, of = Store(BUILD / "late"), key("late", code_digest(), file_digest(file), asked, giants, SEEN, GIANT_M, SCATTER_M)
    if (found := store.load(of)) is None:
        source = open_scene(file)
        cameras, _ = path_of(source, asked)
        if giants is None:
            rows = _costs(source.scene, cameras, range(len(cameras)), say, title)
        else:
            unit = distance_ahead(cameras[0], project(source.scene, cameras[0])) / AHEAD_M
            rows = _costs(with_giants(source.scene, cameras[0], unit, *giants), cameras, SEEN, say, title)
        found = {"frames": rows}
        store.put(of, found)
    return found["frames"]


def _share(value: float) -> str:
    return f"{100 * value:.0f} %"


def _late(cycles: Sequence[int], clock: float) -> str:
    return " / ".join(_share(Timing.of(cycles, 1e9 * clock / rate).late) for rate in RATES)


def _million(cycles: float) -> str:
    return f"{cycles / 1e6:.3f}"


def tables(say: Say) -> dict[str, str]:
    rows = []
    for view in REAL_VIEWS:
        for motion, asked in MOTIONS.items():
            found = _sequence(view, asked, None, say, f"{view.title}, {motion}")
            cycles = [row["cycles"] for row in found]
            timing = Timing.of(cycles, 1e9 / FPS)
            rows.append((
                f"{view.title}, {motion}", _million(timing.p50), _million(timing.p99), f"{_million(timing.worst)} (frame {timing.worst_frame})",
                _million(max(row["latency_cycles"] for row in found)), *(_late(cycles, clock) for clock in CLOCKS), f"{timing.worst * FPS / 1e6:.0f} MHz",
            ))
    rates = " / ".join(f"{rate:g}" for rate in RATES)
    late = table(
        ["million cycles", "p50", "p99", "longest", "longest alone", *(f"late at {rates} Hz, {clock:g} GHz" for clock in CLOCKS), f"clock for {FPS:g} Hz"],
        rows,
    )
    rows = []
    for view in REAL_VIEWS:
        alone: float | None = None
        for what, giants in GIANTS.items():
            found = _sequence(view, MOTIONS["walk"], giants, say, f"{view.title}, {what}")
            worst = max(row["cycles"] for row in found)
            alone = worst if alone is None else alone
            rows.append((
                view.title, what, *(_million(max(row[name] for row in found)) for name in FIGURES[2:]), _million(worst),
                f"{worst / alone - 1:+.1%}" if giants[0] else "",
                f"{max(row['bytes'] for row in found) / 1e6:.1f}",
            ))
    giants_ = table(["view", "enormous Gaussians", "front end, million cycles", "rendering", "frame to frame", "against the scene alone", "MB a frame"], rows)
    return {"paths": late, "giants": giants_}
