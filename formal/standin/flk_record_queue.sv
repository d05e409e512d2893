// The same queue as its user may rely on it (proof record_queue), its words in order: there must be room; what is shown stays. When a word is
// shown is up to the solver (signals without driver). Records are dropped one a cycle: who relies on this watches a queue that drops none.
module flk_record_queue #(
  parameter int unsigned Width = 128,
  parameter int unsigned Depth = 128
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  input  logic [1:0]            in_valid_i,
  input  logic [1:0]            in_last_i,
  input  logic [1:0][Width-1:0] in_data_i,
  input  logic                  drop_i,
  output logic [1:0]            out_valid_o,
  input  logic [1:0]            out_ready_i,
  output logic [1:0]            out_last_o,
  output logic [1:0][Width-1:0] out_data_o,
  output logic [3:0]            left_o,
  output logic                  empty_o
);

  localparam int unsigned UsedBits = $clog2(Depth + 3);

  logic [1:0]                  shows;    // the solver's
  logic [1:0]                  stays_q;  // so many were shown and did not leave, as ones from below
  logic [1:0]                  valid, pop;
  logic                        dropping;
  logic [UsedBits-1:0]         used_q, left;
  logic [Depth-1:0][Width:0]   words_q, words_d, words_left;  // end and data, the oldest first

  assign empty_o     = used_q == '0;
  assign valid[0]    = used_q != '0 && (shows[0] || stays_q[0]);
  assign valid[1]    = valid[0] && used_q >= UsedBits'(2) && (shows[1] || stays_q[1]);
  assign dropping    = drop_i && valid[0] && !out_last_o[0];
  assign out_valid_o = {valid[1] && !drop_i, valid[0] && !dropping};
  assign pop         = dropping ? 2'b01 : out_valid_o & {&out_ready_i, out_ready_i[0]};
  assign left_o      = {2'b00, pop[1], pop[0] && !pop[1]};
  assign left        = used_q - UsedBits'(pop[0]) - UsedBits'(pop[1]);

  for (genvar k = 0; k < 2; k++) begin : gen_out
    assign {out_last_o[k], out_data_o[k]} = words_q[k];
  end

  always_comb begin
    words_left = pop[1] ? words_q >> 2 * (Width + 1) : pop[0] ? words_q >> (Width + 1) : words_q;
    words_d    = words_left;
    for (int unsigned d = 0; d < Depth; d++) begin
      if (in_valid_i[0] && left == UsedBits'(d)) begin
        words_d[d] = {in_last_i[0], in_data_i[0]};
      end
      if (in_valid_i[1] && left + UsedBits'(in_valid_i[0]) == UsedBits'(d)) begin
        words_d[d] = {in_last_i[1], in_data_i[1]};
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      used_q  <= '0;
      stays_q <= '0;
    end else if (clear_i) begin
      used_q  <= '0;
      stays_q <= '0;
    end else begin
      used_q  <= left + UsedBits'(in_valid_i[0]) + UsedBits'(in_valid_i[1]);
      stays_q <= pop[1] ? '0 : pop[0] ? {1'b0, valid[1]} : valid;
    end
  end

  always_ff @(posedge clk_i) begin
    words_q <= words_d;
  end

endmodule
