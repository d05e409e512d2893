"""`make docs PART=chip`, `PART=constants` and `PART=dram`: tables of docs/results/chip_model.md, docs/results/list_schemes.md and
docs/results/memory_formats.md.

`chip`: the demo scene and the real ones, one view each. The others need no view.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from flicker.chip.compare import estimate
from flicker.chip.constants import constant_table
from flicker.chip.cull import cull
from flicker.chip.delivery import broadcast_cycles
from flicker.chip.dram import DramConfig, simulate
from flicker.chip.execute import run_scheme, scheme_rows
from flicker.chip.frame import ChipConfig, FrameEstimate, Prepared, prepare
from flicker.chip.lists import collect
from flicker.chip.quality import KEYS, format_quality, key_quality
from flicker.chip.schemes import SCHEMES, Scheme
from flicker.explore.configurations import get_configuration
from flicker.explore.evaluate import draw
from flicker.explore.machine import subtile_cycles
from flicker.front.view import View
from flicker.markdown import table
from flicker.scene.clusters import build_clusters
from flicker.scene.memory import MemoryFormat

from .common import Say, titled_views

CONFIGURATION = "flicker"  # whose rendering stage the frames have
TRAFFIC_OF = "flowers"
_table = partial(table, numbers=True)
CLUSTER_SIZES = (32, 64, 128, 256, 512, 1024)

Rows = list[tuple[str, ...]]


def _decibel(x: float) -> str:
    return "equal" if math.isinf(x) else f"{x:.1f}"


def _cull_rows(title: str, view: View) -> Rows:
    rows = []
    for size in CLUSTER_SIZES:
        _, clusters = build_clusters(view.scene, size)
        kept = [cull(clusters, view.camera, shape) for shape in ("box", "sphere")]
        read = [len(clusters.members(k)) for k in kept]
        rows.append((title, str(size), f"{len(clusters):,}", f"{kept[0].sum():,}", f"{read[0]:,}", f"{read[1]:,}", f"{view.projected.n_visible:,}",
                     f"{len(clusters) * 32 / 1e3:.0f}"))
    return rows


def _frame_row(title: str, label: str, e: FrameEstimate) -> tuple[str, ...]:
    stage = {s.name: s.cycles for s in e.stages}
    front = max(s.cycles for s in e.stages if s.phase == "preprocessing")
    lists = max(v for k, v in stage.items() if k in ("sort", "chain latency", "filter by mask", "hand out records"))
    return (title, label, f"{e.bytes / 1e6:.1f}", f"{front:,}", f"{lists:,}", f"{stage['render']:,}", f"{e.dram_cycles[0]:,}",
            f"{e.dram_cycles[1]:,}", e.bottleneck, f"{e.fps:.0f}", f"{e.latency_fps:.0f}")


def _purpose_rows(title: str, e: FrameEstimate) -> Rows:
    return [(title, p.name, f"{p.used_bytes / 1e6:.2f}", f"{p.moved_bytes / 1e6:.2f}", f"{p.dram_cycles:,}", f"{p.efficiency:.1%}")
            for p in e.purposes]


def _count_rows(title: str, p: Prepared) -> tuple[str, ...]:
    def entries(splats) -> tuple[int, int]:
        box = splats.box.astype(int)
        sub = ((box[:, 1] - box[:, 0]) * (box[:, 3] - box[:, 2])).sum()
        tile = (((box[:, 1] - 1) // 2 - box[:, 0] // 2 + 1) * ((box[:, 3] - 1) // 2 - box[:, 2] // 2 + 1)).sum()
        return int(sub), int(tile)

    sub, tile = entries(p.splats)
    tight = entries(collect(p.view.projected, p.view.camera, tight=True))
    need = int(p.needed.sum())
    return (title, f"{len(p.view.scene):,}", f"{p.view.projected.n_visible:,}", f"{len(p.splats):,}", f"{sub:,}", f"{tile:,}", f"{tight[0]:,}",
            f"{tight[1]:,}", f"{need:,}", f"{1 - need / max(sub, 1):.0%}")


_VARIATIONS = (
    ("write combining 256 lines", {"combiner_ways": 1}),
    ("write combining 512 lines", {"combiner_ways": 2}),
    ("write combining 2048 lines", {"combiner_ways": 8}),
    ("sort capacity 1024", {"sort_capacity": 1024}),
    ("sort capacity 4096", {"sort_capacity": 4096}),
    ("keys of 24 bits", {"key_bits": 24}),
    ("keys of 16 bits", {"key_bits": 16}),
    ("no record cache", {"record_cache_bytes": 0}),
    ("record cache 32 KB", {"record_cache_bytes": 32 * 1024}),
    ("record cache 128 KB", {"record_cache_bytes": 128 * 1024}),
)


def _variation_rows(title: str, p: Prepared, scheme: Scheme) -> Rows:
    rows = []
    for label, changes in (("as recommended", {}), *_VARIATIONS):
        (row,) = scheme_rows([run_scheme(p.splats, replace(scheme, **changes), p.needed)])
        rows.append((title, label, row[3], row[4], row[6], row[10], row[11], row[14]))
    return rows


_DEPTHS = (16, 32, 64, 128, 256, 512, 4096)


def _broadcast_row(title: str, p: Prepared, subtile_cycles: np.ndarray) -> tuple[str, ...]:
    rows, cols = p.lists.rows, p.lists.cols
    grid = np.zeros((rows + rows % 2, cols + cols % 2), np.int64)
    grid[:rows, :cols] = subtile_cycles.reshape(rows, cols)
    parts = [grid[k // 2 :: 2, k % 2 :: 2] for k in range(4)]
    cycles = [broadcast_cycles(p.splats, p.needed, subtile_cycles, depth) for depth in _DEPTHS]
    return (title, f"{max(int(x.sum()) for x in parts):,}", f"{int(np.maximum.reduce(parts).sum()):,}", *(f"{n:,}" for n in cycles))


def _dram_rows() -> Rows:
    rng = np.random.default_rng(1)
    bursts = 1 << 18
    rows = []
    stream = np.arange(bursts)
    rows.append(("stream, read", simulate(stream)))
    rows.append(("stream, write", simulate(stream, 1)))
    rows.append(("stream, read and written in turn by 256 bursts", simulate(stream, stream // 256 % 2)))
    for size in (1, 2, 4, 8):
        first = rng.integers(0, (1 << 22) // size, bursts // size) * size
        rows.append((f"gather of aligned {32 * size} bytes", simulate((first[:, None] + np.arange(size)).ravel())))
    one = rng.integers(0, 1 << 22, bursts)
    rows.append(("gather of 32 bytes, window 8", simulate(one, config=DramConfig(window=8))))
    rows.append(("scattered write of 32 bytes", simulate(one, 1)))
    rows.append(("scattered masked write of 32 bytes", simulate(one, 2)))
    return [(name, f"{r.efficiency:.1%}", f"{r.activates / r.bursts:.3f}") for name, r in rows]


def tables(say: Say) -> dict[str, str]:
    """Of every view."""
    culls, frames, purposes, counts, schemes, variations, formats, broadcasts = ([] for _ in range(8))
    keys: dict[tuple[str, int], list[str]] = {k: [] for k in KEYS}
    titles = []
    configuration = get_configuration(CONFIGURATION)
    for title, view in titled_views(say):
        titles.append(title)
        p = prepare(view)
        counts.append(_count_rows(title, p))
        culls += _cull_rows(title, view)
        say(f"{title}: {CONFIGURATION}")
        work = draw(p.view, configuration).work
        _, counters = configuration.simulate(work)
        assert counters is not None
        broadcasts.append(_broadcast_row(title, p, subtile_cycles(work, counters)))
        say(f"{title}: schemes")
        results = {name: run_scheme(p.splats, s, p.needed) for name, s in SCHEMES.items()}
        schemes += [(title, *row) for row in scheme_rows(list(results.values()))]
        base = ChipConfig()
        variations += _variation_rows(title, p, base.scheme)
        say(f"{title}: frames")
        for label, chip in (
            ("chunk", base), ("fp16", ChipConfig(memory=MemoryFormat.FP16)),
            ("fp16, colour of all members", ChipConfig(memory=MemoryFormat.FP16, two_step=False)),
            ("fp16, counting-subtile", ChipConfig(memory=MemoryFormat.FP16, scheme=SCHEMES["counting-subtile"])),
        ):
            e = estimate(p, configuration, chip, results[chip.scheme.name])
            frames.append(_frame_row(title, label, e))
            if label in ("chunk", "fp16") and title.startswith(TRAFFIC_OF):
                purposes += _purpose_rows(f"{title}, {label}", e)
        say(f"{title}: formats and keys")
        formats += [(title, q.form, f"{q.scene_bytes / 1e6:.2f}", str(q.gaussian_bytes), _decibel(q.reference_db), _decibel(q.golden_db))
                    for q in format_quality(view)]
        for kind, bits, value in key_quality(view.projected, view.camera):
            keys[kind, bits].append(_decibel(value))
    return {
        "counts": _table(("view", "Gaussians", "visible", "records", "sub-tile entries", "tile entries", "sub-tile, tight boxes",
                          "tile, tight boxes", "sub-tile entries needed", "cut by early stop"), counts),
        "culling": _table(("view", "cluster", "clusters", "kept", "members read, box", "members read, sphere", "visible",
                           "headers KB"), culls),
        "frames": _table(("view", "memory", "MB", "preprocess", "lists and sort", "render", "DRAM preprocess", "DRAM render",
                          "bottleneck", "FPS", "FPS, no overlap"), frames),
        "traffic": _table(("view", "purpose", "used MB", "moved MB", "DRAM cycles alone", "efficiency"), purposes),
        "schemes": _table(("view", *scheme_rows(None)[0]), schemes),
        "variations": _table(("view", "variation", "list MB", "record MB", "DRAM cycles", "sort", "chain", "on chip KB"), variations),
        "broadcast": _table(("view", "independent cores", "barrier after each tile", *(f"queues of {d}" for d in _DEPTHS)), broadcasts),
        "formats": _table(("view", "format", "MB", "bytes a Gaussian", "float64, dB", "golden, dB"), formats),
        "keys": _table(("key", "bits", *titles), [(kind, str(bits), *values) for (kind, bits), values in keys.items()]),
    }


def constant_tables(say: Say) -> dict[str, str]:
    return {"": table(("constant", "value", "source"), [(f"`{n}`", f"{v:,}", s) for n, v, s in constant_table()])}


def dram_tables(say: Say) -> dict[str, str]:
    return {"": _table(("access", "efficiency", "activates a burst"), _dram_rows())}
