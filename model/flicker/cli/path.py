"""`flicker path`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from ..errors import FlickerError, FlickerWarning, Interrupted
from ..front.path_rules import kind_of
from ..output import write_text
from ..params import Coords, Form, SortOrder
from .engine import Chosen, EngineChoice, FormatChoice, parse_engine, takes_engine
from .kept import command_line, printed
from .options import (
    BACKGROUND_HELP,
    CAMERAS_HELP,
    ORDER_HELP,
    SIZE_HELP,
    RichSteps,
    background_of,
    check_scene,
    check_there,
    console,
    parse_size,
    writable,
    writable_folder,
)
from .tables import decibels

if TYPE_CHECKING:
    from ..motion.keep import Kept
    from ..motion.record import Recording

VIDEOS = (".mp4", ".webm", ".gif", ".webp")  # flicker.motion.video
REFERENCE = "reference"
MANY = 16  # frames from which on processes beside each other pay


@takes_engine
def path(
    scene: Annotated[Path, typer.Argument(help="scene as for flicker render, or demo")],
    *,
    out: Annotated[Path, typer.Option("--out", "-o", help="video (.mp4, .webm, .gif, .webp), else a folder of pictures")],
    cameras: Annotated[Path | None, typer.Option(help=CAMERAS_HELP)] = None,
    view: Annotated[int, typer.Option(help="camera that a made motion begins at")] = 0,
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbit: x, y, z, -x, -y, -z [default: -y]")] = None,
    keyframes: Annotated[bool, typer.Option("--keyframes", help="join the cameras by splines [default: each is a frame]")] = False,
    pan: Annotated[float | None, typer.Option(help="turn on the spot to the right, pixels a frame in the middle of the picture")] = None,
    orbit: Annotated[float | None, typer.Option(help="around what is ahead, degrees of the whole path")] = None,
    dolly: Annotated[bool, typer.Option("--dolly", help="forward along the axis")] = False,
    walk: Annotated[bool, typer.Option("--walk", help="forward on level ground, with a walker's head")] = False,
    shake: Annotated[bool, typer.Option("--shake", help="a head that is never still: 6 degrees of freedom, at random")] = False,
    speed: Annotated[float | None, typer.Option(help="of --dolly and --walk, m/s [default: 1.4]")] = None,
    ahead: Annotated[float | None, typer.Option(help="metres from the first camera to what it looks at, for --dolly, --walk, --shake [default: 3]")] = None,
    seed: Annotated[int | None, typer.Option(help="of --shake [default: 1]")] = None,
    frames: Annotated[int | None, typer.Option(help="number of frames [default: all cameras; a second; a second from keyframe to keyframe]", min=1)] = None,
    fps: Annotated[float, typer.Option(help="frames a second")] = 90.0,
    size: Annotated[str | None, typer.Option(help=SIZE_HELP)] = None,
    background: Annotated[str, typer.Option(help=BACKGROUND_HELP)] = "black",
    order: Annotated[SortOrder, typer.Option(help=ORDER_HELP)] = SortOrder.DEPTH,
    chosen: Chosen,
    keep_colours: Annotated[str | None, typer.Option(
        "--keep-colours", help="show colours of frames before while no channel differs by more than this, such as 2/255; of bit-true front ends",
    )] = None,
    side_by_side: Annotated[str | None, typer.Option(
        "--side-by-side", help="reference, or options of a second configuration such as '--stage channels --cat sparse': it and the error stand beside",
    )] = None,
    amplify: Annotated[float | None, typer.Option(help="what the error beside is multiplied by; 0: no error [default: 8]", min=0)] = None,
    stats: Annotated[Path | None, typer.Option(help="figures of every frame (.csv)")] = None,
    chart: Annotated[Path | None, typer.Option(help="figures over time (.png)")] = None,
    cycles: Annotated[bool, typer.Option("--cycles", help="cycles and bytes of the chip by its models; --engine chip has its own")] = False,
    warping: Annotated[bool, typer.Option("--warping", help="warping error of Lai et al. 2018, too")] = False,
    clock: Annotated[float, typer.Option(help="of the chip, GHz: a frame of more cycles than its slot has is late")] = 1.0,
    save_cameras: Annotated[Path | None, typer.Option(help="cameras of the path with their times, as cameras.json")] = None,
    workers: Annotated[int | None, typer.Option(help=f"processes [default: number of cores, 2 at most; 1 below {MANY} frames]", min=1, max=64)] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on with the frames that are there")] = False,
) -> None:
    """Render a camera path to a video, with figures of every frame and over time."""
    kind = kind_of(
        {"pan": pan, "orbit": orbit, "dolly": dolly, "walk": walk, "shake": shake, "keyframes": keyframes, "speed": speed, "ahead": ahead, "seed": seed,
         "fps": fps, "clock": clock}, lambda option: f"--{option}",
    )
    if amplify is not None and side_by_side is None:
        raise FlickerError("--amplify: for --side-by-side only")
    if cycles and chosen.engine is EngineChoice.REFERENCE:
        raise FlickerError("--cycles: not with --engine reference, which is no machine")
    if workers is not None and chosen.engine is EngineChoice.CHIP:
        raise FlickerError("--workers: not with --engine chip, whose frames go through one simulation")
    if cycles and chosen.config.coords is Coords.ABSOLUTE:
        raise FlickerError("--cycles: not with --coords absolute, of which no chip has records")
    tolerance = None if keep_colours is None else _tolerance(keep_colours, chosen, workers, resume)
    second = None if side_by_side in (None, REFERENCE) else parse_engine(side_by_side, "--side-by-side")  # type: ignore[arg-type]
    video = out.suffix.lower() in VIDEOS
    if not video and out.suffix and not out.is_dir():
        raise FlickerError(f"--out: {out}: {out.suffix} is not one of {', '.join(VIDEOS)}, nor a folder")
    for file, option, suffix in ((stats, "--stats", ".csv"), (chart, "--chart", ".png"), (save_cameras, "--save-cameras", ".json")):
        if file is not None and file.suffix.lower() != suffix:
            raise FlickerError(f"{option}: {file}: only {suffix} is written")
        writable(file, option)
    if video:
        writable(out, "--out")
    folder = out.with_name(out.name + ".frames") if video else out
    writable_folder(folder, "--out")
    wanted_size, behind = parse_size(size), background_of(background)
    check_scene(scene)
    check_there(cameras)
    steps = RichSteps()
    with steps.step("starting"):
        from ..front.paths import Asked, path_of
        from ..motion import keep, record
        from ..motion.chart import write_chart
        from ..motion.frames import Wanted
        from ..motion.video import CODECS, ffmpeg, write_video
        from ..scene.camera import cameras_text
        from ..scene.files import scene_title
        from ..scene.sources import open_scene

        if out.suffix.lower() in CODECS:
            ffmpeg()
        drawing = chosen.drawing()
    simulator = {}
    if chosen.engine is EngineChoice.CHIP:
        from ..sim.chip import build

        with steps.step("building the chip's simulator (once per configuration)"):
            simulator = {"simulator": build(chosen.config).parent.name}  # its name is of the RTL
    with steps.step(f"loading {scene_title(scene)}"):
        source = open_scene(scene, cameras, up)
        given = {name: value for name, value in (("speed", speed), ("ahead", ahead), ("seed", seed)) if value is not None}
        along, what = path_of(source, Asked(kind, pan or orbit or 0.0, view, wanted_size, frames, fps, **given))  # type: ignore[arg-type]
    judged = stats is not None or chart is not None or warping
    wanted = Wanted(
        drawing, None if second is None else second.drawing(), judged or side_by_side == REFERENCE, judged, warping, cycles, behind, order, judged, tolerance,
    )
    beside = None if side_by_side is None else record.Beside("reference" if second is None else _short(second), 8.0 if amplify is None else amplify)
    recording = record.Recording(source.scene, source.file or str(scene), along, fps, clock * 1e9, wanted, _short(chosen), beside)
    if save_cameras is not None:
        from dataclasses import replace

        write_text(save_cameras, cameras_text([replace(camera, timestamp=n / fps) for n, camera in enumerate(along)]))
    kept = keep.Kept(folder, not video)
    settings = {
        "drawing": repr(wanted.drawing), "side-by-side": f"{wanted.beside!r} {beside!r}", "background": list(behind), "order": order.value,
        "figures": [judged, warping, cycles],
        **({} if tolerance is None else {"keep-colours": tolerance}),
        **simulator,
    }
    if said := kept.begin(keep.about(source.file or str(scene), along, fps, settings), resume):
        printed(said)
    printed(f"{source.file or scene}: {what}, {len(along)} frames of {along[0].width}x{along[0].height} at {fps:g} frames a second")
    count = workers or (1 if tolerance is not None or len(along) - len(kept.rows) < MANY else _cores())

    def finish() -> None:
        with steps.step(f"writing {out}"):
            if video:
                write_video(out, kept.pictures, fps)
            if stats is not None:
                record.write_stats(stats, kept.rows)
            if chart is not None:
                write_chart(chart, kept.rows, f"{source.name}, {what}, {recording.title}", recording.slot, fps)

    before = len(kept.rows)
    try:
        seconds = _recorded(recording, kept, count)
    except KeyboardInterrupt:
        if not kept.rows:
            kept.forget()
            raise
        finish()
        raise Interrupted(f"{len(kept.rows)} of {len(along)} frames are in {out}; to go on: {command_line('--resume')}") from None
    except FlickerError as error:
        if not kept.rows:
            kept.forget()
            raise
        raise FlickerError(f"{error}; {len(kept.rows)} frames are kept in {folder}, --resume goes on") from None
    try:
        finish()
    except FlickerError as error:
        raise FlickerError(f"{error}; {len(kept.rows)} frames are kept in {folder}, --resume writes it") from None
    kept.finish()
    _show(recording, kept.rows, out, seconds / max(len(kept.rows) - before, 1))


def _tolerance(text: str, chosen: Chosen, workers: int | None, resume: bool) -> float:
    """Of --keep-colours, a number or a share."""
    from fractions import Fraction

    drawn = chosen.engine
    try:
        value = float(Fraction(text))
    except (ValueError, ZeroDivisionError):
        value = -1.0
    if not 0.0 <= value <= 1.0:
        raise FlickerError(f"--keep-colours: {text}: not 0 to 1, such as 2/255")
    if drawn in (EngineChoice.REFERENCE, EngineChoice.RTL) or (drawn is EngineChoice.GOLDEN and (chosen.front is None or chosen.front.value != "golden")):
        raise FlickerError("--keep-colours: for --engine golden with --front golden, chip-golden and chip")
    if chosen.config.form is not Form.FACTORED or chosen.memory not in (None, FormatChoice.CHUNK):
        raise FlickerError("--keep-colours: of scenes in chunks, in records of 16 bytes")
    if chosen.whole and not chosen.config.colour_store:
        raise FlickerError("--keep-colours: the chip has no colour store")
    if workers not in (None, 1):
        raise FlickerError("--keep-colours: --workers must be 1, as every frame needs those before it")
    if resume and drawn is EngineChoice.CHIP:
        raise FlickerError("--keep-colours: no --resume with --engine chip, whose memory is gone")
    return value


def _cores() -> int:
    import os

    return min(os.cpu_count() or 1, 2)


def _short(chosen: Chosen) -> str:
    """What draws, in few words."""
    engine, config = chosen.engine.value, chosen.config
    if chosen.engine is EngineChoice.REFERENCE:
        return engine
    front = "" if chosen.front is None or chosen.front.value == "float" else f", front {chosen.front.value}"
    if config.by_lanes:
        return f"{engine}, {config.lanes} lanes{front}"
    return f"{engine}, {config.form.name.lower()}, cat {config.cat.name.lower()}, {config.precision.name.lower()}{front}"


def _recorded(recording: Recording, kept: Kept, workers: int) -> float:
    """Make the frames, with a bar; seconds that it took."""
    import time
    import warnings

    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from ..motion.record import record

    began, first = time.monotonic(), len(kept.rows)
    with Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TextColumn("frames, {task.fields[rate]}"), TimeRemainingColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("rendering (compiling on the first run)", total=len(recording.cameras), completed=first, rate="")

        def told(done: int) -> None:
            rate = (done - first) / (time.monotonic() - began)
            progress.update(task, description="rendering", completed=done, rate=f"{rate:.2f} a second")

        record(recording, kept, workers, told, lambda note: warnings.warn(FlickerWarning(note), stacklevel=2))
    return time.monotonic() - began


def _show(recording: Recording, rows: list[dict], out: Path, seconds: float) -> None:
    """What a run prints at its end."""
    from ..motion.record import mean_of, summary_of, timing_of
    from ..scene.motion import speeds

    table = Table(show_header=False)
    table.add_column(style="bold")
    table.add_column(justify="right", overflow="fold")
    table.add_row("video" if out.suffix.lower() in VIDEOS else "pictures", str(out))
    table.add_row("engine", recording.title)
    moved, turned = speeds(recording.cameras, recording.fps)
    table.add_row("fastest", f"{moved:.3g} units of the scene a second, {turned:.3g} degrees a second")
    found = summary_of(rows, recording.fps)
    if found is not None:
        table.add_row("PSNR against float64", decibels(found.psnr_db))
        if found.temporal_psnr_db is not None and found.jumps is not None:
            table.add_row("temporal PSNR", decibels(found.temporal_psnr_db))
            table.add_row("jumps", f"{found.jumps:.4%} of the pixels a frame")
            table.add_row("worst frame", f"frame {found.worst_frame}: {decibels(found.worst_frame_db)}")
            table.add_row("worst second", f"from frame {found.worst_second} on: {decibels(found.worst_second_db)}")
    for name, label, form in (("ssim", "SSIM", ".4f"), ("flip", "FLIP", ".4f"), ("warping_error", "warping error", ".3e"),
                              ("warping_error_reference", "warping error of the reference", ".3e")):
        if (value := mean_of(rows, name)) is not None:
            table.add_row(label, format(value, form))
    if (value := mean_of(rows, "kept_colours")) is not None:
        table.add_row("colours of frames before", f"{value:.1%}")
    if (value := mean_of(rows, "pops")) is not None:
        table.add_row("pops a frame", f"{value:,.1f} pairs, {mean_of(rows, 'popped') or 0.0:.4%} of the pixels")
    timing = timing_of(rows, recording.slot)
    if timing is not None:
        table.add_row("cycles a frame, p50, p99", f"{timing.p50:,.0f}, {timing.p99:,.0f}")
        table.add_row("longest frame", f"frame {timing.worst_frame}: {timing.worst:,} cycles")
        table.add_row(f"late at {recording.fps:g} Hz", f"{timing.late:.2%} of the frames, slot of {recording.slot:,.0f} cycles")
        table.add_row("memory", f"{sum(v for row in rows for k, v in row.items() if k.startswith('bytes_')) / len(rows) / 1e6:.2f} MB a frame")
    elif (value := mean_of(rows, "stage_cycles")) is not None:
        table.add_row("cycles of the rendering stage a frame", f"{value:,.0f}")
    table.add_row("time", f"{seconds:.2f} s a frame")
    console.print(table)
