// Bitonic sorting network: one vector of Lanes elements per cycle, unsigned keys, ascending.
//
// log2(Lanes) * (log2(Lanes) + 1) / 2 stages, a pipeline register after every StagesPerReg stages
// and after the last. Latency: the number of registers, ceil(stages / StagesPerReg); throughput 1
// vector per cycle. Lane 0 gets the smallest key. The pipeline is elastic (bubbles are filled while
// the output waits); in_ready_o depends combinationally on out_ready_i through one gate per register.
// Equal keys keep their lane order: a bitonic network alone is not stable, so the lane number
// travels with each element as the low bits of its key.
module flk_bitonic_sorter #(
  parameter int unsigned Lanes        = 16,
  parameter int unsigned KeyWidth     = 32,
  parameter int unsigned PayloadWidth = 16,
  parameter int unsigned StagesPerReg = 1
) (
  input  logic                               clk_i,
  input  logic                               rst_ni,
  // Upstream
  input  logic                               in_valid_i,
  output logic                               in_ready_o,
  input  logic [Lanes-1:0][KeyWidth-1:0]     in_key_i,
  input  logic [Lanes-1:0][PayloadWidth-1:0] in_payload_i,
  // Downstream
  output logic                               out_valid_o,
  input  logic                               out_ready_i,
  output logic [Lanes-1:0][KeyWidth-1:0]     out_key_o,
  output logic [Lanes-1:0][PayloadWidth-1:0] out_payload_o
);

  if (Lanes < 2 || Lanes > 32 || (Lanes & (Lanes - 1)) != 0) begin : gen_check_lanes
    $error("flk_bitonic_sorter: Lanes must be 2, 4, 8, 16 or 32");
  end
  if (KeyWidth < 1) begin : gen_check_key_width
    $error("flk_bitonic_sorter: KeyWidth must be at least 1");
  end
  if (PayloadWidth < 1) begin : gen_check_payload_width
    $error("flk_bitonic_sorter: PayloadWidth must be at least 1");
  end
  if (StagesPerReg < 1) begin : gen_check_stages_per_reg
    $error("flk_bitonic_sorter: StagesPerReg must be at least 1");
  end

  localparam int unsigned LaneBits = $clog2(Lanes);  // lane numbers 0 to Lanes - 1
  localparam int unsigned Stages   = LaneBits * (LaneBits + 1) / 2;  // merges of 1, 2, ... stages
  localparam int unsigned TagWidth = KeyWidth + LaneBits;  // key, made unique by its lane

  typedef struct packed {
    logic [TagWidth-1:0]     key;
    logic [PayloadWidth-1:0] payload;
  } element_t;

  typedef element_t [Lanes-1:0] vector_t;

  // Merge that a stage belongs to: merge m has m + 1 stages and sorts runs of 2^(m+1) lanes.
  function automatic int unsigned merge_of(int unsigned stage);
    int unsigned m = 0;
    while ((m + 1) * (m + 2) / 2 <= stage) begin
      m++;
    end
    return m;
  endfunction

  // Elements enter with their lane as the low bits of the key.

  vector_t in_vector;

  for (genvar lane = 0; lane < Lanes; lane++) begin : gen_in
    assign in_vector[lane].key     = {in_key_i[lane], LaneBits'(lane)};
    assign in_vector[lane].payload = in_payload_i[lane];
  end

  // Stages: elements Distance apart meet; the runs of a merge alternate in direction.

  for (genvar stage = 0; stage < Stages; stage++) begin : gen_stage
    localparam int unsigned Merge    = merge_of(stage);
    localparam int unsigned Step     = stage - Merge * (Merge + 1) / 2;
    localparam int unsigned Distance = 1 << (Merge - Step);
    localparam int unsigned Run      = 2 << Merge;
    localparam bit          Register = (stage + 1) % StagesPerReg == 0 || stage == Stages - 1;

    logic    valid, ready, next_valid, next_ready;
    vector_t unsorted, exchanged, next;

    if (stage == 0) begin : gen_first
      assign valid      = in_valid_i;
      assign in_ready_o = ready;
      assign unsorted   = in_vector;
    end else begin : gen_later
      assign valid    = gen_stage[stage-1].next_valid;
      assign unsorted = gen_stage[stage-1].next;
    end

    if (stage == Stages - 1) begin : gen_last
      assign next_ready = out_ready_i;
    end else begin : gen_earlier
      assign next_ready = gen_stage[stage+1].ready;
    end

    for (genvar lane = 0; lane < Lanes; lane++) begin : gen_lane
      if ((lane & Distance) == 0) begin : gen_exchange
        localparam int unsigned Low  = (lane & Run) == 0 ? lane : lane + Distance;
        localparam int unsigned High = (lane & Run) == 0 ? lane + Distance : lane;

        flk_compare_exchange #(
          .KeyWidth    (TagWidth),
          .PayloadWidth(PayloadWidth)
        ) i_compare_exchange (
          .a_key_i       (unsorted[lane].key),
          .a_payload_i   (unsorted[lane].payload),
          .b_key_i       (unsorted[lane+Distance].key),
          .b_payload_i   (unsorted[lane+Distance].payload),
          .low_key_o     (exchanged[Low].key),
          .low_payload_o (exchanged[Low].payload),
          .high_key_o    (exchanged[High].key),
          .high_payload_o(exchanged[High].payload)
        );
      end
    end

    if (Register) begin : gen_register
      flk_pipe_reg #(
        .Width($bits(vector_t))
      ) i_pipe_reg (
        .clk_i,
        .rst_ni,
        .clear_i    (1'b0),
        .in_valid_i (valid),
        .in_ready_o (ready),
        .in_data_i  (exchanged),
        .out_valid_o(next_valid),
        .out_ready_i(next_ready),
        .out_data_o (next)
      );
    end else begin : gen_wire
      assign next_valid = valid;
      assign ready      = next_ready;
      assign next       = exchanged;
    end
  end

  // The lane numbers have done their work.

  logic [Lanes-1:0][LaneBits-1:0] unused_lane;

  assign out_valid_o = gen_stage[Stages-1].next_valid;

  for (genvar lane = 0; lane < Lanes; lane++) begin : gen_out
    assign {out_key_o[lane], unused_lane[lane]} = gen_stage[Stages-1].next[lane].key;
    assign out_payload_o[lane]                  = gen_stage[Stages-1].next[lane].payload;
  end

endmodule
