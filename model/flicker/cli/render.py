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
    say,
    writable,
    write_atomically,
)
from .pictures import Files, check_distinct, write_pictures
from .tables import bar, bytes_text, decibels

CompareChoice = Enum("CompareChoice", {"REFERENCE": "reference"}, type=str)


LEFT_OUT, ADJUSTED, UNSEEN = "left out", "adjusted", "unseen"  # sections that a reader should see
LABEL = 36  # characters of a label that is never wrapped


def _number(value) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)


def _where(stats: dict, picture: Path | None) -> list[tuple[str, str]]:
    rows = [] if picture is None else [("file", str(picture))]
    rows += [("scene", stats["file"])] if "file" in stats else []
    rows += [(key, stats[key]["file"]) for key in ("alpha", "depth") if key in stats]
    engine = stats["engine"]
    if "formats" in stats:
        engine += " (lanes)"
    elif engine != "reference":
        engine += f" ({stats['form']}, {stats['precision']}, cat {stats['cat']}, FIFO {stats['fifo_depth']})"
    rows += [("cameras", stats["cameras"]), ("engine", engine)]
    if stats.get("front") != "float":
        rows.append(("front end", f"{stats['front']} ({stats['format']}, records {stats['records']})"))
    return rows


def _work(stats: dict) -> list[tuple[str, str]]:
    rows = [(label, _number(stats[key])) for key, label in (
        ("gaussians", "Gaussians"), ("visible", "visible"), ("list_entries", "list entries"), ("subtile_pairs", "sub-tile pairs"),
        ("minitiles_sent", "mini-tiles sent"),
    ) if stats.get(key) is not None]
    if "lanes" in stats:
        lanes = stats["lanes"]
        rows.append(("pixel visits", f"{_number(lanes['visited'])}, {lanes['skipped'] / max(lanes['visited'], 1):.1%} of them skipped"))
    return rows


def _time(stats: dict) -> list[tuple[str, str]]:
    rows = []
    if stats.get("cycles") is not None:
        whole = "frames_per_second" in stats
        rows.append(("frame" if whole else "rendering stage", f"{stats['cycles']:,} cycles"))
        rows.append(("  at 1 GHz", f"{stats['milliseconds']:.3f} ms" + (f", {stats['frames_per_second']:,.0f} a second" if whole else "")))
    if stats.get("front_cycles") is not None:
        rows.append(("front end", f"{stats['front_cycles']:,} cycles"))
    rows += [(f"  {name}", f"{cycles:,} cycles") for name, cycles in stats.get("phases", {}).items()]
    if "least_cycles" in stats.get("lanes", {}):
        rows.append((f"{stats['lanes']['lanes']} lanes, at least", f"{stats['lanes']['least_cycles']:,} cycles"))
    if "bottleneck" in stats:
        rows.append(("bottleneck", stats["bottleneck"]))
    if stats.get("simulated_cycles_per_second"):
        rows.append(("simulation", f"{stats['simulated_cycles_per_second']:,} cycles a second"))
    return rows


def _busy(stats: dict) -> list[tuple[str, str]]:
    rows = [(label, bar(stats[key])) for key, label in (
        ("lane_utilisation", "lanes with a pair that counts"), ("vru_utilisation", "VRUs"), ("ctu_utilisation", "CTU"),
    ) if key in stats]
    return rows + [(f"{half}: {part}", bar(share)) for half, parts in stats.get("busy", {}).items() for part, share in parts.items()]


def _memory(stats: dict) -> list[tuple[str, str]]:
    if "dram_bytes" not in stats:
        return []
    moved = sum(map(sum, stats["dram_bytes"].values()))
    rows = [("all", f"{bytes_text(moved)}, {stats['dram_efficiency']:.0%} of the peak rate, refresh {stats['refresh']}")]
    return rows + [
        (name, ", ".join(f"{bytes_text(n)} {what}" for n, what in ((read, "read"), (written, "written")) if n))
        for name, (read, written) in stats["dram_bytes"].items()
    ]


