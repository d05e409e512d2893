"""`flicker convert`: a scene from any format that is read to any that is written."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from ..errors import FlickerError
from .options import RichSteps, check_apart, check_scene, console, writable, write_atomically

if TYPE_CHECKING:
    from ..scene.write import Written


def _box(text: str | None) -> tuple[float, ...] | None:
    """`x0,y0,z0,x1,y1,z1` to six numbers."""
    if text is None:
        return None
    try:
        box = tuple(float(part) for part in text.split(","))
    except ValueError:
        box = ()
    if len(box) != 6 or not all(map(math.isfinite, box)):
        raise FlickerError(f"--box: expected six numbers x0,y0,z0,x1,y1,z1, not '{text}'")
    for axis, low, high in zip("xyz", box[:3], box[3:]):
        if low > high:
            raise FlickerError(f"--box: {axis}0 = {low:g} is above {axis}1 = {high:g}")
    return box


def told(title: str, out: Path, done: Written, count: int, left_out: dict[str, int], notes: list[str]) -> Table:
    """What has been written of `count` Gaussians, and what was lost on the way: before, by reason and in words, and in the file."""
    table = Table(show_header=False, title=title)
    table.add_column(style="bold")
    table.add_column(justify="right")
    table.add_column()
    table.add_row("Gaussians", f"{done.count:,}", f"of {count:,}")
    table.add_row("file", f"{out.stat().st_size:,}", "bytes")
    for name, (largest, mean) in done.losses.items():
        table.add_row(f"{name}: change", f"{largest:.2g}", f"at most; {mean:.2g} in the mean")
    for reason, number in {**left_out, **done.left_out}.items():
        table.add_row(Text(reason, "yellow"), f"{number:,}", "left out")
    for note in (*notes, *done.notes):
        table.add_row(Text("lost", "yellow"), "", note)
    return table


def convert(
    scene: Annotated[Path, typer.Argument(help="scene as for flicker render, or demo")],
    out: Annotated[Path, typer.Argument(help="file to write: .ply, .compressed.ply, .spz, .sog, .splat, .flk")],
    box: Annotated[str | None, typer.Option(help="keep what lies in x0,y0,z0,x1,y1,z1 [default: all]")] = None,
    no_flyaways: Annotated[bool, typer.Option("--no-flyaways", help="leave out Gaussians far away from most (docs/reference/memory_image.md)")] = False,
    degree: Annotated[int, typer.Option(min=0, max=3, help="cut spherical harmonics to this degree")] = 3,
) -> None:
    """Convert a scene to another format; what is lost is measured and told."""
    wanted = _box(box)
    check_scene(scene)
    steps = RichSteps()
    with steps.step("starting"):
        from ..scene.files import scene_title
        from ..scene.sources import DEMO, read_scene
        from ..scene.write import Selection, write_scene, writer_of
    suffix = writer_of(out)
    writable(out, "OUT")
    check_apart(out, "OUT", scene)
    title = DEMO if str(scene) == DEMO else scene_title(scene)
    with steps.step(f"loading {title}"):
        loaded = read_scene(scene)
    if loaded.path not in (None, scene):
        title = str(loaded.path)  # in a trainer's folder
    chosen, left_out = Selection(wanted, not no_flyaways, degree).of(loaded)
    written: list[Written] = []
    with steps.step(f"writing {out.name}"):
        write_atomically(out, lambda path: written.append(write_scene(chosen, path, suffix)))
    done = written[0]
    cut = [f"harmonics of degree {loaded.sh_degree} are cut to {chosen.sh_degree}"] if chosen.sh_degree < loaded.sh_degree else []
    console.print(told(f"{title} in {out.name}", out, done, len(loaded) + sum(loaded.rejected.values()), loaded.rejected | left_out, cut))
