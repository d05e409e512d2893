"""`make docs PART=modules`: every module of rtl/ with its page, purpose, parameters, tests and proofs, from the heads of the sources and of the tests.
`make docs PART=heads`: what the heads of a page's modules say of their ports, duties and timing.
"""

from __future__ import annotations

import ast
import re
import textwrap
from pathlib import Path

from flicker.datapath.units import PIPELINES
from flicker.errors import FlickerError
from flicker.markdown import table
from flicker.toolchain import ROOT

from .common import Say

# Pages of docs/reference/ and the modules that each describes, by part of the chip; a name with * begins several. Each module belongs to the first that fits.
PAGES = (
    ("Chip", (
        ("chip.md", "flk_top"), ("chip_ports.md", "flk_top_axi"), ("registers.md", "flk_registers flk_registers_pkg"),
        ("frame_control.md", "flk_frame_control flk_frame_counters flk_counter_pkg flk_descriptor flk_top_pkg"),
        ("memory_port.md", "flk_axi_arbiter flk_axi_half flk_axi_hold flk_axi_downsizer flk_priority_arbiter flk_front_throttle"),
        ("chip_memory.md", "flk_sram flk_sram_single"),
        ("chip_ports.md", "flk_clock_gate flk_reset_sync"),
    )),
    ("Front end", (
        ("front_end.md", "flk_preprocessing* flk_preproc_pkg flk_front_pkg flk_colour_fetch"), ("cluster_cull.md", "flk_cluster_cull flk_geometry_fetch"),
        ("colour_store.md", "flk_colour_store flk_colour_heads flk_colour_rows flk_colour_keeper"),
        ("datapath.md", "flk_cluster_* flk_geometry_decode flk_projection* flk_splat_b* flk_colour_* flk_colours_* flk_*_field flk_coefficient flk_phase_mux"),
        ("entries_and_records.md", "flk_tile_walker flk_entry_merge flk_record_writer"), ("list_writer.md", "flk_list_writer flk_pointer_port"),
    )),
    ("Rendering half", (
        ("rendering.md", "flk_rendering flk_rendering_pkg flk_stage flk_tile_walk"), ("list_reader.md", "flk_list_reader"),
        ("list_layout.md", "flk_line_entry flk_entry_near"),
        ("list_sorter.md", "flk_list_sorter flk_run_*"), ("bitonic_sorter.md", "flk_bitonic_sorter flk_compare_exchange"), ("sorting_unit.md", "flk_sort*"),
        ("delivery.md", "flk_delivery flk_entry_buffer flk_record_cache flk_record_queue"), ("frame_writer.md", "flk_frame_writer flk_pixel_out"),
    )),
    ("Stage of channels", (
        ("render_stage.md", "flk_render_stage flk_stage_control flk_perf_counters flk_splat_input"),
        ("record_to_splat.md", "flk_record_to_splat flk_*_to_fp16"), ("mask_generators.md", "flk_mask_generator flk_mask_all"),
        ("ctu.md", "flk_ctu* flk_mmu"), ("prtu.md", "flk_prtu flk_weight"),
        ("rendering_core.md", "flk_rendering_core flk_fifo_monitor flk_channel flk_vru flk_blend_pipe flk_pixel_*"),
    )),
    ("Stage of lanes", (
        ("lane_stage.md", "flk_lane_stage flk_lane_core flk_lane_arbiter flk_lane_queue flk_lane_counters flk_lane_pkg"),
        ("lanes.md", "flk_lane flk_lane_result flk_splat_setup flk_row_mask"),
    )),
    ("Cells and packages", (
        ("streams.md", "flk_pipe_reg flk_skid_buffer flk_*fifo flk_stream_arbiter flk_delay* flk_event_counter*"),
        ("axi.md", "flk_axi_* flk_line_writer"), ("ff.md", "flk_ff_* flk_fixed_mul"),
        ("arithmetic.md", "flk_fp_* flk_fixed_to_fp flk_log_opacity* flk_exp_neg* flk_table_pkg flk_lzc"), ("constants.md", "flk_pkg flk_param_pkg"),
    )),
)
# Pages that show the heads of modules: duties of ports, latency, throughput and combinational paths have their home there.
HEADS = {
    "axi": "flk_axi_split flk_axi_read flk_axi_fetch flk_axi_write flk_line_writer flk_axi_read_mux",
    "streams": "flk_pipe_reg flk_skid_buffer flk_fifo flk_sram_fifo flk_pair_fifo flk_stream_arbiter",
    "frame_control": "flk_frame_control flk_frame_counters",
    "memory_port": "flk_axi_arbiter flk_priority_arbiter flk_axi_hold flk_front_throttle flk_axi_half flk_axi_downsizer",
    "front_end": "flk_preprocessing flk_preprocessing_core flk_colour_fetch", "cluster_cull": "flk_cluster_cull flk_geometry_fetch",
    "colour_store": "flk_colour_store flk_colour_heads flk_colour_rows flk_colour_keeper",
    "entries_and_records": "flk_tile_walker flk_entry_merge flk_record_writer", "list_writer": "flk_list_writer flk_pointer_port",
    "rendering": "flk_rendering flk_tile_walk", "list_reader": "flk_list_reader", "bitonic_sorter": "flk_bitonic_sorter",
    "sorting_unit": "flk_sorting_unit flk_sort_runs flk_sort_merge flk_sort_select",
    "list_sorter": "flk_list_sorter flk_run_writer flk_run_merge", "delivery": "flk_entry_buffer flk_delivery flk_record_cache flk_record_queue",
    "frame_writer": "flk_frame_writer", "record_to_splat": "flk_record_to_splat flk_splat_input", "render_stage": "flk_render_stage",
    "ctu": "flk_ctu flk_ctu_controller flk_mmu", "prtu": "flk_prtu",
    "rendering_core": "flk_rendering_core flk_fifo_monitor flk_channel flk_vru flk_blend_pipe flk_pixel_state flk_pixel_drain",
    "lane_stage": "flk_lane_stage flk_lane_core flk_splat_setup flk_row_mask flk_lane_queue flk_lane flk_lane_arbiter flk_lane_result",
    "arithmetic": "flk_fp_add_pipe flk_fp_mul_pipe flk_weight flk_exp_neg_pipe flk_log_opacity_pipe",
}
COLUMNS = 200


