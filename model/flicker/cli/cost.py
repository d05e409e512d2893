"""`flicker cost`: what a scene costs on the chip, and why."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ..chips import chip_of, chips
from ..errors import FlickerError
from ..output import json_text, write_text
from ..params import Form, RenderConfig
from ..progress import Steps
from .engine import FormatChoice
from .options import CAMERAS_HELP, SIZE_HELP, RichSteps, check_scene, check_there, console, parse_size, say, say_source, writable, write_atomically


def _picture(cost, number: int, out: Path) -> None:
    """Visits of each pixel of a view, with a scale."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    view = cost.views[number]
    figure, axis = plt.subplots(figsize=(view.camera.width / 100 + 1.5, view.camera.height / 100 + 0.6), layout="constrained")
    drawn = axis.imshow(view.visited, cmap="inferno", interpolation="nearest")
    axis.set_axis_off()
    axis.set_title(f"Gaussians visited per pixel, {view.visited.mean():.0f} on average, {view.interval:,} cycles a frame")
    figure.colorbar(drawn, ax=axis, fraction=0.03, pad=0.01)
    write_atomically(out, lambda path: figure.savefig(path, dpi=100))
    plt.close(figure)


def _show(cost, numbers: list[int]) -> None:
    table = Table(title="a frame of each view", title_justify="left")
    for name in ("view", "front end, cycles", "rendering, cycles", "frames a second", "MB", "recorded", "seen", "tile entries", "visits"):
        table.add_column(name, justify="right" if name != "view" else "left")
    for number, view in zip(numbers, cost.views):
        table.add_row(
            str(number), f"{view.cycles['front end']:,}", f"{view.cycles['rendering']:,}", f"{view.frames_per_second:,.0f}",
            f"{sum(view.bytes.values()) / 1e6:.2f}", f"{view.recorded.sum():,}", f"{(view.peak > 0).sum():,}", f"{view.tiles.sum():,}",
            f"{view.visits.sum():,}",
        )
    console.print(table)
    table = Table(title="what could be spared, a frame's mean", title_justify="left")
    for name in ("finding", "what", "Gaussians", "share", "MB", "entries", "visits"):
        table.add_column(name, justify="right" if name not in ("finding", "what") else "left")
    entries, visits = (max(sum(int(getattr(view, name).sum()) for view in cost.views) / len(cost.views), 1) for name in ("entries", "visits"))
    for f in cost.findings():
        table.add_row(
            f.name, f.what, f"{f.gaussians:,}", f"{f.gaussians / len(cost.scene.opacities):.1%}", f"{f.bytes / 1e6:.2f}", f"{f.entries / entries:.1%}",
            f"{f.visits / visits:.1%}",
        )
    console.print(table)
    table = Table(title="dearest Gaussians for what they give, a frame's mean", title_justify="left")
    for name in ("number in the file", "cycles", "sub-tile entries", "visits", "blended weight, pixels", "largest weight", "opacity", "largest scale"):
        table.add_column(name, justify="right")
    for g in cost.dearest():
        table.add_row(
            str(g["gaussian"]), f"{g['cycles']:,.0f}", f"{g['entries']:,.0f}", f"{g['visits']:,.0f}", f"{g['weight']:,.1f}", f"{g['peak']:.4f}",
            f"{g['opacity']:.3f}", f"{g['scale']:.3g}",
        )
    console.print(table)


def _show_chips(found, fps: float, clock_hz: float, best, numbers: list[int]) -> None:
    table = Table(title=f"chips for {fps:g} frames a second at {clock_hz / 1e9:g} GHz, by the slowest view", title_justify="left")
    for name in ("chip", "GE", "view", "cycles a frame", "frames a second", "", "waits for"):
        table.add_column(name, justify="left" if name in ("chip", "", "waits for") else "right")
    for rate in found:
        per_second = rate.per_second(clock_hz)
        table.add_row(
            rate.chip.name, "not synthesised" if rate.ge is None else f"{rate.ge:,.0f}", str(numbers[rate.view]), f"{rate.cycles:,}", f"{per_second:,.1f}",
            "yes" if per_second >= fps else "no", rate.waits,
        )
    console.print(table)
    console.print("by the model, which is early for small pictures on small chips, by up to 24 %", soft_wrap=True)
    if best is None:
        fastest = min(found, key=lambda rate: rate.cycles)
        console.print(f"no chip makes {fps:g} frames a second; the fastest, {fastest.chip.name}, waits for: {fastest.waits}", soft_wrap=True)
    else:
        console.print(f"smallest chip for {fps:g} frames a second: {best.chip.name}, which waits for: {best.waits}", soft_wrap=True)


