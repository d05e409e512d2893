"""Named methods: what each streams, masks and draws.

    view = View(project(scene, camera), camera)
    result = run("flicker", view)
    result.image, result.work
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from ..scene.camera import Camera
from ..errors import FlickerError
from ..front.records import SubtileLists, build_lists
from ..golden.render import assemble, stream_order
from ..params import FAITHFUL, CatMode, Coords, Form, Precision, RenderConfig
from ..front.projection import Projected
from .generators.disc import DiscFormat, disc_masks, disc_operations
from .generators.exact import edge_slopes, exact_masks, exact_operations
from .generators.leaders import DENSE_LEADERS, SPARSE_LEADERS, cat_masks, cat_operations, seele_masks, seele_operations
from ..front.lists import absolute_means, ellipse_lists, obb_lists, reach_lists, tile_lists
from .generators.numbers import FORMATS, numbers
from ..cost.operations import NONE, Op, Operation, Operations
from ..golden.masked import pixel_tests, render_masked
from ..perf.work import Work


@dataclass
class View:
    """Projected splats and their camera, with the lists that methods share, made on first use.

    origin: position of the picture's first pixel on the screen, when the picture is a window of a larger one; matters for absolute
    coordinates only.
    """

    projected: Projected
    camera: Camera
    coords: Coords = Coords.LOCAL
    origin: tuple[int, int] = (0, 0)
    _cache: dict = field(default_factory=dict, repr=False)

    def lists(self, form: Form, kind: str = "subtile") -> SubtileLists:
        """Lists of a form: `subtile` (3-sigma box on 8x8), `tile` (vanilla, 16x16), `obb` (GSCore),
        `reach` and `ellipse` (as `subtile`, without entries that cannot contribute; factored form)."""
        key = form, kind
        if key not in self._cache:
            if kind == "subtile":
                made = build_lists(self.projected, self.camera, RenderConfig(form=form))
                if self.coords == Coords.ABSOLUTE:
                    made.mean = absolute_means(made, self.projected, self.origin)
            elif self.coords == Coords.ABSOLUTE:
                raise FlickerError(f"lists '{kind}': absolute coordinates are there for sub-tile lists only")
            else:
                made = _LISTS[kind](self.lists(form), self.projected, self.camera)
            self._cache[key] = made
        return self._cache[key]

    def slopes(self) -> np.ndarray:
        """Slopes of the exact-rectangle test, float64 (N, 2)."""
        if "slopes" not in self._cache:
            self._cache["slopes"] = edge_slopes(self.projected)
        return self._cache["slopes"]

    def drop(self) -> None:
        """Forget the lists."""
        self._cache.clear()


_LISTS = {"tile": tile_lists, "obb": obb_lists, "reach": reach_lists, "ellipse": ellipse_lists}


@dataclass
class Masks:
    """What a mask generator says; fields as in `Work`."""

    mask: np.ndarray
    test_cycles: np.ndarray
    evaluations: np.ndarray
    visit: np.ndarray | None = None
    fallen: np.ndarray | None = None


Generator = Callable[["View", SubtileLists, np.ndarray, np.ndarray], Masks]
"""(view, lists, order, core_start) to masks."""


@dataclass(frozen=True)
class Method:
    """A method.

    name: unique, lower case. title: for tables. family: `baseline`, `flicker`, `exact`, `rows` or `oracle`. form: of VRU and record.
    lists: kind of `View.lists`. generate: its mask generator. config: configuration of the RTL that does the same, if there is one.
    operations: hardware operations of the mask generator. exact: never leaves out a pixel that the VRU would have blended, proved
    in docs/methods.md. model_only: no RTL exists. pixels: the VRUs visit single pixels. precision: formats of the generator.
    accumulator: fraction bits of the VRUs' colour accumulators, 0: FP16.
    """

    name: str
    title: str
    family: str
    form: Form
    generate: Generator = field(repr=False, compare=False)
    lists: str = "subtile"
    config: RenderConfig | None = None
    operations: Operations = NONE
    exact: bool = False
    model_only: bool = True
    pixels: bool = False
    precision: str = "-"
    accumulator: int = 0


@dataclass
class Result:
    """What a method gives: image float32 (H, W, 3), unquantised, rounded as the hardware does; its work; its lists."""

    method: Method
    image: np.ndarray
    work: Work
    lists: SubtileLists


def whole(test_cycles: int) -> Generator:
    """No test: every element goes to all four mini-tiles."""

    def generate(view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray) -> Masks:
        n = len(lists.entry)
        return Masks(np.full(n, 15, np.uint8), np.full(n, test_cycles, np.uint8), np.zeros(n, np.uint16))

    return generate


def cat(config: RenderConfig) -> Generator:
    """The contribution-aware test of a configuration."""

    def generate(view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray) -> Masks:
        mask, cycles, fallen = cat_masks(lists, config, order, core_start)
        leaders = np.where(cycles == 2, DENSE_LEADERS, SPARSE_LEADERS).astype(np.uint16)
        return Masks(mask, cycles, leaders, fallen=fallen)

    return generate


def seele(view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray) -> Masks:
    """SeeLe's leader pixels of 2x2 groups."""
    mask, visit = seele_masks(lists)
    n = len(mask)
    return Masks(mask, np.full(n, 2, np.uint8), np.full(n, 16, np.uint16), visit)


