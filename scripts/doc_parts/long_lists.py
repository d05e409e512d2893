"""`make docs PART=long_lists`: tables of docs/results/long_lists.md. Made lists of every order; `real`: the longest lists of a real view in a small
picture."""

from __future__ import annotations

import numpy as np

from flicker.chip.frame import prepare
from flicker.chip.list_layout import key_entries
from flicker.chip.long_lists import ORDERS, WAYS, Cost, Way, code, lines_of, make_list, reading_order
from flicker.cost.chip_area import square_millimetres
from flicker.front.view import load_view
from flicker.golden.lists import MASK_BITS, RECORD_BITS
from flicker.golden.sorting import CAPACITY
from flicker.markdown import table
from flicker.scene.real import REAL_VIEWS

from .common import Say, folder_of_scenes

SIZES = (100, 2048, 2500, 10_000, 32_768, 100_000)
SHARES = (1.0, 0.5, 0.1)
OF_SHARES = 20_000
REAL = (320, 178)


def _bytes(cost: Cost, n: int) -> float:
    return cost.moved / int(lines_of(n))


def _sizes(say: Say) -> str:
    rows = []
    for n in SIZES:
        for way in WAYS:
            say(f"{n} entries, {way.name}")
            costs = [way.cost(make_list(np.random.default_rng(n), n, order), n) for order in ORDERS]
            rows.append((f"{n:,}", way.name, *(f"{c.cycles / n:.2f}, {_bytes(c, n):.2f}" for c in costs),
                         "yes" if all(c.cycles <= 3 * n + 2000 and _bytes(c, n) <= 4.05 for c in costs) else "no"))
    return table(("entries", "way", *ORDERS, "within the bounds"), rows, numbers=True)


def _early(say: Say) -> str:
    rows = []
    for way in WAYS:
        say(f"early, {way.name}")
        lists = [make_list(np.random.default_rng(7), OF_SHARES, order) for order in ("random", "walls", "clumps")]
        found = [way.cost(entries, int(OF_SHARES * share)) for entries in lists for share in SHARES]
        rows.append((way.name, *(f"{c.cycles / OF_SHARES:.2f}, {_bytes(c, OF_SHARES):.2f}" for c in found)))
    heads = [f"{order}, {share:.0%}" for order in ("random", "walls", "clumps") for share in SHARES]
    return table(("way", *heads), rows, numbers=True)


def _real(say: Say) -> str:
    rows = []
    for view in REAL_VIEWS:
        say(f"{view.title}, {REAL[0]}x{REAL[1]}")
        keyed = key_entries(prepare(load_view(view.path(folder_of_scenes()), view.number, REAL)))
        e = keyed.entries
        depth = keyed.depth[e.splat]
        count = np.bincount(e.tile, minlength=e.cols * e.rows)
        order = np.lexsort((e.splat, e.tile))
        start = np.concatenate([[0], np.cumsum(count)])
        long = np.flatnonzero(count > CAPACITY)
        total: dict[str, list[int]] = {way.name: [0, 0] for way in WAYS}
        for t in long:
            own = order[start[t] : start[t + 1]]
            # Splats come in the order of the scene here, which is that of packing in the chip.
            key = code(depth[own])
            entries = (key << RECORD_BITS | np.arange(len(own))).astype(np.uint64)[reading_order(len(own))] << np.uint64(MASK_BITS)
            for way in WAYS:
                cost = way.cost(entries, max(int(keyed.needed[t]), 1))
                total[way.name][0] += cost.cycles
                total[way.name][1] += cost.moved
        n, lines = int(count[long].sum()), int(lines_of(count[long]).sum())
        for name, (cycles, moved) in total.items():
            if n:
                rows.append((view.title, f"{len(long)} of {int((count > 0).sum())}", f"{count.max():,}", f"{keyed.needed[long].sum() / n:.0%}", name,
                             f"{cycles / n:.2f}", f"{moved / lines:.2f}"))
    return table(("view", "lists longer than a unit", "longest", "needed of them", "way", "cycles an entry", "bytes"), rows, numbers=True)


def _means(way: Way) -> tuple[str, ...]:
    return (way.name, f"{way.bits:,}", f"{way.gates:,.0f}", f"{square_millimetres(way.gates, way.bits):.4f}", f"{way.chip_bits / 8192:.0f}")


def tables(say: Say) -> dict[str, str]:
    heads = ("way", "bits of SRAM, a unit", "GE, a unit", "mm2, a unit", "KB in the front end")
    return {"sizes": _sizes(say), "early": _early(say), "real": _real(say), "means": table(heads, [_means(w) for w in WAYS], numbers=True)}
