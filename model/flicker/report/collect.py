"""What the report needs of every view: rows of the configurations, facts for single figures, maps, pictures.

Everything is kept in the store that sweeps use (`explore.store`): what a sweep has computed is read, what is missing is computed and kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..chip.compare import chip_estimates
from ..cost.energy import memory_energy
from ..explore.configurations import CONFIGURATIONS, get_configuration, group
from ..explore.evaluate import evaluate
from ..explore.facts import as_bytes, duplicates, fifo_sweep, heat_maps
from ..explore.points import Point, SceneFile, Target
from ..explore.store import Store
from ..front.view import View

MAPPED = ("vanilla", "faithful", "flicker", "lanes")
PICTURED = ("flicker-smooth-fp16-conic", "flicker-smooth-mixed-conic", "flicker-smooth-fp8-conic")
FIFO_SWEPT = "faithful"


@dataclass
class ViewResult:
    """One view. rows, maps, pictures: by name of the configuration.

    rows: as `Evaluation.row`. facts: `duplicates`, `fifo`, `chip`. maps: of the configurations in `MAPPED`, arrays by name
    (`heat_maps`). pictures: uint8 (H, W, 3) of `PICTURED`. reference: uint8 (H, W, 3). count: of the views whose mean this is.
    """

    target: Target
    rows: dict[str, dict] = field(default_factory=dict)
    facts: dict[str, dict] = field(default_factory=dict)
    maps: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    pictures: dict[str, np.ndarray] = field(default_factory=dict)
    reference: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3), np.uint8))
    count: int = 1

    @property
    def title(self) -> str:
        return self.target.title if self.count == 1 else f"{self.target.scene.name}, {self.count} views"

    @property
    def photographed(self) -> bool:
        """Whether its configurations were measured against a photograph."""
        return any(row.get("photo_psnr_db") is not None for row in self.rows.values())


def _mean(values: list) -> Any:
    """Mean of numbers, by item of lists and dictionaries; of other things the most frequent one."""
    first = values[0]
    if isinstance(first, dict):
        return {key: _mean([value[key] for value in values]) for key in first if all(key in value for value in values)}
    if isinstance(first, list):
        return [_mean(list(items)) for items in zip(*values)]
    if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
        return sum(values) / len(values)
    return max(values, key=values.count)


def by_scene(views: Sequence[ViewResult]) -> list[ViewResult]:
    """One result a scene: rows and facts are means over its views, without maps and pictures."""
    groups: dict[SceneFile, list[ViewResult]] = {}
    for view in views:
        groups.setdefault(view.target.scene, []).append(view)
    return [
        group[0] if len(group) == 1 else ViewResult(group[0].target, _mean([v.rows for v in group]), _mean([v.facts for v in group]), count=len(group))
        for group in groups.values()
    ]


class _Collector:
    """Results of one view, from the store or computed; the view is loaded when the first thing is computed."""

    def __init__(self, target: Target, store: Store) -> None:
        self.target, self.store = target, store

    @cached_property
    def view(self) -> View:
        return self.target.load()

    def configuration(self, name: str, found: ViewResult) -> None:
        """Row of a configuration, and what figures show of it beside."""
        key = Point(self.target, name).key
        row = self.store.load(key)
        wanted = name in MAPPED or name in PICTURED
        arrays = self.store.arrays(key) if wanted else {}
        if row is None or arrays is None:
            result = evaluate(self.view, name)
            row, arrays = result.row, {}
            if name in MAPPED:
                arrays |= heat_maps(result, self.view.reference)
            if name in PICTURED:
                arrays["picture"] = as_bytes(result.image)
            self.store.put(key, row, arrays)
            row = self.store.load(key) or row
        found.rows[name] = row
        if "picture" in arrays:
            found.pictures[name] = arrays.pop("picture")
        if arrays:
            found.maps[name] = arrays

    def facts(self, name: str, make: Callable[[], dict], *parts: object) -> dict:
        """Numbers by name that depend on the view and `parts`."""
        key = self.target.key(name, *parts)
        facts = self.store.load(key)
        if facts is None:
            self.store.put(key, make())
            facts = self.store.load(key)
        return facts or {}

    def reference(self) -> np.ndarray:
        """uint8 (H, W, 3)."""
        key = self.target.key("reference")
        stored = self.store.arrays(key)
        if stored is None:
            stored = {"reference": as_bytes(self.view.reference)}
            self.store.put(key, {}, stored)
        return stored["reference"]

    def duplicates(self) -> dict:
        projected = self.view.projected
        return duplicates(projected, *self.target.size) | {"visible": projected.n_visible, "spiky": int(projected.spiky.sum())}

    def fifo(self) -> dict:
        configuration = get_configuration(FIFO_SWEPT)
        return fifo_sweep(evaluate(self.view, configuration).work, configuration)


def list_kind(name: str) -> tuple[str, str]:
    """What the lists of a configuration depend on."""
    return CONFIGURATIONS[name].lists, CONFIGURATIONS[name].form.name


def collect(
    targets: Sequence[Target], names: Sequence[str], store: Store, progress: Callable[[int, int, str], None] = lambda done, total, text: None,
) -> list[ViewResult]:
    """Everything for the report. progress: called with (done, in all, what is next)."""
    # Few lists in memory; the configurations of one picture one after the other.
    order = sorted(names, key=lambda n: (list_kind(n), repr(CONFIGURATIONS[n].picture_key()), names.index(n)))
    steps = len(targets) * (len(names) + 2)
    done = 0
    views = []
    for target in targets:
        collector = _Collector(target, store)
        found = ViewResult(target)
        kind = None
        for name in order:
            progress(done, steps, f"{target.title}: {name}")
            if list_kind(name) != kind and "view" in collector.__dict__:
                collector.view.drop()
            kind = list_kind(name)
            collector.configuration(name, found)
            if name == FIFO_SWEPT:
                found.facts["fifo"] = collector.facts("fifo", collector.fifo, repr(CONFIGURATIONS[name]))
            done += 1
        progress(done, steps, f"{target.title}: lists")
        found.facts["duplicates"] = collector.facts("duplicates", collector.duplicates)
        found.reference = collector.reference()
        done += 1
        progress(done, steps, f"{target.title}: chip")
        chip = [name for name in group("chip") if name in found.rows]
        if chip:
            facts = collector.facts("chip", lambda: chip_estimates(collector.view, chip), *(repr(CONFIGURATIONS[name]) for name in chip))
            found.facts["chip"] = {
                name: fact | {"energy_uj": found.rows[name]["energy_uj"] + sum(memory_energy(fact["dram_bytes"]).values())} for name, fact in facts.items()
            }
        done += 1
        found.rows = {name: found.rows[name] for name in names}
        views.append(found)
    progress(done, steps, "done")
    return views
