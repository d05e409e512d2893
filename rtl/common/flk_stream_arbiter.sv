// Round-robin arbiter: several streams into one, with the index of the source.
//
// Latency 0, throughput 1 per cycle. Combinational paths: in_valid_i and in_data_i to the output,
// out_ready_i and in_valid_i to in_ready_o. A waiting input is served after at most Inputs - 1
// transfers of others. The search starts at a registered input: behind the one served last,
// or at the one that is waiting for out_ready_i, so that the choice holds until its transfer.
// clear_i (synchronous) lets the search start at input 0 again.
module flk_stream_arbiter #(
  parameter  int unsigned Inputs    = 4,
  parameter  int unsigned Width     = 8,
  localparam int unsigned IndexBits = Inputs > 1 ? $clog2(Inputs) : 1  // 0 to Inputs - 1
) (
  input  logic                         clk_i,
  input  logic                         rst_ni,
  input  logic                         clear_i,
  // Upstream
  input  logic [Inputs-1:0]            in_valid_i,
  output logic [Inputs-1:0]            in_ready_o,
  input  logic [Inputs-1:0][Width-1:0] in_data_i,
  // Downstream
  output logic                         out_valid_o,
  input  logic                         out_ready_i,
  output logic [Width-1:0]             out_data_o,
  output logic [IndexBits-1:0]         out_index_o
);

  if (Inputs < 2) begin : gen_check_inputs
    $error("flk_stream_arbiter: Inputs must be at least 2");
  end
  if (Width < 1) begin : gen_check_width
    $error("flk_stream_arbiter: Width must be at least 1");
  end

  localparam logic [IndexBits-1:0] LAST = IndexBits'(Inputs - 1);

  // Choice: the first valid input from first_q on, else the first valid input of all.

  logic [IndexBits-1:0] first_d, first_q;
  logic [IndexBits-1:0] choice;

  always_comb begin
    choice = first_q;
    for (int unsigned i = Inputs; i > 0; i--) begin
      if (in_valid_i[i-1]) begin
        choice = IndexBits'(i - 1);
      end
    end
    for (int unsigned i = Inputs; i > 0; i--) begin
      if (in_valid_i[i-1] && IndexBits'(i - 1) >= first_q) begin
        choice = IndexBits'(i - 1);
      end
    end
  end

  always_comb begin
    first_d = first_q;
    if (out_valid_o) begin
      first_d = choice;
      if (out_ready_i) begin
        first_d = choice == LAST ? '0 : choice + 1'b1;
      end
    end
    if (clear_i) begin
      first_d = '0;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      first_q <= '0;
    end else begin
      first_q <= first_d;
    end
  end

  // Outputs

  assign out_valid_o = |in_valid_i;
  assign out_data_o  = in_data_i[choice];
  assign out_index_o = choice;

  always_comb begin
    in_ready_o         = '0;
    in_ready_o[choice] = out_ready_i;
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_index_o))
  else $error("flk_stream_arbiter: choice changed before its transfer");
`endif

endmodule
