"""flicker.shared_text: instances of a module share a text after Verilator, and a broken assertion still names the instance it is of.

Covered: a design of four instances side by side, whose one assertion fails in each of them in turn, against the same design without sharing. That frames stay
the same is covered by their tests, which all run on shared texts.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from flicker import shared_text, toolchain

UNIT = """
module st_unit (
  input  logic       clk_i,
  input  logic       rst_ni,
  input  logic [7:0] value_i,
  output logic [7:0] sum_o
);
  logic [7:0] sum_q;
  function automatic logic [7:0] mixed(logic [7:0] sum, logic [7:0] value);  // its variables get numbers of the whole design
    logic [7:0] result;
    result = value;
    for (int k = 0; k < 8; k++) result = result ^ (sum[k] ? value << k : sum >> k);
    return sum + value + (result ^ result);
  endfunction
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) sum_q <= '0;
    else sum_q <= mixed(sum_q, value_i);
  end
  assign sum_o = sum_q;
  assert property (@(posedge clk_i) disable iff (!rst_ni) value_i != 8'd7 || sum_q > 8'd250) else $error("st_unit: seven");
endmodule
"""
TOP = """
module st_top (
  input  logic            clk_i,
  input  logic            rst_ni,
  input  logic [3:0][7:0] value_i,
  output logic [3:0][7:0] sum_o
);
  for (genvar k = 0; k < 4; k++) begin : gen_unit
    st_unit i_unit (.clk_i, .rst_ni, .value_i(value_i[k]), .sum_o(sum_o[k]));
  end
endmodule
"""
SETTINGS = """`verilator_config
no_inline -module "st_unit"
public_flat_rd -module "st_unit" -var "value_i"
"""
HARNESS = """
#include "Vtop.h"
#include "verilated.h"
void vl_stop(const char*, int, const char*) VL_MT_UNSAFE {}
void vl_fatal(const char*, int, const char*, const char*) VL_MT_UNSAFE {}
extern "C" unsigned run(unsigned values, int cycles) {
  VerilatedContext context;
  Vtop top{&context};
  top.clk_i = 0;
  top.rst_ni = 0;
  top.value_i = 0;
  for (int k = 0; k < 2 * cycles + 4; ++k) {
    top.rst_ni = k > 3;
    if (k > 3) top.value_i = values;
    top.clk_i = k & 1;
    top.eval();
  }
  return top.sum_o;
}
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, Path]:
    """The library, shared and not."""
    folder = tmp_path_factory.mktemp("shared")
    paths = {}
    for name, text in (("st_unit.sv", UNIT), ("st_top.sv", TOP), ("settings.vlt", SETTINGS), ("harness.cpp", HARNESS)):
        paths[name] = folder / name
        paths[name].write_text(text)

    def build(top: str) -> Path:
        return toolchain.verilate(
            "st_top", [paths["st_unit.sv"], paths["st_top.sv"]], settings=[paths["settings.vlt"]], cpp=[paths["harness.cpp"]], args=["--assert", "-fno-dfg"],
            cflags="-DVL_USER_STOP -DVL_USER_FATAL", shared=True, kind="sim", name=top,
        )

    out = {True: build("st_shared")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shared_text, "share", lambda folder: None)
        out[False] = build("st_apart")
    return out


def run(library: Path, values: list[int], cycles: int) -> tuple[int, list[str]]:
    """The sums, and the instances that messages name."""
    word = sum(value << 8 * k for k, value in enumerate(values))
    code = f"import ctypes; print('sum', ctypes.CDLL({str(library)!r}).run({word}, {cycles}) & 0xffffffff)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    found = re.search(r"^sum (\d+)$", done.stdout, re.M)
    assert found is not None
    return int(found[1]), re.findall(r"Assertion failed in ([\w.\[\]]+): st_unit: seven", done.stdout)


def texts(library: Path, what: str) -> int:
    """Functions of the unit that have a text of their own with `what`, a regular expression."""
    return sum(len(re.findall(what, path.read_text())) for path in library.parent.glob("Vtop_st_unit__*.cpp"))


@pytest.mark.parametrize("what", ["st_unit: seven", r"CData/\*7:0\*/ \w+mixed\w+Vfuncout;"], ids=["assertion", "function"])
def test_one_text(built: dict[bool, Path], what: str) -> None:
    assert texts(built[True], what) == 1 and texts(built[False], what) == 4


@pytest.mark.parametrize("k", range(4))
def test_messages_name_the_instance(built: dict[bool, Path], k: int) -> None:
    values = [7 if n == k else 1 + n for n in range(4)]
    shared, apart = run(built[True], values, 3), run(built[False], values, 3)
    assert shared == apart and set(shared[1]) == {f"TOP.st_top.gen_unit[{k}].i_unit"}


def test_values(built: dict[bool, Path]) -> None:
    sums = sum((9 * v & 255) << 8 * k for k, v in enumerate((1, 2, 3, 250)))
    assert run(built[True], [1, 2, 3, 250], 9) == run(built[False], [1, 2, 3, 250], 9) == (sums, [])
