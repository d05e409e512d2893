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
from ..params import (
    CHIP_MEMORIES,
    FAITHFUL,
    LANE_COUNTS,
    MAX_FIFO_DEPTH,
    MAX_LANE_ENTRIES,
    RECOMMENDED,
    STAGES,
    CatMode,
    Coords,
    Form,
    Precision,
    RenderConfig,
)
from ..progress import Steps
from .options import (
    BACKGROUND_HELP,
    CAMERAS_HELP,
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


def _choices(enum: type) -> type[Enum]:
    """Lower-case string choices of an integer enum."""
    return Enum(enum.__name__ + "Choice", {m.name: m.name.lower() for m in enum}, type=str)  # type: ignore[return-value]


def _word(value: object) -> str:
    """A configuration's value as the command line writes it."""
    return value.name.lower() if isinstance(value, Enum) else str(value)


def _default(field: str) -> str:
    return _word(getattr(RenderConfig(), field))


def _faithful() -> str:
    words = [_word(getattr(FAITHFUL, name)) for name in ("form", "precision", "cat")]
    return f"{', '.join(words)}, FIFO {FAITHFUL.fifo_depth}"


CatChoice = _choices(CatMode)
FormChoice = _choices(Form)
PrecisionChoice = _choices(Precision)
CoordsChoice = _choices(Coords)
EngineChoice = Enum("EngineChoice", {"REFERENCE": "reference", "GOLDEN": "golden", "RTL": "rtl", "CHIP_GOLDEN": "chip-golden", "CHIP": "chip"}, type=str)
FrontChoice = Enum("FrontChoice", {"FLOAT": "float", "GOLDEN": "golden", "RTL": "rtl"}, type=str)
FormatChoice = Enum("FormatChoice", {"CHUNK": "chunk", "FP16_LOCAL": "fp16-local", "FP16": "fp16"}, type=str)
ListsChoice = Enum("ListsChoice", {"ELLIPSE": "ellipse", "BOX": "box"}, type=str)
StageChoice = Enum("StageChoice", {name.upper(): name for name in STAGES}, type=str)  # type: ignore[misc]
MemoriesChoice = Enum("MemoriesChoice", {name.upper(): name for name in CHIP_MEMORIES}, type=str)  # type: ignore[misc]
RefreshChoice = Enum("RefreshChoice", {"ALL_BANKS": "all-banks", "PER_BANK": "per-bank"}, type=str)
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


def _stage(stage: Enum | None, engine: Enum, lanes: int | None, given: dict[str, object]) -> str:
    """The stage that the options mean; raises where they contradict each other. given: options by name, None: not given."""
    of_channels = [f"--{k}" for k in ("cat", "precision", "faithful", "coords") if given[k] is not None]
    if given["form"] is FormChoice["CONIC"]:
        of_channels.append("--form conic")
    if stage is None:
        stage = StageChoice.CHANNELS if lanes is None and (of_channels or engine is EngineChoice.REFERENCE) else StageChoice(RECOMMENDED.stage)
    if stage is not StageChoice.LANES:
        if lanes is not None:
            raise FlickerError("--lanes: for --stage lanes only")
    elif engine is EngineChoice.REFERENCE:
        raise FlickerError("--stage lanes: not for --engine reference, which has no stage")
    elif of_channels:
        raise FlickerError(f"--stage lanes: takes records of 16 bytes and has no contribution test, so it cannot be combined with {', '.join(of_channels)}")
    return stage.value


def render(
    scene: Annotated[Path, typer.Argument(
        help=".ply, .spz, .sog, .zip, .glb, .gltf, .ksplat, .splat, .flk; a SOG folder or its meta.json; a trainer's output folder; demo",
    )],
    cameras: Annotated[Path | None, typer.Option(help=CAMERAS_HELP)] = None,
    view: Annotated[str, typer.Option(help="number of the camera, or all: --out and others are folders then, or names with %03d; --stats is a list")] = "0",
    up: Annotated[str | None, typer.Option(help="axis of the scene that points up, for the orbit: x, y, z, -x, -y, -z [default: -y]")] = None,
    size: Annotated[str | None, typer.Option(help=SIZE_HELP)] = None,
    background: Annotated[str, typer.Option(help=BACKGROUND_HELP)] = "black",
    engine: Annotated[EngineChoice, typer.Option(help="what renders")] = EngineChoice.GOLDEN,
    front: Annotated[FrontChoice | None, typer.Option(
        help="what makes records and lists: float64 on the host, bit-true front end, its RTL; not for the chip, which has its own [default: float]",
    )] = None,
    memory: Annotated[FormatChoice | None, typer.Option("--format", help="of the scene in memory, not for --front float [default: chunk or as packed]")] = None,
    rechunk: Annotated[bool, typer.Option("--rechunk", help="make clusters anew of a file that brings its own, not for --front float")] = False,
    lists: Annotated[ListsChoice | None, typer.Option(help="what lists a splat in a tile, not with --front float [default: ellipse]")] = None,
    stage: Annotated[StageChoice | None, typer.Option(
        help="rendering stage: VRUs in channels behind a test, or lanes in the log domain "
             f"[default: {RECOMMENDED.stage}, but channels with an option that only they have]",
    )] = None,
    lanes: Annotated[int | None, typer.Option(help=f"with --stage lanes: {', '.join(map(str, LANE_COUNTS))} [default: {_default('lanes')}]")] = None,
    cat: Annotated[CatChoice | None, typer.Option(help=f"contribution test [default: {_default('cat')}]")] = None,
    precision: Annotated[PrecisionChoice | None, typer.Option(help=f"number formats of the contribution test [default: {_default('precision')}]")] = None,
    form: Annotated[FormChoice | None, typer.Option(help=f"Gaussian weight in CTU and VRU, and of the chip's records [default: {_default('form')}]")] = None,
    fifo_depth: Annotated[int | None, typer.Option(
        help=f"feature FIFO, 1 to {MAX_FIFO_DEPTH}; queue of a lane, 2 to {MAX_LANE_ENTRIES} [default: {_default('fifo_depth')}]",
    )] = None,
    memories: Annotated[MemoriesChoice | None, typer.Option(help="of --engine chip: sizes, for speed or within the paper's 288 KB [default: default]")] = None,
    refresh: Annotated[RefreshChoice | None, typer.Option(help="of --engine chip: what the DRAM refreshes at once [default: all-banks]")] = None,
    coords: Annotated[CoordsChoice, typer.Option(help="where means are rounded to FP16")] = CoordsChoice.LOCAL,
    faithful: Annotated[bool, typer.Option("--faithful", help=f"the paper's configuration: {_faithful()}")] = False,
    compare: Annotated[CompareChoice | None, typer.Option(help="report the PSNR against the float64 reference")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="picture (.png)")] = None,
    depth: Annotated[Path | None, typer.Option(
        help="depth of the float64 reference, whatever the engine (.png of 16 bits, its scale in --stats; 0: nothing there)",
    )] = None,
    alpha: Annotated[Path | None, typer.Option(help="what the engine's Gaussians cover of each pixel (.png of 16 bits, 65535: all); not of a chip")] = None,
    stats: Annotated[Path | None, typer.Option(help="statistics (.json)")] = None,
) -> None:
    """Render one view of a scene, or all."""
    given: dict[str, object] = {"cat": cat, "precision": precision, "form": form, "fifo-depth": fifo_depth}
    chosen: dict[str, object] = {"format": memory, "lists": lists, "rechunk": rechunk or None}
    whole = engine in (EngineChoice.CHIP, EngineChoice.CHIP_GOLDEN)
    if whole and front is not None:
        raise FlickerError(f"--front {front.value}: not with --engine {engine.value}, which has its own front end")
    if engine is not EngineChoice.CHIP:
        for option, value in (("--memories", memories), ("--refresh", refresh)):
            if value is not None:
                raise FlickerError(f"{option}: for --engine chip only")
    if not whole and front in (None, FrontChoice.FLOAT):
        if names := ", ".join(f"--{k}" for k, v in chosen.items() if v is not None):
            raise FlickerError(f"{names}: for --front golden and rtl only")
    else:
        given |= {k: v for k, v in chosen.items() if k != "rechunk"}
    if faithful and any(v is not None for v in given.values()):
        names = ", ".join(f"--{k}" for k, v in given.items() if v is not None)
        raise FlickerError(f"--faithful: fixes the configuration, so it cannot be combined with {names}")
    of_stage = given | {"faithful": faithful or None, "coords": None if coords is CoordsChoice.LOCAL else coords}
    base = FAITHFUL if faithful else RenderConfig()
    config = base.with_(
        cat=CatMode[cat.name] if cat else base.cat,
        precision=Precision[precision.name] if precision else base.precision,
        form=Form[form.name] if form else base.form,
        fifo_depth=base.fifo_depth if fifo_depth is None else fifo_depth,
        coords=Coords[coords.name],
        stage=_stage(stage, engine, lanes, of_stage),
        lanes=base.lanes if lanes is None else lanes,
        memories=base.memories if memories is None else memories.value,
    )
    number = parse_view(view)
    results = [Files(option, path, number is None) for option, path in (("--out", out), ("--depth", depth), ("--alpha", alpha))]
    check_distinct(results)
    writable(stats, "--stats")
    if alpha is not None and whole:
        raise FlickerError(f"--alpha: not with --engine {engine.value}, whose frame buffer has none; --engine golden has that of the same stage")
    wanted, behind = parse_size(size), background_of(background)
    check_scene(scene)
    check_there(cameras)
    steps = RichSteps()
    with steps.step("starting"):
        from ..chip.dram import DramConfig, Refresh
        from ..chip.run import render_on_chip
        from ..front.unseen import advice, unseen
        from ..front.view import view_of
        from ..golden.front.frame import ListKind
        from ..pipeline import Engine, Front, FrontOptions, render_view
        from ..scene.camera import select_view
        from ..scene.files import scene_title
        from ..scene.packed import PackedFormat
        from ..scene.sources import open_scene
    options = FrontOptions(PackedFormat.FP16, ListKind.BOX, rechunk) if faithful else FrontOptions(
        None if memory is None else PackedFormat(memory.value), ListKind.ELLIPSE if lists is None else ListKind(lists.value), rechunk,
    )
    with steps.step(f"loading {scene_title(scene)}"):
        source = open_scene(scene, cameras, up)
        select_view(source.cameras, number or 0)

    def one(k: int, told: Steps) -> dict:
        """Render and write a view: its statistics."""
        loaded = view_of(source, k, wanted, behind)
        if whole:
            dram = DramConfig() if refresh is None else DramConfig(refresh=Refresh(refresh.value))
            result = render_on_chip(loaded, Engine(engine.value), config=config, options=options, dram=dram, compare=compare is not None, steps=told)
        else:
            result = render_view(
                loaded, engine=Engine(engine.value), config=config, front=Front((front or FrontChoice.FLOAT).value), options=options,
                compare=compare is not None, alpha=alpha is not None, steps=told,
            )
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
