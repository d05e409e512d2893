"""`flicker fit`: a scene from posed photographs."""

from __future__ import annotations

import shlex
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from ..errors import FlickerError
from .kept import Checkpoint, checkpoint_path, measuring, printed
from .options import RichSteps, check_apart, console, writable, write_atomically

if TYPE_CHECKING:
    from ..fit.shot import Shot


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


def _copy(shots: Sequence[Shot], folder: Path, background: tuple[float, float, float]) -> None:
    """The photographs by the names of their cameras: without their lenses, as they were turned, else as they are."""
    from ..scene.image import save_png

    for shot in shots:
        path = folder / str(shot.camera.img_name)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FlickerError(f"{path.parent}: cannot be written ({error.strerror})") from None
        if not shot.changed:
            write_atomically(path, lambda to: shutil.copyfile(shot.path, to))
        else:
            write_atomically(path, lambda to: save_png(to, shot.load(background)))


def fit(
    dataset: Annotated[Path, typer.Argument(help="folder with transforms.json, transforms_train.json, or a COLMAP model and images/; or a transforms.json")],
    out: Annotated[Path, typer.Option("--out", "-o", help="scene, .ply; cameras.json of the test photographs goes beside it")],
    scene: Annotated[Path | None, typer.Option("--from", help="scene of these photographs to fine-tune, as in the last third of a fit")] = None,
    begin: Annotated[float | None, typer.Option(help="of --from: share of a fit whose learning rates are passed; default: 2/3", min=0.0, max=1.0)] = None,
    longer: Annotated[float | None, typer.Option(
        help="steps longer than the INRIA code's by this factor, twice as much those of sizes and colours; default: by --iterations; with --from: its own",
        min=0.01, max=100.0,
    )] = None,
    through: Annotated[str | None, typer.Option(help="draw through the contribution test of this configuration (docs/reference/configurations.md)")] = None,
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
    engine: Annotated[str, typer.Option(help="what draws: numba, or gsplat on a GPU (docs/reference/fit.md), whose bits differ from run to run")] = "numba",
    exposure: Annotated[bool, typer.Option("--exposure", help="an affine colour for each photograph")] = False,
    images: Annotated[str | None, typer.Option(help="folder of the photographs, in the data set or anywhere; default: where the data set has them")] = None,
    checkpoint: Annotated[Path | None, typer.Option(
        help="file that the state is written to every 500 iterations and at Ctrl-C; default: OUT.checkpoint.npz, which goes when all is done",
    )] = None,
    resume: Annotated[bool, typer.Option("--resume", help="continue from the checkpoint, if it is there")] = False,
) -> None:
    """Fit a scene to photographs; every eighth is held back and measured against."""
    from ..fit.dataset import load_dataset, photo_folder
    from ..fit.parameters import Parameters
    from ..fit.train import Options, Trainer
    from ..scene.camera import cameras_text
    from ..scene.files import save_ply
    from ..scene.photos import parse_background
    from ..scene.sources import read_scene

    if out.suffix.lower() != ".ply":
        raise FlickerError(f"--out: {out}: not a .ply")
    writable(out, "--out")
    check_apart(out, "--out", scene)
    place = checkpoint_path(checkpoint, out)
    if begin is not None and scene is None:
        raise FlickerError("--begin: of which scene, --from?")
    options = Options(iterations, gaussians, degree, seed, parse_background(background), exposure, scene is not None, through, least,
                      Options.begin if begin is None else begin, squared, longer, engine)
    data = load_dataset(dataset, size, images)
    text = cameras_text([shot.camera for shot in data.tests])
    cameras = _cameras_beside(out, text)
    steps = RichSteps()
    with steps.step("reading photographs"):
        given = None if scene is None else Parameters.of(read_scene(scene))
        trainer = Trainer(data, options, given)
    kept = Checkpoint(place, checkpoint is None, trainer.save, lambda: f"the state after {trainer.iteration:,} of {iterations:,} iterations")
    continued = kept.begin(resume, trainer.restore)
    sizes = sorted({(shot.camera.width, shot.camera.height) for shot in data.shots})
    size_text = " to ".join(f"{w}x{h}" for w, h in dict.fromkeys((sizes[0], sizes[-1])))
    beginning = scene or ("random places" if data.points is None else f"{len(data.points):,} points of {data.points_of}")
    console.print(f"{dataset}: {len(data.fitted)} photographs to fit, {len(data.tests)} for testing, {size_text}; starts from {beginning}")
    for note in data.notes:
        printed(note)
    if any(shot.masked for shot in data.shots):
        printed(f"{trainer.masked:.1%} of all pixels are masked: they have no part in loss, start and PSNR")
    if trainer.hidden:
        printed(f"{trainer.hidden} of {len(data.shots)} photographs are masked wholly")
    before = None if given is None else trainer.quality(given.scene())
    if data.dropped and scene is None:
        console.print(f"{data.dropped:,} points were left out: not finite")
    if continued:
        console.print(f"continues after {trainer.iteration:,} iterations")
    began, used = time.monotonic(), time.process_time()

    def told(iteration: int, count: int, decibels: float) -> None:
        console.print(f"{iteration:7,} iterations {count:9,} Gaussians {decibels:6.2f} dB on the test photographs {time.monotonic() - began:6.0f} s")

    with kept.interruptible():
        trainer.run(steps, told, kept.keep)
    seconds, processor = time.monotonic() - began, time.process_time() - used
    fitted = trainer.scene()
    if not len(fitted):
        raise FlickerError("fit: no Gaussian is left")
    write_atomically(out, lambda path: save_ply(fitted, path))
    write_atomically(cameras, lambda path: path.write_text(text))
    kept.finish()
    with measuring(out):
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
    folder = photo_folder(data.tests)
    if folder is None:
        folder = out.with_name(f"{out.stem}_photographs")
        _copy(data.tests, folder, options.background)
        printed(f"{folder}: the test photographs as they were measured against")
    elif folder.resolve() in (out.parent.resolve(), (out.parent / "images").resolve()):
        return
    masks = ", masked pixels too" if any(shot.masked for shot in data.tests) else ""
    printed(f"measures against the test photographs{masks}:\n{shlex.join(['flicker', 'report', f'{out}:all', '--photos', str(folder)])}")
