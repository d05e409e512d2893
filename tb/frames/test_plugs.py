"""Plug points: a rendering stage and a mask generator that the project does not have, each one module and one line in a table, in a copy of the
project; `make generate` does the rest.

State space: a stage that takes its lists and gives background pixels, rendered by the harness; a generator with masks of pixels, all ones, which
must give the picture and the cycles of `all`; an assertion of the stage that fails. Not covered: a stage with another record than the splat's
(layout.RECORDS then has one more).
"""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from flicker.front.projection import project
from flicker.front.records import build_lists
from flicker.golden.render import render_golden
from flicker.params import CatMode, RenderConfig
from flicker.scene.demo import demo_cameras, generate
from flicker.toolchain import BUILD, ROOT

STUB = """// Rendering stage that takes its lists and gives background pixels.
module flk_stub_stage
  import flk_pkg::*;
  import flk_param_pkg::*;
(
  input  logic                         clk_i,
  input  logic                         rst_ni,
  input  logic                         clear_i,
  output logic                         idle_o,
  input  logic                   [2:0] mode_i,
  input  logic             [CORES-1:0] in_valid_i,
  output logic             [CORES-1:0] in_ready_o,
  input  splat_elem_t      [CORES-1:0] in_elem_i,
  output logic             [CORES-1:0] finished_o,
  output logic             [CORES-1:0] out_valid_o,
  input  logic             [CORES-1:0] out_ready_i,
  output core_pixel_t      [CORES-1:0] out_data_o,
  input  logic                         clear_counters_i,
  input  logic                         hold_counters_i,
  input  logic [COUNTER_ADDR_BITS-1:0] counter_addr_i,
  output logic      [COUNTER_BITS-1:0] counter_data_o
);
  logic [CORES-1:0] valid, ready, idle, in_eos, unused_clear;
  logic [CORES-1:0][COUNTER_BITS-1:0] counter;
  logic [2:0] unused_mode;

  flk_stage_control i_control (
    .clk_i, .rst_ni, .clear_i, .mode_i, .mode_o(unused_mode), .idle_o, .in_valid_i, .in_ready_o, .in_eos_i(in_eos), .valid_o(valid),
    .ready_i(ready), .idle_i(idle), .counter_core_i(counter_addr_i[COUNTER_ADDR_BITS-1:COUNTER_INDEX_BITS]), .counter_i(counter),
    .counter_data_o
  );

  for (genvar k = 0; k < CORES; k++) begin : gen_core
    logic busy_q;
    logic [5:0] index_q;
    subtile_t subtile_q;
    generator_events_t events;
    assign in_eos[k]      = in_elem_i[k].eos;
    assign ready[k]       = !busy_q;
    assign idle[k]        = !busy_q;
    assign out_valid_o[k] = busy_q;
    always_comb begin
      out_data_o[k] = '0;
      out_data_o[k].subtile = subtile_q;
      {out_data_o[k].minitile, out_data_o[k].index} = index_q;
      out_data_o[k].pixel.transmittance = FP16_ONE;
      events = '0;
      events.splat = valid[k] && ready[k] && !in_eos[k];
      events.token = valid[k] && ready[k] && in_eos[k];
    end
    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        busy_q  <= 1'b0;
        index_q <= '0;
      end else if (clear_i) begin
        busy_q  <= 1'b0;
        index_q <= '0;
      end else begin
        if (events.token) busy_q <= 1'b1;
        if (busy_q && out_ready_i[k]) begin
          index_q <= index_q + 1'b1;
          busy_q  <= index_q != '1;
        end
      end
    end
    assert property (@(posedge clk_i) disable iff (!rst_ni) !busy_q |-> index_q == '0);
    always_ff @(posedge clk_i) if (events.token) subtile_q <= subtile_t'(in_elem_i[k].splat.feature[$bits(subtile_t)-1:0]);
    flk_perf_counters i_counters (
      .clk_i, .rst_ni, .clear_i(clear_counters_i), .hold_i(hold_counters_i), .generator_events_i(events), .dispatch_events_i('0),
      .channel_events_i('0), .addr_i(counter_addr_i[COUNTER_INDEX_BITS-1:0]), .data_o(counter[k])
    );
  end
endmodule
"""
STAGE_ENTRY = 'STAGES["stub"] = Stage("flk_stub_stage", "splat_elem", "core_pixel", (), STAGES["channels"].counters, "background")\n'
GENERATOR_ENTRY = (
    'MASK_GENERATORS["pixels"] = MaskGenerator("flk_mask_pixels", SUBTILE_PIXELS, {}, lambda config: 1, one_token=False, tests=False, note="ones")\n'
)
# Runs in the copy. Lists and golden pixels come from outside: the copy's kernels are not compiled.
RENDER = """
import json, pickle, sys
from pathlib import Path
import numpy as np
from flicker import params
from flicker.errors import FlickerError
from flicker.sim.render_stage import build, render_rtl

changes, inputs, module, wrong = json.loads(sys.argv[1])
config = params.RenderConfig(cat=params.CatMode.OFF, mask_generator="all")
lists, golden = pickle.loads(Path(inputs).read_bytes())
found = {"file": params.__file__, "elements": len(lists.entry), "subtiles": lists.cols * lists.rows}
for change in changes:
    frame = render_rtl(lists, config.with_(**change), checks=True, aborts=[(300, 2)])
    background = (0.25, 0.5, 0.75)
    found[json.dumps(change)] = {
        "cycles": frame.cycles, "golden": bool((frame.pixels == golden).all()),
        "background": bool((frame.image(background) == np.array(background, np.float32)).all()), "counters": frame.counters.tolist(),
    }
if wrong:
    config = config.with_(**changes[0])
    try:
        render_rtl(lists, config, library=build(config, checks=True, replaced={module: Path(wrong)}))
    except FlickerError as error:
        found["error"] = str(error)
print(json.dumps(found))
"""


