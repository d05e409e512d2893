"""The section on stability over time: configurations along three motions, a strip and a clip that show the flicker.

Rows are those of a sweep over the same paths, in the same store (`explore.along`); pictures are those of the pages (`motion.strip`).
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from PIL import Image

from ..explore.along import evaluate_along
from ..explore.configurations import CONFIGURATIONS
from ..explore.points import Point, SceneFile, Target
from ..explore.store import Store
from ..front.paths import AHEAD_M, Asked
from ..front.view import View
from ..motion.strip import AMPLIFIED, CHANNELS, CLIP_FPS, DRAWINGS, LANES, SIDE, SPARSE, STRIP, clip, filmed, strip, write_clip
from ..output import write_atomically
from ..scene.temporal import JUMP
from .collect import list_kind
from .figures import STYLE, Figure, logarithmic_ticks, plt

GROUP = "stability in time"  # of configurations, where none are named
FRAMES, FPS = 3, 90.0  # of each motion
MEASURED, FILMED = 480, 320  # pixels of the longer side, of figures and of strip and clip; smaller pictures stay as they are
PAN = 0.25  # pixels a frame
MOTIONS = {"pan": (f"pan of {PAN:g} pixels a frame", Asked("pan", PAN, fps=FPS)), "shake": ("head shake", Asked("shake", fps=FPS)), "walk": ("walk", Asked("walk", fps=FPS))}
FILM = 12  # frames of the clip


@dataclass(frozen=True)
class Sample:
    """A configuration along a motion. cycles: of the rendering stage, the mean of the frames. dB: inf where nothing changes. jumps: share of the pixels."""

    cycles: float
    psnr_db: float
    temporal_psnr_db: float
    jumps: float

    @classmethod
    def of(cls, row: Mapping) -> Sample:
        """From a row of `evaluate_along`."""
        return cls(row["cycles"], row["psnr_db"], row["temporal_psnr_db"], row["jumps"])


@dataclass
class Moving:
    """A view and what moves from it. samples: by motion and configuration. strip: uint8 (H, W, 3). clip: uint8 (N, H, W, 3). size, filmed: of a frame in
    figures, and in strip and clip, (width, height)."""

    target: Target
    size: tuple[int, int]
    filmed: tuple[int, int]
    samples: dict[str, dict[str, Sample]] = field(default_factory=dict)
    strip: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3), np.uint8))
    clip: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 0, 3), np.uint8))


@dataclass
class Picture:
    """A picture of the page that has no numbers. suffix: `png`, or `webp` of one that moves. data: of the file, once it is written."""

    name: str
    title: str
    note: str
    suffix: str
    save: Callable[[Path], object]
    data: bytes = b""

    def write(self, folder: Path) -> None:
        """NAME.SUFFIX. Raises FlickerError."""
        path = folder / f"{self.name}.{self.suffix}"
        self.save(path)
        self.data = path.read_bytes()

    @property
    def image(self) -> str:
        """As a data URL."""
        return f"data:image/{self.suffix};base64,{base64.b64encode(self.data).decode()}"


def _within(size: tuple[int, int], longest: int) -> tuple[int, int]:
    scale = min(1.0, longest / max(size))
    width, height = (max(round(scale * side), 1) for side in size)
    return width, height


def _path(target: Target, asked: Asked, frames: int, longest: int) -> Target:
    """A motion from a view."""
    return target.scene.path_target(replace(asked, view=target.view, frames=frames), _within(target.size, longest))


def _views(path: Target) -> Iterator[View]:
    scene, cameras = path.cameras()
    for number, camera in enumerate(cameras):
        yield View(camera, scene, name=path.scene.name, number=number, background=path.scene.background, order=path.scene.order)


def _film(path: Target, store: Store) -> dict[str, np.ndarray]:
    key = path.key("film", repr([DRAWINGS[name] for name in (SPARSE, CHANNELS, LANES)]))
    stored = store.arrays(key)
    if stored is None or not {"strip", "clip"} <= stored.keys():
        film = filmed(_views(path), (SPARSE, CHANNELS, LANES))
        stored = {"strip": strip(film, (SPARSE, CHANNELS, LANES)), "clip": np.stack(clip(film, (SPARSE, LANES)))}
        store.put(key, {}, stored)
    return stored


def collect_moving(
    targets: Sequence[Target], names: Sequence[str], frames: int, store: Store, progress: Callable[[int, int, str], None] = lambda done, total, text: None,
) -> list[Moving]:
    """What moves from the first view of each scene, from the store or computed and kept there. frames: of each motion, two at least. progress: called with
    (done, in all, what is next)."""
    firsts: dict[SceneFile, Target] = {}
    for target in targets:
        firsts.setdefault(target.scene, target)
    order = sorted(names, key=lambda n: (list_kind(n), repr(CONFIGURATIONS[n].picture_key()), names.index(n)))  # those of one picture one after the other
    steps, done = len(firsts) * (len(MOTIONS) * len(names) + 1), 0
    found = []
    for target in firsts.values():
        moving = Moving(target, _within(target.size, MEASURED), _within(target.size, FILMED))
        for motion, (title, asked) in MOTIONS.items():
            path = _path(target, asked, frames, MEASURED)
            rows = {name: row for name in order if (row := store.load(Point(path, name).key)) is not None}
            done += len(rows)
            progress(done, steps, f"{target.title}: {title}")
            for name, row in evaluate_along(path, [name for name in order if name not in rows]):
                key = Point(path, name).key
                store.put(key, row)
                rows[name] = store.load(key) or row
                done += 1
                progress(done, steps, f"{target.title}: {title}, {name}")
            moving.samples[motion] = {name: Sample.of(rows[name]) for name in names}
        progress(done, steps, f"{target.title}: strip and clip")
        film = _film(_path(target, MOTIONS["pan"][1], FILM, FILMED), store)
        moving.strip, moving.clip = film["strip"], film["clip"]
        done += 1
        found.append(moving)
    progress(done, steps, "done")
    return found


def speed_stability(found: Mapping[str, Mapping[str, Mapping[str, Sample]]]) -> Figure:
    """Cycles against temporal PSNR, and against jumps, a column a motion of `MOTIONS`; a point a view. found: samples by motion, title of the view, and
    configuration."""
    names = list(next(iter(next(iter(found.values())).values())))
    canvas = plt.figure(figsize=(11, 7), layout="constrained")
    axes = canvas.subplots(2, len(found), sharex=True, sharey="row", squeeze=False)
    rows: list[list] = []
    for column, (motion, views) in enumerate(found.items()):
        for k, name in enumerate(names):
            points = [of[name] for of in views.values()]
            style = {"marker": "o^sDvP*Xd<>"[k % 11], "linestyle": "none", "label": name, "color": f"C{k % 10}", "markersize": 5, "clip_on": False}
            cycles = [p.cycles / 1e6 for p in points]
            axes[0, column].plot(cycles, [min(p.temporal_psnr_db, 120.0) for p in points], **style)
            axes[1, column].plot(cycles, [100 * p.jumps for p in points], **style)
            rows += [[motion, title, name, cycle, p.psnr_db, p.temporal_psnr_db, 100 * p.jumps] for title, cycle, p in zip(views, cycles, points)]
        axes[0, column].set_title(MOTIONS[motion][0], fontsize=10)
        axes[1, column].set_xlabel("million cycles a frame")
        axes[1, column].set_xscale("log")
        logarithmic_ticks(axes[1, column])
        axes[1, column].set_yscale("symlog", linthresh=1e-3)
        for line in range(2):
            axes[line, column].grid(alpha=0.3)
    axes[1, 0].set_ylim(0.0, max(30.0, *(1.5 * row[-1] for row in rows)))
    axes[0, 0].set_ylabel("temporal PSNR, dB")
    axes[1, 0].set_ylabel("jumps, % of the pixels a frame")
    canvas.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    return Figure(
        "speed_stability", "Speed against stability", "", "Cycles of the rendering stage against the change of its error from frame to frame.",
        ["motion", "view", "config", "million_cycles", "psnr_db", "temporal_psnr_db", "jumps_percent"], rows, canvas,
    )


def moving_figure(moving: Sequence[Moving]) -> Figure:
    """`speed_stability` of the report's scenes."""
    with plt.rc_context(STYLE):
        return speed_stability({motion: {m.target.title: m.samples[motion] for m in moving} for motion in MOTIONS})