def oracle(pixels: bool) -> Generator:
    """Free masks without a superfluous bit: what contributes, found by running the VRUs on everything."""

    def generate(view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray) -> Masks:
        n = len(lists.entry)
        _, contributing, _ = render_masked(lists, order, np.full(n, 15, np.uint8), None)
        mask = ((contributing != 0) << np.arange(4)).sum(axis=1).astype(np.uint8)
        return Masks(mask, np.zeros(n, np.uint8), np.zeros(n, np.uint16), contributing if pixels else None)

    return generate


def exact(form: Form, fmt: str, bound: bool, scaled: bool) -> Generator:
    """The exact-rectangle test of each mini-tile, one element per cycle."""

    def generate(view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray) -> Masks:
        mask, evaluations = exact_masks(lists, view.slopes(), numbers(fmt), bound, scaled)
        return Masks(mask, np.ones(len(mask), np.uint8), evaluations)

    return generate


def rows(fmt: DiscFormat, pixels: bool) -> Generator:
    """Row intervals in the unit disc, one element per cycle; eight rows count as eight evaluations."""

    def generate(view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray) -> Masks:
        mask, visit = disc_masks(lists, fmt)
        n = len(mask)
        return Masks(mask, np.ones(n, np.uint8), np.full(n, 8, np.uint16), visit if pixels else None)

    return generate


def all_pixels(view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray) -> Masks:
    """The weight of all 64 pixels in FP16 against the threshold, eight leaders a cycle as two PRTUs have."""
    mask, visit = pixel_tests(lists)
    n = len(mask)
    return Masks(mask, np.full(n, 8, np.uint8), np.full(n, 64, np.uint16), visit)


def run(method: str | Method, view: View, background=(0.0, 0.0, 0.0)) -> Result:
    """Masks, picture and work of a method in a view. Raises FlickerError for an unknown name."""
    if isinstance(method, str):
        method = get_method(method)
    lists = view.lists(method.form, method.lists)
    order, core_start = stream_order(lists)
    masks = method.generate(view, lists, order, core_start)
    pixels, contributing, pixel_finish = render_masked(lists, order, masks.mask, masks.visit, method.accumulator)
    fallen = np.zeros(lists.cols * lists.rows, bool) if masks.fallen is None else masks.fallen
    work = Work(
        lists.cols, lists.rows, order, core_start, lists.start, lists.entry, masks.test_cycles, masks.evaluations, masks.mask,
        masks.visit, contributing, pixel_finish, fallen,
    )
    return Result(method, assemble(lists, pixels, background), work, lists)


def _baselines(form: Form) -> list[Method]:
    end = f"-{form.name.lower()}"
    vru = f"{form.name.lower()} VRU"
    return [
        Method("vanilla" + end, f"vanilla 3DGS, AABB on 16x16 tiles, {vru}", "baseline", form, whole(1), lists="tile"),
        Method(
            "no_ctu" + end, f"FLICKER without CTU: AABB on 8x8 sub-tiles, {vru}", "baseline", form, whole(1),
            config=RenderConfig(form=form, cat=CatMode.OFF), model_only=False,
        ),
        Method("gscore" + end, f"GSCore: OBB on 8x8 sub-tiles, {vru}", "baseline", form, whole(1), lists="obb"),
        Method(
            "seele" + end, f"SeeLe: leader pixel of each 2x2 group, {vru}", "baseline", form, seele, precision="fp16",
            operations=seele_operations(form), pixels=True,
        ),
        Method("oracle_minitile" + end, f"free exact mini-tile masks, {vru}", "oracle", form, oracle(False), exact=True),
        Method("oracle" + end, f"free exact pixel masks, {vru}", "oracle", form, oracle(True), exact=True, pixels=True),
    ]


def _flicker() -> list[Method]:
    methods = []
    for form in (Form.FACTORED, Form.CONIC):
        for precision in Precision:
            for mode in CatMode:
                if mode == CatMode.OFF:
                    continue
                config = RenderConfig(form=form, precision=precision, cat=mode)
                words = mode.name.lower(), precision.name.lower(), form.name.lower()
                methods.append(Method(
                    method_name(config), "FLICKER, " + ", ".join(words), "flicker", form, cat(config), config=config,
                    operations=cat_operations(config), model_only=False, precision=words[1],
                ))
    return methods


