"""`flicker budget`: a scene of fewer Gaussians, bytes or cycles, with the loss stated."""

from __future__ import annotations

import time
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ..errors import FlickerError
from ..output import json_text, write_text
from .engine import FormatChoice
from .kept import Checkpoint, checkpoint_path, measuring
from .options import RichSteps, check_apart, check_scene, check_there, console, parse_size, say_source, writable, write_atomically
from .tables import decibels

ScoreChoice = Enum("ScoreChoice", {"CHANGE": "change", "WEIGHT": "weight", "PEAK": "peak"}, type=str)


def _megabytes(number: float) -> str:
    return f"{number / 1e6:.2f}"


def _show(rows, seconds: list[float | None]) -> None:
    """The table of what each step gave; seconds: None for steps before an interruption."""
    table = Table(title="what each step gave: SH coefficients a channel; dB on the held-out views; a frame", title_justify="left")
    for name in ("step", "Gaussians", "SH", "dB", "cycles", "of lanes", "MB", "packed", "s"):
        table.add_column(name, justify="right" if name != "step" else "left")
    for row, second in zip(rows, seconds):
        cost = row.cost
        table.add_row(
            row.step, f"{row.gaussians:,}", f"{row.coefficients:.2f}", decibels(row.decibels, unit=""),
            f"{cost.cycles:,.0f}" if cost else "", f"{cost.lane_cycles:,.0f}" if cost and cost.lane_cycles else "", _megabytes(cost.bytes) if cost else "",
            _megabytes(cost.image_bytes) if cost else "", "" if second is None else f"{second:,.0f}",
        )
    console.print(table)