def sources() -> dict[str, Path]:
    """Every module and package by name."""
    return {path.stem: path for path in sorted((ROOT / "rtl").rglob("*.sv"))}


def head(text: str) -> str:
    """The comment at the beginning of a source, as running text."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("//"):
            break
        lines.append(line.removeprefix("//").strip())
    return "\n".join(lines)


def purpose(name: str, text: str) -> str:
    """What the first sentence of a head says, without the page that it names. Raises FlickerError where there is none."""
    lines = [line for line in head(text).splitlines() if not line.startswith(("Generated by", "verilator", "https:", "//"))]
    first = " ".join(" ".join(lines).split()) if lines and not lines[0] else " ".join("\n".join(lines).partition("\n\n")[0].split())
    sentence = re.sub(r"\s*\((?:see )?docs/[^)]*\)", "", re.split(r"(?<=[a-z0-9)`])[.:;](?: |$)(?=[A-Z]|$)", first)[0]).rstrip(". ")
    if not sentence and "Generated by" not in text:
        raise FlickerError(f"rtl: {name}: its first line does not say what it is")
    return (sentence or "constants (generated)").replace("|", "\\|").replace("[", "\\[")


def parameters(text: str) -> list[tuple[str, str, str]]:
    """(name, default, comment) of a module's parameters. Raises FlickerError where a line is not understood."""
    found = re.search(r"^module \w+[^;]*?#\(\n(.*?)^\)", re.sub(r"^  import .*?;\n", "", text, flags=re.M), re.S | re.M)
    rows = []
    for line in found[1].splitlines() if found else ():
        if not re.match(r"\s*parameter\b", line):
            continue
        code, _, comment = line.partition("//")
        match = re.fullmatch(r"\s*parameter\s+[^=]*?(\w+)\s*=\s*(.+?),?\s*", code)
        if match is None:
            raise FlickerError(f"rtl: {line.strip()}: not understood")
        rows.append((match[1], re.sub(r"^\d+'[bdh]|^flk_\w+_pkg::", "", match[2]), comment.strip()))
    return rows


