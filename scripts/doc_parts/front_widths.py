"""Of `make docs PART=front`: fixed-point widths and record fields of the front end, one changed at a time, and what 8 bits of opacity cost."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from zlib import crc32

import numpy as np

from flicker.cost.stamp import LIBERTY
from flicker.cost.synth.run import Runner
from flicker.cost.synth.units import Unit, unit
from flicker.datapath.emit import module
from flicker.datapath.units import PIPELINES
from flicker.explore.stability.families import FAMILIES
from flicker.explore.stability.front_ends import truth
from flicker.front.view import DEMO, View, load_view
from flicker.golden.front.blend import blend_records
from flicker.golden.front.fields import FIELDS, Fields, splats_of
from flicker.golden.front.frame import FrontFrame, ListKind, run_front
from flicker.golden.front.record import RecordKind, Splats
from flicker.golden.front.setup import FORMATS, FrontFormats
from flicker.markdown import table
from flicker.scene import Scene
from flicker.scene.camera import Camera
from flicker.scene.metrics import psnr
from flicker.scene.packed import PackedFormat, PackedScene
from flicker.scene.packing import Packing, pack

from .common import SIZE, Say, folder_of_scenes
from .stability import SEED

RECORD_BITS = 8 * RecordKind.FACTORED16.bytes
STEPS = (-2, -1, 1)  # bits more than the default


@dataclass(frozen=True)
class Width:
    """A width: of `FrontFormats` or, where `field` is set, of `Fields`. record: bits of a record for each bit of it. logic: operators of a lane depend on
    it."""

    name: str
    what: str
    field: bool = False
    record: int = 0
    logic: bool = False
    steps: tuple[int, ...] = STEPS

    @property
    def default(self) -> int:
        return getattr(FIELDS if self.field else FORMATS, self.name)


WIDTHS = (
    Width("mean", "mean and radii: fraction of a pixel", record=2, logic=True),
    Width("direction", "direction: fraction", logic=True),
    Width("harmonics", "spherical harmonics: fraction", logic=True),
    Width("coefficient", "coefficient from FP16: fraction", logic=True),
    Width("sums", "sum of a degree's products: fraction", logic=True),
    Width("term", "what is added to a colour: fraction", logic=True),
    Width("key", "depth key", logic=True, steps=(-8, -4, -2, 2)),
    Width("shape", "record: mantissa of l0, l1, l2", field=True, record=3),
    Width("colour", "record: fraction of a colour", field=True, record=3),
    Width("opacity", "record: opacity", field=True, record=1),
)


@dataclass(frozen=True)
class Row:
    """The default, or one width changed."""

    width: Width | None = None
    bits: int = 0

    @property
    def formats(self) -> FrontFormats:
        return FORMATS if self.width is None or self.width.field else replace(FORMATS, **{self.width.name: self.bits})

    @property
    def fields(self) -> Fields:
        return replace(FIELDS, **{self.width.name: self.bits}) if self.width is not None and self.width.field else FIELDS

    @property
    def lists(self) -> ListKind:
        """Those of ellipses are of opacities of 8 bits."""
        return ListKind.BOX if self.fields.opacity != FIELDS.opacity else ListKind.ELLIPSE

    @property
    def record(self) -> int:
        return RECORD_BITS + (self.width.record * (self.bits - self.width.default) if self.width is not None else 0)


ROWS = [Row(), *(Row(width, width.default + step) for width in WIDTHS for step in width.steps)]


def decibel(value: float) -> str:
    return "equal" if math.isinf(value) else f"{value:.1f}"


def _signed(change: float) -> str:
    return f"{change:+.1f}" if abs(change) >= 0.05 else "0.0"


def blended(frame: FrontFrame, splats: Splats) -> np.ndarray:
    """Records of a frame in float64."""
    start, entry = frame.sorted_subtiles()
    return blend_records(splats, frame.kind.form, start, entry, frame.camera.width, frame.camera.height)


class Widths:
    """The table of widths, filled view by view."""

    def __init__(self) -> None:
        self.titles: list[str] = []
        self.found: dict[PackedFormat, list[list[float]]] = {form: [] for form in (PackedFormat.FP16_LOCAL, PackedFormat.CHUNK)}  # by view and row

    def add(self, title: str, view: View, packed: PackedScene, say: Say) -> None:
        if packed.format not in self.found:
            return
        if title not in self.titles:
            self.titles.append(title)
        frames: dict[tuple[FrontFormats, ListKind], FrontFrame] = {}
        values = []
        for row in ROWS:
            key = row.formats, row.lists
            if key not in frames:
                say(f"{title}: {packed.format.value}: {row.width.what if row.width else 'widths'} {row.bits}")
                if row.formats != FORMATS:
                    frames = {kept: frame for kept, frame in frames.items() if kept[0] == FORMATS}
                frames[key] = run_front(packed, view.camera, row.lists, formats=row.formats)
            values.append(psnr(blended(frames[key], splats_of(frames[key], row.fields)), view.reference))
        self.found[packed.format].append(values)

    def table(self, say: Say) -> str:
        """fp16-local in columns; of chunks the largest change."""
        local, chunk = (np.array(self.found[form]).T for form in (PackedFormat.FP16_LOCAL, PackedFormat.CHUNK))  # by row and view
        say("operators of the widths")
        gates = operators([row.formats for row in ROWS if row.width is None or row.width.logic])
        rows = []
        for number, row in enumerate(ROWS):
            change = chunk[number] - chunk[0]
            rows.append((
                row.width.what if row.width else "**default**", f"{row.bits} ({row.width.default})" if row.width else "", *map(decibel, local[number]),
                "-" if row.width is None else _signed(change[np.abs(change).argmax()]), str(row.record),
                f"{gates[row.formats]:,.0f}" if row.formats in gates and row.fields == FIELDS else "-",
            ))
        return table(["width", "bits", *self.titles, "chunk, largest change", "record, bits", "GE"], rows)


# ---- what widths cost ---------------------------------------------------------------------------

# Operators that take or give fixed point, in a lane; the channels of a colour have a term each.
FIXED = ("flk_fixed_mul", "flk_ff_to_fixed", "flk_ff_from_fixed")
LANE = {p.module: 3 if p.module == "flk_colour_term" else 1 for p in PIPELINES
        if p.module not in ("flk_cluster_test", "flk_cluster_header", "flk_projection_conic")}
_INSTANCE = re.compile(r"^\s*(" + "|".join(FIXED) + r") #\((.*?)\) i_", re.M)
_PARAMETER = re.compile(r"\.(\w+)\((\d+)\)")


def operators(tried: list[FrontFormats]) -> dict[FrontFormats, float]:
    """GE of a lane's fixed-point operators by formats: of the pipelines as they would be generated, each operator synthesised (build/synth keeps it)."""
    counts = {formats: _instances(formats) for formats in tried}
    runner = Runner(LIBERTY)
    results = runner.run(sorted({one for count in counts.values() for one in count}, key=str))
    return {formats: sum(results[one]["ge"] * n for one, n in count.items()) for formats, count in counts.items()}


