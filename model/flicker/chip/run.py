"""A view on the whole chip, verilated or its bit-true model: the picture of its frame buffer, and what the frame cost (docs/reference/chip.md)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import params
from ..chip_counters import FRONT, RENDERING
from ..errors import FlickerError
from ..front.view import View
from ..golden.chip import render_chip
from ..golden.front.frame import OUTCOMES, Outcome
from ..golden.front.record import RecordKind
from ..golden.lanes.render import LaneFrame
from ..params import CHANNELS, CORES, Coords, RenderConfig
from ..pipeline import Engine, Front, FrontOptions, Rendered, basic_stats, bit_true_front, compared, golden_lists, lane_lists, lane_stats, packed_for_picture
from ..progress import Steps
from ..scene.camera import Camera
from ..sim.chip import ChipFrame, ChipSession, build
from ..sim.half import MemoryOptions
from .constants import CLOCK_HZ
from .dram import DramConfig

SCENE = ("table", "headers", "geometry", "colour")  # what the front end reads


def frame_image(buffer: np.ndarray, camera: Camera) -> np.ndarray:
    """float64 (H, W, 3) of an RGB8 frame buffer."""
    return buffer[: camera.height, : 3 * camera.width].reshape(camera.height, camera.width, 3) / 255.0


def render_on_chip(
    view: View, engine: Engine, *, config: RenderConfig = RenderConfig(), options: FrontOptions | None = None, dram: DramConfig | None = None,
    compare: bool = False, steps: Steps | None = None,
) -> Rendered:
    """Render a view with an engine of the whole chip (`Engine.whole`); dram: of `Engine.CHIP`; other arguments as of `pipeline.render_view`."""
    steps = steps or Steps()
    image, more = _picture(view, engine, config, options or FrontOptions(), dram or DramConfig(), steps)
    stats = basic_stats(view, engine, Front.RTL if engine is Engine.CHIP else Front.GOLDEN, config) | more
    if compare:
        stats |= compared(view, image, steps)
    return Rendered(image, stats)


def _picture(
    view: View, engine: Engine, config: RenderConfig, options: FrontOptions, dram: DramConfig, steps: Steps,
) -> tuple[np.ndarray, dict[str, Any]]:
    """The frame buffer's picture and the statistics of the chip, or of its bit-true model."""
    if config.coords is Coords.ABSOLUTE:
        raise FlickerError(f"coords absolute: not for --engine {engine.value}; records hold means in 1/128 pixel")
    camera = view.camera
    red, green, blue = (round(255 * float(v)) for v in view.background)
    if engine is Engine.CHIP_GOLDEN:
        front, packing = bit_true_front(view, config, Front.GOLDEN, options, steps)
        lists, stats = lane_lists(front, steps) if config.by_lanes else golden_lists(front, steps)
        longest, most = int(np.bincount(front.entry_tile, minlength=1).max()), config.chip_memories.longest_list
        if longest > most:
            raise FlickerError(f"a tile's list has {longest:,} entries, the chip sorts up to {most:,}: its frame ends with an error (list_read)")
        with steps.step("rendering with the chip's golden model"):
            golden = render_chip(lists, config, background=(red, green, blue))
        stats |= packing | {"tile_pairs": lists.tile_pairs, "subtile_pairs": len(lists.entry)}
        if isinstance(golden.frame, LaneFrame):
            stats |= lane_stats(golden.frame, config)
        else:
            sent = golden.frame.total("minitiles_sent")
            stats |= {"minitiles_sent": sent, "pixel_pairs": 16 * sent}
        return frame_image(golden.buffer, camera), stats
    with steps.step("packing the scene"):
        packed, packing = packed_for_picture(view, options)
    with steps.step("building the chip's simulator (once per configuration)"):
        build(config)
    with steps.bar("simulating the chip") as report, ChipSession(packed, config, memory=MemoryOptions(dram.timing)) as chip:
        began = time.process_time()
        frame = chip.render(camera, background=(red, green, blue), lists=options.lists, order=view.order, progress=report)
        seconds = time.process_time() - began
        stats = packing | chip_stats(chip, frame, config, dram) | {"simulated_cycles_per_second": round(chip.usage().live["cycles"] / seconds)}
    return frame_image(frame.buffer, camera), stats


