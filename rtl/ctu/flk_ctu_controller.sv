// CTU controller: sampling mode of each splat, batches, stall, and the automatic fall to Uniform-Sparse.
//
// Element side: decides from mode and shape flag whether the splat at the head takes one batch (sparse, test off, token) or two
// (dense), and takes it with its last batch. Nothing starts while `stall_i` is high (a feature FIFO is full) or `space_i` is low
// (the CTU's own FIFO is full). ready_o depends combinationally on the element's spiky flag and on stall_i.
//
// Automatic mode: the fall is decided from data already streamed, never from FIFO state, so that stalls cannot change a picture.
// Results come back in order; at each end-of-sub-tile result the controller compares exponentially weighted sums of
//   test cycles the sub-tile takes in the base mode (Smooth-Focused)   and
//   VRU cycles it takes in the busiest channel (VruCycles per mini-tile sent),
// and falls when the first is larger. A token is taken only when no other token is in the test pipeline; therefore the
// decision used for sub-tile j always rests on sub-tiles up to j - 2, whatever the timing.
module flk_ctu_controller
  import flk_param_pkg::*;
#(
  parameter int unsigned VruCycles = PIXELS_PER_VRU  // that a splat takes in a channel
) (
  input  logic       clk_i,
  input  logic       rst_ni,
  input  logic       clear_i,  // forgets everything, the sums too
  input  logic [2:0] mode_i,   // constant while a splat is inside
  // element at the head
  input  logic       valid_i,
  output logic       ready_o,
  input  logic       eos_i,
  input  logic       spiky_i,
  // permission
  input  logic       space_i,
  input  logic       stall_i,
  // batch started this cycle
  output logic       issue_o,
  output logic       issue_batch_o,
  output logic       issue_dense_o,
  output logic       issue_all_o,
  output logic       issue_base_dense_o,
  // results, in order
  input  logic       result_valid_i,
  input  logic       result_eos_i,
  input  logic       result_base_dense_i,
  input  logic [3:0] result_mask_i,
  // state
  output logic       fallen_o
);

  if (VruCycles < 2 || VruCycles != 2 ** $clog2(VruCycles)) begin : gen_check_vru_cycles
    $error("flk_ctu_controller: VruCycles must be a power of two, 2 or more");
  end

  // ---- Sampling ------------------------------------------------------------------------------------

  logic dense, batch_d, batch_q, fall_d, fall_q, eos_pending_d, eos_pending_q, go;
  logic update_d, update_q;
  // The mode, decoded: whether smooth and spiky splats are sampled densely, and the rest.
  logic dense_smooth, dense_spiky, automatic_fall;

  assign dense_smooth   = (mode_i == CAT_DENSE) || (mode_i == CAT_SMOOTH) || (mode_i == CAT_AUTO);
  assign dense_spiky    = (mode_i == CAT_DENSE) || (mode_i == CAT_SPIKY);
  assign automatic_fall = (mode_i == CAT_AUTO);

  assign dense = (spiky_i ? dense_spiky : dense_smooth && !(automatic_fall && fall_q)) && !eos_i;

  assign go = valid_i && space_i && !stall_i && !(eos_i && eos_pending_q);

  assign issue_o            = go;
  assign issue_batch_o      = batch_q;
  assign issue_dense_o      = dense;
  assign issue_all_o        = eos_i || (mode_i == CAT_OFF);
  assign issue_base_dense_o = !spiky_i;
  assign ready_o            = go && (!dense || batch_q);
  assign batch_d            = go ? (dense && !batch_q) : batch_q;

  // A token is in the test pipeline, or the sums are about to take up its sub-tile.
  assign update_d = result_valid_i && result_eos_i;
  always_comb begin
    eos_pending_d = eos_pending_q;
    if (update_q) begin
      eos_pending_d = 1'b0;
    end
    if (go && eos_i) begin
      eos_pending_d = 1'b1;
    end
  end

  // ---- Automatic fall --------------------------------------------------------------------------------

  localparam int unsigned VRU_CYCLES_LOG2 = $clog2(VruCycles);
  localparam int unsigned VRU_BITS = AUTO_SENT_BITS + VRU_CYCLES_LOG2;
  // A sum of weights 1, 3/4, 9/16, ... is below 4 times the largest term: two more bits.
  localparam int unsigned AVG_BITS =
      (VRU_BITS > AUTO_TEST_BITS ? VRU_BITS : AUTO_TEST_BITS) + AUTO_DECAY_SHIFT;

  logic [AUTO_TEST_BITS-1:0]      test_d, test_q, test_inc, test_last_q;
  logic [3:0][AUTO_SENT_BITS-1:0] sent_d, sent_q;
  logic [AUTO_SENT_BITS-1:0]      max01, max23, sent_max, sent_last_q;
  logic [AVG_BITS-1:0]            test_avg_d, test_avg_q, sent_avg_d, sent_avg_q;

  assign test_inc = result_base_dense_i ? AUTO_TEST_BITS'(2) : AUTO_TEST_BITS'(1);
  assign max01    = (sent_q[0] > sent_q[1]) ? sent_q[0] : sent_q[1];
  assign max23    = (sent_q[2] > sent_q[3]) ? sent_q[2] : sent_q[3];
  assign sent_max = (max01 > max23) ? max01 : max23;

  always_comb begin
    test_d = test_q;
    sent_d = sent_q;
    if (result_valid_i) begin
      if (result_eos_i) begin
        test_d = '0;
        sent_d = '0;
      end else begin
        // Both counts saturate.
        test_d = (test_q > ~test_inc) ? '1 : test_q + test_inc;
        for (int m = 0; m < 4; m++) begin
          if (result_mask_i[m] && (sent_q[m] != '1)) begin
            sent_d[m] = sent_q[m] + AUTO_SENT_BITS'(1);
          end
        end
      end
    end
  end

  // One cycle later: what the sub-tile came to is added to the sums.
  always_ff @(posedge clk_i) begin
    if (update_d) begin
      test_last_q <= test_q;
      sent_last_q <= sent_max;
    end
  end

  always_comb begin
    test_avg_d = test_avg_q;
    sent_avg_d = sent_avg_q;
    if (update_q) begin
      test_avg_d = test_avg_q - (test_avg_q >> AUTO_DECAY_SHIFT) + AVG_BITS'(test_last_q);
      sent_avg_d = sent_avg_q - (sent_avg_q >> AUTO_DECAY_SHIFT)
                 + AVG_BITS'({sent_last_q, VRU_CYCLES_LOG2'(0)});
    end
  end

  // Sub-tiles change when a token is taken: no other token is in the pipeline then.
  assign fall_d   = (go && eos_i) ? (test_avg_q > sent_avg_q) : fall_q;
  assign fallen_o = fall_q && automatic_fall;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      batch_q       <= 1'b0;
      fall_q        <= 1'b0;
      eos_pending_q <= 1'b0;
      update_q      <= 1'b0;
      test_q        <= '0;
      sent_q        <= '0;
      test_avg_q    <= '0;
      sent_avg_q    <= '0;
    end else if (clear_i) begin
      batch_q       <= 1'b0;
      fall_q        <= 1'b0;
      eos_pending_q <= 1'b0;
      update_q      <= 1'b0;
      test_q        <= '0;
      sent_q        <= '0;
      test_avg_q    <= '0;
      sent_avg_q    <= '0;
    end else begin
      batch_q       <= batch_d;
      fall_q        <= fall_d;
      eos_pending_q <= eos_pending_d;
      update_q      <= update_d;
      test_q        <= test_d;
      sent_q        <= sent_d;
      test_avg_q    <= test_avg_d;
      sent_avg_q    <= sent_avg_d;
    end
  end

endmodule
