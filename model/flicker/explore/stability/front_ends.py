"""Packed front ends: the scene of a case packed, projected in the hardware's number formats, records blended in float64."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...front.pops import Seen, seen_in
from ...front.projection import Projected, project
from ...front.reference import render_reference
from ...golden.front.blend import blend_records
from ...golden.front.frame import FrontFrame, run_front
from ...golden.front.record import RecordKind
from ...golden.front.setup import FORMATS, MAX_PICTURE, MEAN_FRACTION, FrontFormats
from ...params import SUBTILE, SortOrder
from ...scene.clusters import reorder
from ...scene.gaussians import Scene
from ...scene.packed import PackedFormat, decode
from ...scene.packing import Packing, pack
from .families import Case, crop


@dataclass(frozen=True)
class FrontEnd:
    """A front end: format of the memory image, layout of the record, mantissa bits. record None: the image decoded and drawn in float64, what packing alone
    costs."""

    image: PackedFormat
    record: RecordKind | None
    formats: FrontFormats = FORMATS

    @property
    def name(self) -> str:
        if self.record is None:
            return f"image-{self.image.value}"
        wider = "" if self.formats == FORMATS else f"-{self.precision}"
        return f"front-{self.image.value}-{self.record.bytes}{wider}"

    @property
    def precision(self) -> str:
        return "-" if self.record is None else f"{self.formats.position}/{self.formats.shape}/{self.formats.colour}"

    @property
    def form(self) -> str:
        return "-" if self.record is None else self.record.form.name.lower()


IMAGES = (PackedFormat.CHUNK, PackedFormat.FP16_LOCAL)
RECORDS = (RecordKind.FACTORED16, RecordKind.CONIC32)
WIDE = FrontFormats(21, 13, 13)  # what the default formats are measured against
WIDE_IMAGE = PackedFormat.FP16_LOCAL  # the finer one
FRONT_ENDS = {front.name: front for front in (
    *(FrontEnd(image, record) for image in IMAGES for record in (None, *RECORDS)), *(FrontEnd(WIDE_IMAGE, record, WIDE) for record in RECORDS),
)}


def drawable(case: Case) -> bool:
    """Whether the case's screen is one that front ends take."""
    return max(case.screen.width, case.screen.height) <= MAX_PICTURE


def in_float64(case: Case, scene: Scene, order: SortOrder = SortOrder.DEPTH) -> np.ndarray:
    """float64 picture of the case's window, sorted by float64 depth or distance; equal ones keep the order of the scene."""
    projected = project(scene, case.screen)
    away = (scene.means - case.screen.position)[projected.index]
    by = (away @ case.screen.rotation)[:, 2] if order is SortOrder.DEPTH else np.linalg.norm(away, axis=1)
    places = np.lexsort((projected.index, by))
    projected = Projected(**{name: values[places] for name, values in vars(projected).items()})
    if case.screen is not case.camera:
        projected, _ = crop(projected, case.screen, *case.origin)
    return render_reference(projected, case.camera)


def truth(case: Case, packing: Packing, order: SortOrder = SortOrder.DEPTH) -> np.ndarray:
    """The case's scene as given, drawn in float64. Equal depths or distances have the order of the packed scene, which is as right as any."""
    scene = case.meant or case.scene
    rest = np.setdiff1d(np.arange(len(scene)), packing.order)
    return in_float64(case, reorder(scene, np.concatenate([packing.order, rest])), order)


def draw(case: Case, frame: FrontFrame) -> np.ndarray:
    """float64 picture of the case's window from the records of its screen."""
    start, entry = frame.sorted_subtiles()
    splats = frame.splats()
    camera, (x0, y0) = case.camera, case.origin
    if case.screen is not camera:
        cols, rows = (-(-n // SUBTILE) for n in (camera.width, camera.height))
        col, row = np.meshgrid(np.arange(cols) + x0 // SUBTILE, np.arange(rows) + y0 // SUBTILE)
        subtile = (row * -(-case.screen.width // SUBTILE) + col).ravel()
        entry = np.concatenate([entry[start[s] : start[s + 1]] for s in subtile])
        start = np.append(0, np.cumsum(start[subtile + 1] - start[subtile]))
        splats = replace(splats, mean=splats.mean - (np.array([x0, y0]) << MEAN_FRACTION))
    return blend_records(splats, frame.kind.form, start, entry, camera.width, camera.height)


class Drawer:
    """Pictures of one case by every front end, with what they share made once. order: what splats are sorted by, in the truth, too."""

    def __init__(self, case: Case, order: SortOrder = SortOrder.DEPTH) -> None:
        self.case, self.order = case, order
        self._kept: dict[PackedFormat, tuple[Packing, np.ndarray]] = {}
        self._frames: dict[FrontEnd, FrontFrame] = {}

    def __call__(self, front: FrontEnd) -> tuple[np.ndarray, np.ndarray]:
        """The front end's picture and the truth."""
        if front.image not in self._kept:
            packing = pack(self.case.scene, front.image)
            self._kept[front.image] = packing, truth(self.case, packing, self.order)
        packing, reference = self._kept[front.image]
        if front.record is None:
            return in_float64(self.case, decode(packing.packed), self.order), reference
        self._frames[front] = run_front(packing.packed, self.case.screen, kind=front.record, formats=front.formats, order=self.order)
        return draw(self.case, self._frames[front]), reference

    def seen(self, front: FrontEnd) -> Seen:
        """What a front end that has drawn lists on the screen."""
        if front.record is None:
            return seen_in(project(decode(self._kept[front.image][0].packed), self.case.screen, self.order), self.case.screen)
        return self._frames[front].seen()