# Stalls that are sums over several units.
SUMMED = {
    **{counter.stall: f"{counter.units} {counter.unit}" for counter in (*FRONT, *RENDERING) if counter.units > 1},
    **dict.fromkeys(("contribution test", "no records for the contribution test"), f"{CORES} cores"),
    "feature FIFO full": f"{CORES * CHANNELS} channels",
    **dict.fromkeys(("no records for the lanes", "no slot in the lanes' store", "no room in a lane's queue"), f"{CORES} cores"),
}


def stall_shares(stalls: Mapping[str, int], cycles: int, config: RenderConfig = RenderConfig()) -> dict[str, float]:
    """Stalls as shares of the cycles of a frame, of all the units that wait, as many as the chip has."""
    built = {"cores": config.cores, "lanes": config.preproc_lanes, "list writers": config.list_writers, "sorting units": config.sort_units}

    def units(cause: str) -> int:
        number, _, unit = SUMMED.get(cause, "1 unit").partition(" ")
        return built.get(unit, int(number))

    return {cause: count / (cycles * units(cause)) for cause, count in stalls.items()}


def counted(frame: ChipFrame, config: RenderConfig) -> dict[str, int]:
    """What a frame of the chip listed: splats that are seen, entries of tiles, records that its cores took."""
    return {
        "visible": int(np.sum(frame.front["survivors"]) - np.sum(frame.front["unlisted"])), "list_entries": int(np.sum(frame.front["entries"])),
        "subtile_pairs": int(frame.stage[:, params.STAGES[config.stage].counters.index("gaussians_in")].sum()),
    }


def chip_stats(chip: ChipSession, frame: ChipFrame, config: RenderConfig, dram: DramConfig) -> dict[str, Any]:
    """Of a frame of `ChipSession.render`: cycles by phase, bytes by purpose, stalls by cause, how busy each part was and which one held the frame up.

    dram: the memory of the session.
    """
    assert frame.usage is not None
    front, rendering, live = frame.front, frame.rendering, frame.usage.live
    count = lambda name: int(np.sum(front[name]))  # noqa: E731
    phases = frame.phases
    core = {name: frame.stage[:, k] for k, name in enumerate(params.STAGES[config.stage].counters)}
    stage = (_lane_chip_stats if config.by_lanes else _channel_chip_stats)(core, config, phases["rendering"])
    traffic = {name: moved for name, moved in frame.usage.traffic.items() if any(moved)}
    cycles = frame.cycles
    efficiency = sum(map(sum, traffic.values())) * CLOCK_HZ / (cycles * dram.bytes_per_second)
    # Bytes of each half: the front end reads the scene, writes records and lists; rendering reads these (pointers that the front end reads back
    # are counted there too) and writes the frame.
    first = sum(read for name, (read, _) in traffic.items() if name in SCENE) + sum(written for name, (_, written) in traffic.items() if name != "frame")
    moved = {"front end": first, "rendering": sum(map(sum, traffic.values())) - first}
    peak = {name: moved[name] * CLOCK_HZ / (phases[name] * dram.bytes_per_second) for name in phases}
    tested = chip.scene.gaussians - count("culled_gaussians")
    # Entries of all sorting units, and lines of those that they do not hold and sort a second time: of the one with most the same share.
    given = int(np.sum(rendering["entries"]))
    # Share of the cycles in which each part does what it is there for: a Gaussian in `preproc_interval` cycles each lane, entries of list writers or sorting
    # units one a cycle each, in delivery two.
    busy = {
        "front end": {
            "lanes": config.preproc_interval * tested / (config.preproc_lanes * phases["front end"]),
            "list writers": int(np.max(front["entries"])) / phases["front end"],
            "memory port": (live["table_beats"] + live["geometry_beats"] + live["colour_beats"]) / phases["front end"], "DRAM": peak["front end"],
        },
        "rendering": {
            "sorting units": int(np.max(rendering["entries"])) * (1.0 + int(rendering["sorted_again"]) / max(given, 1)) / phases["rendering"],
            "delivery": given / (2 * phases["rendering"]), "record cache's port": int(rendering["lines"]) / phases["rendering"],
            "DRAM": peak["rendering"],
            **stage.pop("busy"),
        },
    }
    stalls = {
        **stage.pop("stalls"),
        **{c.stall: int(counts[c.name]) for counters, counts in ((FRONT, front), (RENDERING, rendering)) for c in counters if c.stall},
        **{f"{name.removesuffix('_waits')}, at the port": count for name, count in live.items() if "waits" in name},
    }
    longest = max(phases, key=lambda name: phases[name])
    part = max(busy[longest], key=lambda name: busy[longest][name])
    return {
        **counted(frame, config), "memories": config.memories, "sort_units": config.sort_units, "list_writers": config.list_writers,
        "preproc_lanes": config.preproc_lanes, "preproc_interval": config.preproc_interval, "format": chip.packed.format.value,
        "records": RecordKind.of(config.form).value,
        "clusters": chip.scene.clusters, "clusters_kept": chip.scene.clusters - count("culled_clusters"),
        "outcomes": {
            OUTCOMES[Outcome.CULLED]: count("culled_gaussians"), OUTCOMES[Outcome.NEAR]: count("too_near"), OUTCOMES[Outcome.OUTSIDE]: count("outside"),
            OUTCOMES[Outcome.FAINT]: count("faint"), OUTCOMES[Outcome.MISSED]: count("unlisted") - count("faint"),
            OUTCOMES[Outcome.LISTED]: count("survivors") - count("unlisted"),
        },
        "adjusted": {text: count(name) for text, name in (("mean beyond 2^22 pixels", "saturated"), ("colour above 2 clipped", "clipped")) if count(name)},
        "cycles": cycles, "phases": phases, "refresh": dram.refresh.value, "dram_bytes": traffic, "dram_efficiency": efficiency,
        "stalls": stalls, "stall_shares": stall_shares(stalls, cycles, config),
        "busy": busy, "bottleneck": f"{longest}: {part}, busy {busy[longest][part]:.0%}",
        "counters": {"front": _plain(front), "rendering": _plain(rendering), "live": live},
        **stage,
    }


