"""Tools around the tests: which checkout is tested, choice of units, progress, traces, manifests for other tools.

Not covered: GTKWave itself, Bender itself (its manifest is read as YAML and compared with rtl/flk.f), the hosted CI.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

import lint
import pytest
import registers
import yaml
from flicker_tb import elaboration, runner, signal_view

from flicker import toolchain
from flicker.chip_registers import REGISTERS, ResultError
from flicker.errors import FlickerError
from flicker.toolchain import ROOT, filelist

BIN = Path(sys.prefix) / "bin"


def command(*words: object, cwd: Path = ROOT, **environment: str) -> subprocess.CompletedProcess:
    """Run a command outside this run of pytest; both outputs in ``stdout``."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "FLICKER_PROGRESS", "MAKE"))}
    return subprocess.run(
        [str(word) for word in words], cwd=cwd, env={**own, **environment}, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )


# ---- which checkout is tested -------------------------------------------------------------------


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What ``cp -r`` makes of this checkout and its environment; packages but our own are links."""
    copy = tmp_path_factory.mktemp("copied") / "checkout"
    skip = shutil.ignore_patterns(".venv", "build", ".git", "__pycache__", "*.egg-info", ".*_cache")
    shutil.copytree(ROOT, copy, ignore=skip)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", copy / ".venv"], check=True)
    site = copy / ".venv" / Path(sysconfig.get_path("purelib")).relative_to(sys.prefix)
    for path in Path(sysconfig.get_path("purelib")).iterdir():
        if "flicker" not in path.name:
            (site / path.name).symlink_to(path)
        elif path.is_dir():
            shutil.copytree(path, site / path.name)
        else:
            shutil.copy(path, site / path.name)
    shutil.copy(BIN / "pytest", copy / ".venv" / "bin" / "pytest")
    (copy / ".venv" / ".installed").write_text(f"{ROOT}\n")
    return copy


def test_copied_checkout_tests_itself(copy: Path) -> None:
    """Its interpreter finds its own package at once; its commands do after the set-up, which make runs by itself."""
    found = command(copy / ".venv/bin/python", "-c", "from flicker.toolchain import ROOT; print(ROOT)", cwd=copy)
    assert found.stdout.strip() == str(copy)
    assert (copy / ".venv/bin/pytest").read_text().startswith(f"#!{BIN}/python")
    done = command("make", "setup", cwd=copy)
    assert done.returncode == 0 and "setup: done" in done.stdout, done.stdout
    assert (copy / ".venv/bin/pytest").read_text().startswith(f"#!{copy}/.venv/bin/python")
    found = command(copy / ".venv/bin/python", "-c", "from flicker.toolchain import ROOT; print(ROOT)", cwd=copy)
    assert found.stdout.strip() == str(copy)
    assert "Nothing to be done" in command("make", "setup", cwd=copy).stdout
    assert command(BIN / "python", "-c", "from flicker.toolchain import ROOT; print(ROOT)").stdout.strip() == str(ROOT)


def test_foreign_package_is_refused(copy: Path) -> None:
    """The original's interpreter in the copy would test the original's RTL."""
    done = command(sys.executable, "-m", "pytest", "--collect-only", "-q", "tb", cwd=copy)
    assert done.returncode and "another checkout" in done.stdout and str(ROOT) in done.stdout and "make setup" in done.stdout


# ---- choice of units ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "says"), [("camera", "unit 'camera' does not simulate; those that simulate"), ("vruu", "no unit 'vruu'; those that simulate")]
)
def test_unit_that_does_not_simulate(unit: str, says: str) -> None:
    done = command(sys.executable, "-m", "pytest", "-m", "sim", "--unit", unit, "--collect-only", "-q", "tb")
    assert done.returncode and says in done.stdout, done.stdout
    named = re.search(r"simulate: (.*)", done.stdout)[1].split(", ")
    assert {"vru", "stream_cells", "frames"} <= set(named) and not {"camera", "formal", "tooling"} & set(named)


def test_names_of_tests_are_unique() -> None:
    """UNIT= names a file by its stem, and pytest imports one module of a name."""
    stems = [path.stem for path in (ROOT / "tb").rglob("*.py") if path.stem not in ("__init__", "conftest")]
    assert len(set(stems)) == len(stems), sorted({stem for stem in stems if stems.count(stem) > 1})


@pytest.mark.slow
def test_every_named_unit_has_simulations() -> None:
    """Each test file outside tb/model and tb/sw gives tests under ``-m sim``, and only these; but for files that need a package that is not here. Of tb/model,
    whose imports take longest, one file is collected: the mark comes from the folder, and no file of it sets it."""
    others = [path for path in sorted((ROOT / "tb").glob("*/test_*.py")) if path.parent.name == "model"]
    assert not [path for path in others if "mark.sim" in path.read_text()]
    ignored = [f"--ignore={path}" for path in others if path.name != "test_memory.py"]
    done = command(sys.executable, "-m", "pytest", "-m", "sim", "--slow", "--collect-only", "-q", *ignored, "tb")
    files = {line.split("::")[0] for line in done.stdout.splitlines() if "::" in line}
    needs = re.compile(r'^pytest\.importorskip\("(\w+)"', re.M)
    assert files == {
        path.relative_to(ROOT).as_posix() for path in (ROOT / "tb").glob("*/test_*.py")
        if path.parent.name not in ("model", "sw") and all(importlib.util.find_spec(name) for name in needs.findall(path.read_text()))
    }


# ---- progress -----------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [0, 2])
def test_progress_is_shown(workers: int, tmp_path: Path) -> None:
    """A build is announced while output is captured, and what lasts is listed with its time."""
    (tmp_path / "conftest.py").write_text(
        f"import sys\nsys.path.insert(0, {str(ROOT / 'tb')!r})\nfrom flicker_tb import progress\n"
        "def pytest_configure(config):\n"
        "    progress.register(config, pause=1.0)\n"
    )
    (tmp_path / "test_slow.py").write_text(
        "import time\nfrom flicker.toolchain import under_way\n"
        "def test_quick(): pass\n"
        "def test_slow():\n    with under_way('building flk_x (sim)'):\n        time.sleep(2.6)\n"
    )
    done = command(sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-n", workers, tmp_path, cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    assert re.search(r"^\[building flk_x \(sim\)\]$", done.stdout, re.M), done.stdout
    test, build = r"test_slow.py::test_slow \(\d s\)", r"building flk_x \(sim\) \(\d s\)"  # the longest first; both began just now
    assert re.search(rf"^\[\d+ s, under way: ({test}, {build}|{build}, {test})\]$", done.stdout, re.M), done.stdout
    assert "test_quick (" not in done.stdout


# ---- parameters that are refused ----------------------------------------------------------------


@pytest.mark.parametrize(("top", "parameters"), [
    ("flk_fifo", {"Depth": 0}), ("flk_bitonic_sorter", {"Lanes": 3, "KeyWidth": 0}), ("flk_axi_split", {"Bytes": 48, "AddrBits": 12}),
])
def test_slang_and_verilator_refuse_the_same(top: str, parameters: dict[str, int]) -> None:
    """The other tests of parameters ask slang alone."""
    with pytest.raises(FlickerError) as raised:
        runner.build(top, parameters=parameters)
    log = Path(re.search(r"\(see (.*)\)", str(raised.value))[1]).read_text()
    told = set(re.findall(r"-USERERROR: \S+:\d+:\d+: (.*)", log))
    assert told == set(elaboration.refusals(top, parameters)) and len(told) == len(parameters), log


def test_defaults_are_not_refused() -> None:
    """No module refuses its own defaults; a parameter that is not there, and messages that nobody says, are failures."""
    assert {top: said for top in (path.stem for path in filelist()) if not top.endswith("_pkg") and (said := elaboration.refusals(top, {}))} == {}
    for parameters, message in (({"Deepth": 0}, "Depth must be"), ({"Depth": 0}, "Width must be"), ({"Depth": 8}, "Depth must be")):
        with pytest.raises(AssertionError, match="no parameter Deepth|not refused with"):
            elaboration.refused("flk_fifo", parameters, message)


# ---- traces -------------------------------------------------------------------------------------

VCD = """$version Generated by VerilatedVcd $end
$scope module $rootio $end
 $var wire 1 ! clk_i $end
