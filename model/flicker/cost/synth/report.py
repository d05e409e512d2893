"""What `make synth` prints and writes: tables, CSV, Markdown, chart."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ... import markdown, output
from ..chip_area import CHIPS, OTHERS, PAPER_MM2, UM2_PER_BIT, UM2_PER_GE, components, in_all, square_millimetres
from .run import Runner
from .units import FIFO_DEPTHS, FORMS, PRECISIONS, Unit, channel_config, vru_config

CSV_COLUMNS = ("unit", "config", "ge", "ge_seq", "ge_comb", "mem_bits", "sram_bits", "ff", "fo4")

Results = dict[Unit, dict]
Areas = dict[tuple[str, str], float]  # GE by unit and configuration


@dataclass
class Sheet:
    """A table: title, column heads, rows of text, remarks below."""

    title: str
    heads: list[str]
    rows: list[list[str]]
    note: str = ""

    def print(self, console: Console) -> None:
        table = Table(title=self.title, title_justify="left", caption=self.note or None, caption_justify="left")
        for index, head in enumerate(self.heads):
            numeric = all(row[index][:1].isdigit() or row[index][:1] in "-<" for row in self.rows if row[index])
            table.add_column(head, justify="right" if numeric else "left", overflow="fold")
        for row in self.rows:
            table.add_row(*row)
        console.print(table)

    def table(self) -> str:
        """Markdown of heads and rows."""
        return markdown.table(self.heads, self.rows) + "\n"

    def markdown(self) -> str:
        return f"### {self.title}\n\n{self.table()}" + (f"\n{self.note}\n" if self.note else "")


def _ge(value: float) -> str:
    return f"{value:,.0f}"


def _short(name: str) -> str:
    """End of a path without the middle of its hierarchy."""
    parts = name.split(".")
    return name if len(parts) < 4 else f"{parts[0]}..{parts[-1]}"


def units_sheet(results: Results, library: str) -> Sheet:
    rows = []
    for unit, result in results.items():
        path = result["paths"][0] if result["paths"] else {"from": "", "to": ""}
        rows.append([
            unit.name, unit.config, _ge(result["ge"]), _ge(result["ge_seq"]), _ge(result["ge_comb"]), _ge(result["mem_bits"]),
            _ge(result["sram_bits"]), _ge(result["ff"]), f"{result['fo4']:.0f}", f"{_short(path['from'])} -> {_short(path['to'])}",
        ])
    return Sheet(
        f"Units ({library})",
        ["unit", "configuration", "GE", "seq", "comb", "storage bits", "SRAM bits", "FF", "FO4", "longest path"],
        rows,
        "GE: NAND2 = 1. Storage bits are flip-flops, counted in seq and FF; SRAM bits are in no GE. FO4: longest path, with registers at the ports.",
    )


def prtu_ratio(areas: Areas, config: str) -> float:
    """A PRTU over four single-pixel units."""
    return areas["prtu", config] / (4 * areas["prtu", f"{config}, 1 pixel"])


def ctu_ratio(areas: Areas, config: str) -> float:
    """A CTU over the eight VRUs of its core."""
    form = "conic" if config == "faithful" else config.split()[0]
    return areas["ctu", config] / (8 * areas["vru", form])


class Comparison:
    """Results by module and parameters, and the comparisons made of them."""

    def __init__(self, runner: Runner, results: Results) -> None:
        self.runner, self.results = runner, results
        self.by_name = {(unit.name, unit.config): result for unit, result in results.items()}

        self.areas: Areas = {key: result["ge"] for key, result in self.by_name.items()}

    def ge(self, name: str, config: str) -> float:
        return self.areas[name, config]

    def parts(self, key: str, factor: int = 1) -> Counter:
        """GE of a unit by module, its own glue included."""
        own = self.runner.results[key]
        parts = Counter({own["top"].removeprefix("flk_"): factor * (own["ge_seq"] + own["ge_comb"])})
        for child, count in own["children"].items():
            parts += self.parts(child, factor * count)
        return parts

    def prtu(self) -> Sheet:
        rows = []
        for form in FORMS:
            for precision in PRECISIONS:
                config = f"{form} {precision}"
                acus = 4 * self.ge("prtu", f"{config}, 1 pixel")
                rows.append([form, precision, _ge(self.ge("prtu", config)), _ge(acus), f"{prtu_ratio(self.areas, config):.1%}"])
        return Sheet(
            "PRTU and four single-pixel units (ACUs)", ["form", "precision", "PRTU", "4 ACUs", "ratio"], rows,
            "The same RTL with two columns and rows, and with one; the same precision and throughput. Logarithm of the opacity and conversion of "
            "the shape are outside both.",
        )

    def ctu(self) -> Sheet:
        rows = []
        configs = [(f"{form} {precision}", form) for form in FORMS for precision in PRECISIONS] + [("faithful", "conic")]
        for config, form in configs:
            vrus, ctu = 8 * self.ge("vru", form), self.ge("ctu", config)
            parts = self.parts(self.by_name["ctu", config]["key"])
            rows.append([
                config, _ge(ctu), _ge(parts["prtu"]), _ge(parts["log_opacity_pipe"]), _ge(parts["ctu_controller"]),
                _ge(parts["fifo"]), _ge(parts["ctu"] + parts["mmu"]), _ge(vrus), f"{ctu_ratio(self.areas, config):.1%}",
            ])
        return Sheet(
            "CTU and the eight VRUs of its core",
            ["configuration", "CTU", "2 PRTUs", "log", "controller", "output FIFO", "pipeline, rest", "8 VRUs", "CTU / VRUs"], rows,
            "Paper: below 10 %. 'faithful' has the paper's output FIFO; the others hold the pipeline instead.",
        )

    def alternatives(self) -> Sheet:
        fifo = self.ge("fifo", "145 x 16")
        rows = []
        cores = [f"{form} {_ge(4 * self.ge('rendering_core', channel_config(form, 4)))}" for form in FORMS]
        for form in FORMS:
            vru, baseline = self.ge("vru", form), 64 * self.ge("vru", vru_config(form, 4))
            for precision in PRECISIONS:
                ctu = self.ge("ctu", f"{form} {precision}")
                ours = 32 * vru + 4 * ctu + 16 * fifo
                memory = 32 * vru + 4 * ctu + 16 * 2320 * UM2_PER_BIT / UM2_PER_GE
                rows.append([
                    form, precision, _ge(ours), _ge(memory), _ge(baseline), f"{ours / baseline:.1%}", f"{memory / baseline:.1%}",
                ])
        return Sheet(
            "32 VRUs with 4 CTUs and 16 feature FIFOs, against 64 VRUs",
            ["form", "precision", "32 VRU + CTU + FIFO", "FIFOs as SRAM (estimate)", "64 VRUs", "ratio", "ratio, SRAM"], rows,
            f"64 VRUs hold 4 pixels each; with FIFOs, arbiters and control, as four cores of four VRUs per channel: {', '.join(cores)}. "
            "Rendering stage alone; the paper's 14 % saving is of the whole chip.",
        )

    def fifos(self) -> Sheet:
        core = self.ge("vru", "factored") * 8
        rows = []
        for depth in FIFO_DEPTHS:
            result = self.by_name["fifo", f"145 x {depth}"]
            ge, bits = result["ge"], result["mem_bits"]
            rows.append([
                str(depth), _ge(bits), _ge(ge), f"{ge / bits:.2f}", f"{4 * ge / core:.1%}", f"{ge * UM2_PER_GE:,.0f}",
                f"{bits * UM2_PER_BIT:,.0f}",
            ])
        return Sheet(
            "Feature FIFO by depth",
            ["depth", "bits", "GE", "GE / bit", "4 FIFOs / 8 VRUs", "um2, flip-flops (estimate)", "um2, SRAM (estimate)"], rows,
            "SRAM: bit cells and periphery of a large macro; a memory of a few rows has far more periphery.",
        )

    def paper(self) -> Sheet:
        total = sum(PAPER_MM2.values())
        chips = {chip: components(chip, lambda unit: (self.by_name[unit]["ge"], self.by_name[unit]["sram_bits"])) for chip in CHIPS}
        rows = [
            [name, f"{area:.2f}", f"{area / total:.0%}", *(self._with_memories(*parts[name]) for parts in chips.values())]
            for name, area in PAPER_MM2.items()
        ]
        rows.append(["In all", f"{total:.2f}", "", *(f"{in_all(parts):.2f}" for parts in chips.values())])
        ratio = [
            self.ge("ctu", config) / self.ge("rendering_core", form)
            for config, form in (("conic mixed", "conic"), ("factored fixed", "factored"))
        ]
        rows.append(["CTU without FIFO / rendering core", f"{0.09 / 0.96:.1%}", "", *(f"{value:.1%}" for value in ratio)])
        return Sheet(
            "Beside the paper's Table 2 (mm2 in 28 nm)",
            ["component", "paper", "share", *(f"here, {chip} (estimate)" for chip in chips)], rows,
            f"Estimate: {UM2_PER_GE} um2 per GE + {UM2_PER_BIT:.3f} um2 per bit of SRAM, nothing for wires. The paper's numbers are from Design Compiler and a "
            f"memory compiler. {OTHERS.split(' (')[0]} here: all of the chip but the units above.",
        )

    def _with_memories(self, ge: float, bits: int) -> str:
        """Logic + SRAM, mm2, and the SRAM's size."""
        return f"{square_millimetres(ge):.2f}" + (f" + {square_millimetres(0, bits):.2f} ({bits / 8192:.0f} KB)" if bits else "")

    def summary(self) -> Sheet:
        """For the README: area and longest path of the main units, default and as in the paper."""
        units: list[tuple[str, list[tuple[str, str]]]] = [
            ("FP16 adder, multiplier (combinational)", [("fp_add", "fp16"), ("fp_mul", "fp16")]),
            ("E4M3 adder, multiplier (combinational)", [("fp_add", "e4m3"), ("fp_mul", "e4m3")]),
            ("PRTU: four leader pixels a cycle, default", [("prtu", "factored fixed")]),
            ("CTU, default", [("ctu", "factored fixed")]),
            ("CTU, `faithful`", [("ctu", "faithful")]),
            ("VRU, default", [("vru", "factored")]),
            ("VRU, `faithful`", [("vru", "conic")]),
            ("rendering core: 8 VRUs, 4 FIFOs of 16, default", [("rendering_core", "factored")]),
            ("rendering stage: 4 cores with CTUs, default", [("render_stage", "factored fixed")]),
            ("rendering stage, `faithful`", [("render_stage", "faithful")]),
        ]
        rows = []
        for name, keys in units:
            results = [self.by_name[key] for key in keys]
            rows.append([
                name, ", ".join(_ge(result["ge"]) for result in results), ", ".join(_ge(result["ff"]) for result in results) if results[0]["ff"] else "",
                ", ".join(f"{result['fo4']:.0f}" for result in results),
            ])
        rows += [
            ["PRTU / four single-pixel units, default", f"{prtu_ratio(self.areas, 'factored fixed'):.1%}", "", ""],
            ["CTU / eight VRUs, default", f"{ctu_ratio(self.areas, 'factored fixed'):.1%}", "", ""],
            ["CTU / eight VRUs, `faithful`", f"{ctu_ratio(self.areas, 'faithful'):.1%}", "", ""],
        ]
        return Sheet("Area and timing", ["unit", "GE (NAND2 = 1)", "flip-flops", "longest path, FO4"], rows)

    def targets(self) -> Sheet:
        clocked = [(result["fo4"], unit.name, unit.config) for unit, result in self.results.items() if result["ff"]]
        worst = max(clocked)
        ratio = max((prtu_ratio(self.areas, f"{f} {p}"), f"{f} {p}") for f in FORMS for p in PRECISIONS)
        default = prtu_ratio(self.areas, "factored fixed")
        forms = max(self.ge("prtu", f"factored {p}") / self.ge("prtu", f"conic {p}") for p in PRECISIONS)
        goals = [
            ("FP16 adder, GE", 800, self.ge("fp_add", "fp16"), "{:.0f}"),
            ("FP16 multiplier with subnormals, GE", 1600, self.ge("fp_mul", "fp16"), "{:.0f}"),
            ("E4M3 adder, GE", 350, self.ge("fp_add", "e4m3"), "{:.0f}"),
            ("E4M3 multiplier, GE", 250, self.ge("fp_mul", "e4m3"), "{:.0f}"),
            ("PRTU / 4 ACUs, default (factored fixed)", 0.6, default, "{:.1%}"),
            (f"PRTU / 4 ACUs, worst ({ratio[1]})", 0.6, ratio[0], "{:.1%}"),
            ("CTU / 8 VRUs, default (factored fixed)", 0.1, ctu_ratio(self.areas, "factored fixed"), "{:.1%}"),
            ("CTU / 8 VRUs, conic mixed", 0.1, ctu_ratio(self.areas, "conic mixed"), "{:.1%}"),
            ("factored / conic PRTU, worst", 1.0, forms, "{:.1%}"),
            (f"longest path of a unit with registers, FO4 ({worst[1]} {worst[2]})", 60, worst[0], "{:.0f}"),
        ]
        rows = [
            [name, text.format(limit), text.format(value), "yes" if value <= limit else "no"]
            for name, limit, value, text in goals
        ]
        return Sheet("Numbers to reach", ["what", "at most", "is", "reached"], rows)

    def sheets(self) -> list[Sheet]:
        return [
            self.prtu(), self.ctu(), self.alternatives(), self.fifos(), self.paper(), self.targets(),
        ]

    def chart(self, folder: Path, library: str) -> None:
        """Area of the render stage by unit, for every form and precision: area.png, area.svg."""
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot

        groups = {
            "VRUs": ["vru"], "feature FIFOs": [], "PRTUs": ["prtu"], "CTU, other": [
                "ctu", "ctu_controller", "mmu", "log_opacity_pipe",
            ], "counters": ["perf_counters"], "arbiters, control": [],
        }
        configs = [f"{form} {precision}" for form in FORMS for precision in PRECISIONS]
        heights: dict[str, list[float]] = {name: [] for name in groups}
        for config in configs:
            parts = self.parts(self.by_name["render_stage", config]["key"])
            total = sum(parts.values())
            values = {name: sum(parts[module] for module in modules) for name, modules in groups.items()}
            values["feature FIFOs"] = parts["fifo"]
            values["arbiters, control"] = total - sum(values.values())
            for name, area in values.items():
                heights[name].append(area / 1e6)
        figure, axes = pyplot.subplots(figsize=(8, 4.5), layout="constrained")
        base = [0.0] * len(configs)
        for name, bars in heights.items():
            axes.bar([config.replace(" ", "\n") for config in configs], bars, bottom=base, label=name, width=0.7)
            base = [low + bar for low, bar in zip(base, bars)]
        axes.set_ylabel("million GE")
        axes.set_title(f"Rendering stage: 4 CTUs, 32 VRUs ({library})", fontsize=10)
        axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False, reverse=True)
        axes.spines[["top", "right"]].set_visible(False)
        for ending in ("png", "svg"):
            metadata = {"Date": None} if ending == "svg" else None
            output.write_atomically(folder / f"area.{ending}", lambda path: figure.savefig(path, dpi=150, metadata=metadata))
        pyplot.close(figure)


