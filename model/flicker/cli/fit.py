"""`flicker fit`: a scene from posed photographs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ..errors import FlickerError
from .options import RichSteps, console, writable, write_atomically


def _cameras_beside(out: Path, text: str) -> Path:
    """Where the cameras of the test photographs go; FlickerError where other cameras are in the way."""
    path = out.parent / "cameras.json"
    writable(path, "--out")
    try:
        if path.exists() and path.read_text() != text:
            raise FlickerError(f"{path}: holds other cameras than those of the test photographs, which go there: choose another folder for --out")
    except (OSError, ValueError):
        raise FlickerError(f"{path}: cannot be read") from None
    return path


def fit(
    dataset: Annotated[Path, typer.Argument(help="folder with transforms.json, or with sparse/0 and images/ of COLMAP; or a transforms.json")],
    out: Annotated[Path, typer.Option("--out", "-o", help="scene, .ply; cameras.json of the test photographs goes beside it")],
    scene: Annotated[Path | None, typer.Option("--from", help="scene of these photographs to fine-tune, as in the last third of a fit")] = None,
    begin: Annotated[float | None, typer.Option(help="of --from: share of a fit whose learning rates are passed; default: 2/3", min=0.0, max=1.0)] = None,
    longer: Annotated[float | None, typer.Option(
        help="steps longer than the INRIA code's by this factor, twice as much those of sizes and colours; default: by --iterations; with --from: its own",
        min=0.01, max=100.0,
    )] = None,
    through: Annotated[str | None, typer.Option(help="configuration whose contribution test the pictures are drawn with (docs/configurations.md)")] = None,
    least: Annotated[float, typer.Option(help="standard deviation in pixels of the nearest photograph that no Gaussian falls below", min=0.0, max=100.0)] = 0.0,
    squared: Annotated[float | None, typer.Option(
        help="share of the iterations, at the end, in which squared errors are minimised; default: 1/2; with --from: 0", min=0.0, max=1.0,
    )] = None,
    iterations: Annotated[int, typer.Option(help="photographs looked at, one a step", min=1)] = 4000,
    size: Annotated[int, typer.Option(help="longer side of the pictures in pixels; larger ones are averaged, none is enlarged", min=16)] = 640,
    gaussians: Annotated[int, typer.Option(help="at most so many; of --from, as many as it has", min=4)] = 100_000,
    degree: Annotated[int, typer.Option(help="of the spherical harmonics; of --from, its own", min=0, max=3)] = 2,
    seed: Annotated[int, typer.Option(help="of everything random", min=0)] = 1,
    background: Annotated[str, typer.Option(help="black, white or r,g,b: behind the scene, and behind what is transparent in the pictures")] = "black",
    engine: Annotated[str, typer.Option(help="what draws the pictures: numba, or gsplat on a GPU (docs/fit.md), whose bits differ from run to run")] = "numba",
    exposure: Annotated[bool, typer.Option("--exposure", help="an affine colour for each photograph")] = False,
    checkpoint: Annotated[Path | None, typer.Option(help="file that the state is written to every 500 iterations, .npz")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="continue from the checkpoint, if it is there")] = False,
) -> None:
    """Fit a scene to photographs; every eighth is held back and measured against."""
    from ..fit.dataset import load_dataset
    from ..fit.parameters import Parameters
    from ..fit.train import Options, Trainer
    from ..scene import load_scene
    from ..scene.camera import cameras_text
    from ..scene.files import save_ply
    from ..scene.photos import parse_background

    if out.suffix.lower() != ".ply":
        raise FlickerError(f"--out: {out}: not a .ply")
    writable(out, "--out")
    writable(checkpoint, "--checkpoint")
    if resume and checkpoint is None:
        raise FlickerError("--resume: from which --checkpoint?")
    if begin is not None and scene is None:
        raise FlickerError("--begin: of which scene, --from?")
    options = Options(iterations, gaussians, degree, seed, parse_background(background), exposure, scene is not None, through, least,
                      Options.begin if begin is None else begin, squared, longer, engine)
    data = load_dataset(dataset, size)
    text = cameras_text([shot.camera for shot in data.tests])
    cameras = _cameras_beside(out, text)
    steps = RichSteps()
    with steps.step("reading photographs"):
        given = None if scene is None else Parameters.of(load_scene(scene))
        trainer = Trainer(data, options, given)
    if checkpoint is not None and resume and checkpoint.exists():
        trainer.restore(checkpoint)
    shot = data.tests[0].camera
    beginning = scene or ("random places" if data.points is None else f"{len(data.points):,} points of COLMAP")
    console.print(f"{dataset}: {len(data.fitted)} photographs to fit, {len(data.tests)} for testing, {shot.width}x{shot.height}; starts from {beginning}")
    before = None if given is None else trainer.quality(given.scene())
    if data.dropped and scene is None:
        console.print(f"{data.dropped:,} points were left out: not finite")
    if trainer.iteration:
        console.print(f"continues after {trainer.iteration:,} iterations")
    began, used = time.monotonic(), time.process_time()

    def told(iteration: int, count: int, decibels: float) -> None:
        console.print(f"{iteration:7,} iterations {count:9,} Gaussians {decibels:6.2f} dB on the test photographs {time.monotonic() - began:6.0f} s")

    trainer.run(steps, told, None if checkpoint is None else lambda: write_atomically(checkpoint, trainer.save))
    seconds, processor = time.monotonic() - began, time.process_time() - used
    fitted = trainer.scene()
    if not len(fitted):
        raise FlickerError("fit: no Gaussian is left")
    write_atomically(out, lambda path: save_ply(fitted, path))
    write_atomically(cameras, lambda path: path.write_text(text))
    after = trainer.quality(fitted)
    table = Table(show_header=before is not None)
    table.add_column(style="bold")
    if before is not None:
        table.add_column("before", justify="right")
    table.add_column("after", justify="right")

    def row(title: str, now: str, then: str = "") -> None:
        table.add_row(title, *([] if before is None else [then]), now)

    row("scene", out.name, "" if scene is None else scene.name)
    row("Gaussians", f"{len(fitted):,}", f"{trainer.first:,}")
    if removed := trainer.removed + len(trainer.parameters) - len(fitted):
        row("taken out, not finite", f"{removed:,}")
    for name, title, form in (
        ("psnr", "PSNR on the test photographs", "{:.2f} dB"), ("compensated", "  after an affine colour fit of each", "{:.2f} dB"),
        ("machine", f"  as {through} draws", "{:.2f} dB"), ("ssim", "SSIM", "{:.4f}"),
    ):
        if name != "machine" or through is not None:
            row(title, form.format(getattr(after, name)), "" if before is None else form.format(getattr(before, name)))
    row("time", f"{seconds:,.0f} s, {processor:,.0f} s of processor time")
    console.print(table)
    folder = data.tests[0].path.parent
    if folder.resolve() not in (out.parent.resolve(), (out.parent / "images").resolve()):
        console.print(f"flicker report {out}:all --photos {folder} measures against them")
