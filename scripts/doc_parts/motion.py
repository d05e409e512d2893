"""`make docs PART=motion`: speed against stability. Cycles of rendering stages beside what their pictures do from frame to frame, in docs/results/motion.md.

The real views, three motions at 90 Hz, every picture against the float64 reference of the same frame. Results are kept in build/motion, so that Ctrl-C loses
a sequence at most. Pictures in the pages are of the demo scene.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from PIL import Image

from flicker import markdown
from flicker.chip.compare import frame_cost
from flicker.chip.drawing import Drawing
from flicker.errors import FlickerError
from flicker.explore.configurations import get_configuration, group, run
from flicker.explore.digest import code_digest, file_digest, key
from flicker.explore.store import Store
from flicker.front.paths import Asked, path_of
from flicker.front.view import View
from flicker.motion.record import composed, eight_bits
from flicker.motion.video import write_video
from flicker.params import RECOMMENDED, RenderConfig
from flicker.pipeline import Engine, FrontOptions
from flicker.report.figures import Figure
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS, RealView
from flicker.scene.sources import Source, open_scene
from flicker.scene.temporal import Change, TemporalError, TemporalSummary, summarise
from flicker.toolchain import BUILD

from .common import IMAGES, Say, folder_of_scenes, save_charts, significant

SIZE, FRAMES, FPS = (480, 270), 6, 90.0
MOTIONS = {
    "pan": ("pan of 0.25 pixels a frame", Asked("pan", 0.25, size=SIZE, frames=FRAMES, fps=FPS)),
    "shake": ("head shake", Asked("shake", size=SIZE, frames=FRAMES, fps=FPS)),
    "walk": ("walk", Asked("walk", size=SIZE, frames=FRAMES, fps=FPS)),
}
# Whole chips, beside the stages: the picture has the bit-true front end and frame buffer of 8 bits, too.
CHIPS = {
    "chip, `chunk`": Drawing(Engine.CHIP_GOLDEN, RECOMMENDED, options=FrontOptions(PackedFormat.CHUNK)),
    "chip, `fp16-local`": Drawing(Engine.CHIP_GOLDEN, RECOMMENDED, options=FrontOptions(PackedFormat.FP16_LOCAL)),
}
TIMED = "pan"
STRIP, CROP, ENLARGED = 6, 40, 3  # frames of the strip, pixels of a side, times
CLIP = (320, 180)


def _plain(summary: TemporalSummary, cycles: Sequence[int]) -> dict:
    return asdict(summary) | {"cycles": [int(c) for c in cycles]}


def _sequence(source: Source, asked: Asked, names: Sequence[str], say: Say, title: str) -> dict[str, dict]:
    """Figures of configurations and chips along a path, by name; cycles of the stage, of a chip from frame to frame, of the first
    and the last frame of the motion `TIMED`; they hardly depend on the motion."""
    cameras, _ = path_of(source, asked)
    errors = {name: TemporalError() for name in (*names, *CHIPS)}
    changes: dict[str, list[Change]] = {name: [] for name in errors}
    cycles: dict[str, list[int]] = {name: [] for name in errors}
    counted = (0, len(cameras) - 1) if asked.kind == TIMED else ()
    for n, camera in enumerate(cameras):
        say(f"{title}: frame {n + 1} of {len(cameras)}")
        view = View(camera, source.scene)
        kept: dict[tuple, object] = {}
        for name in sorted(names, key=lambda name: (get_configuration(name).lists, get_configuration(name).form, repr(get_configuration(name).picture_key()))):
            configuration = get_configuration(name)
            if (picture := configuration.picture_key()) not in kept:
                kept = {picture: run(configuration, view)}
            result = kept[picture]
            changes[name].append(errors[name].add(result.image, view.reference))
            if n in counted:
                cycles[name].append(configuration.simulate(result.work)[0])
        view.drop()
        for name, drawing in CHIPS.items():
            changes[name].append(errors[name].add(drawing.render(view).image, view.reference))
            if n in counted:
                cycles[name].append(frame_cost(view, drawing)["cycles"])
    return {name: _plain(summarise(changes[name], asked.fps), cycles[name]) for name in errors}


def measured(view: RealView, motion: str, say: Say) -> dict[str, dict]:
    """`_sequence` of a real view, out of the store where it is there."""
    names, (title, asked) = group("stability in time"), MOTIONS[motion]
    asked = replace(asked, view=view.number)
    file = view.path(folder_of_scenes())
    store = Store(BUILD / "motion")
    of = key("motion", code_digest(), file_digest(file), asked, *names, *CHIPS)
    found = store.load(of)
    if found is None:
        store.put(of, _sequence(open_scene(file), asked, names, say, f"{view.title}, {title}"))
        found = store.load(of)
        assert found is not None
    return found


Results = dict[str, dict[str, dict[str, dict]]]  # by motion, title of the view, name


def results(say: Say) -> Results:
    return {motion: {view.title: measured(view, motion, say) for view in REAL_VIEWS} for motion in MOTIONS}


def _decibels(value: float | None) -> str:
    return "equal" if value is None or math.isinf(value) else f"{value:.1f}"


def _jumps(share: float) -> str:
    """Per cent of the pixels; a share that would be rounded to none is told as such."""
    percent = 100 * share
    return "0" if share == 0 else "< 0.001" if percent < 0.001 else f"{percent:.3f}" if percent < 0.1 else f"{percent:.2f}"


def figures(summary: TemporalSummary) -> str:
    """A cell: PSNR of the stills / temporal PSNR / jumps in per cent."""
    return _cell(asdict(summary))


def _cell(row: dict) -> str:
    return f"{_decibels(row['psnr_db'])} / {_decibels(row['temporal_psnr_db'])} / {_jumps(row['jumps'])}"


def stability(found: dict[str, dict[str, dict]]) -> str:
    """A row a configuration: PSNR of the stills / temporal PSNR / jumps in per cent, by view."""
    names = list(next(iter(found.values())))
    rows = [
        [f"`{name}`" if name not in CHIPS else name, *(_cell(rows[name]) for rows in found.values())] for name in names
    ]
    return markdown.table(["configuration", *found], rows)


def cycles(everything: Results) -> str:
    """Million cycles a frame, the mean over the first and the last frame of the pan, by view."""
    first = everything[TIMED]
    rows = []
    for name in next(iter(first.values())):
        cells = [significant(float(np.mean(found[name]["cycles"])) / 1e6, 3) for found in first.values()]
        rows.append([f"`{name}`" if name not in CHIPS else name, *cells])
    return markdown.table(["configuration", *first], rows)


def _chart(everything: Results) -> Figure:
    """Cycles against temporal PSNR, and against jumps, a column a motion; a point a view."""
    from matplotlib.figure import Figure as Plot

    names = [name for name in next(iter(next(iter(everything.values())).values())) if name not in CHIPS]
    plot = Plot(figsize=(11, 7), layout="constrained")
    axes = plot.subplots(2, len(everything), sharex=True, sharey="row")
    rows = []
    for column, (motion, views) in enumerate(everything.items()):
        for k, name in enumerate(names):
            counts = [float(np.mean(found[name]["cycles"])) / 1e6 for found in everything[TIMED].values()]
            points = [(count, row[name]["temporal_psnr_db"], 100 * row[name]["jumps"]) for count, row in zip(counts, views.values())]
            style = {"marker": "o^sDvP*Xd<>"[k % 11], "linestyle": "none", "label": name, "color": f"C{k % 10}", "markersize": 5}
            axes[0, column].plot([p[0] for p in points], [p[1] for p in points], **style)
            axes[1, column].plot([p[0] for p in points], [p[2] for p in points], **style)
            rows += [[motion, title, name, *point] for title, point in zip(views, points)]
        axes[0, column].set_title(MOTIONS[motion][0], fontsize=10)
        axes[1, column].set_xlabel("million cycles a frame")
        axes[1, column].set_xscale("log")
        axes[1, column].set_yscale("symlog", linthresh=1e-3)
        for row in range(2):
            axes[row, column].grid(alpha=0.3)
    axes[1, 0].set_ylim(0.0, 30.0)
    axes[0, 0].set_ylabel("temporal PSNR, dB")
    axes[1, 0].set_ylabel("jumps, % of the pixels a frame")
    plot.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    return Figure(
        "speed_stability", "Speed against stability", "", "Cycles of the rendering stage against the change of its error from frame to frame.",
        ["motion", "view", "configuration", "million_cycles", "temporal_psnr_db", "jumps_percent"], rows, plot,
    )


def _flickering(pictures: Sequence[np.ndarray], references: Sequence[np.ndarray]) -> tuple[int, int]:
    """Left and upper edge of the square of `CROP` pixels in which errors change most."""
    errors = [p - r for p, r in zip(pictures, references)]
    change = np.mean([np.abs(b - a).max(axis=2) for a, b in zip(errors, errors[1:])], axis=0)
    sums = np.pad(change, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    inside = sums[CROP:, CROP:] - sums[:-CROP, CROP:] - sums[CROP:, :-CROP] + sums[:-CROP, :-CROP]
    y, x = np.unravel_index(int(inside.argmax()), inside.shape)
    return int(x), int(y)


def _strip(source: Source, say: Say) -> None:
    """Consecutive frames of a pan, enlarged where the default channels flicker most: reference, channels, lanes, and the errors of both."""
    cameras, _ = path_of(source, Asked("pan", 0.25, size=SIZE, frames=STRIP))
    drawings = {"channels": Drawing(config=RenderConfig()), "lanes": Drawing(config=RECOMMENDED)}
    frames: dict[str, list[np.ndarray]] = {name: [] for name in ("reference", *drawings)}
    for n, camera in enumerate(cameras):
        say(f"strip, frame {n + 1}")
        view = View(camera, source.scene)
        frames["reference"].append(view.reference)
        for name, drawing in drawings.items():
            frames[name].append(drawing.render(view).image.astype(np.float64))
    x, y = _flickering(frames["channels"], frames["reference"])
    lines = [[each[y : y + CROP, x : x + CROP] for each in frames[name]] for name in frames]
    lines += [[8 * np.abs(a - b) for a, b in zip(lines[k], lines[0])] for k in (1, 2)]
    gap = 2
    out = Image.new("RGB", (STRIP * (CROP * ENLARGED + gap) - gap, len(lines) * (CROP * ENLARGED + gap) - gap), "white")
    for row, line in enumerate(lines):
        for column, picture in enumerate(line):
            tile = Image.fromarray(eight_bits(picture)).resize((CROP * ENLARGED, CROP * ENLARGED), Image.Resampling.NEAREST)
            out.paste(tile, (column * (CROP * ENLARGED + gap), row * (CROP * ENLARGED + gap)))
    out.save(IMAGES / "flicker_strip.png", optimize=True)


def _clip(source: Source, say: Say) -> None:
    """A short clip of the demo scene: sparse channels, lanes, and the error of each, a pan of 0.25 pixels a frame, slowly."""
    cameras, _ = path_of(source, Asked("pan", 0.25, size=CLIP, frames=24))
    drawings = {"channels, sparse": Drawing(config=RenderConfig(cat=RenderConfig().cat.SPARSE)), "lanes": Drawing(config=RECOMMENDED)}
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for n, camera in enumerate(cameras):
            say(f"clip, frame {n + 1}")
            view = View(camera, source.scene)
            panels = []
            for name, drawing in drawings.items():
                image = np.clip(drawing.render(view).image, 0.0, 1.0)
                panels += [(name, image), ("error x 8", 8 * np.abs(image - np.clip(view.reference, 0.0, 1.0)))]
            picture = np.concatenate([composed(panels[:2]), composed(panels[2:])], axis=0)
            files.append(Path(folder) / f"{n:03d}.png")
            Image.fromarray(picture).save(files[-1])
        write_video(IMAGES / "flicker_clip.webp", files, 12.0)


def draw(say: Say) -> str:
    """The chart, the strip and the clip."""
    charts = save_charts([_chart(results(say))])
    source = open_scene("demo")
    _strip(source, say)
    _clip(source, say)
    return f"{charts}, docs/images/flicker_strip.png, docs/images/flicker_clip.webp"


def tables(say: Say) -> dict[str, str]:
    everything = results(say)
    for views in everything.values():
        for rows in views.values():
            for row in rows.values():
                if row["frames"] != FRAMES:
                    raise FlickerError("motion: a stored sequence has another number of frames")
    return {"cycles": cycles(everything), **{motion: stability(found) for motion, found in everything.items()}}
