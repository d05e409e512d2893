"""`flicker pack`: scenes into memory images, and what is in one."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from ..errors import FlickerError, FlickerWarning
from .options import RichSteps, check_apart, check_scene, console, writable, write_atomically

if TYPE_CHECKING:
    import numpy as np

    from ..budget.sh_bits import Choice
    from ..scene.gaussians import Scene
    from ..scene.packed import PackedScene
    from ..scene.packing import Packing, Recipe

FormatChoice = Enum("FormatChoice", {"CHUNK": "chunk", "FP16_LOCAL": "fp16-local", "FP16": "fp16"}, type=str)


DECIBELS = 50.0


def _recipe(sh_bits: str | None, decibels: float | None, path: Path, steps: RichSteps, told: list[Choice]) -> Recipe:
    """What the options say. told: takes what `auto` chooses."""
    from ..scene.packed import FULL_SH_BITS, SH_BITS
    from ..scene.packing import Recipe

    if decibels is not None and sh_bits != "auto":
        raise FlickerError("--db: of --sh-bits auto alone")
    if sh_bits is None:
        return Recipe()
    if sh_bits != "auto":
        if sh_bits not in map(str, SH_BITS):
            raise FlickerError(f"--sh-bits: {', '.join(map(str, SH_BITS[:-1]))}, {FULL_SH_BITS} or auto, not {sh_bits}")
        return Recipe(sh_bits=int(sh_bits))
    if decibels is not None and not 20.0 <= decibels <= 120.0:
        raise FlickerError(f"--db: 20 to 120, not {decibels:g}")

    def bits(scene: Scene, start: np.ndarray) -> np.ndarray:
        from ..budget.sh_bits import choose
        from ..scene.steps import scene_views

        told.append(choose(scene, start, scene_views(scene, path), DECIBELS if decibels is None else decibels, steps))
        return told[-1].bits

    return Recipe(sh_bits=bits)


def _contents(packed: PackedScene, title: str) -> Table:
    """Where the bytes are, and what is in the clusters."""
    import numpy as np

    from ..scene.packed import FULL_SH_BITS, HEADER_BYTES

    table = Table(show_header=False, title=title)
    table.add_column(style="bold")
    table.add_column(justify="right")
    table.add_column(justify="right")
    sizes = {"image header": HEADER_BYTES, **{name: len(part) for name, part in packed.sections().items()}}
    names = {"table": "cluster table", "headers": "cluster headers"}
    total = sum(sizes.values())
    for name, size in sizes.items():
        table.add_row(names.get(name, name), f"{size:,} bytes", f"{size / total:.1%}")
    table.add_row("image", f"{total:,} bytes", f"{total / len(packed):.1f} a Gaussian", end_section=True)
    table.add_row("Gaussians", f"{len(packed):,}")
    unused = len(packed.geometry) - len(packed)
    table.add_row("slots", f"{len(packed.geometry):,}", f"{unused:,} unused")
    table.add_row("clusters", f"{len(packed.table):,}")
    table.add_row("Gaussians a cluster", f"{packed.counts.min()} to {packed.counts.max()}", f"{packed.counts.mean():.0f} in the mean")
    for degree, count in enumerate(np.bincount(packed.degrees).tolist()):
        if count:
            inside = int(packed.counts[packed.degrees == degree].sum())
            table.add_row(f"SH degree {degree}", f"{count:,} clusters", f"{inside:,} Gaussians")
    coded = np.where(packed.degrees > 0, packed.sh_bits, FULL_SH_BITS)
    for bits, count in enumerate(np.bincount(coded).tolist()):
        if count and bits < FULL_SH_BITS:
            table.add_row(f"SH codes of {bits} bits", f"{count:,} clusters", f"{int(packed.counts[coded == bits].sum()):,} Gaussians")
    for name, corner in (("lowest mean", packed.table["low"].min(axis=0)), ("highest mean", packed.table["high"].max(axis=0))):
        table.add_row(name, " ".join(f"{x:.4g}" for x in corner))
    table.add_row("largest deviation", f"{packed.sigma.max():.4g}")
    if packed.antialiased:
        table.add_row("antialiased", "yes")
    return table


def _measured(table: Table, packed: PackedScene, path: Path, brought: bool) -> None:
    """How coarse positions are, in the scene's own views or an orbit; warns where that is a loss to be seen. brought: the clusters are the
    file's own."""
    from ..scene.packed import decode
    from ..scene.steps import measure_steps, scene_views

    steps = measure_steps(packed, scene_views(replace(decode(packed), path=path), path))
    table.add_row("steps of positions", f"{steps.mean:.2g}, largest {steps.largest:.2g}", "units of the scene")
    table.add_row("", f"{steps.mean_px:.2g}, largest {steps.largest_px:.2g}", f"pixels, in {steps.views} views")
    if steps.coarse:
        warnings.warn(FlickerWarning(f"{path}: {steps.warning(brought)}"), stacklevel=2)