$upscope $end
$scope module flk_x $end
 $var wire 32 a Depth [31:0] $end
 $var wire 1 ! clk_i $end
 $var wire 8 b data_q[0] [7:0] $end
 $scope module pixel $end
  $var wire 16 c red [15:0] $end
 $upscope $end
 $scope module gen_core[0] $end
  $var wire 1 d inner $end
 $upscope $end
 $scope module i_fifo $end
  $var wire 1 d push $end
 $upscope $end
$upscope $end
$enddefinitions $end
"""


def test_view_of_a_vcd(tmp_path: Path) -> None:
    """Signals of the top, structs by field; a view made for FST, with other widths, fits."""
    trace, view, fitted = tmp_path / "x.vcd", tmp_path / "x.gtkw", tmp_path / "fitted.gtkw"
    trace.write_text(VCD)
    names = ["flk_x.clk_i", "flk_x.data_q[0][7:0]", "flk_x.pixel.red[15:0]"]
    assert list(signal_view.signals(trace, "flk_x")) == names
    view.write_text("[*] saved\nflk_x.clk_i\nflk_x.data_q.data_q[0][3:0]\nflk_x.pixel.red[7:0]\n")
    signal_view.fit(view, trace, "flk_x", fitted)
    assert fitted.read_text().splitlines() == ["[*] saved", *names]
    trace.write_text(VCD.split("$enddefinitions")[0])
    with pytest.raises(FlickerError, match="incomplete"):
        list(signal_view.signals(trace, "flk_x"))


def test_trace_format(monkeypatch: pytest.MonkeyPatch) -> None:
    """FST where its headers are, else VCD; none unless asked for."""
    for missing, format in ((["liblz4-dev"], "vcd"), ([], "fst")):
        monkeypatch.setattr(toolchain, "missing_fst_packages", lambda missing=missing: missing)
        toolchain.trace_format.cache_clear()
        monkeypatch.setenv("WAVES", "1")
        assert runner.waves() == format
    toolchain.trace_format.cache_clear()
    monkeypatch.setenv("WAVES_FORMAT", "vcd")
    assert runner.waves() == "vcd"
    monkeypatch.setenv("WAVES_FORMAT", "lxt")
    with pytest.raises(FlickerError, match="WAVES_FORMAT.*'lxt'"):
        runner.waves()
    monkeypatch.setenv("WAVES", "0")
    assert runner.waves() == ""


@pytest.mark.slow
def test_vcd_is_written() -> None:
    """A simulation with traces leaves a VCD and its view; needs no headers."""
    done = command(
        sys.executable, "-m", "pytest", "--unit", "stream_cells", "-k", "test_skid_buffer and 146", "tb", WAVES="1", WAVES_FORMAT="vcd"
    )
    assert done.returncode == 0, done.stdout
    trace = ROOT / "build/waves/stream_cells/skid_buffer/test_skid_buffer_146-seed1.vcd"
    assert "$enddefinitions" in trace.read_text()
    shown = trace.with_suffix(".gtkw").read_text().splitlines()
    assert set(signal_view.signals(trace, "flk_skid_buffer")) <= set(shown)


# ---- front ends, as docs/guide/integration.md says ----------------------------------------------------

YOSYS = "import sys; from pyosys import libyosys as y; d = y.Design(); [y.run_pass(c, d) for c in sys.argv[1:]]"


def test_slang_reads_everything_and_the_template_fits() -> None:
    """No errors in the sources; the instantiation template of the page elaborates and is that of the module's ports."""
    page = (ROOT / "docs/reference/template_stage.md").read_text()
    template = page.split("<!-- make docs PART=instance -->\n```systemverilog\n")[1].split("```")[0]
    sys.path.insert(0, str(ROOT / "scripts"))
    from doc_parts.instance import elaborate

    assert elaborate()[0] == []
    errors, tops = elaborate(f"module outside; {template} endmodule")
    assert errors == [] and {"outside"} <= tops.keys() and "flk_render_stage" not in tops
    assert elaborate(f"module outside; {template.replace('.clk_i', '.clock_i')} endmodule")[0]