def budget(
    scene: Annotated[str, typer.Argument(help="scene as for flicker render, or demo")],
    out: Annotated[Path, typer.Option("--out", "-o", help="scene: .ply, .compressed.ply, .spz or .flk")],
    keep: Annotated[float | None, typer.Option(help="share of the Gaussians that may stay, such as 0.4")] = None,
    db: Annotated[float | None, typer.Option(help="least mean PSNR against the full scene on held-out views; as few Gaussians as reach it")] = None,
    cycles: Annotated[float | None, typer.Option(help="of a frame, at most, as flicker cost counts them")] = None,
    mbytes: Annotated[float | None, typer.Option(help="10^6 bytes of a frame, at most, as flicker cost counts them")] = None,
    views: Annotated[Path | None, typer.Option(
        help="as --cameras of flicker render, every sixth held out (default: orbits at several distances and heights)",
    )] = None,
    count: Annotated[int | None, typer.Option(help="cameras of the orbits, every sixth held out [default: 144]", min=3)] = None,
    size: Annotated[str | None, typer.Option(
        help="WxH of the pictures that are fitted to, as --size of flicker render [default: the cameras', 480x270 of orbits]",
    )] = None,
    frame: Annotated[str, typer.Option(help="WxH of the frames whose cycles and bytes are counted, as --size of flicker render")] = "1280x720",
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbits: x, y, z, -x, -y, -z [default: -y]")] = None,
    by: Annotated[ScoreChoice, typer.Option(help="of Gaussians: change of the pictures without it, or sum or largest of alpha T")] = ScoreChoice.CHANGE,
    rounds: Annotated[int, typer.Option(help="of removal, on the way to a share, cycles or bytes", min=1, max=40)] = 4,
    steps: Annotated[int, typer.Option(help="of tuning after each round, a view each", min=0)] = 150,
    last: Annotated[int, typer.Option(help="steps of tuning at the end, at most", min=0)] = 1500,
    degrees: Annotated[float, typer.Option(help="SH coefficients go up to this share of the squared error; 0: none", min=0, max=1)] = 0.02,
    through: Annotated[str | None, typer.Option(help="configuration through whose contribution test the scene is drawn, as --through of flicker fit")] = None,
    least: Annotated[float, typer.Option(help="standard deviation in pixels of the nearest view that no Gaussian falls below", min=0.0, max=100.0)] = 0.0,
    refit: Annotated[int, typer.Option(help="steps of conjugate gradients of the least squares of colours; 0: none", min=0)] = 8,
    merge: Annotated[float, typer.Option(help="near-equal neighbours that lose at most this become one, such as 0.1; 0: none", min=0.0, max=100.0)] = 0.0,
    engine: Annotated[str, typer.Option(help="what draws the views that are tuned: numba, or gsplat on a GPU, as --engine of flicker fit")] = "numba",
    seed: Annotated[int, typer.Option(help="of everything random", min=0)] = 1,
    form: Annotated[FormatChoice, typer.Option("--format", help="in memory: of a .flk, and of the frames that are counted")] = FormatChoice["CHUNK"],
    checkpoint: Annotated[Path | None, typer.Option(help="file that the state is written to; default: OUT.checkpoint.npz, which goes when all is done")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="continue from the checkpoint, if it is there")] = False,
    json_: Annotated[Path | None, typer.Option("--json", help="what each step gave, as JSON")] = None,
) -> None:
    """Bring a scene to a budget: remove what gives least, refit colours, tune the rest, and say what it lost on held-out views."""
    given = {name: value for name, value in (("keep", keep), ("db", db), ("cycles", cycles), ("mbytes", mbytes)) if value is not None}
    if len(given) != 1:
        raise FlickerError(f"--keep, --db, --cycles, --mbytes: one is needed, not {' and '.join('--' + name for name in given) or 'none'}")
    check_scene(scene)
    check_there(views)
    with RichSteps().step("starting"):
        from ..budget.goal import Goal, Kind
        from ..budget.reduce import Options, Reducer, sound
        from ..budget.score import Score
        from ..budget.views import VIEWS, cameras_of, machine_psnr, reference_psnr
        from ..budget.write import check_suffix, save
        from ..fit.engines import engine as engine_of
        from ..fit.through import through as machine_of
        from ..scene.camera import DEFAULT_UP, camera_files
        from ..scene.files import load_scene
        from ..scene.packed import PackedFormat
        from ..scene.sources import read_scene

    (name, value), = given.items()
    goal = Goal(Kind(name), value)
    check_suffix(out)
    if through is not None:
        machine_of(through)
    engine_of(engine, through is not None)
    for path, option in ((out, "--out"), (json_, "--json")):
        writable(path, option)
    check_apart(out, "--out", Path(scene))
    place = checkpoint_path(checkpoint, out)
    if views is not None and count is not None:
        raise FlickerError(f"--count: all cameras of {views} are taken")
    counted = parse_size(frame)
    assert counted is not None
    options = Options(goal, Score(by.value), rounds, steps, last, degrees, seed, counted, PackedFormat(form.value), through, least, refit, merge, engine)
    progress = RichSteps()
    with progress.step(f"loading {scene}"):
        full = read_scene(scene)
    fitted, held = cameras_of(full, views, VIEWS if count is None else count, parse_size(size), up, seed)
    held[0].resized(*counted)
    clean, pictures, broken = sound(full, [*fitted, *held], progress)
    console.print(f"{scene}: {len(clean):,} Gaussians; {len(fitted)} views to fit, {len(held)} held out, {fitted[0].width}x{fitted[0].height}")
    cameras_from = f"orbits, up {up or DEFAULT_UP}" if views is None else str(camera_files(views)[0])
    say_source(full.path or scene, cameras_from)
    bad = sum(full.rejected.values()) + broken
    if bad:
        console.print(f"{bad:,} Gaussians were left out: numbers that are not finite, or make no sense")
    reducer = Reducer(clean, fitted, held, pictures, options)
    kept = Checkpoint(place, checkpoint is None, reducer.save, lambda: f"the state after {len(reducer.rows)} steps of the table, {reducer.phase.value} next")
    if kept.begin(resume, reducer.restore):
        console.print(f"continues after {len(reducer.rows)} steps of the table")
    began = time.monotonic()
    seconds: list[float | None] = [None] * len(reducer.rows)

    def told(row) -> None:
        seconds.append(time.monotonic() - began)
        console.print(f"{row.step:20} {row.gaussians:9,} Gaussians {decibels(row.decibels):>9} on the held-out views {seconds[-1]:6.0f} s")

    with kept.interruptible():
        reducer.run(progress, told, kept.keep)
    found = reducer.scene()
    if not len(found):
        raise FlickerError("budget: no Gaussian is left")
    write_atomically(out, lambda path: save(found, out, path, options.form, progress))
    kept.finish()
    written = load_scene(out)
    with measuring(out):
        lost = reference_psnr(clean, written, held, progress)
        at_frame = reference_psnr(clean, written, [camera.resized(*counted) for camera in held], progress)
        drawn = None if reducer.machine is None else [machine_psnr(of, held, reducer.wanted_held, reducer.machine, progress) for of in (clean, written)]
    _show(reducer.rows, seconds)
    table = Table(show_header=False)
    table.add_column(style="bold")
    table.add_column(justify="right")
    table.add_row("scene", str(out))
    table.add_row("Gaussians", f"{len(found):,}, {len(found) / len(full):.1%}")
    if removed := reducer.removed + len(reducer.parameters) - len(found):
        table.add_row("taken out, not finite", f"{removed:,}")
    table.add_row("PSNR of the file on the held-out views, mean", decibels(sum(lost) / len(lost)))
    table.add_row("  worst view", decibels(min(lost)))
    table.add_row(f"  at {counted[0]}x{counted[1]}, mean", decibels(sum(at_frame) / len(at_frame)))
    if drawn is not None:
        table.add_row(f"as {through} draws it, mean", f"{decibels(sum(drawn[1]) / len(held))}, the full scene {decibels(sum(drawn[0]) / len(held))}")
    table.add_row("bytes", f"{out.stat().st_size:,}")
    console.print(table)
    if json_ is not None:
        text = json_text({
            "scene": scene, "cameras": cameras_from, "goal": {goal.kind.value: goal.value},
            "gaussians": [len(full), len(found)], "left_out": bad, "taken_out": removed,
            "held_out_db": lost, "held_out_db_at_frame": at_frame, "through": through, "drawn_db": drawn and {"full": drawn[0], "scene": drawn[1]},
            "steps": [asdict(row) | {"decibels": row.decibels if row.decibels < 200 else None} for row in reducer.rows],
        })
        write_text(json_, text)
