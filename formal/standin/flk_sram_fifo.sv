// The same queue with its words in order: what leaves it, and when, is that of flk_sram_fifo (proof sram_fifo),
// without pointers.
module flk_sram_fifo #(
  parameter int unsigned Width = 8,
  parameter int unsigned Depth = 16
) (
  input  logic             clk_i,
  input  logic             rst_ni,
  input  logic             clear_i,
  input  logic             in_valid_i,
  output logic             in_ready_o,
  input  logic [Width-1:0] in_data_i,
  output logic             out_valid_o,
  input  logic             out_ready_i,
  output logic [Width-1:0] out_data_o,
  output logic             empty_o
);

  localparam int unsigned UsedBits = $clog2(Depth + 1);

  logic [UsedBits-1:0]         used_q, left;
  logic                        out_valid_q, push, fetch;
  logic [Width-1:0]            out_q;
  logic [Depth-1:0][Width-1:0] words_d, words_q;  // the oldest first

  assign empty_o     = used_q == '0 && !out_valid_q;
  assign in_ready_o  = used_q != UsedBits'(Depth);
  assign push        = in_valid_i && in_ready_o;
  assign fetch       = used_q != '0 && (!out_valid_q || out_ready_i);
  assign left        = used_q - UsedBits'(fetch);
  assign out_valid_o = out_valid_q;
  assign out_data_o  = out_q;

  always_comb begin
    words_d = fetch ? words_q >> Width : words_q;
    for (int unsigned d = 0; d < Depth; d++) begin
      if (push && left == UsedBits'(d)) begin
        words_d[d] = in_data_i;
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      used_q      <= '0;
      out_valid_q <= 1'b0;
    end else if (clear_i) begin
      used_q      <= '0;
      out_valid_q <= 1'b0;
    end else begin
      used_q      <= left + UsedBits'(push);
      out_valid_q <= fetch || (out_valid_q && !out_ready_i);
    end
  end

  always_ff @(posedge clk_i) begin
    words_q <= words_d;
    if (fetch) begin
      out_q <= words_q[0];
    end
  end

endmodule