def refusals(text: str) -> list[str]:
    """What a module asks of its parameters: the messages of its checks when it is built."""
    return [re.sub(r"^\w+: ", "", message) for message in re.findall(r"begin : gen_check\w*\n\s*\$(?:error|fatal)\((?:1, )?\"(.*?)\"", text)]


def page_of(name: str) -> tuple[str, str]:
    """Part of the chip and page of a module. Raises FlickerError."""
    for part, rows in PAGES:
        for page, modules in rows:
            if any(re.fullmatch(pattern.replace("*", r"\w*"), name) for pattern in modules.split()):
                return part, page
    raise FlickerError(f"scripts/doc_parts/modules.py: PAGES: no page for {name}")


def tests() -> dict[str, Path]:
    """Tests of units by the name that `make sim UNIT=` takes."""
    return {path.stem.removeprefix("test_"): path for folder in sorted((ROOT / "rtl").iterdir()) if folder.is_dir()
            for path in sorted((ROOT / "tb" / folder.name).glob("test_*.py"))}


def proofs() -> set[str]:
    return {path.stem.removeprefix("fv_") for path in (ROOT / "formal").glob("fv_*.sv")}


def verified(name: str) -> str:
    """Tests that a module is the subject of, and its proof."""
    units, unit = tests(), name.removeprefix("flk_")
    named = [unit] if unit in units else [u for u, path in units.items() if re.search(rf"\b(?:flk_)?{unit}\b", path.read_text())]
    return ", ".join([*(f"`{u}`" for u in named[:3]), *(["proof"] if unit in proofs() else [])])


def inventory() -> str:
    there, rows, last = sources(), [], ""
    order = {page: k for k, page in enumerate(page for _, pages in PAGES for page, _ in pages)}
    parts = [part for part, _ in PAGES]
    for name in sorted(there, key=lambda n: (parts.index(page_of(n)[0]), order[page_of(n)[1]], n)):
        part, page = page_of(name)
        rows.append((part if part != last else "", f"[`{name}`]({page})", purpose(name, there[name].read_text()), verified(name)))
        last = part
    return table(["", "module, its page", "what", "tests (`make sim UNIT=`), proof"], rows)


def parameter_table() -> str:
    rows = []
    for name, path in sources().items():
        text = path.read_text()
        if own := parameters(text):
            cells = (f"`{p}` = {default}" + (f" ({comment})" if comment else "") for p, default, comment in own)
            rows.append((f"`{name}`", "; ".join(cells).replace("|", "\\|"), "; ".join(refusals(text)).replace("|", "\\|")))
    return table(["module", "parameters with defaults", "checked when it is built"], rows)


def test_table() -> str:
    rows = []
    for unit, path in tests().items():
        text = " ".join((ast.get_docstring(ast.parse(path.read_text())) or "").split())
        if not text:
            raise FlickerError(f"{path.relative_to(ROOT)}: does not say what it covers")
        rows.append((f"`{unit}`", re.sub(r"docs/reference/(\w+\.md)", r"[\1](\1)", text).replace("|", "\\|").replace("<", "&lt;")))
    return table(["unit", "what its test covers, and what not"], rows)


# Of a signal, a module or a constant, in running text; what begins an item.
NAME = r"(?:\*?[a-zA-Z]\w*_(?:[\w*]*(?:\[\w+\])*)|\*_\w+|[A-Z][A-Z0-9]+_[A-Z0-9_*]+)(?:(?:::|\.)[\w*]+)?"
TOPICS = r"in |out |Frames?[.:]|Lines:|Counters:|Combinational|Throughput|Latency|Faults:|Structure:|Stall|Mask:|Dispatch:|A frame:|A descriptor"
ITEM = re.compile(f"(?:{NAME}|{TOPICS})")