def pixel_operations(form: Form) -> Operations:
    """Eight of 64 pixels a cycle: eight columns, then one row a cycle."""
    if form == Form.FACTORED:
        own = (Operation(Op.MUL, "FP16", 8 + 16), Operation(Op.MUL, "FP16", 8 + 64, sqr=True), Operation(Op.ADD, "FP16", 128))
    else:
        own = (Operation(Op.MUL, "FP16", 16 + 128), Operation(Op.MUL, "FP16", 16, sqr=True), Operation(Op.ADD, "FP16", 128))
    return Operations((Operation(Op.LOG, "FP16", 1), Operation(Op.ADD, "FP16", 16, note="differences"), *own, Operation(Op.CMP, "FP16", 64)), cycles=8)


def _exploration() -> list[Method]:
    found = []
    for form in (Form.FACTORED, Form.CONIC):
        for fmt in FORMATS:
            for bound in (False, True):
                for scaled in (False, True):
                    fixed_point = fmt.startswith("q")
                    if scaled and (fmt == "fp16" or fixed_point) or bound and fixed_point:
                        continue
                    words = [form.name.lower()] + ["scaled"] * scaled + ["bound"] * bound
                    found.append(Method(
                        "-".join(["exact", fmt, *words]), ", ".join(["exact rectangle", fmt, *words]), "exact", form,
                        exact(form, fmt, bound, scaled), operations=exact_operations(form, fmt, bound, scaled), exact=bound, precision=fmt,
                    ))
    for fmt in DISC_FORMATS:
        for pixels in (True, False):
            for kind in ("subtile", "reach", "ellipse"):
                if kind != "subtile" and fmt != DISC_FORMATS[0]:
                    continue
                words = ["rows" if pixels else "rows_minitile", f"f{fmt.fraction}a{fmt.address}"] + [kind] * (kind != "subtile")
                title = f"row intervals, {fmt.fraction} fraction bits, {fmt.address}-bit root table, {'pixel' if pixels else 'mini-tile'} masks"
                found.append(Method(
                    "-".join(words), title + _LIST_TITLES[kind], "rows", Form.FACTORED, rows(fmt, pixels), lists=kind,
                    operations=disc_operations(fmt), exact=True, pixels=pixels, precision=f"fixed f{fmt.fraction}a{fmt.address}",
                ))
    lanes = next(m for m in found if m.name == f"rows-f{DISC_FORMATS[0].fraction}a{DISC_FORMATS[0].address}-ellipse")
    for bits in ACCUMULATORS:
        found.append(replace(lanes, name=f"{lanes.name}-acc{bits}", title=f"{lanes.title}, colour accumulators of {bits} fraction bits", accumulator=bits))
    for form in (Form.FACTORED, Form.CONIC):
        found.append(Method(
            f"pixels-fp16-{form.name.lower()}", f"all 64 pixels tested in FP16, {form.name.lower()}", "rows", form, all_pixels,
            operations=pixel_operations(form), exact=True, pixels=True, precision="fp16",
        ))
    return found


ACCUMULATORS = (16, 10, 12, 14, 20)
# The first is the recommended one.
DISC_FORMATS = [DiscFormat(f, a) for f, a in ((8, 8), (6, 6), (7, 5), (7, 7), (8, 6), (9, 7), (10, 10))]
_LIST_TITLES = {"subtile": "", "reach": ", lists by the box of the reach", "ellipse": ", lists by the ellipse"}


@lru_cache(maxsize=None)
def methods() -> dict[str, Method]:
    """All methods by name, in the order of tables."""
    found = _baselines(Form.FACTORED) + _baselines(Form.CONIC) + _flicker() + _exploration()
    return {m.name: m for m in found}


def method_name(config: RenderConfig) -> str:
    """Name of the method that an RTL configuration is."""
    if config.cat == CatMode.OFF:
        return f"no_ctu-{config.form.name.lower()}"
    return "-".join(("flicker", config.cat.name, config.precision.name, config.form.name)).lower()


ALIASES = {
    "faithful": method_name(FAITHFUL),
    "flicker": method_name(RenderConfig()),
    "exact": "exact-fp16-factored-bound",
    "rows": "rows-f8a8",
    **{name: f"{name}-factored" for name in ("vanilla", "no_ctu", "gscore", "seele", "oracle", "oracle_minitile")},
}


def get_method(name: str) -> Method:
    """The method of a name or alias; FlickerError, naming close ones, when there is none."""
    found = methods().get(ALIASES.get(name, name))
    if found is None:
        import difflib

        close = difflib.get_close_matches(name, [*ALIASES, *methods()], 3, 0.3)
        raise FlickerError(f"unknown method '{name}'; close names: {', '.join(close) or 'none'} (flicker stability --list shows all)")
    return found
