#!/usr/bin/env python3
"""Lint: Verilator with every module as top, Verible style rules; ruff, mypy and the order of rooms on the Python; generated files.

Exits 1 on any warning, and if a generated source is not current (`make generate`). Each module is linted with its default parameters (or SMALLER ones) and
with those of VARIANTS, as synthesised (SYNTHESIS defined) and, where one of its sources looks at SYNTHESIS, as simulated, with assertions.
Accepted findings and their reasons: lint/waiver.vlt; style rules: lint/verible.rules; rules of ruff and mypy: pyproject.toml.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from flicker import toolchain
from flicker.errors import FlickerError

ROOT = toolchain.ROOT
RTL = ROOT / "rtl"
VERSIONS = (ROOT / "requirements.lock").read_text()

# Parameters in place of the defaults, where these only make more of a part that is linted by itself: the stage hands the number of VRUs to its cores.
SMALLER: dict[str, dict[str, int]] = {"flk_render_stage": {"VrusPerChannel": 1}}

# Parameters, beside those, under which a module takes another shape. What a parent has below it with all its parameters needs no entry of its own:
# the tables of flk_ff_rom stand under flk_ff_poly, the sizes of a channel under flk_channel.
VARIANTS: dict[str, list[dict[str, int]]] = {
    "flk_fifo": [{"Width": 1, "Depth": 1}, {"Depth": 5}, {"Depth": 128}],
    "flk_pipe_reg": [{"Width": 1}],
    "flk_skid_buffer": [{"Width": 1}],
    "flk_stream_arbiter": [{"Inputs": 2, "Width": 1}, {"Inputs": 5}],
    "flk_vru": [{"Form": 0}, *({"Form": form, "Pixels": pixels} for form in (0, 1) for pixels in (4, 16))],
    "flk_channel": [{"VrusPerChannel": 1}, {"VrusPerChannel": 4, "MiniTile": 3}],
    "flk_fifo_monitor": [{"MaskBits": 64}],
    "flk_mask_all": [{"MaskBits": 64}],
    "flk_mask_generator": [{"MaskGenerator": 1}],
    "flk_rendering_core": [{"VrusPerChannel": 1, "MaskBits": 64}],
    "flk_render_stage": [{"VrusPerChannel": 1, "MaskGenerator": 1}],
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
    "flk_cluster_cull": [{"BufferBeats": 16, "MaxBeats": 16}],
    "flk_geometry_fetch": [{"BufferBeats": 20, "Clusters": 3, "MaxBeats": 16, "Bursts": 5}],
    "flk_axi_write": [{"Width": 64, "MaxBeats": 256}, {"Bursts": 1, "IdBits": 1, "Id": 1, "BeatBits": 1}],
    "flk_bitonic_sorter": [
        {"Lanes": 2, "KeyWidth": 1, "PayloadWidth": 1},
        {"Lanes": 8, "StagesPerReg": 4},
        {"Lanes": 32, "StagesPerReg": 2},
    ],
}


# Checks beside those of the hardware, the longest last: programs of the environment, and scripts that compare what they have written.
CHECKS: list[list[object]] = [
    [sys.executable, "-m", "ruff", "check", "--output-format", "concise"],
    [Path(sys.executable).parent / "lint-imports"],
    [sys.executable, "scripts/mutants.py", "--check"],
    [sys.executable, "scripts/gen_manifests.py", "--check"],
    [sys.executable, "-m", "mypy"],
]


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


def run(command: list[object]) -> str:
    """Output of a lint tool if it found anything, else an empty string. What has passed is not run again on equal files."""
    words = [str(word) for word in command]
    files = [ROOT / word for word in words if word.endswith((".sv", ".vlt", ".rules", ".waiver"))]
    key = hashlib.sha256("\0".join([*words, VERSIONS, *(file.read_text() for file in files)]).encode()).hexdigest()
    passed = toolchain.BUILD / "lint" / key
    if files and passed.exists():
        return ""
    done = subprocess.run(
        words, cwd=ROOT, env=toolchain.environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )
    if files and not done.returncode:
        passed.parent.mkdir(parents=True, exist_ok=True)
        passed.touch()
    return f"$ {' '.join(words)}\n{done.stdout}" if done.returncode else ""


def unseen(outputs: list[str]) -> list[str]:
    """Outputs that say something new: a module's warning comes again under every top above it."""
    seen: set[str] = set()
    kept = []
    for output in outputs:
        said = set(re.findall(r"^%(?!Error: Exiting).*$|^rtl/.*$", output, re.M))
        if not said or said - seen:
            kept.append(output)
        seen |= said
    return kept


def main() -> int:
    listed = toolchain.filelist()
    findings = check_filelist(listed)
    findings += run([sys.executable, "scripts/gen_params.py", "--check"]).splitlines()[1:]

    commands: list[list[object]] = []
    for path in listed:
        top = path.stem
        if top.endswith("_pkg"):
            continue
        sources = [source.relative_to(ROOT) for source in toolchain.sources_of(top)]
        # Without a word of SYNTHESIS both passes read the same text, and the one of synthesis has fewer waivers.
        simulated = any("SYNTHESIS" in (ROOT / source).read_text() for source in sources)
        for parameters in [SMALLER.get(top, {}), *VARIANTS.get(top, [])]:
            for define in ([], ["-DSYNTHESIS"]) if simulated else (["-DSYNTHESIS"],):
                commands.append(
                    ["verilator", "--lint-only", "-Wall", "--quiet", *define, "--top-module", top,
                     *(f"-G{name}={value}" for name, value in parameters.items()),
                     "lint/waiver.vlt", *sources]
                )
    tools = Path(sys.executable).parent
    commands.append(
        [tools / "verible-verilog-lint", "--rules_config", "lint/verible.rules",
         "--waiver_files", "lint/verible.waiver",
         *(path.relative_to(ROOT) for path in listed)]
    )
    commands += CHECKS
    with ThreadPoolExecutor(2) as pool:
        outputs = [*pool.map(run, reversed(commands))]  # the long ones begin first
    findings += unseen([output for output in reversed(outputs) if output])

    for finding in findings:
        print(finding.rstrip())
    modules = sum(not path.stem.endswith("_pkg") for path in listed)
    print(f"lint: {modules} modules, {len(commands)} checks, {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except FlickerError as error:
        sys.exit(f"lint: {error}")
