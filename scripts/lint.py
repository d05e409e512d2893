#!/usr/bin/env python3
"""Lint: Verilator on every module, Verible style rules; ruff, mypy and the order of rooms on the Python; generated files; links of the pages.

Exits 1 on any warning, and if a generated source is not current (`make generate`). A shape is a module with its default parameters (or SMALLER ones)
or with those of VARIANTS. All shapes are instances of one generated top, in which Verilator elaborates each once, wherever it stands. Two steps:

1. elaboration (`--json-only`), as synthesised (SYNTHESIS defined) and as simulated, with assertions. Gives all warnings for which Verilator looks at
   one module: widths, signals without use or driver, ports, names, order of statements.
2. flattening (`--lint-only`), as synthesised. Gives the rest: latches, loops, several drivers, incomplete cases, resets of two kinds. Only the shapes
   that elaboration has found in no other module are instances here, in groups; all others are inside them.

Step 1 also gives the registers without reset and what they feed (scripts/registers.py): each must be on the list lint/registers.toml with its reason.

Accepted findings and their reasons: lint/waiver.vlt; style rules: lint/verible.rules; rules of ruff and mypy: pyproject.toml.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import registers

from flicker import toolchain
from flicker.chips import chip_of
from flicker.errors import FlickerError

ROOT = toolchain.ROOT
RTL = ROOT / "rtl"
REGISTERS = {RTL / "generated" / f"flk_registers{suffix}.sv" for suffix in ("", "_pkg")}  # by PeakRDL-regblock, in a style of its own: not for Verible
FOLDER = toolchain.BUILD / "lint"
REGISTER_LIST = ROOT / "lint" / "registers.toml"  # those that have no reset
VERSIONS = (ROOT / "requirements.lock").read_text() + Path(__file__).read_text() + Path(registers.__file__).read_text()

# Parameters in place of the defaults, where these only make more of a part that is linted by itself: the stage hands the number of VRUs to its cores.
SMALLER: dict[str, dict[str, int]] = {"flk_render_stage": {"VrusPerChannel": 1}}

# Parameters, beside those, under which a module takes another shape. What a parent has below it with all its parameters needs no entry of its own:
# the tables of flk_ff_rom stand under flk_ff_poly, the sizes of a channel under flk_channel, halves of small chips under flk_top.
VARIANTS: dict[str, list[dict[str, int]]] = {
    "flk_fifo": [{"Width": 1, "Depth": 1}, {"Depth": 5}, {"Depth": 128}],
    "flk_pipe_reg": [{"Width": 1}],
    "flk_skid_buffer": [{"Width": 1}],
    "flk_reset_sync": [{"Stages": 3}],
    "flk_stream_arbiter": [{"Inputs": 2, "Width": 1}, {"Inputs": 5}],
    "flk_vru": [{"Form": 0}, *({"Form": form, "Pixels": pixels} for form in (0, 1) for pixels in (4, 16))],
    "flk_channel": [{"VrusPerChannel": 1}, {"VrusPerChannel": 4, "MiniTile": 3}],
    "flk_fifo_monitor": [{"MaskBits": 64}],
    "flk_mask_all": [{"MaskBits": 64}],
    "flk_mask_generator": [{"MaskGenerator": 1}],
    "flk_rendering_core": [{"VrusPerChannel": 1, "MaskBits": 64}],
    "flk_render_stage": [{"VrusPerChannel": 1, "MaskGenerator": 1}],
    "flk_lane": [{"Lanes": 16}, {"Lanes": 32}],
    "flk_frame_writer": [{"Lanes": 32}, {"Lanes": 128}, {"Cores": 1, "Lanes": 8}],
    "flk_stage": [{"Stage": 1}],
    "flk_preprocessing": [{"Form": 0, "PreprocLanes": 1, "PreprocInterval": 4, "ListWriters": 1}, {"PreprocInterval": 4},
        {"PreprocLanes": 2, "ListWriters": 2}],
    "flk_top_axi": [{**chip_of("small").parameters, "IdWidth": 12, "UserWidth": 4, "ResetStages": 0}],
    "flk_rendering": [{"Stage": 1, "SortUnits": 1}, chip_of("default").config.chip_parameters()],
    "flk_axi_downsizer": [{"PortBits": 256}, {"PortBits": 512}],
    "flk_top": [chip_of("tiny").parameters],
    "flk_lane_stage": [{"Lanes": 128, "InWidth": 1, "Slots": 2, "Depth": 2}, {"Cores": 1, "Lanes": 8}],
    "flk_ctu_controller": [{"VruCycles": 4}, {"VruCycles": 16}],
    "flk_prtu": [{"Form": f, "Precision": p} for f in (0, 1) for p in (0, 1, 2)],
    "flk_ctu": [{"Form": 0, "Precision": 1, "CtuFifoDepth": 16}, {"Precision": 0}, {"Precision": 2}],
    "flk_fp_add_pipe": [{"Stages": 0}, {"Stages": 2, "Cancel": 0}],
    "flk_fp_mul_pipe": [{"Stages": 0}],
    "flk_ff_add": [{"ManBits": 23}, {"ManBits": 11, "Stages": 2}, {"Stages": 0}],
    "flk_ff_mul": [{"ManBits": 23, "Stages": 4}, {"ManBits": 11, "Stages": 2}, {"Stages": 0}],
    "flk_ff_poly": [
        {"Function": f, "ManBits": m, "Stages": s} for f in range(4) for m, s in ((10, 3), (15, 2), (19, 0), (23, 4))
    ],
    **{f"flk_ff_{name}": [{"ManBits": 23, "Stages": 4}, {"ManBits": 10}, {"Stages": 0}] for name in ("recip", "rsqrt", "sqrt", "exp2")},
    "flk_ff_from_fixed": [{"Bits": 11}, {"Bits": 48, "FracBits": 14, "ManBits": 23}, {"Stages": 0}],
    "flk_ff_to_fixed": [{"Bits": 20, "Round": 1}, {"Bits": 48, "FracBits": 14, "ManBits": 11}, {"Stages": 0}],
    "flk_lzc": [{"Width": 1}, {"Width": 15}],
    "flk_weight": [{"Form": 0}, {"Form": 0, "Cols": 2, "Rows": 2, "ExpBits": 4, "ManBits": 3, "Fn": 1, "Saturate": 1}],
    "flk_blend_pipe": [{"Form": 0}],
    "flk_pixel_state": [{"Pixels": 4}],
    "flk_record_to_splat": [{"Form": 0}],
    "flk_exp_neg_pipe": [{"Base2": 0, "Stages": 3}],
    "flk_axi_split": [{"Bytes": 4, "MaxBeats": 256, "BeatBits": 4}, {"MaxBeats": 1}, {"Bytes": 128, "MaxBeats": 256}],
    "flk_axi_read": [{"Width": 64, "MaxBeats": 256}, {"Bursts": 1, "IdBits": 1, "Id": 1, "BeatBits": 1}],
    "flk_axi_fetch": [{"Width": 64, "MaxBeats": 2, "Places": 3, "TagBits": 3}, {"MaxBeats": 64}],
    "flk_cluster_cull": [{"BufferBeats": 32, "MaxBeats": 16}],
    "flk_geometry_fetch": [{"BufferBeats": 20, "Clusters": 3, "MaxBeats": 16, "Bursts": 5}],
    "flk_record_cache": [{"RecordBits": 256, "Banks": 2, "Sets": 2, "Ways": 2, "Depth": 8, "Places": 4}],
    "flk_record_queue": [{"Width": 1, "Depth": 8}],
    "flk_delivery": [{"Queue": 8, "Units": 1}, {"Cores": 1, "InWidth": 2}],
    "flk_list_reader": [{"Contexts": 2, "Slots": 5, "Ahead": 1}],
    "flk_axi_write": [{"Width": 64, "MaxBeats": 256}, {"Bursts": 1, "IdBits": 1, "Id": 1, "BeatBits": 1}],
    "flk_bitonic_sorter": [
        {"Lanes": 2, "KeyWidth": 1, "PayloadWidth": 1},
        {"Lanes": 8, "StagesPerReg": 4},
        {"Lanes": 32, "StagesPerReg": 2},
    ],
}

# Checks beside those of the hardware, the longest first: programs of the environment, and scripts that compare what they have written.
CHECKS: list[list[object]] = [
    [sys.executable, "-m", "mypy"],
    [sys.executable, "scripts/gen_registers.py", "--check"],
    [sys.executable, "scripts/gen_counters.py", "--check"],
    [sys.executable, "scripts/gen_params.py", "--check"],
    [sys.executable, "scripts/gen_manifests.py", "--check"],
    [sys.executable, "scripts/gen_figures.py", "--check"],
    [sys.executable, "scripts/mutants.py", "--check"],
    [sys.executable, "scripts/check_pages.py"],
    [Path(sys.executable).parent / "lint-imports"],
    [sys.executable, "-m", "ruff", "check", "--output-format", "concise"],
]

TOP = "flk_lint_top"  # the generated top
GROUP = 400  # instances, at all depths, of the shapes of a group; more take more than proportionally longer


@dataclass(frozen=True)
class Shape:
    """A module with parameters; `name` is its instance's."""

    name: str
    module: str
    parameters: Mapping[str, int | str]
    outputs: tuple[str, ...]