def cost(
    scene: Annotated[str, typer.Argument(help="scene as for flicker render, or demo")],
    cameras: Annotated[Path | None, typer.Option(help=CAMERAS_HELP)] = None,
    view: Annotated[int | None, typer.Option(help="number of one camera [default: --views of them, evenly spread]")] = None,
    views: Annotated[int, typer.Option(help="how many cameras", min=1)] = 8,
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbit: x, y, z, -x, -y, -z [default: -y]")] = None,
    size: Annotated[str | None, typer.Option(help=SIZE_HELP)] = None,
    form: Annotated[FormatChoice | None, typer.Option("--format", help="of the scene in memory [default: chunk or as packed]")] = None,
    chip: Annotated[str | None, typer.Option(help="a chip by its name in chips.toml [default: that of the stage of channels]")] = None,
    chips_file: Annotated[Path | None, typer.Option("--chips", help="file with chips of your own for --chip, as chips.toml")] = None,
    fps: Annotated[float | None, typer.Option(help="frames a second: name the smallest chip of the table that makes them in every view")] = None,
    clock: Annotated[float, typer.Option(help="of the chip, GHz, for --fps; the memory's cycles stay those at 1 GHz")] = 1.0,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="picture: Gaussians visited per pixel of the dearest view")] = None,
    json_: Annotated[Path | None, typer.Option("--json", help="everything as JSON; -: printed, and nothing else")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="print nothing but errors")] = False,
) -> None:
    """Say what a scene costs on the chip, view by view, and which Gaussians cost more than they give."""
    printed = json_ == Path("-")
    if printed and quiet:
        raise FlickerError("--json -: not with --quiet")
    writable(out, "--out")
    writable(None if printed else json_, "--json")
    if chips_file is not None and chip is None and fps is None:
        raise FlickerError("--chips: with --chip NAME or --fps only")
    for name, value in (("--fps", fps), ("--clock", clock)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise FlickerError(f"{name}: more than 0, not {value:g}")
    if clock != 1.0 and fps is None:
        raise FlickerError("--clock: with --fps only")
    table = chips() | (chips(chips_file) if chips_file is not None else {})
    config = RenderConfig() if chip is None else chip_of(chip, chips_file).config
    if config.form is not Form.FACTORED:
        raise FlickerError(f"--chip {chip}: has records of 32 bytes; costs are counted for those of 16")
    wanted = parse_size(size)
    check_scene(scene)
    check_there(cameras)
    from ..chip.scene_cost import scene_cost
    from ..front.unseen import why_empty
    from ..front.view import view_of
    from ..scene.packed import PackedFormat
    from ..scene.sources import open_scene

    source = open_scene(scene, cameras, up)
    found = source.cameras
    numbers = [view] if view is not None else [int(k * len(found) / min(views, len(found))) for k in range(min(views, len(found)))]
    chosen = [view_of(source, n, wanted) for n in numbers]
    result = scene_cost(source.scene, [of.camera for of in chosen], form=None if form is None else PackedFormat(form.value), config=config,
                        steps=Steps() if printed or quiet else RichSteps())
    if out is not None:
        dearest = max(range(len(result.views)), key=lambda k: result.views[k].interval)
        _picture(result, dearest, out)
    everything = {"scene": scene, "chip": chip, "cameras": source.cameras_from, "numbers": numbers} | result.summary()
    if fps is not None:
        from ..chip.sizing import rates, smallest

        found_rates = rates(result.packing, [of.camera for of in chosen], table.values(), Steps() if printed or quiet else RichSteps())
        best, clock_hz = smallest(found_rates, fps, 1e9 * clock), 1e9 * clock
        everything |= {"fps": fps, "chips": [rate.summary(clock_hz) | {"view": numbers[rate.view]} for rate in found_rates],
                       "smallest_chip": best.chip.name if best else None}
    if printed:
        say(everything, True, False, Table)
    elif json_ is not None:
        write_text(json_, json_text(everything))
    if printed or quiet:
        return
    packed = result.packing.packed
    console.print(f"{scene}: {len(result.scene):,} Gaussians, {packed.format.value}, {len(packed.table):,} clusters; chip {chip or ''}".rstrip()
                  + " at 1 GHz, LPDDR4 of 51.2 GB/s")
    say_source(source.file, source.cameras_from)
    for of, found_of in zip(chosen, result.views):
        if not found_of.recorded.any() and (nothing := why_empty(of)):
            console.print(f"view {of.number}: {nothing}", highlight=False, soft_wrap=True)
    _show(result, numbers)
    if fps is not None:
        _show_chips(found_rates, fps, clock_hz, best, numbers)
    if out is not None:
        console.print(f"view {numbers[dearest]}: {out}")