def _marked(text: str) -> str:
    """Markdown of a head's words: names of signals and modules in code, pages as links."""
    text = re.sub(r"docs/reference/(\w+)\.md", r"[\1.md](\1.md)", text.replace("`", "").replace("<", "&lt;"))
    name = rf"(?<![\w`/.*])(?!\w+\.md){NAME}"
    found = ""
    for part in re.split(r"(\[\w+\.md\]\(\w+\.md\))", text):
        marked = part if part.startswith("[") else re.sub(name, r"`\g<0>`", part)
        found += marked if part.startswith("[") else re.sub(r"\[(?=[^`]*(?:`[^`]*`[^`]*)*$)", r"\\[", marked)
    return found


def module_head(name: str, text: str) -> str:
    """A module's head as Markdown: its paragraphs, filled, with an item for each port or topic that begins a line behind the end of a sentence. Tables stay,
    drawings do not."""
    blocks: list[list[str]] = [[]]
    for line in text.splitlines():
        last = blocks[-1][-1] if blocks[-1] else ""
        if not line or re.search(r"[─│└▲▼]", line):
            blocks.append([])
        elif line.startswith("|"):
            blocks[-1].append(line) if last.startswith("|") else blocks.append([line])
        elif ITEM.match(line) and (not last or last.endswith((".", ":"))):
            blocks.append([f"- {line}"])
        else:
            blocks[-1].append(line)
    out = ""
    for block in filter(None, blocks):
        if block[0].startswith("|"):
            out += "\n\n" + "\n".join(block)
            continue
        item = out and block[0].startswith("- ")
        words = " ".join(" ".join(block).split()).removeprefix("- ")
        words = _marked(re.sub(r"^(in|out) +", r"**\1** ", words) if item else words)
        filled = textwrap.wrap(words if out else f"**`{name}`** {words}", COLUMNS, initial_indent="- " if item else "", subsequent_indent="  " if item else "",
                               break_long_words=False, break_on_hyphens=False)
        close = item and out.rpartition("\n\n")[2].startswith("- ")
        out += ("\n" if close else "\n\n" if out else "") + "\n".join(filled)
    return out


def heads(say: Say) -> dict[str, str]:
    there = sources()
    found = {}
    for page, names in HEADS.items():
        own = re.compile(rf"\s*\(docs/reference/{page}\.md\)|docs/reference/{page}\.md, ")
        found[page] = "\n\n".join(module_head(name, own.sub("", head(there[name].read_text()))) for name in names.split())
    return found


def pipeline_table() -> str:
    """Pipelines made from the golden model, with how many operations share how many units."""
    there, rows = sources(), []
    package = there["flk_front_pkg"].read_text()
    for pipeline in PIPELINES:
        name = pipeline.module.removeprefix("flk_")
        latency = re.search(rf" {name.upper()}_LATENCY = (\d+);| {name}_latency\(.*?return ([^;]*);", package, re.S)
        shared = re.findall(r"Units(?: with Interval \d+)?: ([^.]*)\.", " ".join(head(there[pipeline.module].read_text()).split()))
        if latency is None or len(shared) != len(pipeline.intervals):
            raise FlickerError(f"rtl: {pipeline.module}: no latency, or no units")
        usual, others = re.findall(r"\d+$", latency[1] or latency[2])[0], dict(re.findall(r"interval == (\d+)\) \? (\d+)", latency[2] or ""))
        rows += [
            (f"`{pipeline.module}`" if k == 0 else "", str(n), usual if k == 0 else others[str(n)], pipeline.head.rstrip(".") if k == 0 else "",
             shared[k].replace(" of 0 bits", ""))
            for k, n in enumerate(pipeline.intervals)
        ]
    return table(["module", "interval", "latency", "what", "operations in units"], rows)


def tables(say: Say) -> dict[str, str]:
    return {"inventory": inventory(), "parameters": parameter_table(), "tests": test_table(), "pipelines": pipeline_table()}