def check_filelist(listed: list[Path]) -> list[str]:
    """Findings on the file list: unlisted sources, names that differ from the file's."""
    findings = []
    for path in sorted(set(RTL.rglob("*.sv")) - set(listed)):
        findings.append(f"{path.relative_to(ROOT)}: not listed in rtl/flk.f")
    for path in listed:
        names = re.findall(r"^(?:module|package)\s+(\w+)", path.read_text(), re.M)
        if names != [path.stem]:
            findings.append(f"{path.relative_to(ROOT)}: must hold just {path.stem}, has {names}")
    for name in (VARIANTS.keys() | SMALLER.keys()) - {path.stem for path in listed}:
        findings.append(f"scripts/lint.py: VARIANTS or SMALLER names the unknown module {name}")
    return findings


def shapes_of(listed: Sequence[Path]) -> list[Shape]:
    """All shapes, in the order of the file list. A default that is a package's constant is given with every instance: Verilator would take a parent's
    instance, which gives it too, for another shape.
    """
    packages = [path for path in listed if path.stem.endswith("_pkg")]
    homes = {name: path.stem for path in packages for name in re.findall(r"\b(?:localparam|parameter)\b[^=;]*?(\w+)\s*=", path.read_text())}
    found = []
    for path in listed:
        module = path.stem
        if module.endswith("_pkg"):
            continue
        header = re.search(rf"^module\s+{module}\b.*?^\);", re.sub(r"//.*", "", path.read_text()), re.M | re.S)
        if header is None:
            raise FlickerError(f"{path.relative_to(ROOT)}: no header of {module} that ends with a line `);`")
        outputs = tuple(re.findall(r"\boutput\b[^,;]*?(\w+)\s*(?=,|\n\))", header[0]))
        constants = re.findall(r"\bparameter\b[^,=]*?(\w+)\s*=\s*(?:\w+::)?([A-Z][A-Z0-9_]+)\s*(?=[,\n])", header[0])
        named = {name: f"{homes[value]}::{value}" for name, value in constants if value in homes}
        for number, parameters in enumerate([SMALLER.get(module, {}), *VARIANTS.get(module, [])]):
            found.append(Shape(f"{module}_{number}", module, {**named, **parameters}, outputs))
    return found


