"""The options that say what draws: engine, front end, stage, configuration. One place for every command that renders.

A command takes them all with `takes_engine` in the place of a parameter `chosen`; `parse_engine` reads the same options from one text.
"""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..chips import chip_of
from ..errors import FlickerError
from ..params import (
    CHIP_MEMORIES,
    CORE_COUNTS,
    FAITHFUL,
    LANES_PER_CORE,
    MAX_FIFO_DEPTH,
    MAX_LANE_ENTRIES,
    PORT_WIDTHS,
    RECOMMENDED,
    STAGES,
    UNIT_COUNTS,
    CatMode,
    Coords,
    Form,
    Precision,
    RenderConfig,
)

if TYPE_CHECKING:
    from ..chip.drawing import Drawing


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


UNITS = ", ".join(map(str, UNIT_COUNTS))
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


@dataclass(frozen=True)
class Chosen:
    """What the options mean, before anything heavy is imported; values of options as they are given, None: not given."""

    engine: EngineChoice
    config: RenderConfig
    front: FrontChoice | None = None
    memory: FormatChoice | None = None
    lists: ListsChoice | None = None
    rechunk: bool = False
    refresh: RefreshChoice | None = None
    faithful: bool = False

    @property
    def whole(self) -> bool:
        """The engine is a whole chip."""
        return self.engine in (EngineChoice.CHIP, EngineChoice.CHIP_GOLDEN)

    def drawing(self) -> Drawing:
        """What renders a view so. Imports the engines."""
        from ..chip.dram import DramConfig, Refresh
        from ..chip.drawing import Drawing
        from ..golden.front.frame import ListKind
        from ..pipeline import Engine, Front, FrontOptions
        from ..scene.packed import PackedFormat

        options = FrontOptions(PackedFormat.FP16, ListKind.BOX, self.rechunk) if self.faithful else FrontOptions(
            None if self.memory is None else PackedFormat(self.memory.value), ListKind.ELLIPSE if self.lists is None else ListKind(self.lists.value),
            self.rechunk,
        )
        dram = DramConfig() if self.refresh is None else DramConfig(refresh=Refresh(self.refresh.value))
        return Drawing(Engine(self.engine.value), self.config, Front((self.front or FrontChoice.FLOAT).value), options, dram)


def _stage(stage: Enum | None, engine: Enum, sizes: dict[str, int | None], given: dict[str, object]) -> str:
    """The stage that the options mean; raises where they contradict each other. sizes: options of the lanes by name, given: others; None: not given."""
    of_lanes = [f"--{name}" for name, value in sizes.items() if value is not None]
    of_channels = [f"--{k}" for k in ("cat", "precision", "faithful", "coords") if given[k] is not None]
    if given["form"] is FormChoice["CONIC"]:
        of_channels.append("--form conic")
    if stage is None:
        stage = StageChoice.CHANNELS if not of_lanes and (of_channels or engine is EngineChoice.REFERENCE) else StageChoice(RECOMMENDED.stage)
    if stage is not StageChoice.LANES:
        if of_lanes:
            raise FlickerError(f"{', '.join(of_lanes)}: for --stage lanes only")
    elif engine is EngineChoice.REFERENCE:
        raise FlickerError("--stage lanes: not for --engine reference, which has no stage")
    elif of_channels:
        raise FlickerError(f"--stage lanes: takes records of 16 bytes and has no contribution test, so it cannot be combined with {', '.join(of_channels)}")
    return stage.value


