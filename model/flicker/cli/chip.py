"""`flicker chip`: the model of the rest of the chip on one view of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ..errors import FlickerError
from ..output import json_text, write_text
from .options import CAMERAS_HELP, SIZE_HELP, check_scene, check_there, console, parse_size, say_source, writable
from .tables import decibels


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column(columns[0])
    for name in columns[1:]:
        table.add_column(name, justify="right")
    return table


def _show_frame(estimate) -> None:
    table = _table("stages", "stage", "phase", "cycles")
    for s in estimate.stages:
        table.add_row(s.name, s.phase, f"{s.cycles:,}")
    for phase, cycles in zip(("preprocessing", "rendering"), estimate.dram_cycles):
        table.add_row("DRAM", phase, f"{cycles:,}")
    console.print(table)
    table = _table("DRAM traffic", "purpose", "phase", "used MB", "moved MB", "bursts", "cycles alone", "efficiency")
    for p in estimate.purposes:
        table.add_row(p.name, p.phase, f"{p.used_bytes / 1e6:.2f}", f"{p.moved_bytes / 1e6:.2f}", f"{p.moved_bytes // 32:,}",
                      f"{p.dram_cycles:,}", f"{p.efficiency:.1%}")
    table.add_row("all", "", f"{sum(p.used_bytes for p in estimate.purposes) / 1e6:.2f}", f"{estimate.bytes / 1e6:.2f}",
                  f"{estimate.bytes // 32:,}", "", "")
    console.print(table)
    table = _table("on chip", "buffer", "KB")
    for name, size in estimate.on_chip.items():
        table.add_row(name, f"{size / 1024:.1f}")
    table.add_row("all", f"{sum(estimate.on_chip.values()) / 1024:.1f}")
    console.print(table)
    table = _table("counts", "what", "number")
    for name, number in estimate.counts.items():
        table.add_row(name, f"{number:,}")
    console.print(table)
    console.print(f"interval {estimate.interval_cycles:,} cycles, {estimate.fps:.0f} FPS at 1 GHz; bottleneck: {estimate.bottleneck}")
    console.print(f"latency  {estimate.latency_cycles:,} cycles, {estimate.latency_fps:.0f} FPS without overlap of frames")


def _show_built(fact: dict) -> None:
    table = _table("the chip that exists as RTL, by the models held to it", "what", "")
    for what, key in (
        ("front end, cycles", "front_cycles"), ("rendering, cycles", "render_cycles"), ("DRAM for both, cycles", "dram_cycles"),
        ("interval, cycles", "interval_cycles"), ("latency, cycles", "latency_cycles"), ("bytes", "dram_bytes"),
    ):
        table.add_row(what, f"{fact[key]:,}")
    table.add_row("bottleneck", fact["bottleneck"])
    console.print(table)


def chip(
    scene: Annotated[Path, typer.Argument(help="scene as for flicker render, or demo")],
    cameras: Annotated[Path | None, typer.Option(help=CAMERAS_HELP)] = None,
    view: Annotated[int, typer.Option(help="number of the camera")] = 0,
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbit: x, y, z, -x, -y, -z [default: -y]")] = None,
    size: Annotated[str | None, typer.Option(help=SIZE_HELP)] = None,
    config: Annotated[str, typer.Option(help="configuration of the rendering stage (flicker report --list)")] = "flicker",
    render_cycles: Annotated[int | None, typer.Option(help="cycles of the rendering stage [default: its cycle model]")] = None,
    memory: Annotated[str, typer.Option(help="parameters in DRAM: fp16, fp16-local, chunk, chunk-sh")] = "chunk",
    refresh: Annotated[str, typer.Option(help="what the DRAM refreshes at once: all-banks, per-bank, none")] = "all-banks",
    scheme: Annotated[str | None, typer.Option(help="lists and sorting [default: the recommended scheme]")] = None,
    schemes: Annotated[bool, typer.Option("--schemes", help="compare all schemes")] = False,
    formats: Annotated[bool, typer.Option("--formats", help="picture quality and bytes of the memory formats")] = False,
    keys: Annotated[bool, typer.Option("--keys", help="picture quality of short depth keys")] = False,
    constants: Annotated[bool, typer.Option("--constants", help="list the constants with their sources")] = False,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="the estimate as JSON")] = None,
) -> None:
    """Estimate a whole frame: culling, memory, lists, sorting, rendering; where the chip exists as RTL, first by the models that are held to it."""
    writable(out, "--out")
    check_scene(scene)
    check_there(cameras)
    wanted = parse_size(size)
    from ..chip.compare import FRONTS, chip_estimates, chip_stage, estimate
    from ..chip.constants import constant_table
    from ..chip.dram import DramConfig, Refresh
    from ..chip.execute import run_scheme, scheme_rows
    from ..chip.frame import ChipConfig, frame_estimate, prepare
    from ..chip.schemes import RECOMMENDED, SCHEMES
    from ..explore.configurations import get_configuration
    from ..front.unseen import why_empty
    from ..front.view import load_view
    from ..scene.memory import MemoryFormat

    scheme = scheme or RECOMMENDED
    if scheme not in SCHEMES:
        raise FlickerError(f"--scheme: '{scheme}' is not one of {', '.join(SCHEMES)}")
    if memory not in [m.value for m in MemoryFormat]:
        raise FlickerError(f"--memory: '{memory}' is not one of {', '.join(m.value for m in MemoryFormat)}")
    if refresh not in list(Refresh):
        raise FlickerError(f"--refresh: '{refresh}' is not one of {', '.join(Refresh)}")
    if render_cycles is not None and render_cycles < 0:
        raise FlickerError(f"--render-cycles: must not be negative, not {render_cycles}")
    configuration = get_configuration(config)
    loaded = load_view(scene, view, wanted, cameras, up)
    setting = ChipConfig(memory=MemoryFormat(memory), scheme=SCHEMES[scheme], dram=DramConfig(refresh=Refresh(refresh)))
    prepared = prepare(loaded, setting.cluster_size)
    if render_cycles is None:
        frame = estimate(prepared, configuration, setting)
    else:
        frame = frame_estimate(prepared, render_cycles, setting)
    say_source(loaded.scene.path or scene, loaded.cameras_from)
    if nothing := why_empty(loaded):
        console.print(nothing, highlight=False, soft_wrap=True)
    console.print(f"{scene.name}, view {view}, {loaded.camera.width}x{loaded.camera.height}, {config}, memory {memory}, refresh {refresh}, scheme {scheme}")
    built = {}
    if render_cycles is None and scheme == RECOMMENDED and memory == FRONTS[configuration.form][0] and chip_stage(configuration) is not None:
        built = chip_estimates(loaded, [config], dram=setting.dram)[config]
        _show_built(built)
        console.print("by the parametric model, which no RTL holds (docs/reference/chip_model.md)")
    _show_frame(frame)
    if schemes:
        table = _table("schemes", *scheme_rows(None)[0])
        results = [run_scheme(prepared.splats, s, prepared.needed) for s in SCHEMES.values()]
        for row in scheme_rows(results):
            table.add_row(*row)
        console.print(table)
    if formats:
        from ..chip.quality import format_quality

        table = _table("memory formats", "format", "MB", "bytes a Gaussian", "float64 dB", "golden dB")
        for q in format_quality(loaded):
            table.add_row(q.form, f"{q.scene_bytes / 1e6:.2f}", str(q.gaussian_bytes), decibels(q.reference_db, 1, ""), decibels(q.golden_db, 1, ""))
        console.print(table)
    if keys:
        from ..chip.quality import key_quality

        table = _table("depth keys", "key", "bits", "dB")
        for kind, bits, value in key_quality(prepared.view.projected, loaded.camera):
            table.add_row(kind, str(bits), decibels(value, 1, ""))
        console.print(table)
    if constants:
        table = _table("constants", "name", "value", "source")
        for name, value, source in constant_table():
            table.add_row(name, f"{value:,}", source)
        console.print(table)
    if out is not None:
        given = {"scene": str(scene), "view": view, "cameras": loaded.cameras_from, "config": config, "memory": memory, "refresh": refresh, "scheme": scheme}
        write_text(out, json_text(frame.as_dict() | given | {"rtl": built}))
