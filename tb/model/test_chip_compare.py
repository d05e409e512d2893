"""Machines in whole chips: what their halves and the shared memory come to, GSCore's lists, what has no chip."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scene_samples import random_scene

from flicker.chip import preprocessing, rendering
from flicker.chip.compare import FRONTS, by_oriented_boxes, chip_estimates, chip_stage, own_sorter
from flicker.chip.dram import DramConfig
from flicker.chip.tile_lists import TileLists
from flicker.chip.whole import WholeFrame, first_half, whole_frame
from flicker.errors import FlickerError
from flicker.explore.configurations import get_configuration, group
from flicker.front.lists import obb_lists
from flicker.front.view import DEMO, View, load_view
from flicker.golden.front.frame import FrontFrame, ListKind, run_front
from flicker.golden.front.memory import front_memory
from flicker.golden.front.record import RecordKind
from flicker.golden.front.setup import MEAN_FRACTION
from flicker.golden.lanes.lists import front_lists
from flicker.params import FAITHFUL, Form, RenderConfig
from flicker.perf.lanes import lane_work, simulate_lanes
from flicker.pipeline import packed_scene
from flicker.scene.packed import PackedFormat
from flicker.sim.preprocessing import Regions

SIZE = (160, 90)


@pytest.fixture(scope="module")
def view() -> View:
    return load_view(DEMO, 0, SIZE)


@pytest.fixture(scope="module")
def conic(view: View) -> FrontFrame:
    format_, lists = FRONTS[Form.CONIC]
    return run_front(packed_scene(view, format_), view.camera, lists, RecordKind.CONIC32)


@pytest.mark.parametrize("form", list(Form), ids=lambda form: form.name)
def test_oriented_boxes(view: View, form: Form) -> None:
    """Entries of the boxes on whose sub-tiles the exploration's GSCore lists the same splats, no others, none without a sub-tile."""
    front = run_front(packed_scene(view, PackedFormat.FP16), view.camera, ListKind.BOX, RecordKind.of(form))
    found = by_oriented_boxes(front)
    assert 0 < len(found.entry_mask) < len(front.entry_mask) and found.entry_mask.all()
    splats = front.splats()
    s0, s1, s2 = splats.shape.T
    if form is Form.CONIC:
        inverse = np.stack([np.stack([2 * s0, s1], axis=1), np.stack([s1, 2 * s2], axis=1)], axis=1)
    else:  # 2^-(u^2 + v^2)
        rows = np.stack([np.stack([s0, s1], axis=1), np.stack([0 * s0, s2], axis=1)], axis=1)
        inverse = 2 * np.log(2) * np.einsum("nki,nkj->nij", rows, rows)
    cov = np.linalg.inv(inverse)
    projected = SimpleNamespace(mean=splats.mean / (1 << MEAN_FRACTION), cov2d=np.stack([cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1]], axis=1))
    lists, expected = found.subtile_lists(), obb_lists(front.subtile_lists(), projected, view.camera)
    assert np.array_equal(lists.start, expected.start) and np.array_equal(lists.entry, expected.entry)


def test_stages(view: View) -> None:
    """Every configuration of figure 10 has a chip, GSCore in both forms; one without RTL has none."""
    stages = {name: chip_stage(get_configuration(name)) for name in (*group("chip"), "gscore")}
    assert stages["faithful"] == FAITHFUL and stages["gscore-conic"] == stages["no-ctu-64-conic"] != stages["gscore"]
    for name, vrus in (("gscore", 4), ("gscore-conic", 4), ("no-ctu-32-conic", 2)):
        assert (stages[name].mask_generator, stages[name].vrus_per_channel) == ("all", vrus)
    assert stages["log-lanes-64"].lanes == 64 and stages["gscore"].form is Form.FACTORED
    assert chip_stage(get_configuration("rows-ellipse")) is None
    with pytest.raises(FlickerError, match="rows-ellipse: no RTL of its rendering stage"):
        chip_estimates(view, ["rows-ellipse"])


