// The same queue as its user may rely on it (proof pair_fifo), its words in order: room for one with fewer than Depth inside and for two
// with fewer than Depth - 1, two taken together or not at all; what is shown stays. Whether it takes more, and when a word is shown, is up
// to the solver (signals without driver).
module flk_pair_fifo #(
  parameter int unsigned Width = 8,
  parameter int unsigned Depth = 16
) (
  input  logic                  clk_i,
  input  logic                  rst_ni,
  input  logic                  clear_i,
  input  logic [1:0]            in_valid_i,
  output logic [1:0]            in_ready_o,
  input  logic [1:0][Width-1:0] in_data_i,
  output logic [1:0]            out_valid_o,
  input  logic [1:0]            out_ready_i,
  output logic [1:0][Width-1:0] out_data_o,
  output logic                  empty_o
);

  localparam int unsigned Held = Depth + 2;
  localparam int unsigned UsedBits = $clog2(Held + 3);

  logic [1:0]                 takes, shows;  // the solver's
  logic [1:0]                 stays_q;       // so many were shown and did not leave, as ones from below
  logic [1:0]                 push, pop;
  logic [UsedBits-1:0]        used_q, left;
  logic [Held-1:0][Width-1:0] words_q, words_d, words_left;  // the oldest first

  assign empty_o        = used_q == '0;
  assign in_ready_o[0]  = used_q < UsedBits'(Depth) || (takes[0] && used_q < UsedBits'(Held));
  assign in_ready_o[1]  = used_q < UsedBits'(Depth - 1) || (takes == 2'b11 && used_q < UsedBits'(Held - 1));
  assign push           = (&in_valid_i ? in_ready_o[1] : in_ready_o[0]) ? in_valid_i : '0;
  assign out_valid_o[0] = used_q != '0 && (shows[0] || stays_q[0]);
  assign out_valid_o[1] = out_valid_o[0] && used_q >= UsedBits'(2) && (shows[1] || stays_q[1]);
  assign pop            = {out_valid_o[1] && (&out_ready_i), out_valid_o[0] && out_ready_i[0]};
  assign left           = used_q - UsedBits'(pop[0]) - UsedBits'(pop[1]);
  assign out_data_o     = words_q[1:0];

  always_comb begin
    words_left = pop[1] ? words_q >> 2 * Width : pop[0] ? words_q >> Width : words_q;
    words_d    = words_left;
    for (int unsigned d = 0; d < Held; d++) begin
      if (push[0] && left == UsedBits'(d)) begin
        words_d[d] = in_data_i[0];
      end
      if (push[1] && left + UsedBits'(push[0]) == UsedBits'(d)) begin
        words_d[d] = in_data_i[1];
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
      used_q  <= left + UsedBits'(push[0]) + UsedBits'(push[1]);
      stays_q <= pop[1] ? '0 : pop[0] ? {1'b0, out_valid_o[1]} : out_valid_o;
    end
  end

  always_ff @(posedge clk_i) begin
    words_q <= words_d;
  end

endmodule