def engine_options(
    engine: Annotated[EngineChoice, typer.Option(
        help="what renders: float64; rendering stage, bit-true or verilated; whole chip, bit-true or verilated",
    )] = EngineChoice.GOLDEN,
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
    cores: Annotated[int | None, typer.Option(help=f"with --stage lanes: {', '.join(map(str, CORE_COUNTS))} [default: {_default('cores')}]")] = None,
    lanes: Annotated[int | None, typer.Option(
        help=f"with --stage lanes: of all cores, {', '.join(map(str, LANES_PER_CORE))} of each [default: {_default('lanes')}]",
    )] = None,
    cat: Annotated[CatChoice | None, typer.Option(help=f"contribution test [default: {_default('cat')}]")] = None,
    precision: Annotated[PrecisionChoice | None, typer.Option(help=f"number formats of the contribution test [default: {_default('precision')}]")] = None,
    form: Annotated[FormChoice | None, typer.Option(help=f"Gaussian weight in CTU and VRU, and of the chip's records [default: {_default('form')}]")] = None,
    fifo_depth: Annotated[int | None, typer.Option(
        help=f"feature FIFO, 1 to {MAX_FIFO_DEPTH}; queue of a lane, 2 to {MAX_LANE_ENTRIES} [default: {_default('fifo_depth')}]",
    )] = None,
    memories: Annotated[MemoriesChoice | None, typer.Option(
        help="of --engine chip: sizes, for speed, within the paper's 288 KB, or for fewer bytes a frame, in as much memory or more [default: default]")] = None,
    port_bits: Annotated[int | None, typer.Option(help=f"of --engine chip: data of the memory port, {', '.join(map(str, PORT_WIDTHS))} [default: 512]")] = None,
    sort_units: Annotated[int | None, typer.Option(help=f"of --engine chip: sorting units, {UNITS} [default: {_default('sort_units')}]")] = None,
    list_writers: Annotated[int | None, typer.Option(help=f"of --engine chip: list writers, {UNITS} [default: {_default('list_writers')}]")] = None,
    preproc_lanes: Annotated[int | None, typer.Option(help=f"of --engine chip: preprocessing cores, {UNITS} [default: {_default('preproc_lanes')}]")] = None,
    preproc_interval: Annotated[int | None, typer.Option(
        help=f"of --engine chip: cycles from a Gaussian of a preprocessing core to the next, 2 or 4 [default: {_default('preproc_interval')}]",
    )] = None,
    refresh: Annotated[RefreshChoice | None, typer.Option(help="of --engine chip: what the DRAM refreshes at once [default: all-banks]")] = None,
    chip: Annotated[str | None, typer.Option(help="a chip by its name in chips.toml, as tiny, instead of options of its parts")] = None,
    chips_file: Annotated[Path | None, typer.Option("--chips", help="file with chips of your own for --chip, as chips.toml")] = None,
    coords: Annotated[CoordsChoice, typer.Option(help="where means are rounded to FP16")] = CoordsChoice.LOCAL,
    faithful: Annotated[bool, typer.Option("--faithful", help=f"the paper's configuration: {_faithful()}")] = False,
) -> Chosen:
    """The options themselves. FlickerError where they contradict each other."""
    given: dict[str, object] = {"cat": cat, "precision": precision, "form": form, "fifo-depth": fifo_depth}
    chosen: dict[str, object] = {"format": memory, "lists": lists, "rechunk": rechunk or None}
    whole = engine in (EngineChoice.CHIP, EngineChoice.CHIP_GOLDEN)
    if whole and front is not None:
        raise FlickerError(f"--front {front.value}: not with --engine {engine.value}, which has its own front end")
    if engine is not EngineChoice.CHIP:
        for option, value in (
            ("--memories", memories), ("--port-bits", port_bits), ("--refresh", refresh), ("--sort-units", sort_units), ("--list-writers", list_writers),
            ("--preproc-lanes", preproc_lanes), ("--preproc-interval", preproc_interval),
        ):
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
    base = FAITHFUL if faithful else RenderConfig()
    if chips_file is not None and chip is None:
        raise FlickerError("--chips: with --chip NAME only")
    if chip is not None:
        parts = {
            "stage": stage, "cores": cores, "lanes": lanes, "cat": cat, "precision": precision, "form": form, "fifo-depth": fifo_depth, "memories": memories,
            "port-bits": port_bits, "sort-units": sort_units, "list-writers": list_writers, "preproc-lanes": preproc_lanes,
            "preproc-interval": preproc_interval,
            "coords": None if coords is CoordsChoice.LOCAL else coords, "faithful": faithful or None,
        }
        if names := ", ".join(f"--{k}" for k, v in parts.items() if v is not None):
            raise FlickerError(f"--chip: fixes the configuration, so it cannot be combined with {names}")
        if engine is EngineChoice.REFERENCE:
            raise FlickerError("--chip: not for --engine reference, which has no stage")
        config = chip_of(chip, chips_file).config
        # Records of 32 bytes mean the paper's scene format and lists, as --faithful does.
        conic = config.form is Form.CONIC and (whole or front not in (None, FrontChoice.FLOAT)) and not any(v is not None for v in chosen.values())
        return Chosen(engine, config, front, memory, lists, rechunk, refresh, conic)
    of_stage = given | {"faithful": faithful or None, "coords": None if coords is CoordsChoice.LOCAL else coords}
    config = base.with_(
        cat=CatMode[cat.name] if cat else base.cat,
        precision=Precision[precision.name] if precision else base.precision,
        form=Form[form.name] if form else base.form,
        fifo_depth=base.fifo_depth if fifo_depth is None else fifo_depth,
        coords=Coords[coords.name],
        stage=_stage(stage, engine, {"cores": cores, "lanes": lanes}, of_stage),
        cores=base.cores if cores is None else cores,
        lanes=base.lanes if lanes is None else lanes,
        memories=base.memories if memories is None else memories.value,
        port_bits=base.port_bits if port_bits is None else port_bits,
        sort_units=base.sort_units if sort_units is None else sort_units,
        list_writers=base.list_writers if list_writers is None else list_writers,
        preproc_lanes=base.preproc_lanes if preproc_lanes is None else preproc_lanes,
        preproc_interval=base.preproc_interval if preproc_interval is None else preproc_interval,
    )
    return Chosen(engine, config, front, memory, lists, rechunk, refresh, faithful)


_OPTIONS = inspect.signature(engine_options, eval_str=True).parameters


def takes_engine(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command with the options of `engine_options` in the place of its parameter `chosen`, which gets what they mean."""
    own = inspect.signature(command, eval_str=True)

    @wraps(command)
    def run(**values: Any) -> Any:
        return command(chosen=engine_options(**{name: values.pop(name) for name in _OPTIONS}), **values)

    given: list[inspect.Parameter] = []
    for name, parameter in own.parameters.items():
        given += _OPTIONS.values() if name == "chosen" else [parameter]
    run.__signature__ = own.replace(parameters=[p.replace(kind=p.KEYWORD_ONLY) for p in given])  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in given}
    return run


def parse_engine(text: str, option: str) -> Chosen:
    """What a text such as `--stage channels --cat sparse` means. FlickerError, naming `option`, where it means nothing."""
    app = typer.Typer(add_completion=False)
    app.command(add_help_option=False)(engine_options)
    try:
        with typer.main.get_command(app).make_context(option, shlex.split(text)) as context:
            return context.command.invoke(context)
    except ValueError as error:
        raise FlickerError(f"{option}: '{text}': {error}") from None
    except typer.exceptions.TyperException as error:
        raise FlickerError(f"{option}: {error.format_message()}") from None
    except FlickerError as error:
        raise FlickerError(f"{option}: {error}") from None
