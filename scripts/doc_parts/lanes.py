"""`make docs PART=lanes`: lanes in the log domain, in docs/results/lanes.md: where the dB go, number formats and what a lane of them costs, masks, counts,
hard inputs."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from zlib import crc32

import lane_picture
import matplotlib.pyplot as plt
import numpy as np
from gen_params import lane_package

from flicker.cost.synth.gates import DEFAULT_LIBERTY
from flicker.errors import FlickerError
from flicker.explore.stability import FAMILIES
from flicker.front.projection import Projected
from flicker.front.records import LOG2E, SubtileLists
from flicker.front.reference import render_reference
from flicker.front.view import View
from flicker.golden.front.blend import blend_records
from flicker.golden.front.frame import run_front
from flicker.golden.front.record import Splats
from flicker.golden.front.setup import MEAN_FRACTION
from flicker.golden.lanes.formats import FORMATS, LaneFormats, h_lines
from flicker.golden.lanes.formats import tables as lane_tables
from flicker.golden.lanes.lists import RecordLists, float_lists, front_lists
from flicker.golden.lanes.render import LaneFrame, render_lanes
from flicker.markdown import table
from flicker.params import LANE_COUNTS, Form
from flicker.pipeline import packed_scene
from flicker.report.figures import COLOURS, STYLE
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat
from flicker.scene.real import REAL_VIEWS
from flicker.toolchain import ROOT, filelist

from .common import Say, load

SEED = 1
LISTS = {"subtile": "3-sigma boxes on 8x8", "ellipse": "ellipse alpha = 1/255 in these boxes", "tile": "INRIA's squares on 16x16"}
COLOUR_BITS = 10
CHART = ROOT / "docs" / "images" / "lane_formats.png"
EQUAL = 200.0  # dB: what is left is the rounding of float64
D = FORMATS
# The default; what the design began with; one number changed at a time.
TRIED = tuple(dict.fromkeys((
    D, LaneFormats(uv=12, log=14, sum=16, mantissa=12, accumulator=20, pieces=0), LaneFormats(uv=9, log=9, sum=12, pieces=0),
    LaneFormats(uv=8, log=8, sum=16, mantissa=9), LaneFormats(uv=8, log=8, sum=10, mantissa=9, pieces=0),
    LaneFormats(uv=8, log=8, sum=10, mantissa=7, pieces=0),
    *(replace(D, uv=b) for b in (7, 8, 10)), *(replace(D, log=b) for b in (7, 8, 10)), *(replace(D, sum=b) for b in (11, 12, 13, 14, 20)),
    *(replace(D, pieces=b) for b in (0, 2, 3, 5)), *(replace(D, mantissa=b) for b in (7, 8, 9, 11)), *(replace(D, accumulator=b) for b in (11, 12, 13, 16)),
    replace(D, guard=6), LaneFormats(uv=8, log=8, sum=13, mantissa=9), LaneFormats(uv=8, log=8, sum=16, mantissa=10),
    LaneFormats(uv=8, log=8, sum=13, mantissa=8, accumulator=13),
)))
NAMED = ("layers", "faint", "opaque")
NARROWER = (D, replace(D, mantissa=9), replace(D, uv=8), replace(D, log=8), replace(D, uv=8, log=8), replace(D, uv=8, log=8, mantissa=9),
            replace(D, accumulator=13), replace(D, pieces=3), replace(D, pieces=0), replace(D, sum=14), replace(D, sum=13))
MASKS = tuple((mask, root) for mask in (4, 5, 6, 7, 8) for root in (4, 6, 8))


@dataclass
class Seen:
    """A real view with its default records: in float64, and the reference."""

    title: str
    view: View
    lists: RecordLists
    truth: np.ndarray
    records: np.ndarray

    def decibel(self, frame: LaneFrame) -> str:
        """Against the reference, and against the records in float64."""
        image = frame.image()
        return f"{psnr(image, self.truth):.1f} / {psnr(image, self.records):.1f}"


def _blended(lists: RecordLists) -> np.ndarray:
    return blend_records(lists.splats(), Form.FACTORED, lists.start, lists.entry, lists.width, lists.height)


def unrounded(p: Projected) -> Splats:
    """The projection as splats, every number in float64."""
    half = 0.5 * LOG2E
    l0 = np.sqrt(p.conic[:, 0] * half)
    shape = np.stack([l0, p.conic[:, 1] * half / l0, np.sqrt(half / p.cov2d[:, 2])], 1)
    return Splats(p.mean * (1 << MEAN_FRACTION), shape, p.opacity, p.rgb, np.asarray(p.spiky, bool))


def bits(formats: LaneFormats) -> tuple[int, int, int]:
    """Sizes of one lane's datapath: products of the multipliers' operand widths, summed (a squarer counts half); bits of tables; bits of state of a pixel."""
    f, t = formats, lane_tables(formats)
    products = (f.uv + 2) ** 2 + 3 * f.mantissa * COLOUR_BITS
    entries = (f.mantissa - 1) << f.mantissa
    if f.pieces:
        value, fall = h_lines(f, t.clamp + 1, t.limit)
        width = [int(a.max()).bit_length() for a in (value, fall)]
        entries += sum(width) * int((value > 0).sum())
        products += width[1] * (f.log + 2 - f.pieces)
    else:
        entries += (f.sum + 3) * (t.limit - t.clamp)
    return products, entries, 4 + f.sum + 3 * (2 + f.accumulator)


# Synthesis with another file list, in a process of its own: the flow runs Yosys, whose state is global.
_SYNTHESISE = "import sys; from pathlib import Path; from flicker.cost.synth import flow; flow.FILELIST = Path(sys.argv.pop()); sys.exit(flow.main())"


def lane_area(formats: LaneFormats, lanes: int = 8) -> tuple[float, float] | None:
    """GE and longest path in FO4 of one of so many lanes of a core, synthesised in these formats; None for formats that the RTL does not have."""
    try:
        package = lane_package(formats)
    except FlickerError:
        return None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "flk_lane_pkg.sv").write_text(package)
        files = [folder / path.name if path.name == "flk_lane_pkg.sv" else path for path in filelist()]
        (folder / "flk.f").write_text("".join(f"{path}\n" for path in files))
        job = {"action": "synthesise", "top": "flk_lane", "parameters": {"Lanes": lanes}, "extra": [], "boxes": [], "children": {}, "child_parameters": {},
               "liberty": str(DEFAULT_LIBERTY.resolve()), "results": name, "open": []}
        (folder / "job.json").write_text(json.dumps(job))
        done = subprocess.run([sys.executable, "-c", _SYNTHESISE, str(folder / "job.json"), str(folder / "flk.f")], capture_output=True, text=True)
        error = folder / "error"
        if done.returncode or error.exists():
            raise FlickerError(f"lanes, {formats.name}: {error.read_text() if error.exists() else done.stderr}")
        result = json.loads((folder / "result.json").read_text())
    return result["ge_comb"] + result["ge_seq"], result["paths"][0]["fo4"]


def format_rows(seen: list[Seen], say: Say) -> list[tuple[str, ...]]:
    """PSNR and size of all formats that were tried; draws `CHART` of those that the RTL has."""
    rows, built = [], []
    for formats in TRIED:
        say(formats.name)
        name = formats.name + (f", guard {formats.guard}" if formats.guard != D.guard else "")
        frames = [render_lanes(one.lists, formats) for one in seen]
        area, small = lane_area(formats), lane_area(formats, 32)
        if area is None or small is None:
            size = ["", "", ""]
        else:
            size = [f"{area[0]:,.0f}", f"{small[0]:,.0f}", f"{max(area[1], small[1]):.0f}"]
            built.append((area[0], min(psnr(frame.image(), one.records) for frame, one in zip(frames, seen)), name))
        cells = [one.decibel(frame) for frame, one in zip(frames, seen)]
        rows.append((f"**{name}**" if formats is D else name, *cells, *size, *(f"{n:,}" for n in bits(formats))))
    _draw(built)
    return rows


def _draw(built: list[tuple[float, float, str]]) -> None:
    """Area of a lane against the least PSNR of its arithmetic, the default first, with the formats that no other beats in both."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
        front = sorted(i for i, (area, db, _) in enumerate(built) if not any(a <= area and b >= db and (a, b) != (area, db) for a, b, _ in built))
        front.sort(key=lambda i: built[i][0])
        axes.plot([area / 1000 for area, _, _ in built], [db for _, db, _ in built], ".", color=COLOURS[7])
        axes.plot([built[i][0] / 1000 for i in front], [built[i][1] for i in front], ".-", color=COLOURS[0], linewidth=0.8)
        axes.plot(built[0][0] / 1000, built[0][1], "o", color=COLOURS[1])
        for number, i in enumerate(front, 1):
            axes.annotate(str(number), (built[i][0] / 1000, built[i][1]), fontsize=7, xytext=(0, 5), textcoords="offset points", ha="center")
        names = [f"{number}: {built[i][2]}{'' if i else ' (default)'}" for number, i in enumerate(front, 1)]
        axes.text(0.98, 0.03, "\n".join(names), fontsize=6.5, transform=axes.transAxes, ha="right", va="bottom")
        axes.set(xlabel="one lane of eight pixels, thousand GE", ylabel="least PSNR of four views against the same records in float64, dB")
        figure.savefig(CHART, dpi=130, metadata={"Software": None})
        plt.close(figure)