def top_text(shapes: Sequence[Shape]) -> str:
    """SystemVerilog of a top with every shape. Inputs stay open; outputs are looked at, or Verilator would take away what leads to them."""
    lines = []
    for number, shape in enumerate(shapes):
        values = ", ".join(f".{name}({value})" for name, value in shape.parameters.items())
        outputs = ", ".join(f"{shape.name}.{output}" for output in shape.outputs)
        lines.append(f"  {shape.module} {f'#({values}) ' if values else ''}{shape.name} ();")
        lines.append(f"  assign seen_o[{number}] = {f'^{{{outputs}}}' if outputs else chr(39) + '0'};")
    return "\n".join([f"module {TOP} (output logic [{len(shapes) - 1}:0] seen_o);", *lines, "endmodule", ""])


@cache
def sources_of(module: str) -> list[Path]:
    return toolchain.sources_of(module)


def verilator(shapes: Sequence[Shape], *options: str) -> list[object]:
    """Verilator on the generated top of shapes, with the sources that they need."""
    text = top_text(shapes)
    top = FOLDER / hashlib.sha256(text.encode()).hexdigest()[:16] / f"{TOP}.sv"
    top.parent.mkdir(parents=True, exist_ok=True)
    top.write_text(text)
    needed = {source.stem: source for module in {shape.module for shape in shapes} for source in sources_of(module)}
    sources = [needed[source.stem] for source in toolchain.filelist() if source.stem in needed]
    return ["verilator", "-Wall", "--quiet-build", *options, "--top-module", TOP, "lint/waiver.vlt", *(path.relative_to(ROOT) for path in [*sources, top])]


def elaborate(shapes: Sequence[Shape], *defines: str) -> tuple[str, dict[str, int]]:
    """Findings of step 1, and the shapes that no other one holds with their number of instances at all depths (empty after findings)."""
    out, seen = look(shapes, *defines)
    return out, seen.get("outermost", {})