def _history(table: Table, packing: Packing) -> None:
    """What making the image did to the scene."""
    if packing.kept_chunks:
        table.add_row("chunks", "kept", "codes of the file")
    for what, counts in (("left out", packing.left_out), ("changed", packing.clamped)):
        for reason, count in counts.items():
            table.add_row(Text(reason, "yellow"), f"{count:,}", what)


def pack(
    scene: Annotated[Path, typer.Argument(help="scene as for flicker render, or demo; with --info a .flk")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="memory image (.flk)")] = None,
    form: Annotated[FormatChoice | None, typer.Option("--format", help="how Gaussians lie in memory [default: chunk]")] = None,
    info: Annotated[bool, typer.Option("--info", help="check a memory image and say what is in it")] = False,
    sh_bits: Annotated[str | None, typer.Option("--sh-bits", metavar="N|auto", help="bits of SH codes, 3 to 6 or 8; auto: by cluster [default: 8]")] = None,
    decibels: Annotated[float | None, typer.Option("--db", help="of --sh-bits auto: least PSNR of views to those with 8 bits [default: 50]")] = None,
    rechunk: Annotated[bool, typer.Option("--rechunk", help="make clusters anew of a file that brings its own: compressed .ply, .flk")] = False,
) -> None:
    """Pack a scene into the image that the chip's memory holds."""
    steps = RichSteps()
    if info:
        for name, value in (("--out", out), ("--format", form), ("--sh-bits", sh_bits), ("--db", decibels), ("--rechunk", rechunk or None)):
            if value is not None:
                raise FlickerError(f"--info: reads an image, so it cannot be combined with {name}")
        from ..scene.packed import load_packed

        with steps.step(f"checking {scene.name}"):
            found = load_packed(scene)
            table = _contents(found, f"{scene.name}, {found.format.value}")
            _measured(table, found, scene, True)
        console.print(table)
        return
    if out is None:
        raise FlickerError("--out: name the image to write, such as -o scene.flk")
    if out.suffix.lower() != ".flk":
        raise FlickerError(f"--out: {out}: only .flk is written")
    writable(out, "--out")
    check_apart(out, "--out", scene)
    check_scene(scene)
    with steps.step("starting"):
        from ..scene.files import scene_title
        from ..scene.packed import PackedFormat
        from ..scene.packing import pack as pack_scene
        from ..scene.packing import pack_file
        from ..scene.sources import DEMO, read_scene, scene_path
    chosen, file = PackedFormat(form.value if form else "chunk"), scene_path(scene)
    if sh_bits is not None and chosen is not PackedFormat.CHUNK:
        raise FlickerError(f"--sh-bits: of --format chunk alone, not {chosen.value}")
    told: list[Choice] = []
    recipe = _recipe(sh_bits, decibels, Path(file), steps, told)
    if str(scene) == DEMO:
        with steps.step("making the demo scene"):
            made = read_scene(scene)
        packing, title = pack_scene(made, chosen, recipe, steps), DEMO
    else:
        packing, title = pack_file(file, chosen, recipe, steps, rechunk), str(file) if file is not scene else scene_title(scene)
    with steps.step(f"writing {out.name}"):
        image = packing.packed.image()
        write_atomically(out, lambda path: path.write_bytes(image))
    table = _contents(packing.packed, f"{title} in {out.name}, {chosen.value}")
    with steps.step("measuring"):
        _measured(table, packing.packed, Path(file), packing.brought)
    for choice in told:
        table.add_row("SH codes", "equal" if math.isinf(choice.decibels) else f"{choice.decibels:.1f} dB", f"to 8 bits, in {choice.views} views")
    _history(table, packing)
    console.print(table)
