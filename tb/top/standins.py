"""Stand-ins for the chip's halves: what flk_top does itself is seen without the minutes that the halves take to build.

Each has the ports of its module and makes `turns` turns of a read and a write of one beat, the low byte of a register; its counters are that byte, repeated,
but for the last one, which counts the edges of its clock since reset. The rendering half stops between two turns; its picture is whole after the last one.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

from flicker import toolchain

# Module: (turns, reader, writer, as indices of its ports, address of reads, address of writes, error, further assignments).
HALVES = {
    "flk_preprocessing": (
        "registers_i.clusters[7:0]", "[FRONT_READ_TABLE]", "[FRONT_WRITE_LINES]", "{registers_i.table_beat, 6'b0}", "{registers_i.records_beat, 6'b0}",
        "FRONT_ERRORS'(failed_q)", "",
    ),
    "flk_rendering": (
        "registers_i.chunks[7:0]", "[RENDERING_READ_LISTS]", "", "{registers_i.lists_beat, 6'b0}", "{registers_i.frame_beat, 6'b0}", "3'(failed_q)",
        """  logic [COUNTER_LATENCY-1:0][COUNTER_BITS-1:0] counter_q;  // the oldest highest
  always_ff @(posedge clk_i) begin
    counter_q <= $bits(counter_q)'({counter_q, COUNTER_BITS'(counter_addr_i) + COUNTER_BITS'(turns)});
  end
  assign counter_data_o = counter_q[COUNTER_LATENCY-1];
  assign stopped_o = stop_i && (state_q == READ || state_q == IDLE);
  assign left_o = 16'(turn_q != '0);
""",
    ),
}
BODY = """
  typedef enum logic [2:0] {{IDLE, READ, BEAT, WRITE, DATA, ANSWER, DONE}} state_e;
  state_e     state_q;
  logic [7:0] turn_q, turns;
  logic       failed_q;

  assign turns = {turns};

  logic [31:0] edges_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      edges_q <= '0;
    end else begin
      edges_q <= edges_q + 1'b1;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q  <= IDLE;
      turn_q   <= '0;
      failed_q <= 1'b0;
    end else begin
      unique case (state_q)
        IDLE:
        if (start_i) begin
          state_q  <= READ;
          turn_q   <= turns;
          failed_q <= 1'b0;
        end
        READ:  if (ar_ready_i{reader}) state_q <= BEAT;
        BEAT:
        if (r_valid_i{reader}) begin
          state_q  <= WRITE;
          failed_q <= failed_q || r_i{reader}.resp != '0;
        end
        WRITE: if (aw_ready_i{writer}) state_q <= DATA;
        DATA:  if (w_ready_i{writer}) state_q <= ANSWER;
        ANSWER:
        if (b_valid_i{writer}) begin
          state_q <= turn_q <= 8'd1 ? DONE : READ;
          turn_q  <= turn_q - 1'b1;
        end
        default: state_q <= IDLE;
      endcase
    end
  end

  assign idle_o = state_q == IDLE;
  assign done_o = state_q == DONE;
  assign error_o = {error};
  localparam int unsigned Bits = $bits(counters_o);
  logic [(Bits + 7) / 8 * 8 - 1:0] repeated;
  assign repeated = {{((Bits + 7) / 8){{turns}}}};
  assign counters_o = {{repeated[$bits(repeated)-1-:Bits-32], edges_q}};
  always_comb begin
    ar_valid_o = '0;
    ar_o = '0;
    aw_valid_o = '0;
    aw_o = '0;
    w_valid_o = '0;
    w_o = '1;
    ar_valid_o{reader} = state_q == READ;
    ar_o{reader}.addr = {read};
    ar_o{reader}.size = 3'd6;
    ar_o{reader}.burst = 2'd1;
    aw_valid_o{writer} = state_q == WRITE;
    aw_o{writer}.addr = {write};
    aw_o{writer}.size = 3'd6;
    aw_o{writer}.burst = 2'd1;
    w_valid_o{writer} = state_q == DATA;
  end
  assign r_ready_o = '1;
  assign b_ready_o = '1;
{further}{zero}
endmodule
"""


def sources() -> list[Path]:
    """Sources of flk_top with the stand-ins in place of its halves, which are written anew."""
    folder = toolchain.BUILD / "standins"
    folder.mkdir(parents=True, exist_ok=True)
    for module, (turns, reader, writer, read, write, error, further) in HALVES.items():
        source = next(path for path in toolchain.filelist() if path.stem == module)
        header = re.search(rf"^module {module}\b.*?^\);\n", source.read_text(), re.M | re.S)
        assert header is not None
        outputs = re.findall(r"^\s*output\s.*?(\w+)\s*(?:,|$)", re.sub(r"//.*", "", header[0]), re.M)
        body = partial(BODY.format, turns=turns, reader=reader, writer=writer, read=read, write=write, error=error, further=further)
        zero = "".join(f"  assign {name} = '0;\n" for name in outputs if not re.search(rf"\b{name} = ", body(zero="")))
        text = header[0] + body(zero=zero)
        path = folder / f"{module}.sv"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    # What flk_top names, with the halves' packages but without what stands below the halves.
    listed = {path.stem: path for path in toolchain.filelist()}
    found: set[str] = set()
    pending = ["flk_top"]
    while pending:
        name = pending.pop()
        if name in found:
            continue
        found.add(name)
        text = (folder / f"{name}.sv" if name in HALVES else listed[name]).read_text()
        pending += set(re.findall(r"\w+", re.sub(r"//.*", "", text))) & listed.keys()
    return [folder / f"{path.stem}.sv" if path.stem in HALVES else path for path in toolchain.filelist() if path.stem in found]
