"""Builds a top with Verilator (cached) and runs cocotb tests on it, under pytest.

Environment: FLICKER_SEED (default 1) seeds everything random, stimulus and initial register
values alike; WAVES=1 writes traces to build/waves: FST, or VCD where the headers for FST are
missing; WAVES_FORMAT=fst or vcd chooses.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest
from cocotb_tools import config as cocotb_config
from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

from flicker import toolchain
from flicker.errors import FlickerError
from flicker_tb import bench, four_state, signal_view
from flicker_tb.bench import netlist

TB = toolchain.ROOT / "tb"


def seed() -> int:
    """The seed of this run: FLICKER_SEED, 1 if unset."""
    text = os.environ.get("FLICKER_SEED", "1")
    try:
        return int(text)
    except ValueError:
        raise FlickerError(f"FLICKER_SEED: not an integer: {text!r}") from None


def waves() -> str:
    """Format of the traces that are wanted (WAVES, WAVES_FORMAT), ``fst`` or ``vcd``; empty if none are."""
    if os.environ.get("WAVES", "") in ("", "0"):
        return ""
    wanted = os.environ.get("WAVES_FORMAT") or toolchain.trace_format()
    if wanted not in ("fst", "vcd"):
        raise FlickerError(f"WAVES_FORMAT: fst or vcd, not {wanted!r}")
    return wanted


def build(
    top: str,
    *,
    parameters: Mapping[str, str | int] | None = None,
    extra: Sequence[Path] = (),
    sources: Sequence[Path] | None = None,
    args: Sequence[str] = (),
    opt: str = "-O0",
    inner: bool = False,
) -> Path:
    """Program that runs cocotb on ``top``; built unless an equal build exists.

    cocotb sees the ports only, or with ``inner`` all signals, which for large designs is several times more C++; registers get random values at the start
    of a run. Compilation is quick instead of thorough (one piece of C++, ``opt``): most of a simulation's time is Python's. With NETLIST=1 in the environment
    the design is its synthesised netlist instead of the RTL, of which only ports are visible and registers with a reset begin reset. With FOUR_STATE=1 it
    runs in Icarus Verilog (`four_state`).
    Args as of ``flicker.toolchain.verilate``.
    """
    if bench.four_state():
        return four_state.build(top, parameters or {}, list(sources or toolchain.sources_of(top, extra)))
    visible = ["--public-flat-rw"] if inner or waves() else ["--public-depth", "1"]
    if netlist():
        if sources is not None or extra:
            pytest.skip(f"{top}: sources outside rtl/flk.f have no netlist")
        from flicker.cost.synth.gates import sources as gates

        sources = gates(top, {name: int(value) for name, value in (parameters or {}).items()})
        parameters, args, visible = None, [*args, "-Wno-fatal"], []
    libs = cocotb_config.libs_dir
    main = cocotb_config.share_dir / "lib" / "verilator" / "verilator.cpp"
    trace = [f"--trace-{waves()}", "--trace-structs"] if waves() else []
    if waves() == "fst" and (missing := toolchain.missing_fst_packages()):
        raise FlickerError(f"WAVES: FST headers missing, install the packages {' '.join(missing)}")
    return toolchain.verilate(
        top,
        sources,
        extra=extra,
        parameters=parameters,
        args=["--vpi", *visible, "--output-split", "0", "--assert", "--x-assign", "unique",
              "--x-initial", "unique", *trace, *args],
        cpp=[main],
        ldflags=f"-Wl,-rpath,{libs} -L{libs} -lcocotbvpi_verilator",
        opt=opt,
        kind="sim",
    )


def build_and_test(
    top: str,
    module: str,
    *,
    parameters: Mapping[str, str | int] | None = None,
    config: Mapping[str, object] | None = None,
    extra: Sequence[Path] = (),
    sources: Sequence[Path] | None = None,
    args: Sequence[str] = (),
    opt: str = "-O0",
    inner: bool = False,
    tests: Sequence[str] = (),
    seeds: int = 1,
) -> None:
    """Build ``top`` and run the cocotb tests of the Python module ``module`` on it.

    Args:
        top, parameters, extra, sources, args, opt, inner: as of ``build``.
        module: importable name; the folder of the pytest file is on the path.
        config: JSON-able settings, which the tests read with ``flicker_tb.bench.config()``.
        tests: names of the cocotb tests to run, parametrized ones in all variants; default all.
        seeds: number of runs, with seeds FLICKER_SEED, FLICKER_SEED + 1, ...

    Fails the pytest test if a cocotb test fails, an assertion of the design fires, or no
    cocotb test ran.
    """
    program = build(top, parameters=parameters, extra=extra, sources=sources, args=args, opt=opt, inner=inner)
    test = os.environ.get("PYTEST_CURRENT_TEST", f"{module}::{top} ")
    file, _, name = test.rsplit(" ", 1)[0].partition("::")
    unit = Path(file).stem.removeprefix("test_")
    label = re.sub(r"[^\w.=-]+", "_", name).strip("_")
    view = TB / "waves" / f"{top.removeprefix('flk_')}.gtkw"
    for number in range(seed(), seed() + seeds):
        folder = toolchain.BUILD / "sim-run" / unit / f"{label}-seed{number}"
        shutil.rmtree(folder, ignore_errors=True)
        trace = toolchain.BUILD / "waves" / unit / view.stem / f"{label}-seed{number}.{waves() or 'fst'}"
        if waves():
            trace.parent.mkdir(parents=True, exist_ok=True)
        print(f"{top} {dict(parameters or {})} FLICKER_SEED={number}", file=sys.stderr, flush=True)
        results = folder / "results.xml"
        try:
            simulator = "icarus" if bench.four_state() else "verilator"
            get_runner(simulator).test(
                test_module=module,
                hdl_toplevel=top,
                hdl_toplevel_lang="verilog",
                build_dir=program.parent,
                test_dir=folder,
                results_xml=str(results),
                seed=number,
                test_filter=rf"\.({'|'.join(tests)})(/.*)?$" if tests else None,
                waves=bool(waves()),
                test_args=["--trace-file", str(trace)] if waves() else [],
                plusargs=[] if bench.four_state() else ["+verilator+rand+reset+2", f"+verilator+seed+{_verilator_seed(number)}"],
                extra_env={
                    "FLICKER_TB_CONFIG": json.dumps(dict(config or {})),
                    "COCOTB_ANSI_OUTPUT": "0",
                    # pytest's rewriting of every imported module, numba's too, takes seconds.
                    "COCOTB_REWRITE_ASSERTION_FILES": "cocotb_*.py",
                },
            )
            ran, failed = get_results(results)
        except (SystemExit, RuntimeError) as error:
            ran, failed = _results_or_zero(results)
            reason = f"{failed} of {ran} cocotb tests failed" if failed else f"simulation: {error}"
            pytest.fail(f"{top}, FLICKER_SEED={number}: {reason}", pytrace=False)
        finally:
            if waves() and trace.exists():
                signal_view.save(trace, top, view)
                signal_view.fit(view, trace, top, trace.with_suffix(".gtkw"))
        cases = ElementTree.parse(results).iter("testcase")
        known = {case.get("name", "").split("/")[0] for case in cases}
        if failed or not ran or not set(tests) <= known:
            pytest.fail(
                f"{top}: {failed} of {ran} cocotb tests failed, "
                f"not found: {sorted(set(tests) - known)}",
                pytrace=False,
            )


def _verilator_seed(number: int) -> int:
    """Seed for the initial register values; Verilator takes 1 to 2^31 - 1."""
    return number % (2**31 - 1) or 1


def _results_or_zero(results: Path) -> tuple[int, int]:
    try:
        return get_results(results)
    except RuntimeError:
        return 0, 0