def mask_rows(seen: list[Seen], say: Say) -> list[tuple[str, ...]]:
    """Share of the visits that the lane's own test ends."""
    rows = []
    for mask, root in MASKS:
        say(f"masks of {mask} bits, roots of {root}")
        frames = [render_lanes(one.lists, replace(D, mask=mask, root=root)) for one in seen]
        strong = "**" if (mask, root) == (D.mask, D.root) else ""
        rows.append((f"{strong}{mask}{strong}", f"{strong}{root}{strong}", *(f"{f.total('skipped') / f.total('visited'):.1%}" for f in frames)))
    return rows


def breakdown(seen: Seen, say: Say) -> list[tuple[str, ...]]:
    """Lists, records, front end and lanes, one after the other."""
    rows = []

    def add(source: str, exact: str, lists: RecordLists) -> None:
        render_lanes(lists)
        began = time.monotonic()
        image = render_lanes(lists).image()
        seconds = time.monotonic() - began
        rows.append((seen.title, source, exact, f"{psnr(_blended(lists), seen.truth):.1f}", f"{psnr(image, seen.truth):.1f}", f"{seconds:.1f}"))

    for kind, what in LISTS.items():
        say(f"{seen.title}: {kind}")
        lists: SubtileLists = seen.view.lists(Form.FACTORED, kind)
        exact = blend_records(unrounded(seen.view.projected), Form.FACTORED, lists.start, lists.entry, lists.width, lists.height)
        decibel = psnr(exact, seen.truth)
        add(f"float64; lists by {what}", f"{decibel:.1f}" if decibel < EQUAL else "equal", float_lists(seen.view.projected, lists))
    seen.view.drop()
    for form in (PackedFormat.CHUNK, PackedFormat.FP16_LOCAL):
        say(f"{seen.title}: {form.value}")
        add(f"bit-true front end, `{form.value}`", "", front_lists(run_front(packed_scene(seen.view, form), seen.view.camera)))
    return rows