def moving_pictures(moving: Moving) -> list[Picture]:
    """The strip and the clip."""
    of, width, height = f"{moving.target.scene.name}_{moving.target.view}", *moving.filmed
    pan = f"Pan of {PAN:g} pixels a frame at {width}x{height}"

    def save(path: Path) -> None:
        buffer = io.BytesIO()
        Image.fromarray(moving.strip).save(buffer, format="PNG", optimize=True)
        write_atomically(path, lambda place: place.write_bytes(buffer.getvalue()))

    side = min(SIDE, width, height)
    return [
        Picture(f"flicker_strip_{of}", f"Strip of {moving.target.title}", f"{pan}: {STRIP} frames that follow each other, the square of {side} pixels in which sparse "
                "sampling flickers most. Rows: the float64 reference; channels with sparse and with default sampling; lanes; the error of each.", "png", save),
        Picture(f"flicker_clip_{of}", f"Clip of {moving.target.title}", f"{pan}, shown at {CLIP_FPS:g} frames a second: channels with sparse sampling, lanes; to the right "
                f"the error times {AMPLIFIED}.", "webp", lambda path: write_clip(path, list(moving.clip))),
    ]


def assumptions(moving: Sequence[Moving], frames: int) -> str:
    """What is measured and what is assumed, in sentences."""
    sizes = ", ".join(dict.fromkeys("{}x{}".format(*m.size) for m in moving))
    return (
        f"From the first view of each scene, {frames} frames a motion at {FPS:g} Hz, {sizes}, against the float64 reference of the same frame. The error of a frame is its "
        "picture minus that reference, so that motion itself cancels. Temporal PSNR: of the change of the error from frame to frame; jumps: pixels in which it changes by "
        f"more than {JUMP * 255:g}/255. Cycles: of the rendering stage alone, the mean of the frames; pictures have float64 records, no bit-true front end and no frame "
        f"buffer of 8 bits. Scenes have no scale: what the camera looks at is taken to be {AHEAD_M:g} m away. Definitions: docs/reference/motion.md."
    )


def jumps_text(share: float) -> str:
    """A share of the pixels in per cent; one that would be rounded to none is told as such."""
    percent = 100 * share
    return "0" if share == 0 else "< 0.001" if percent < 0.001 else f"{percent:.3f}" if percent < 0.1 else f"{percent:.2f}"


def decibels_text(value: float | None) -> str:
    """A PSNR; `equal` of none and of inf."""
    return "equal" if value is None or math.isinf(value) else f"{value:.1f}"
