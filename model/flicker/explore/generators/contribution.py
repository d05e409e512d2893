"""FLICKER's contribution-aware test: masks from leader pixels, in all modes; and no test at all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np

from ...cost.area import RECORD_BITS, ctu_area, part
from ...cost.energy import clock_pj, ctu, ctu_pj, fifo_pj, switching_pj
from ...cost.operations import Operations, ctu_operations
from ...front.records import SubtileLists
from ...front.view import View
from ...golden.cat import SCRATCH, is_dense, splat_mask
from ...golden.masked import load_splat
from ...params import AUTO_DECAY_SHIFT, AUTO_SENT_BITS, AUTO_TEST_BITS, CHANNELS, CORES, FAITHFUL, CatMode, Form, Precision, RenderConfig
from ...perf.work import Work
from ..machine import Configuration, MaskGenerator, Masks, RenderingStage
from ..stages.channels import Barrier, Channels
from ..stages.subtile import SubtileVrus

DENSE_LEADERS = 16
SPARSE_LEADERS = 8


@numba.njit(parallel=True, cache=True)
def _cat(gauss, spiky, start, entry, mean, mode, form, precision, mask, cycles):
    for s in numba.prange(len(start) - 1):
        scratch = np.empty(SCRATCH, np.float32)
        f = np.empty(9, np.float32)
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            load_splat(n, i, gauss, mean, f)
            dense = is_dense(mode, spiky[i])
            cycles[n] = 2 if dense else 1
            mask[n] = splat_mask(f[0], f[1], f[2], f[3], f[4], f[5], dense, form, precision, scratch)


def _saturated(x: int, bits: int) -> int:
    return min(x, (1 << bits) - 1)


def _fallen(
    order: np.ndarray, core_start: np.ndarray, base_test: np.ndarray, sent: np.ndarray, sent_sparse: np.ndarray, per_vru: int,
) -> np.ndarray:
    """Sub-tiles in which the automatic mode has fallen (docs/reference/ctu.md). base_test (S,), sent and sent_sparse (S, 4) per sub-tile; per_vru:
    pixels of a VRU."""
    fallen = np.zeros(len(base_test), bool)
    for core in range(CORES):
        test_avg = sent_avg = 0
        decided = latest = False
        for s in order[core_start[core] : core_start[core + 1]]:
            fallen[s] = decided
            counts = sent_sparse[s] if decided else sent[s]
            test_avg += _saturated(int(base_test[s]), AUTO_TEST_BITS) - (test_avg >> AUTO_DECAY_SHIFT)
            sent_avg += per_vru * _saturated(int(counts.max()), AUTO_SENT_BITS) - (sent_avg >> AUTO_DECAY_SHIFT)
            decided, latest = latest, test_avg > sent_avg
    return fallen


def per_subtile(values: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Sums of per-element values (E,) or (E, k) over each sub-tile, int64."""
    total = np.zeros((len(values) + 1, *values.shape[1:]), np.int64)
    np.cumsum(values, axis=0, out=total[1:])
    return total[start[1:]] - total[start[:-1]]