def _channel_chip_stats(core: Mapping[str, np.ndarray], config: RenderConfig, cycles: int) -> dict[str, Any]:
    """`chip_stats` of the channels. core: counters by name, int64 (cores,)."""
    channel = {
        name: np.stack([core[f"channel {c} {name}"] for c in range(CHANNELS)]) for name, _ in params.CHANNEL_COUNTERS
    }
    sent = int(channel["minitiles_sent"].sum())
    return {
        "minitiles_sent": sent, "pixel_pairs": 16 * sent, "vrus": CORES * CHANNELS * config.vrus_per_channel,
        "busy": {
            "contribution test": float(core["ctu_busy"].max() / cycles),
            "VRUs": float(channel["vru_busy"].sum(axis=0).max() / (CHANNELS * cycles)),
        },
        "stalls": {
            "contribution test": int(core["ctu_stalled"].sum()), "no records for the contribution test": int(core["ctu_idle"].sum()),
            "feature FIFO full": int(channel["fifo_full"].sum()),
        },
    }


def _lane_chip_stats(core: Mapping[str, np.ndarray], config: RenderConfig, cycles: int) -> dict[str, Any]:
    """`chip_stats` of the lanes."""
    count = {name: int(values.sum()) for name, values in core.items()}
    return {
        "pixel_pairs": count["visits"], "pairs_blended": count["blended"], "pixels_finished": count["pixels_finished"],
        "lanes": {"lanes": config.lanes, "visited": count["visits"], "skipped": count["skipped"], "blended": count["blended"]},
        "busy": {"lanes": float(core["visits"].max() * config.cores / (config.lanes * cycles))},
        "stalls": {
            "no records for the lanes": count["idle"], "no slot in the lanes' store": count["no_slot"], "no room in a lane's queue": count["no_room"],
        },
    }


def _plain(counters: Mapping[str, int | np.ndarray]) -> dict[str, int | list[int]]:
    return {name: [int(v) for v in value] if isinstance(value, np.ndarray) else value for name, value in counters.items()}
