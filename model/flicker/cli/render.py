"""`flicker render` and `flicker demo`."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from ..errors import FlickerError, Interrupted
from ..output import folder_atomically, json_text, write_text
from ..params import RECOMMENDED, SortOrder
from ..progress import Steps
from .engine import Chosen, takes_engine
from .options import (
    BACKGROUND_HELP,
    CAMERAS_HELP,
    ORDER_HELP,
    SIZE_HELP,
    RichSteps,
    Within,
    background_of,
    check_scene,
    check_there,
    console,
    parse_size,
    parse_view,
    writable,
    write_atomically,
)
from .pictures import Files, check_distinct, write_pictures
from .tables import decibels

CompareChoice = Enum("CompareChoice", {"REFERENCE": "reference"}, type=str)


def _number(value) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)


def summary(stats: dict, picture: Path | None) -> Table:
    """What a run prints at its end."""
    from ..scene.files import scene_title

    table = Table(show_header=False, title=f"{scene_title(stats['scene'])}, view {stats['view']}, {stats['width']}x{stats['height']}")
    table.add_column(style="bold")
    table.add_column(justify="right", overflow="fold")  # long paths
    if picture is not None:
        table.add_row("picture", str(picture))
    table.add_row("cameras", stats["cameras"])
    engine = stats["engine"]
    if "formats" in stats:
        engine += " (lanes)"
    elif engine != "reference":
        engine += f" ({stats['form']}, {stats['precision']}, cat {stats['cat']}, FIFO {stats['fifo_depth']})"
    table.add_row("engine", engine)
    if stats.get("front") != "float":
        table.add_row("front end", f"{stats['front']} ({stats['format']}, records {stats['records']})")
    if "psnr_db" in stats:
        table.add_row("PSNR against float64", decibels(stats["psnr_db"]))
    for key, label in (("gaussians", "Gaussians"), ("visible", "visible"), ("list_entries", "list entries"), ("subtile_pairs", "sub-tile pairs"),
                       ("minitiles_sent", "mini-tiles sent"), ("front_cycles", "cycles of the front end"), ("cycles", "cycles")):
        if stats.get(key) is not None:
            table.add_row(label, _number(stats[key]))
    if "lanes" in stats:
        lanes = stats["lanes"]
        table.add_row("pixel visits", f"{_number(lanes['visited'])}, {lanes['skipped'] / max(lanes['visited'], 1):.1%} of them skipped")
        if "least_cycles" in lanes:
            table.add_row(f"cycles of {lanes['lanes']} lanes, at least", _number(lanes["least_cycles"]))
        for cause, share in lanes.get("waiting", {}).items():
            table.add_row(f"  lanes waiting: {cause}", f"{share:.1%} of their cycles")
    for key, label in (("lane_utilisation", "lanes with a pair that counts"), ("vru_utilisation", "VRU utilisation"),
                       ("ctu_utilisation", "CTU utilisation"), ("ctu_stall_rate", "CTU stall rate")):
        if key in stats:
            table.add_row(label, f"{stats[key]:.1%}")
    if "phases" in stats:
        from ..chip.run import stalled

        for name, cycles in stats["phases"].items():
            table.add_row(f"  {name}", f"{cycles:,} cycles")
        for name, (read, written) in stats["dram_bytes"].items():
            table.add_row(f"  bytes of {name}", " + ".join(f"{_number(n)} {what}" for n, what in ((read, "read"), (written, "written")) if n))
        moved = sum(map(sum, stats["dram_bytes"].values()))
        table.add_row("memory", f"{moved / 1e6:.2f} MB, {stats['dram_efficiency']:.0%} of the peak rate, refresh {stats['refresh']}")
        for cause, cycles in stats["stalls"].items():
            if cycles:
                table.add_row(f"  stalled: {cause}", stalled(cause, cycles))
        table.add_row("bottleneck", stats["bottleneck"])
    if stats.get("simulated_cycles_per_second"):
        table.add_row("simulation speed", f"{stats['simulated_cycles_per_second']:,} cycles/s")
    for reason, count in {**stats["gaussians_left_out"], **stats["adjusted"]}.items():
        table.add_row(Text(reason, "yellow"), _number(count))
    for key, label in (("alpha", "alpha"), ("depth", "depth of the float64 reference")):
        if key in stats:
            table.add_row(label, stats[key]["file"])
    if "unseen" in stats:
        for reason, count in stats["unseen"].items():
            table.add_row(Text(f"nothing is seen: {reason}", "yellow"), _number(count))
        table.add_row(Text("what may help", "yellow"), stats["advice"])
    return table


@takes_engine
def render(
    scene: Annotated[Path, typer.Argument(
        help=".ply, .spz, .sog, .zip, .glb, .gltf, .ksplat, .splat, .flk; a SOG folder or its meta.json; a trainer's output folder; demo",
    )],
    *,
    cameras: Annotated[Path | None, typer.Option(help=CAMERAS_HELP)] = None,
    view: Annotated[str, typer.Option(help="number of the camera, or all: --out and others are folders then, or names with %03d; --stats is a list")] = "0",
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbit: x, y, z, -x, -y, -z [default: -y]")] = None,
    size: Annotated[str | None, typer.Option(help=SIZE_HELP)] = None,
    background: Annotated[str, typer.Option(help=BACKGROUND_HELP)] = "black",
    order: Annotated[SortOrder, typer.Option(help=ORDER_HELP)] = SortOrder.DEPTH,
    chosen: Chosen,
    device: Annotated[str | None, typer.Option(
        help="of --engine chip: render with the driver on a device: chip (simulated), soc (a SoC in simulation), or MODULE:NAME, a Python backend of a board",
    )] = None,
    compare: Annotated[CompareChoice | None, typer.Option(help="report the PSNR against the float64 reference")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="picture (.png)")] = None,
    depth: Annotated[Path | None, typer.Option(
        help="depth of the float64 reference, whatever the engine (.png of 16 bits, its scale in --stats; 0: nothing there)",
    )] = None,
    alpha: Annotated[Path | None, typer.Option(help="what the engine's Gaussians cover of each pixel (.png of 16 bits, 65535: all); not of a chip")] = None,
    stats: Annotated[Path | None, typer.Option(help="statistics (.json)")] = None,
) -> None:
    """Render one view of a scene, or all."""
    number = parse_view(view)
    results = [Files(option, path, number is None) for option, path in (("--out", out), ("--depth", depth), ("--alpha", alpha))]
    check_distinct(results)
    writable(stats, "--stats")
    if alpha is not None and chosen.whole:
        raise FlickerError(f"--alpha: not with --engine {chosen.engine.value}, whose frame buffer has none; --engine golden has that of the same stage")
    if device is not None and chosen.engine.value != "chip":
        raise FlickerError(f"--device: for --engine chip only, not {chosen.engine.value}")
    wanted, behind = parse_size(size), background_of(background)
    check_scene(scene)
    check_there(cameras)
    steps = RichSteps()
    with steps.step("starting"):
        from ..front.unseen import advice, unseen
        from ..front.view import view_of
        from ..scene.camera import select_view
        from ..scene.files import scene_title
        from ..scene.sources import open_scene
        drawing = chosen.drawing()
    with steps.step(f"loading {scene_title(scene)}"):
        source = open_scene(scene, cameras, up)
        select_view(source.cameras, number or 0)

    def one(k: int, told: Steps) -> dict:
        """Render and write a view: its statistics."""
        loaded = view_of(source, k, wanted, behind, order=order)
        if device is None:
            result = drawing.render(loaded, compare=compare is not None, alpha=alpha is not None, steps=told)
        else:
            from ..device import render_on_device

            result = render_on_device(loaded, device, config=drawing.config, options=drawing.options, compare=compare is not None, steps=told)
        found = result.stats | {"background": list(behind)} | write_pictures(loaded, result, *(files.of(k) for files in results))
        empty = unseen(loaded, result.image, found.get("visible"))
        return found if empty is None else found | {"unseen": empty, "advice": advice(empty, source.cameras_from, len(source.cameras))}

    if number is not None:
        found = one(number, steps)
        if stats is not None:
            write_text(stats, json_text(found))
        table = summary(found, out)
        if source.file != str(scene):
            table.add_row("scene", source.file)
        console.print(table)
        return
    rows: list[dict] = []
    try:
        with steps.bar("views") as report:
            for k in range(len(source.cameras)):
                rows.append(one(k, Within(lambda share: report(k + share, len(source.cameras)))))
    finally:  # what is there is told, also when the rest is interrupted
        if stats is not None and rows:
            write_text(stats, json_text(rows))
        if 0 < len(rows) < len(source.cameras):
            console.print(f"{len(rows)} of {len(source.cameras)} views are written", highlight=False)
    console.print(_of_all(rows, source.file))
    for files in results:
        if files.path is not None:
            console.print(f"{files}: {len(rows)} views", highlight=False, soft_wrap=True)


def _of_all(rows: list[dict], scene: str) -> Table:
    """A line a view."""
    keys = [(key, label) for key, label in (
        ("visible", "visible"), ("subtile_pairs", "sub-tile pairs"), ("psnr_db", "PSNR against float64, dB"), ("cycles", "cycles"),
    ) if any(key in row for row in rows)]
    table = Table(title=f"{scene}, cameras: {rows[0]['cameras']}", title_justify="left")
    for name in ("view", "size", *(label for _, label in keys)):
        table.add_column(name, justify="right")
    for row in rows:
        cells = ["" if (value := row.get(key)) is None else f"{value:.2f}" if key == "psnr_db" else _number(value) for key, _ in keys]
        table.add_row(str(row["view"]), f"{row['width']}x{row['height']}", *cells)
    empty = [str(row["view"]) for row in rows if "unseen" in row]
    if empty:
        table.caption = f"nothing is seen in view {', '.join(empty)}: {rows[int(empty[0])]['advice']}"
    return table


def demo(
    size: Annotated[str | None, typer.Option(help="WxH [default: 640x360]")] = None,
    folder: Annotated[Path, typer.Option("--dir", help="where scene, picture and statistics go")] = Path("build/demo"),
    seed: Annotated[int, typer.Option(help="seed of the scene")] = 1,
) -> None:
    """Make the demo scene and render it on the verilated chip, beside its golden model and the reference."""
    wanted = parse_size(size)
    steps = RichSteps()
    with steps.step("starting"):
        from ..chip.run import render_on_chip
        from ..front.view import load_view
        from ..pipeline import Engine
        from ..scene.demo import write_demo
        from ..scene.image import save_png
    try:
        with folder_atomically(folder) as made:
            with steps.step(f"making the demo scene (seed {seed})"):
                scene_path, cameras_path = write_demo(made, seed)
            view = load_view(scene_path, 0, wanted, cameras_path)
            with steps.step("rendering the float64 reference (compiling on the first run)"):
                _ = view.reference
            golden = render_on_chip(view, Engine.CHIP_GOLDEN, config=RECOMMENDED, compare=True, steps=steps)
            rtl = render_on_chip(view, Engine.CHIP, config=RECOMMENDED, compare=True, steps=steps)
            if not (golden.image == rtl.image).all():
                raise FlickerError("demo: the chip's picture differs from its golden model's")
            stats = rtl.stats | {"scene": str(folder / scene_path.name)}
            write_atomically(made / "demo.png", lambda path: save_png(path, rtl.image))
            write_text(made / "stats.json", json_text(stats))
    except KeyboardInterrupt:
        raise Interrupted(f"nothing was written to {folder}; simulators that were built are kept, and the same command begins anew") from None
    table = summary(stats, folder / "demo.png")
    table.add_row("golden model", "equal, bit for bit")
    console.print(table)