def count_row(seen: Seen) -> tuple[str, ...]:
    frame = render_lanes(seen.lists)
    visited = frame.total("visited")
    return (
        seen.title, *(f"{frame.total(name):,}" for name in ("splats", "empty", "visited", "skipped", "blended", "clamped", "pixels_finished")),
        *(f"{-(-visited // lanes):,}" for lanes in LANE_COUNTS),
    )


def cases(name: str) -> Iterator[tuple[np.ndarray, RecordLists, np.ndarray]]:
    """Of every step of a family: reference, records and lists, records in float64."""
    family = FAMILIES[name]
    for value in family.values:
        case = family.make(value, np.random.default_rng([SEED, crc32(family.name.encode())]))
        truth = render_reference(case.truth or case.projected, case.camera)
        lists = float_lists(case.projected, View(case.camera, projected=case.projected).lists(Form.FACTORED))
        with np.errstate(all="ignore"):
            yield truth, lists, _blended(lists)


def stability_rows(say: Say) -> list[tuple[str, ...]]:
    """Lowest PSNR of each sweep: records in float64 to the reference, lanes to the records in float64, lanes to the reference."""
    rows = []
    for name in FAMILIES:
        say(name)
        found = []
        for truth, lists, records in cases(name):
            image = render_lanes(lists).image()
            found.append((psnr(records, truth), psnr(image, records), psnr(image, truth)))
        rows.append((f"`{name}`", *(f"{db:.0f}" for db in np.min(found, axis=0))))
    return rows


def faint_layers(formats: LaneFormats) -> float:
    """Light that 1,000 layers of alpha 1/255 leave, relative to what they should."""
    tables_ = lane_tables(formats)
    return 2.0 ** (-1000 * int(tables_.h[tables_.limit]) / 2**formats.sum) / (254 / 255) ** 1000 - 1


def family_rows(say: Say) -> list[tuple[str, ...]]:
    """Lowest PSNR of sweeps by formats, lanes to the records in float64; what is wrong behind 1,000 faint layers."""
    made = {name: list(cases(name)) for name in NAMED}
    rows = []
    for formats in NARROWER:
        say(formats.name)
        lowest = [min(psnr(render_lanes(lists, formats).image(), records) for _, lists, records in made[name]) for name in NAMED]
        strong = "**" if formats is D else ""
        rows.append((f"{strong}{formats.name}{strong}", *(f"{db:.1f}" for db in lowest), f"{faint_layers(formats):+.1%}"))
    return rows


def draw(say: Say) -> str:
    """The picture that explains the arithmetic."""
    say("picture")
    return lane_picture.draw()


def tables(say: Say) -> dict[str, str]:
    seen, parts = [], []
    for real in REAL_VIEWS:
        say(real.title)
        view = load(real)
        lists = float_lists(view.projected, view.lists(Form.FACTORED))
        seen.append(Seen(real.title, view, lists, view.reference, _blended(lists)))
        parts += breakdown(seen[-1], say)
    titles = [one.title for one in seen]
    return {
        "breakdown": table(["view", "records from", "exact, float64", "records, float64", "lanes", "lanes, s"], parts),
        "formats": table(
            ["u, v / La / S, h; weight; colour", *titles, "lane of 8 pixels, GE", "of 2", "FO4", "multipliers", "tables", "state"], format_rows(seen, say),
        ),
        "families": table(["u, v / La / S, h; weight; colour", *(f"`{name}`" for name in NAMED), "light behind 1,000 layers of 1/255"], family_rows(say)),
        "masks": table(["fraction bits", "bits of the root's address", *titles], mask_rows(seen, say)),
        "counts": table(
            ["view", "splats", "empty masks", "visits", "skipped", "blended", "clamped", "pixels finished", *(f"{n} lanes, at least" for n in LANE_COUNTS)],
            [count_row(one) for one in seen],
        ),
        "stability": table(["family", "records, float64, to the reference", "lanes to the records", "lanes to the reference"], stability_rows(say)),
    }