def write_csv(path: Path, results: Results) -> None:
    output.write_csv(path, [CSV_COLUMNS, *(
        [
            unit.name, unit.config, f"{result['ge']:.1f}", f"{result['ge_seq']:.1f}", f"{result['ge_comb']:.1f}",
            result["mem_bits"], result["sram_bits"], result["ff"], f"{result['fo4']:.1f}",
        ]
        for unit, result in results.items()
    )])


def write_markdown(path: Path, sheets: Iterable[Sheet]) -> None:
    output.write_text(path, "\n".join(sheet.markdown() for sheet in sheets))


def _areas(folder: Path) -> Areas | None:
    """GE by unit and configuration from a folder's area.csv; None if there is none."""
    path = folder / "area.csv"
    if not path.exists():
        return None
    with path.open() as file:
        return {(row["unit"], row["config"]): float(row["ge"]) for row in csv.DictReader(file)}


def _factored_over_conic(areas: dict, precision: str) -> float:
    return areas["prtu", f"factored {precision}"] / areas["prtu", f"conic {precision}"]


def against(folder: Path, other: Path, library: str) -> list[Sheet]:
    """A library's area.csv beside the default library's: ratios between units first, then every unit. Empty if the default has not been run."""
    here, there = _areas(folder), _areas(other)
    if here is None or there is None:
        return []
    ratios: dict[str, Callable[[dict], float]] = {}
    for form in FORMS:
        for precision in PRECISIONS:
            config = f"{form} {precision}"
            ratios[f"PRTU / 4 ACUs, {config}"] = partial(prtu_ratio, config=config)
            ratios[f"CTU / 8 VRUs, {config}"] = partial(ctu_ratio, config=config)
    ratios["CTU / 8 VRUs, faithful"] = lambda areas: ctu_ratio(areas, "faithful")
    for precision in PRECISIONS:
        ratios[f"factored / conic PRTU, {precision}"] = partial(_factored_over_conic, precision=precision)
    ratios["32 VRUs with CTUs / 4 cores of 16 VRUs, factored fixed"] = (
        lambda ge: ge["render_stage", "factored fixed"] / (4 * ge["rendering_core", "factored, 4 VRUs"])
    )
    rows = [
        [name, f"{ratio(there):.1%}", f"{ratio(here):.1%}", f"{ratio(here) / ratio(there) - 1:+.1%}"] for name, ratio in sorted(ratios.items())
    ]
    units = sorted((there[key], key) for key in here.keys() & there.keys())
    return [
        Sheet(
            f"Ratios between units: {library} beside the default library", ["ratio", "default", library, "difference"], rows,
            "Each library in gate equivalents of its own NAND2.",
        ),
        Sheet(
            f"{library} against the default library", ["unit", "configuration", "GE default", "GE here", "ratio"],
            [[*key, _ge(ge), _ge(here[key]), f"{here[key] / ge:.2f}"] for ge, key in units],
        ),
    ]