def plug(name: str, module: str, file: str, text: str, entry: str, changes: list[dict[str, str]], wrong: str = "") -> dict:
    """Copy the project, add a module and a line of params.py, generate, render; asserts that nothing else was touched by hand.

    wrong: another text of the module, which is rendered, too; `error` of the result is what was said.
    """
    copy = BUILD / "plugs" / name
    shutil.rmtree(copy, ignore_errors=True)
    for folder in ("rtl", "model", "scripts"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    (copy / "build").symlink_to(BUILD)
    (copy / file).write_text(text)
    params = copy / "model" / "flicker" / "params.py"
    params.write_text(params.read_text() + entry)
    inputs, other = copy / "inputs.pickle", copy / "wrong" / Path(file).name
    camera = demo_cameras()[0].resized(64, 48)
    config = RenderConfig(cat=CatMode.OFF, mask_generator="all")
    lists = build_lists(project(generate(), camera), camera, config)
    inputs.write_bytes(pickle.dumps((lists, render_golden(lists, config).pixels)))
    if wrong:
        other.parent.mkdir()
        other.write_text(wrong)
    environment = {**os.environ, "PYTHONPATH": str(copy / "model"), "NUMBA_CACHE_DIR": str(BUILD / "plugs" / "numba")}
    subprocess.run([sys.executable, copy / "scripts" / "gen_params.py"], env=environment, check=True)
    arguments = json.dumps([changes, str(inputs), module, str(other) if wrong else ""])
    done = subprocess.run([sys.executable, "-c", RENDER, arguments], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    # The simulator's own message of the broken assertion may come behind it.
    found = json.loads(next(line for line in reversed(done.stdout.splitlines()) if line.startswith("{")))
    assert Path(found["file"]).is_relative_to(copy), "the copy was not used"
    return found


def touched(name: str) -> set[str]:
    """Files of the copy that differ from the project's, or are new."""
    copy = BUILD / "plugs" / name
    files = [path.relative_to(copy) for folder in ("rtl", "model", "scripts") for path in (copy / folder).rglob("*")
             if path.is_file() and "__pycache__" not in path.parts]
    return {str(path) for path in files if not (ROOT / path).is_file() or (ROOT / path).read_bytes() != (copy / path).read_bytes()}


def test_stub_stage() -> None:
    """A new rendering stage: its module, and one line by hand elsewhere. A frame that breaks an assertion ends with an error that names the place."""
    change = {"stage": "stub"}
    good = "index_q != '1;"
    assert STUB.count(good) == 1
    found = plug("stage", "flk_stub_stage", "rtl/render/flk_stub_stage.sv", STUB, STAGE_ENTRY, [change], wrong=STUB.replace(good, "index_q != 6'd40;"))
    assert found[json.dumps(change)]["background"] and not found[json.dumps(change)]["golden"]
    line = 1 + STUB[:STUB.index("assert property")].count("\n")
    assert re.search(rf"assertion failed at .*wrong/flk_stub_stage.sv:{line}\b", found["error"])
    counters = found[json.dumps(change)]["counters"]
    assert sum(core[2] for core in counters) == found["elements"] and sum(core[1] for core in counters) == found["subtiles"]
    generated = {"rtl/flk.f", "rtl/generated/flk_param_pkg.sv", "rtl/generated/flk_stage.sv"}
    assert touched("stage") == {"rtl/render/flk_stub_stage.sv", "model/flicker/params.py"} | generated


@pytest.mark.slow
def test_pixel_mask_generator() -> None:
    """A new mask generator, with 64-bit masks: all ones give picture, cycles and counters of four bits."""
    source = (ROOT / "rtl" / "render" / "flk_mask_all.sv").read_text()
    source = source.replace("flk_mask_all", "flk_mask_pixels").replace("MaskBits       = CHANNELS,", "MaskBits       = SUBTILE * SUBTILE,")
    changes = [{"mask_generator": "all"}, {"mask_generator": "pixels"}]
    found = plug("generator", "flk_mask_pixels", "rtl/render/flk_mask_pixels.sv", source, GENERATOR_ENTRY, changes)
    four, pixels = (found[json.dumps(change)] for change in changes)
    assert pixels["golden"] and not pixels["background"]
    assert pixels == four
    generated = {"rtl/flk.f", "rtl/generated/flk_param_pkg.sv", "rtl/generated/flk_mask_generator.sv"}
    assert touched("generator") == {"rtl/render/flk_mask_pixels.sv", "model/flicker/params.py"} | generated
