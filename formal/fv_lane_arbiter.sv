// flk_lane_arbiter: equal to flk_stream_arbiter (fv_stream_arbiter) in every cycle, for lanes that say what their valid bits become.
module fv_lane_arbiter
  import flk_lane_pkg::*;
#(
  parameter  int unsigned Lanes = 8,
  localparam int unsigned LaneW = $clog2(Lanes)
) (
  input logic                    clk_i,
  input logic                    again_i,
  input logic                    clear_i,
  input lane_pixel_t [Lanes-1:0] in_data_i,
  input logic        [Lanes-1:0] start_i,
  input logic        [Lanes-1:0] last_i,
  input logic                    out_ready_i
);

  logic rst_n, out_valid, expected_valid;
  logic [Lanes-1:0] valid_q, in_ready, expected_ready;
  logic [LaneW-1:0] expected_lane;
  lane_pixel_t out_data, expected_data;
  logic [Lanes-1:0][$bits(lane_pixel_t)-1:0] in_bits;

  assign in_bits = in_data_i;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  flk_lane_arbiter #(
    .Lanes(Lanes)
  ) dut (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i (valid_q),
    .in_ready_o (in_ready),
    .in_data_i,
    .in_start_i (start_i),
    .in_last_i  (last_i),
    .out_valid_o(out_valid),
    .out_ready_i,
    .out_data_o (out_data)
  );

  flk_stream_arbiter #(
    .Inputs(Lanes),
    .Width ($bits(lane_pixel_t))
  ) i_expected (
    .clk_i,
    .rst_ni     (rst_n),
    .clear_i,
    .in_valid_i (valid_q),
    .in_ready_o (expected_ready),
    .in_data_i  (in_bits),
    .out_valid_o(expected_valid),
    .out_ready_i,
    .out_data_o (expected_data),
    .out_index_o(expected_lane)
  );

  // As flk_lane's full_q.
  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      valid_q <= '0;
    end else if (clear_i) begin
      valid_q <= '0;
    end else begin
      valid_q <= start_i | (valid_q & ~(last_i & in_ready));
    end
  end

  always_comb begin
    if (rst_n) begin
      a_valid: assert (out_valid == expected_valid);
      a_ready: assert (in_ready == expected_ready);
      a_data: assert (!out_valid || out_data == expected_data);
      l_choice: assert (dut.choice_q == expected_lane);
      c_turn: cover (out_valid && out_ready_i && dut.choice_q == LaneW'(Lanes - 1) && valid_q[0]);
      c_waits: cover (out_valid && !out_ready_i && start_i != '0 && valid_q[Lanes-1]);
    end
  end

endmodule