def test_verible_parses_everything() -> None:
    done = command(BIN / "verible-verilog-syntax", *filelist())
    assert done.returncode == 0, done.stdout


def test_what_yosys_reads(tmp_path: Path) -> None:
    """`read_slang` reads the structs; `read_verilog -sv` refuses our sources, and builds a wrong netlist of the page's example without a warning."""
    page = (ROOT / "docs/guide/integration.md").read_text()
    source = tmp_path / "wrong.sv"
    source.write_text(page.split("holds this text against Yosys -->\n```systemverilog\n")[1].split("```")[0])
    shown = {}
    for reader in ("read_verilog -sv", "read_slang"):
        done = command(
            sys.executable, "-c", YOSYS, f"{reader} {source}", "prep -top wrong", "check -assert",
            *(f"eval -set in_i 16'h1234 -set k_i {k} -show sel_o wrong" for k in (0, 1)),
        )
        assert done.returncode == 0 and "Warning" not in done.stdout, done.stdout
        shown[reader] = re.findall(r"sel_o = 8'([01]{8})", done.stdout)
    assert shown == {"read_verilog -sv": ["00000000"] * 2, "read_slang": [f"{0x34:08b}", f"{0x12:08b}"]}
    done = command(sys.executable, "-c", YOSYS, f"read_verilog -sv {' '.join(map(str, filelist()))}")
    assert done.returncode and re.search(r"flk_\w+_pkg\.sv:\d+: ERROR: syntax error", done.stdout), done.stdout[-500:]


