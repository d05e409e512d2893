"""`make docs PART=motion`: speed against stability. Cycles of rendering stages beside what their pictures do from frame to frame, in docs/results/motion.md.

The real views, three motions at 90 Hz, every picture against the float64 reference of the same frame. Results are kept in build/motion, so that Ctrl-C loses
a sequence at most. Pictures in the pages are of the demo scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace

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
from flicker.motion.strip import CHANNELS, LANES, SPARSE, STRIP, clip, filmed, strip, write_clip
from flicker.params import RECOMMENDED
from flicker.pipeline import Engine, FrontOptions
from flicker.report.figures import Figure
from flicker.report.moving import MOTIONS, Sample, decibels_text, jumps_text, speed_stability
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS, RealView
from flicker.scene.sources import Source, open_scene
from flicker.scene.temporal import Change, TemporalError, TemporalSummary, summarise
from flicker.toolchain import BUILD, ROOT

from .common import IMAGES, Say, folder_of_scenes, save_charts, significant

SIZE, FRAMES = (480, 270), 6
# Whole chips, beside the stages: the picture has the bit-true front end and frame buffer of 8 bits, too.
CHIPS = {
    "chip, `chunk`": Drawing(Engine.CHIP_GOLDEN, RECOMMENDED, options=FrontOptions(PackedFormat.CHUNK)),
    "chip, `fp16-local`": Drawing(Engine.CHIP_GOLDEN, RECOMMENDED, options=FrontOptions(PackedFormat.FP16_LOCAL)),
}
TIMED = "pan"
CLIP, CLIP_FRAMES = (320, 180), 24


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
    asked = replace(asked, view=view.number, size=SIZE, frames=FRAMES)
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


def figures(summary: TemporalSummary) -> str:
    """A cell: PSNR of the stills / temporal PSNR / jumps in per cent."""
    return _cell(asdict(summary))


def _cell(row: dict) -> str:
    return f"{decibels_text(row['psnr_db'])} / {decibels_text(row['temporal_psnr_db'])} / {jumps_text(row['jumps'])}"


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
    """The report's figure; cycles of every motion are those of the pan."""
    def sample(row: dict, name: str, title: str) -> Sample:
        return Sample(float(np.mean(everything[TIMED][title][name]["cycles"])), row["psnr_db"], row["temporal_psnr_db"], row["jumps"])

    return speed_stability({
        motion: {title: {name: sample(row, name, title) for name, row in rows.items() if name not in CHIPS} for title, rows in views.items()}
        for motion, views in everything.items()
    })


def _demo(frames: int, size: tuple[int, int], say: Say, what: str) -> Iterator[View]:
    """Views of a pan in the demo scene."""
    source = open_scene("demo")
    for n, camera in enumerate(path_of(source, replace(MOTIONS["pan"][1], size=size, frames=frames))[0]):
        say(f"{what}, frame {n + 1}")
        yield View(camera, source.scene)


def pictures(say: Say) -> str:
    """The strip and the clip, of the demo scene; the files that were written."""
    shown, files = (CHANNELS, LANES), (IMAGES / "flicker_strip.png", IMAGES / "flicker_clip.webp")
    Image.fromarray(strip(filmed(_demo(STRIP, SIZE, say, "strip"), shown), shown)).save(files[0], optimize=True)
    slow = (SPARSE, LANES)
    write_clip(files[1], clip(filmed(_demo(CLIP_FRAMES, CLIP, say, "clip"), slow), slow))
    return ", ".join(str(file.relative_to(ROOT)) for file in files)


def draw(say: Say) -> str:
    """The chart, the strip and the clip."""
    return f"{save_charts([_chart(results(say))])}, {pictures(say)}"


def tables(say: Say) -> dict[str, str]:
    everything = results(say)
    for views in everything.values():
        for rows in views.values():
            for row in rows.values():
                if row["frames"] != FRAMES:
                    raise FlickerError("motion: a stored sequence has another number of frames")
    return {"cycles": cycles(everything), **{motion: stability(found) for motion, found in everything.items()}}
