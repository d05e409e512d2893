// Priority arbiter with a bound on waiting: several streams into one, with the index of the source.
//
// The lowest valid input goes first, unless an input has been passed over Patience times: such inputs
// go before all others, the lowest first. A waiting input is served after at most
// Patience + Inputs - 1 transfers of others, Patience at least Inputs - 1.
// Latency 0, throughput 1 per cycle. Combinational paths: in_valid_i and in_data_i to the output,
// out_ready_i and in_valid_i to in_ready_o. The choice may change until its transfer: where the output
// must hold, a register follows (flk_skid_buffer).
module flk_priority_arbiter #(
  parameter  int unsigned Inputs    = 4,
  parameter  int unsigned Width     = 8,
  parameter  int unsigned Patience  = 16,
  localparam int unsigned IndexBits = Inputs > 1 ? $clog2(Inputs) : 1  // 0 to Inputs - 1
) (
  input  logic                         clk_i,
  input  logic                         rst_ni,
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
    $error("flk_priority_arbiter: Inputs must be at least 2");
  end
  if (Patience < Inputs - 1) begin : gen_check_patience
    $error("flk_priority_arbiter: Patience must be at least Inputs - 1");
  end

  localparam int unsigned CountBits = $clog2(Patience + 1);

  logic [Inputs-1:0][CountBits-1:0] passed_q;  // by others since an input waits
  logic [Inputs-1:0]                urgent;
  logic [IndexBits-1:0]             choice;

  always_comb begin
    choice = '0;
    for (int unsigned k = 0; k < Inputs; k++) begin
      urgent[k] = in_valid_i[k] && passed_q[k] == CountBits'(Patience);
    end
    for (int unsigned k = Inputs; k > 0; k--) begin
      if (in_valid_i[k-1]) begin
        choice = IndexBits'(k - 1);
      end
    end
    for (int unsigned k = Inputs; k > 0; k--) begin
      if (urgent[k-1]) begin
        choice = IndexBits'(k - 1);
      end
    end
  end

  assign out_valid_o = |in_valid_i;
  assign out_data_o  = in_data_i[choice];
  assign out_index_o = choice;

  always_comb begin
    in_ready_o         = '0;
    in_ready_o[choice] = out_ready_i;
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      passed_q <= '0;
    end else begin
      for (int unsigned k = 0; k < Inputs; k++) begin
        if (!in_valid_i[k] || in_ready_o[k]) begin
          passed_q[k] <= '0;
        end else if (out_ready_i && !urgent[k]) begin
          passed_q[k] <= passed_q[k] + 1'b1;
        end
      end
    end
  end

endmodule