# ---- lint ---------------------------------------------------------------------------------------

# Something wrong in a module, and what is said of it: by elaboration, by flattening.
FAULTS = {
    "width": ("endmodule", "logic [2:0] unused_narrow; assign unused_narrow = 4'(clk_i);\nendmodule", "WIDTHTRUNC"),
    "unused": ("endmodule", "logic useless; assign useless = clk_i;\nendmodule", "UNUSEDSIGNAL"),
    "simulated": ("endmodule", "`ifndef SYNTHESIS\nlogic useless; assign useless = clk_i;\n`endif\nendmodule", "UNUSEDSIGNAL"),
    "latch": ("endmodule", "logic unused_latch; always_comb if (clk_i) unused_latch = rst_ni;\nendmodule", "LATCH"),
    "loop": ("= out_valid_o && out_ready_i", "= out_valid_o && out_ready_i && !pop", "UNOPTFLAT"),
    "drivers": ("= out_valid_o && out_ready_i", "= out_valid_o;\nassign pop = out_ready_i", "MULTIDRIVEN"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("module", ["flk_fifo", "flk_axi_read"])
def test_lint_finds(fault: str, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault in a module inside another and in the outer one; `seen` of the generated top keeps what leads to outputs alone."""
    old, new, rule = FAULTS[fault]
    source = next(path for path in filelist() if path.stem == module)
    assert source.read_text().count(old) == 1
    wrong = toolchain.BUILD / "lint-faults" / f"{fault}-{module}" / source.name
    wrong.parent.mkdir(parents=True, exist_ok=True)
    wrong.write_text(source.read_text().replace(old, new))
    right = toolchain.sources_of
    monkeypatch.setattr(lint, "sources_of", lambda name: [wrong if path == source else path for path in right(name)])
    assert rule in said_of("flk_axi_read")


def said_of(module: str) -> str:
    """Findings of lint on the shapes of a module."""
    shapes = [shape for shape in lint.shapes_of(filelist()) if shape.module == module]
    out, sizes = lint.elaborate(shapes, "-DSYNTHESIS")
    out += lint.elaborate(shapes)[0]
    return out + "".join(lint.run(lint.verilator(group, "--lint-only", "-DSYNTHESIS"))[0] for group in lint.groups_of(shapes, sizes))


def test_lint_flattens_every_shape_once() -> None:
    """A shape that another one holds is left to it; others of the same module are not."""
    assert said_of("flk_axi_read") == ""
    outer, default, *_ = (shape for shape in lint.shapes_of(filelist()) if shape.module in ("flk_axi_read", "flk_fifo") and not shape.parameters)
    if outer.module == "flk_fifo":
        outer, default = default, outer
    inner = lint.Shape("inner", "flk_fifo", {"Width": 2, "Depth": 8}, default.outputs)  # as flk_axi_read has it with its default parameters
    _, sizes = lint.elaborate([inner, outer, default], "-DSYNTHESIS")
    assert sizes.keys() == {outer.name, default.name} and sizes[outer.name] > 2 and sizes[default.name] == 1
    _, sizes = lint.elaborate([inner, default], "-DSYNTHESIS")
    assert sizes == {inner.name: 1, default.name: 1}
    # A parent that gives its child a package's constant, which is the child's default too.
    parent, child = (shape for shape in lint.shapes_of(filelist()) if shape.name in ("flk_channel_0", "flk_vru_0"))
    assert lint.elaborate([parent, child], "-DSYNTHESIS")[1].keys() == {"flk_channel_0"}
    groups = lint.groups_of([inner, outer, default], {"inner": lint.GROUP, outer.name: 2 * lint.GROUP, default.name: 1})
    assert groups == [[outer], [inner], [default]]


# What a register without reset is: the next value of each in turn, with `held` around it or not.
BARE = {
    "load": ("if (go_i) q <= d_i;", "data"),
    "row": ("if (go_i) q <= {q[2:0], d_i[0]};", "data"),
    "hold": ("q <= go_i ? d_i : q;", "data"),
    "count": ("if (go_i) q <= q + 4'd1;", "feeds itself"),
    "ring": ("if (go_i) q <= {q[2:0], q[3]};", "feeds itself"),
    "wrap": ("if (go_i) q <= next; ", "feeds itself"),
    "by itself": ("if (q[3]) q <= d_i;", "feeds itself"),
    "by another": ("if (go_i) q <= other + 4'd1; other <= q;", "feeds itself"),
    "decides": ("q <= d_i; state <= q[0];", "drives control"),
}


@pytest.mark.parametrize("name", BARE)
def test_registers_without_reset(name: str, tmp_path: Path) -> None:
    """What each is, through Verilator's tree; also below another module, whose register it decides. The list must name it as that."""
    text, kind = BARE[name]
    bare, reset = (part.strip() for part in text.split("state <=")) if "state" in text else (text, "")
    source = tmp_path / "inner.sv"
    source.write_text(
        "module inner (input logic clk_i, rst_ni, go_i, input logic [3:0] d_i, output logic [3:0] q_o, output logic state_o);\n"
        "  logic [3:0] q, other, next;\n  logic state;\n  assign next = q >= 4'd9 ? 4'd0 : q + 4'd1;\n"
        f"  always_ff @(posedge clk_i) begin {bare} end\n"
        f"  always_ff @(posedge clk_i or negedge rst_ni) if (!rst_ni) state <= 1'b0; else state <= {reset or 'go_i;'}\n"
        "  assign q_o = q;\n  assign state_o = state;\nendmodule\n"
    )
    tree = tmp_path / "tree.json"
    done = command(
        "verilator", "--json-only", "--json-only-output", tree, "--json-only-meta-output", tmp_path / "meta", "-Mdir", tmp_path, "-Wno-fatal", source,
        **toolchain.environment(),
    )
    assert done.returncode == 0, done.stdout
    found = registers.registers_of(json.loads(tree.read_text())["modulesp"])
    assert found["inner"]["q"] == kind
    allowed = tmp_path / "list.toml"
    names = json.dumps([*found["inner"], "another"])
    allowed.write_text(f'[[register]]\nmodules = ["inner"]\nkind = "{kind}"\nnames = {names}\nreason = "a test"\n')
    said = [line for line in registers.check(found, allowed) if "inner: other" not in line]
    assert said == [f"{tmp_path.name}/list.toml: entry 1: nothing is like another"]
    wrong = "data" if kind != "data" else "feeds itself"
    allowed.write_text(allowed.read_text().replace(kind, wrong))
    assert any("inner: q has no reset" in line for line in registers.check(found, allowed))
    state = registers.with_reset(json.loads(tree.read_text())["modulesp"])
    allowed.write_text(allowed.read_text().replace(names, '["*"]'))
    assert state == ["inner"] and "list.toml: entry 1: inner has registers with a reset: name those without" in registers.check(found, allowed, state)


# ---- manifests for other tools ------------------------------------------------------------------


def test_manifests_follow_the_list() -> None:
    done = command(sys.executable, "scripts/gen_manifests.py", "--check")
    assert done.returncode == 0, done.stdout
    files = [path.relative_to(ROOT).as_posix() for path in filelist()]
    assert yaml.safe_load((ROOT / "Bender.yml").read_text()) == {"package": {"name": "flicker"}, "sources": files}
    assert yaml.safe_load((ROOT / "flicker.core").read_text())["filesets"]["rtl"]["files"] == files


BENCH = ROOT / "tb" / "top" / "flk_top_tb.sv"


def fusesoc(tree: Path, work: Path, target: str, *parameters: str, steps: Sequence[str] = ()) -> subprocess.CompletedProcess:
    """A target of the core in a folder, all of it or the steps named, with the environment's Verilator, whose makefiles want to be told of the compiler."""
    work.mkdir()
    path = toolchain.environment()
    return command(
        sys.executable, "-m", "fusesoc.main", "--cores-root", tree, "run", "--target", target, "--work-root", work, *steps, "flicker", *parameters,
        cwd=work,
        HOME=str(work), PATH=path["PATH"], VERILATOR_ROOT=path["VERILATOR_ROOT"],
        MAKEFLAGS="AR=ar CFG_CXXFLAGS_PCH_I=-include CFG_CXXFLAGS_STD_NEWEST=-std=gnu++20 CFG_CXXFLAGS_COROUTINES=-fcoroutines OPT_FAST=-O0 OPT_GLOBAL=-O0",
    )


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """What a user of the core has."""
    for name in ("rtl", "lint"):
        shutil.copytree(ROOT / name, tmp_path / "tree" / name)
    (tmp_path / "tree" / "tb" / "top").mkdir(parents=True)
    shutil.copy(BENCH, tmp_path / "tree" / "tb" / "top")
    shutil.copy(ROOT / "flicker.core", tmp_path / "tree")
    return tmp_path / "tree"


def test_fusesoc_targets(tree: Path, tmp_path: Path) -> None:
    """FuseSoC sets each target up with the parameters that it is given; every file of it is there."""
    core = yaml.safe_load((ROOT / "flicker.core").read_text())
    assert set(core["targets"]) == {"default", "lint", "lint_stage", "sim"}
    assert {name for target in core["targets"].values() for name in target.get("parameters", [])} == set(core["parameters"])
    for number, (target, top, given) in enumerate([
        ("lint", "flk_top_axi", {"Stage": 1, "IdWidth": 9}), ("lint_stage", "flk_render_stage", {}), ("sim", "flk_top_tb", {"Lanes": 64, "ResetStages": 0}),
    ]):
        done = fusesoc(tree, tmp_path / f"work{number}", target, *(f"--{name}={value}" for name, value in given.items()), steps=["--setup"])
        assert done.returncode == 0 and "ERROR" not in done.stdout, done.stdout
        options = next((tmp_path / f"work{number}").glob("*.vc")).read_text()
        assert f"--top-module {top}" in options and all(path.name in options for path in filelist())
        assert dict(re.findall(r"-G(\w+)=(\w+)", options)) == {name: str(value) for name, value in given.items()}


def test_bench_of_the_chip_follows_the_registers() -> None:
    """Its addresses are those of the registers, its parameters those of the core; slang finds no error in it."""
    sys.path.insert(0, str(ROOT / "scripts"))
    from doc_parts.instance import elaborate

    text = BENCH.read_text()
    addresses = {name: int(value, 16) for name, value in re.findall(r"logic \[9:0\] (\w+) = 10'h(\w+);", text)}
    nothing = addresses.pop("NOTHING")
    assert len(addresses) == 9 and addresses == {name: REGISTERS[name.lower()].offset for name in addresses}
    assert nothing not in {register.offset + 4 * k for register in REGISTERS.values() for k in range(register.count)}
    assert f"DESCRIPTOR_ERROR = 16'h{1 << ResultError.DESCRIPTOR:x}" in text
    assert set(re.findall(r"parameter int unsigned (\w+)", text)) == set(yaml.safe_load((ROOT / "flicker.core").read_text())["parameters"])
    errors, tops = elaborate(text, {"flk_top_tb"})
    assert errors == [] and tops.keys() == {"flk_top_tb"}


@pytest.mark.slow
def test_fusesoc_lint(tree: Path, tmp_path: Path) -> None:
    """FuseSoC finds the core and lints chip and stage with the environment's Verilator; a wrong source fails."""
    for number, (target, given) in enumerate([("lint", ("--Stage=1", "--IdWidth=9")), ("lint_stage", ())]):
        done = fusesoc(tree, tmp_path / f"good{number}", target, *given)
        assert done.returncode == 0 and "Error" not in done.stdout and "%Warning" not in done.stdout, done.stdout
        options = next((tmp_path / f"good{number}").glob("*.vc")).read_text()
        assert {"--lint-only", "-Wall"} <= set(options.split())
    cell = tree / "rtl/common/flk_fifo.sv"
    cell.write_text(cell.read_text().replace("endmodule", "logic [1:0] unread; assign unread = 3'd1;\nendmodule"))
    done = fusesoc(tree, tmp_path / "bad", "lint_stage")
    assert done.returncode and "%Warning-WIDTHTRUNC" in done.stdout, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("whole", [False, True], ids=["stand-ins for the halves", "whole chip"])
def test_fusesoc_sim(whole: bool, tree: Path, tmp_path: Path) -> None:
    """The smoke test of the chip as a user of the core runs it."""
    if not whole:
        sys.path.insert(0, str(ROOT / "tb" / "top"))
        import standins

        for path in standins.sources():
            if path.parent.name == "standins":
                shutil.copy(path, next((tree / "rtl").rglob(path.name)))
    done = fusesoc(tree, tmp_path / "work", "sim", "--IdWidth=9")
    assert done.returncode == 0 and "flk_top_tb: passed" in done.stdout, done.stdout[-3000:]