def _waits(stats: dict, front: bool) -> list[tuple[str, str]]:
    """Shares of the cycles in which something waits, the longest first: of the front end, or of the rest."""
    shares = {cause: share for cause, share in stats.get("stall_shares", {}).items() if share}
    if not front:
        shares |= {f"lanes: {cause}": share for cause, share in stats.get("lanes", {}).get("waiting", {}).items()}
        shares |= {"CTU": stats["ctu_stall_rate"]} if "ctu_stall_rate" in stats else {}
    begun = "front end, "
    found = {cause.removeprefix(begun): share for cause, share in shares.items() if cause.startswith(begun) == front}
    return [(cause, bar(share)) for cause, share in sorted(found.items(), key=lambda entry: -entry[1])]


def summary(stats: dict, picture: Path | None) -> Table:
    """What a run prints at its end, by section; all of it is in its statistics."""
    from ..scene.files import scene_title

    table = Table(show_header=False, title=f"{scene_title(stats['scene'])}, view {stats['view']}, {stats['width']}x{stats['height']}")
    table.add_column(style="bold")
    table.add_column()
    table.add_column(overflow="fold")  # long paths
    sections: list[tuple[str, list[tuple[str, str]]]] = [
        ("picture", _where(stats, picture)),
        ("quality", [("PSNR against float64", decibels(stats["psnr_db"]))] if "psnr_db" in stats else []),
        ("work", _work(stats)), ("time", _time(stats)), ("memory", _memory(stats)), ("busy", _busy(stats)), ("waits", _waits(stats, False)),
        ("  front end", _waits(stats, True)),
        (LEFT_OUT, [(reason, _number(count)) for reason, count in stats["gaussians_left_out"].items()]),
        (ADJUSTED, [(reason, _number(count)) for reason, count in stats["adjusted"].items()]),
    ]
    if "unseen" in stats:
        nothing = [(f"nothing is seen: {reason}", _number(count)) for reason, count in stats["unseen"].items()]
        sections.append((UNSEEN, [*nothing, ("what may help", stats["advice"])]))
    for name, rows in sections:
        colour = "yellow" if name in (LEFT_OUT, ADJUSTED, UNSEEN) else ""
        for number, (label, value) in enumerate(rows):
            table.add_row("" if number else name, Text(label, colour, no_wrap=len(label) <= LABEL), value, end_section=number == len(rows) - 1)
    return table


def timed(stats: dict, whole: bool) -> dict:
    """Statistics with the time of a frame at the chip's clock; of the whole chip also frames a second."""
    if not stats.get("cycles"):
        return stats
    from ..chip.constants import CLOCK_HZ

    seconds = stats["cycles"] / CLOCK_HZ
    return stats | {"milliseconds": 1e3 * seconds} | ({"frames_per_second": 1 / seconds} if whole else {})


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
    json_: Annotated[bool, typer.Option("--json", help="print the statistics as JSON, and nothing else")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="print nothing but errors")] = False,
) -> None:
    """Render one view of a scene, or all."""
    if json_ and quiet:
        raise FlickerError("--json: not with --quiet")
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
    steps = Steps() if json_ or quiet else RichSteps()
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
        found = timed(result.stats, chosen.whole) | {"background": list(behind)} | write_pictures(loaded, result, *(files.of(k) for files in results))
        empty = unseen(loaded, result.image, found.get("visible"))
        return found if empty is None else found | {"unseen": empty, "advice": advice(empty, source.cameras_from, len(source.cameras))}

    if number is not None:
        found = one(number, steps)
        if source.file != str(scene):
            found["file"] = source.file
        if stats is not None:
            write_text(stats, json_text(found))
        say(found, json_, quiet, lambda: summary(found, out))
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
            if not (json_ or quiet):
                console.print(f"{len(rows)} of {len(source.cameras)} views are written", highlight=False)
    say(rows, json_, quiet, lambda: _of_all(rows, source.file))
    if json_ or quiet:
        return
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
            stats = timed(rtl.stats, True) | {"scene": str(folder / scene_path.name)}
            write_atomically(made / "demo.png", lambda path: save_png(path, rtl.image))
            write_text(made / "stats.json", json_text(stats))
    except KeyboardInterrupt:
        raise Interrupted(f"nothing was written to {folder}; simulators that were built are kept, and the same command begins anew") from None
    table = summary(stats, folder / "demo.png")
    table.add_row("check", "golden model", "equal, bit for bit")
    console.print(table)
