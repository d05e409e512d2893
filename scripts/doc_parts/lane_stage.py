"""`make docs PART=lane_stage`: cycles and areas of the lanes' RTL, and cycles of cores that take more than it does, in docs/results/lane_stage.md."""

from __future__ import annotations

from flicker.cost.area import part
from flicker.cost.synth.units import lane_builds, lane_config
from flicker.front.view import View, load_view
from flicker.golden.lanes.lists import float_lists
from flicker.markdown import table
from flicker.params import CORES, SUBTILE_PIXELS, Form
from flicker.perf.lanes import lane_work, simulate_lanes
from flicker.scene.real import REAL_VIEWS

from .common import Say, folder_of_scenes, load

SMALL = (480, 270)
# Of cores that take more: elements a cycle, splats of these to the lanes, slots, depth of queues.
FEEDS = ((2, 1, 20, 16), (2, 2, 20, 16), (2, 2, 40, 16), (3, 2, 40, 16), (4, 4, 64, 16), (4, 4, 64, 32), (8, 8, 64, 64))


def cycle_rows(view: View, title: str, say: Say) -> list[tuple[str, ...]]:
    """Cycles of every build by the model that equals the RTL; lists by the ellipse, as the front end makes them, left early, empty ones not streamed."""
    say(title)
    work = lane_work(float_lists(view.projected, view.lists(Form.FACTORED, "ellipse")))
    rows = []
    for config in lane_builds():
        m = simulate_lanes(work, config, leave=True, empty=False)
        slots = m.cycles * config.lanes
        late = m.total("visits") - m.total("skipped") - m.total("blended") - m.total("pixels_finished")
        lanes = [m.total("skipped"), late, m.total("starved"), m.total("bank_waits")]
        cores = [m.total("no_slot"), m.total("no_room")]
        rows.append((
            title, lane_config(config), f"{work.contributing / config.lanes:,.0f}", f"{m.cycles:,}", f"{work.contributing / slots:.1%}",
            *(f"{n / slots:.1%}" for n in lanes), *(f"{n / (m.cycles * CORES):.1%}" for n in cores),
        ))
    return rows


def feed_rows(view: View, say: Say) -> list[tuple[str, ...]]:
    """Cycles of 32 lanes whose cores take and dispatch more in a cycle, by the same model; the first row is the RTL. GE: of further setups and masks alone."""
    say("cores that take more")
    work = lane_work(float_lists(view.projected, view.lists(Form.FACTORED, "ellipse")))
    config = lane_builds()[0]
    front = CORES * (part("splat_setup", "default").ge + part("row_mask", "default").ge)
    rows = []
    for in_width, dispatch, slots, depth in FEEDS:
        m = simulate_lanes(work, config.with_(slots=slots, fifo_depth=depth), leave=True, empty=False, in_width=in_width, dispatch=dispatch)
        lanes = m.cycles * config.lanes
        shares = (work.contributing / lanes, m.total("starved") / lanes, m.total("no_slot") / (m.cycles * CORES), m.total("no_room") / (m.cycles * CORES))
        rows.append((
            str(in_width), str(dispatch), str(slots), str(depth), f"{m.cycles:,}", *(f"{share:.1%}" for share in shares),
            f"{front * (in_width - config.in_width):,.0f}",
        ))
    return rows


def area_rows() -> list[tuple[str, ...]]:
    """GE of the stage by part, for each build."""
    rows = []
    for config in lane_builds():
        name = f"{SUBTILE_PIXELS * CORES // config.lanes} pixels"
        stage = part("lane_stage", lane_config(config)).ge
        found = [
            CORES * config.in_width * part("splat_setup", "default").ge, CORES * config.in_width * part("row_mask", "default").ge,
            config.lanes * part("lane", name).ge, config.lanes * part("lane_queue", name).ge, CORES * part("lane_counters", "default").ge,
        ]
        rows.append((lane_config(config), f"{stage:,.0f}", *(f"{v:,.0f}" for v in (*found, stage - sum(found))), f"{part('lane', name).ge:,.0f}"))
    return rows


def tables(say: Say) -> dict[str, str]:
    views = [(real.title, load(real)) for real in REAL_VIEWS]
    small = REAL_VIEWS[0]
    small_view = load_view(small.path(folder_of_scenes()), small.number, SMALL)
    views.append((f"{small.title}, {SMALL[0]}x{SMALL[1]}", small_view))
    return {
        "cycles": table(
            ["view", "build", "bound", "cycles", "share of the bound", "skipped", "finished before", "no entry", "bank taken", "no slot", "no room"],
            [row for title, view in views for row in cycle_rows(view, title, say)],
        ),
        "feeds": table(
            ["elements a cycle", "of these to the lanes", "slots", "entries of a queue", "cycles", "share of the bound", "no entry", "no slot", "no room",
             "further setups and masks, GE"],
            feed_rows(small_view, say),
        ),
        "area": table(
            ["build", "stage, GE", "setup", "masks", "lanes", "their queues", "counters", "store, dispatch, delays, output", "one lane"], area_rows(),
        ),
    }