def cat_masks(
    lists: SubtileLists, config: RenderConfig, order: np.ndarray, core_start: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mask uint8 (E,), test cycles uint8 (E,), fallen bool (S,)) of the contribution-aware test."""
    n = len(lists.entry)

    def fixed(mode: CatMode) -> tuple[np.ndarray, np.ndarray]:
        mask, cycles = np.empty(n, np.uint8), np.empty(n, np.uint8)
        _cat(
            lists.gauss, lists.spiky, lists.start, lists.entry, lists.mean,
            int(mode), int(config.form), int(config.precision), mask, cycles,
        )
        return mask, cycles

    fallen = np.zeros(lists.cols * lists.rows, bool)
    if config.cat == CatMode.OFF:
        return np.full(n, 15, np.uint8), np.ones(n, np.uint8), fallen
    if config.cat != CatMode.AUTO:
        return *fixed(config.cat), fallen
    mask, cycles = fixed(CatMode.SMOOTH)
    sparse_mask, sparse_cycles = fixed(CatMode.SPARSE)
    bits = np.arange(CHANNELS, dtype=np.uint8)
    sent, sent_sparse = (per_subtile((m[:, None] >> bits) & 1, lists.start) for m in (mask, sparse_mask))
    fallen = _fallen(order, core_start, per_subtile(cycles, lists.start), sent, sent_sparse, config.pixels_per_vru)
    down = np.repeat(fallen, np.diff(lists.start))
    return np.where(down, sparse_mask, mask), np.where(down, sparse_cycles, cycles), fallen


@dataclass(frozen=True)
class Untested(MaskGenerator):
    """No test: every element goes to all four mini-tiles, one a cycle."""

    form: Form = Form.FACTORED

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        n = len(lists.entry)
        return Masks(np.full(n, 15, np.uint8), np.ones(n, np.uint8), np.zeros(n, np.uint16))

    def rtl(self) -> dict:
        return {"form": self.form, "cat": CatMode.OFF, "mask_generator": "all"}

    def area(self) -> float:
        return part("mask_all", "default").ge

    def energy_pj(self, work: Work, tested: int) -> float:
        unit = part("mask_all", "default")
        return tested * (switching_pj(unit.load) + clock_pj(unit.clock_gated))

    def clock_free(self) -> float:
        return part("mask_all", "default").clock_free


@dataclass(frozen=True)
class ContributionTest(MaskGenerator):
    """The CTU. fifo_depth: of its output FIFO, 0: its pipeline holds (`RenderConfig.ctu_fifo_depth`)."""

    form: Form
    number_formats: Precision
    mode: CatMode
    fifo_depth: int = 0

    @property
    def precision(self) -> str:
        return self.number_formats.name.lower()

    @property
    def operations(self) -> Operations:
        return ctu_operations(RenderConfig(form=self.form, precision=self.number_formats, cat=self.mode))

    def rtl(self) -> dict:
        return {"form": self.form, "precision": self.number_formats, "cat": self.mode, "ctu_fifo_depth": self.fifo_depth}

    def picture_key(self, stage: RenderingStage) -> object:
        return stage.vrus if self.mode == CatMode.AUTO else None

    def masks(self, view: View, lists: SubtileLists, order: np.ndarray, core_start: np.ndarray, stage: RenderingStage) -> Masks:
        config = RenderConfig(form=self.form, precision=self.number_formats, cat=self.mode, vrus_per_channel=stage.vrus // (CORES * CHANNELS))
        mask, cycles, fallen = cat_masks(lists, config, order, core_start)
        leaders = np.where(cycles == 2, DENSE_LEADERS, SPARSE_LEADERS).astype(np.uint16)
        return Masks(mask, cycles, leaders, fallen=fallen)

    def area(self) -> float:
        return ctu_area(self.form, self.number_formats, self.fifo_depth)

    def energy_pj(self, work: Work, tested: int) -> float:
        through_fifo = int((work.mask != 0).sum(dtype=np.int64)) if self.fifo_depth else 0
        return tested * ctu_pj(self.form, self.number_formats) + through_fifo * fifo_pj(self.fifo_depth, RECORD_BITS + CHANNELS)

    def clock_free(self) -> float:
        return ctu(self.form, self.number_formats).clock_free


def flicker(config: RenderConfig, name: str, title: str, **stage) -> Configuration:
    """The RTL's configuration with the stage's other fields as given."""
    generator = ContributionTest(config.form, config.precision, config.cat, config.ctu_fifo_depth)
    return Configuration(name, title, "flicker", generator, Channels(config.form, **stage))


def configurations() -> Iterator[Configuration]:
    """Baselines without a test, FLICKER as in the paper and as the default, its variants, every mode, format and form."""
    for form in Form:
        end, what = ("", "") if form == Form.FACTORED else ("-conic", ", conic")
        untested = Untested(form)
        yield Configuration("vanilla" + end, f"vanilla 3DGS, AABB on 16x16 tiles{what}", "baseline", untested, Channels(form), lists="tile")
        for vrus in (32, 64):
            title = f"FLICKER without CTU, {vrus} VRUs{what}"
            yield Configuration(f"no-ctu-{vrus}{end}", title, "baseline", untested, Channels(form, vrus_per_channel=vrus // (CORES * CHANNELS)))
        yield Configuration(
            "gscore" + end, f"GSCore: OBB on 8x8 sub-tiles, 64 VRUs{what}", "baseline", untested, SubtileVrus(form, vrus_per_channel=4), lists="obb",
        )
    default = RenderConfig()
    for config, name, title in ((FAITHFUL, "faithful", "FLICKER as in the paper"), (default, "flicker", "FLICKER, default")):
        base = flicker(config, name, title + (" configuration" if config is default else ""))
        yield base
        yield Configuration(f"{name}-barrier", f"{title}, barrier after every tile", "flicker", base.generator, Barrier(config.form))
    stop = flicker(default, "flicker-stop", "FLICKER, default, finished sub-tiles are left at once")
    yield Configuration(stop.name, stop.title, stop.family, stop.generator, stop.stage, stop=True)
    yield flicker(default, "flicker-16", "FLICKER, default, 16 VRUs", vrus_per_channel=1)
    yield flicker(default, "flicker-64", "FLICKER, default, 64 VRUs", vrus_per_channel=4)
    yield flicker(default, "flicker-fifo-64", "FLICKER, default, FIFO depth 64", fifo_depth=64)
    for form in (Form.FACTORED, Form.CONIC):
        for precision in Precision:
            for mode in CatMode:
                if mode != CatMode.OFF:
                    words = mode.name.lower(), precision.name.lower(), form.name.lower()
                    config = RenderConfig(form=form, precision=precision, cat=mode)
                    yield flicker(config, "-".join(("flicker", *words)), "FLICKER, " + ", ".join(words))
