"""`make docs PART=frame_energy`: energy of whole frames by the chip model, over GSCore's; in docs/results/energy.md."""

from __future__ import annotations

from collections.abc import Iterator

from flicker.chip.compare import chip_estimates
from flicker.chip.dram import DramConfig
from flicker.chip.whole import first_half, whole_frame
from flicker.cost.area import part
from flicker.cost.energy import busy_energy, memory_energy
from flicker.explore.configurations import get_configuration
from flicker.golden.front.frame import run_front
from flicker.golden.front.reuse import ColourStore, Reuse
from flicker.markdown import table
from flicker.params import Form
from flicker.scene.packing import pack_file
from flicker.scene.real import REAL_VIEWS, RealView
from flicker.scene.sources import open_scene

from .common import Measured, Say, folder_of_scenes, significant
from .kept_colours import MODELLED, MOVING, cameras

GSCORE, KEEPS = "gscore-conic", "log-lanes-64"
NAMES = (GSCORE, "faithful", "log-lanes", KEEPS)
# By form of the stage: the front end; the rendering half and the stage in it.
UNITS = {
    Form.CONIC: (("preprocessing", "conic"), ("rendering", "faithful"), ("render_stage", "faithful")),
    Form.FACTORED: (("preprocessing", "default"), ("rendering", "32 lanes"), ("lane_stage", "32 lanes")),
}
BUFFER = 32 * 1024  # bytes of the memory on the chip that what the DRAM moves is written to and read from


def _kept(view: RealView) -> dict[str, int]:
    """As of `chip_estimates`: the mean of frames of a path that keeps colours."""
    path, config, dram = view.path(folder_of_scenes()), get_configuration(KEEPS).render_config, DramConfig()
    assert config is not None
    source, packed = open_scene(path), pack_file(path).packed
    reuse, found = Reuse(ColourStore(packed), float(MOVING.tolerance)), []
    for number, camera in enumerate(cameras(MOVING, source, view, packed)):
        front = run_front(packed, camera, reuse=reuse)
        if number in MODELLED:
            found.append(whole_frame(*first_half(front, config, dram), config, dram))
    sums = (sum(f.front.cycles for f in found), sum(f.back.cycles for f in found), sum(sum(f.bytes.values()) for f in found))
    return dict(zip(("front_cycles", "render_cycles", "dram_bytes"), (value // len(found) for value in sums), strict=True))


def _rows(view: RealView, say: Say) -> Iterator[tuple[str, ...]]:
    measured = Measured(view)
    stages, facts = measured.rows(NAMES, say), chip_estimates(measured.view, NAMES)
    say(f"{view.title}: a path that keeps colours")
    base = 0.0
    for name, fact, title in [*((name, facts[name], f"`{name}`") for name in NAMES), (KEEPS, _kept(view), f"`{KEEPS}`, colours kept")]:
        front, half, stage = (part(*unit) for unit in UNITS[get_configuration(name).form])
        memory = memory_energy(fact["dram_bytes"], 2 * 8 * fact["dram_bytes"], BUFFER)
        parts = [
            memory["LPDDR4"], busy_energy(front, fact["front_cycles"]),
            busy_energy(half, fact["render_cycles"]) - busy_energy(stage, fact["render_cycles"]), stages[name]["energy_uj"], memory["SRAM"],
        ]
        base = base or sum(parts)
        yield (
            view.title, title, f"{fact['dram_bytes'] / 1e6:.1f}", *(significant(value / 1e3, 2) for value in parts), significant(sum(parts) / 1e3, 2),
            f"{base / sum(parts):.2f}",
        )


def tables(say: Say) -> dict[str, str]:
    rows = [row for view in REAL_VIEWS for row in _rows(view, say)]
    return {"": table(
        ["view", "machine", "MB", "DRAM, mJ", "front end", "sorting, delivery, frame buffer", "rendering stage", "memories on the chip", "all, mJ",
         "GSCore over it"], rows, numbers=True,
    )}