@pytest.mark.slow
def test_rivals_have_their_own_sorter(view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    """GSCore and stages without a contribution test, lanes not: an ideal one, so that ours slows none of them."""
    assert {name for name in group("chip") if own_sorter(get_configuration(name))} == {"no-ctu-32-conic", "no-ctu-64-conic", "gscore-conic"}
    names = ["no-ctu-64-conic", "faithful"]
    ideal = chip_estimates(view, names)
    monkeypatch.setattr("flicker.chip.compare.own_sorter", lambda configuration: False)
    ours = chip_estimates(view, names)
    assert ideal["faithful"] == ours["faithful"] and ideal["no-ctu-64-conic"]["render_cycles"] < ours["no-ctu-64-conic"]["render_cycles"]
    assert ideal["no-ctu-64-conic"]["dram_bytes"] <= ours["no-ctu-64-conic"]["dram_bytes"]


def test_estimates(view: View) -> None:
    """An interval is the longest of the halves and their memory, or of the rendering half beside the front end. GSCore's lists are shorter than boxes, the
    paper's records longer than the default's."""
    found = chip_estimates(view, ["no-ctu-64-conic", "gscore-conic", "faithful", "flicker", "log-lanes"])
    for fact in found.values():
        parts = {"front end": fact["front_cycles"], "rendering": fact["render_cycles"], "DRAM": fact["dram_cycles"]}
        assert fact["interval_cycles"] >= max(parts.values()) == parts[fact["bottleneck"]]
        assert fact["interval_cycles"] == max(parts.values()) or fact["interval_cycles"] < 1.5 * fact["render_cycles"]
        assert fact["latency_cycles"] == fact["front_cycles"] + fact["render_cycles"]
        assert fact["dram_cycles"] > fact["dram_bytes"] / 51.2
    assert found["gscore-conic"]["dram_bytes"] < found["no-ctu-64-conic"]["dram_bytes"]
    assert found["gscore-conic"]["render_cycles"] < found["no-ctu-64-conic"]["render_cycles"]
    assert found["flicker"]["dram_bytes"] < 0.7 * found["faithful"]["dram_bytes"]
    assert found["faithful"]["front_cycles"] == found["no-ctu-64-conic"]["front_cycles"] != found["gscore-conic"]["front_cycles"]


@pytest.mark.parametrize(("cycles", "bottleneck"), [((70, 50, 60), "front end"), ((50, 70, 60), "rendering"), ((50, 60, 70), "DRAM")])
def test_bottlenecks(cycles: tuple[int, int, int], bottleneck: str) -> None:
    """What takes longest sets the interval; a frame alone takes both halves."""
    first = preprocessing.Preprocessing((), {}, 0, 0, cycles[0])
    for beside in (0, 30):
        frame = WholeFrame(first, rendering.Rendering(cycles[1], {}, np.zeros(0), [], cycles[1] + beside), cycles[2])
        assert (frame.interval, frame.bottleneck, frame.latency) == (max(70, cycles[1] + beside), bottleneck, cycles[0] + cycles[1])


def _whole(front: FrontFrame, config: RenderConfig) -> WholeFrame:
    dram = DramConfig()
    return whole_frame(*first_half(front, config, dram), config, dram)


def test_beside_the_front_end(conic: FrontFrame) -> None:
    """Lines of lists and records come the later, the more the front end moves; alone the rendering half is as fast as without one."""
    dram = DramConfig()
    first, tables = first_half(conic, FAITHFUL, dram)
    found = [rendering.estimate(tables, FAITHFUL, dram, beside=moved) for moved in (0, sum(first.bytes.values()), 10 * sum(first.bytes.values()))]
    assert len({frame.cycles for frame in found}) == 1 and found[0].beside_cycles == found[0].cycles
    assert found[0].beside_cycles < found[1].beside_cycles < found[2].beside_cycles


def test_traffic(conic: FrontFrame) -> None:
    """Bursts of the rendering half are its bytes, but those of the frame buffer, whose beats are not all full."""
    frame = _whole(conic, FAITHFUL)
    moved: dict[str, int] = {}
    for stream in frame.back.traffic:  # lists in three: as they are, written as runs, read again
        moved[stream.name] = moved.get(stream.name, 0) + stream.moved_bytes
    width, height = -(-SIZE[0] // 32) * 32, -(-SIZE[1] // 16) * 16
    assert moved == frame.back.bytes | {"frame": 3 * width * height} and moved["frame"] < frame.back.bytes["frame"]
    assert sum(frame.bytes.values()) == sum(frame.front.bytes.values()) + sum(moved.values())
    assert frame.bytes["lists"] == frame.front.bytes["lists"] + moved["lists"]
    records = next(stream for stream in frame.back.traffic if stream.name == "records")
    regions = Regions.of(conic.packed, conic.camera, front_memory(conic).lists.chunks, conic.kind)
    listed = regions.records // 32 + np.unique(conic.number[conic.entry_splat])  # a record is a line
    assert np.isin(records.burst, listed).all() and len(np.unique(records.burst)) > 0.9 * len(listed)


def test_lanes(view: View) -> None:
    """Many small splats come too slowly for lanes, by lists and memory; few large ones are visited nearly as slowly as in the stage alone."""
    config, dense = RenderConfig(stage="lanes", lanes=32), run_front(packed_scene(view, FRONTS[Form.FACTORED][0]), view.camera)
    scene = random_scene(1, 60)
    large = View(view.camera, replace(scene, scales=np.full_like(scene.scales, 0.7), opacities=np.full_like(scene.opacities, 0.03)))
    few = run_front(packed_scene(large, FRONTS[Form.FACTORED][0]), view.camera)
    cycles = []
    for front in (dense, few):
        tables = TileLists.of(front, front_memory(front))
        alone = simulate_lanes(lane_work(front_lists(front)), config.with_(in_width=1), leave=True).cycles
        cycles.append((alone, *(rendering.estimate(tables, config, dram).cycles for dram in (None, DramConfig()))))
    assert cycles[0][0] < cycles[0][1] < cycles[0][2]
    assert cycles[1][0] < cycles[1][1] < 1.15 * cycles[1][0]