def look(shapes: Sequence[Shape], *defines: str) -> tuple[str, dict[str, dict]]:
    """Findings of step 1; with defines, unless something was found, `outermost` and the registers without reset (`registers.registers_of`)."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree.json"
        out, kept = run(
            verilator(shapes, "--json-only", *defines),
            "--json-only-output", tree, "--json-only-meta-output", Path(folder) / "meta.json", "-Mdir", folder,
            keep=lambda: json.dumps(_facts(json.loads(tree.read_text())["modulesp"])) if defines else "{}",
        )
    return out, json.loads(kept or "{}")


def _facts(modules: list[dict]) -> dict[str, dict]:
    return {"outermost": outermost(modules), "registers": registers.registers_of(modules), "state": registers.with_reset(modules)}


def outermost(modules: list[dict]) -> dict[str, int]:
    """Instances of the top, one of each elaborated module that is instantiated by no other, with the number of instances below."""
    cells = {module["addr"]: list(_cells(module)) for module in modules}
    top = next(module["addr"] for module in modules if module["name"] == TOP)
    inner = {below for module, found in cells.items() if module != top for _, below in found}

    @cache
    def size(module: str) -> int:
        return 1 + sum(size(below) for _, below in cells[module])

    names = {module: name for name, module in reversed(cells[top]) if module not in inner}
    return {name: size(module) for module, name in names.items()}


def _cells(node: dict) -> list[tuple[str, str]]:
    """Instances anywhere below a node of Verilator's tree: name and elaborated module."""
    found = [(node["name"], node["modp"])] if node.get("type") == "CELL" else []
    for children in node.values():
        if isinstance(children, list):
            found += [cell for child in children for cell in _cells(child)]
    return found


def groups_of(shapes: Sequence[Shape], sizes: Mapping[str, int]) -> list[list[Shape]]:
    """Shapes of `sizes` in groups, the largest first."""
    groups: list[tuple[int, list[Shape]]] = []
    for shape in sorted((shape for shape in shapes if shape.name in sizes), key=lambda shape: -sizes[shape.name]):
        size, group = next((entry for entry in groups if entry[0] + sizes[shape.name] <= GROUP), (0, []))
        if group:
            groups.remove((size, group))
        groups.append((size + sizes[shape.name], [*group, shape]))
    return [group for _, group in sorted(groups, key=lambda entry: -entry[0])]


def run(command: list[object], *unhashed: object, keep: Callable[[], str] = str) -> tuple[str, str]:
    """Output of a lint tool if it found anything, else an empty string; and what `keep` makes of a run that passed.

    What has passed is not run again on equal files. unhashed: further arguments, of no influence on what is found.
    """
    words = [str(word) for word in command]
    files = [ROOT / word for word in words if word.endswith((".sv", ".vlt", ".rules", ".waiver"))]
    key = hashlib.sha256("\0".join([*words, VERSIONS, *(file.read_text() for file in files)]).encode()).hexdigest()
    passed = FOLDER / key
    if files and passed.exists():
        return "", passed.read_text()
    done = subprocess.run(
        [*words, *map(str, unhashed)], cwd=ROOT, env=toolchain.environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )
    if done.returncode:
        return f"$ {' '.join(words)}\n{done.stdout}", ""
    kept = keep()
    if files:
        passed.parent.mkdir(parents=True, exist_ok=True)
        passed.write_text(kept)
    return "", kept


def unseen(outputs: list[str]) -> list[str]:
    """Outputs that say something new: a warning comes again with every instance, and under every group that holds the module."""
    seen: set[str] = set()
    kept = []
    for output in outputs:
        said = set(re.findall(r"^%\S+ rtl/\S+?:\d+|^%(?!Error: Exiting)(?!\S+ rtl/).*$|^rtl/.*$", output, re.M))
        if not said or said - seen:
            kept.append(output)
        seen |= said
    return kept


def main() -> int:
    listed = toolchain.filelist()
    findings = check_filelist(listed)
    shapes = shapes_of(listed)
    verible: list[object] = [
        Path(sys.executable).parent / "verible-verilog-lint", "--rules_config", "lint/verible.rules",
        "--waiver_files", "lint/verible.waiver",
        *(path.relative_to(ROOT) for path in listed if path not in REGISTERS),
    ]
    with ThreadPoolExecutor(2) as pool:
        jobs: list[Future[tuple[str, object]]] = [pool.submit(run, CHECKS[0])]
        synthesised = pool.submit(look, shapes, "-DSYNTHESIS")
        out, seen = synthesised.result()
        # Shapes that do not elaborate are not flattened either: the findings would be the same.
        groups = [] if out else groups_of(shapes, seen["outermost"])
        jobs += [pool.submit(run, verilator(group, "--lint-only", "-DSYNTHESIS")) for group in groups]
        jobs.append(pool.submit(elaborate, shapes))
        jobs += [pool.submit(run, command) for command in [*CHECKS[1:], verible]]
        outputs = [out, *(job.result()[0] for job in jobs)]
    findings += [] if out else registers.check(seen["registers"], REGISTER_LIST, seen["state"])
    findings += unseen([output for output in outputs if output])

    for finding in findings:
        print(finding.rstrip())
    modules = len({shape.module for shape in shapes})
    print(f"lint: {modules} modules in {len(shapes)} shapes, {len(jobs) + 2} checks, {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"lint: {error}")