def _instances(formats: FrontFormats) -> Counter[Unit]:
    count: Counter[Unit] = Counter()
    for p in PIPELINES:
        if p.module in LANE:
            text, _ = module(p.module, p.head, partial(p.build, formats), p.intervals[:1])
            for name, parameters in _INSTANCE.findall(text):
                count[unit(name, **{key: int(value) for key, value in _PARAMETER.findall(parameters)})] += LANE[p.module]
    return count


# ---- opacity ------------------------------------------------------------------------------------

OPACITIES = (8, 10, 12)
# Scenes whose opacities are no multiples of 1/255, beside our own: fits, at the size of their photographs.
FITTED = ("lego", "kunkun")
FAINT = {"faint": (4, 1.5, 1.1), "layers": (100, 1000, 10000)}


def _cases() -> Iterator[tuple[str, Scene, Packing, Camera, np.ndarray]]:
    """Title, scene, the same packed, camera, float64 picture."""
    for title, view in (
        (f"{DEMO} 0", load_view(DEMO, 0, SIZE)), *((f"{name} 0", load_view(folder_of_scenes() / name / "scene.ply", 0)) for name in FITTED),
    ):
        yield title, view.scene, pack(view.scene, PackedFormat.FP16_LOCAL), view.camera, view.reference
    for family in FAMILIES.values():
        for value in FAINT.get(family.name, ()):
            case = family.make(value, np.random.default_rng([SEED, crc32(family.name.encode())]))
            packing = pack(case.scene, PackedFormat.FP16_LOCAL)
            yield f"{family.name}, {family.parameter} {value:g}", case.scene, packing, case.screen, truth(case, packing)


def opacity_table(say: Say) -> str:
    """Records with opacities of 8 bits, more, and those of the scene."""
    rows = []
    for title, scene, packing, camera, reference in _cases():
        say(f"{title}: opacity")
        frame = run_front(packing.packed, camera, ListKind.BOX)
        exact = blended(frame, replace(splats_of(frame), opacity=scene.opacities[packing.order][frame.gaussian].astype(np.float64)))
        pictures = [blended(frame, splats_of(frame, replace(FIELDS, opacity=bits))) for bits in (*OPACITIES, None)]
        rows.append((title, *(decibel(psnr(image, reference)) for image in (pictures[0], exact)), *(decibel(psnr(image, exact)) for image in pictures)))
    return table(
        ["view, family", "8 bits", "as in the scene", *(f"{bits} bits against that" for bits in OPACITIES), "FP16 against that"], rows,
    )
