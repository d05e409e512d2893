// A cache as its user sees it: elements in order, one or two taken and given in a cycle whenever it likes, none in the cycle after
// out_ready_i was low. A record's number stands in place of the record. What is taken and given is up to the solver (signals without
// driver).
module flk_record_cache #(
  parameter  int unsigned RecordBits = 2,
  parameter  int unsigned NumberBits = 2,
  parameter  int unsigned TagBits    = 5,
  parameter  int unsigned Banks      = 2,
  parameter  int unsigned Sets       = 2,
  parameter  int unsigned Ways       = 2,
  parameter  int unsigned Depth      = 2,
  parameter  int unsigned Places     = 2,
  parameter  int unsigned AddrBits   = 40,
  parameter  int unsigned IdBits     = 4,
  parameter  int unsigned Id         = 0
) (
  input  logic                        clk_i,
  input  logic                        rst_ni,
  input  logic                        start_i,
  input  logic                        clear_i,
  output logic                        idle_o,
  output logic                        error_o,
  output logic [31:0]                 lines_o,
  output logic [1:0]                  waits_o,
  input  logic [AddrBits-6:0]         record_base_i,
  input  logic [1:0]                  in_valid_i,
  output logic [1:0]                  in_ready_o,
  input  logic [1:0]                  in_skip_i,
  input  logic [1:0][NumberBits-1:0]  in_record_i,
  input  logic [1:0][TagBits-1:0]     in_tag_i,
  input  logic [5:0]                  in_tile_i,
  input  logic [1:0][5:0]             in_until_i,
  input  logic                        out_ready_i,
  output logic [1:0]                  out_valid_o,
  output logic [1:0][RecordBits-1:0]  out_record_o,
  output logic [1:0][TagBits-1:0]     out_tag_o,
  output logic                        ar_valid_o,
  input  logic                        ar_ready_i,
  output logic [IdBits-1:0]           ar_id_o,
  output logic [AddrBits-1:0]         ar_addr_o,
  output logic [7:0]                  ar_len_o,
  output logic [2:0]                  ar_size_o,
  output logic [1:0]                  ar_burst_o,
  input  logic                        r_valid_i,
  output logic                        r_ready_o,
  input  logic [IdBits-1:0]           r_id_i,
  input  logic [255:0]                r_data_i,
  input  logic [1:0]                  r_resp_i,
  input  logic                        r_last_i
);

  localparam int unsigned ItemBits = NumberBits + TagBits;

  logic [1:0]               takes, gives;  // the solver's
  logic                     ready;
  logic                     ready_q;       // out_ready_i of the cycle before
  logic [2:0]               used_q, left;
  logic [2:0][ItemBits-1:0] words_q, words_d, words_left;  // the oldest first
  logic [1:0]               push;

  assign idle_o         = used_q == '0 && ready;
  assign ar_valid_o     = 1'b0;
  assign r_ready_o      = 1'b1;
  assign in_ready_o[0]  = takes[0] && used_q <= 3'd1;
  assign in_ready_o[1]  = in_ready_o[0] && takes[1];
  assign push           = in_valid_i & in_ready_o;
  assign out_valid_o[0] = gives[0] && ready_q && used_q != 3'd0;
  assign out_valid_o[1] = out_valid_o[0] && gives[1] && used_q >= 3'd2;
  assign left           = used_q - 3'(out_valid_o[0]) - 3'(out_valid_o[1]);

  for (genvar c = 0; c < 2; c++) begin : gen_out
    assign {out_record_o[c], out_tag_o[c]} = words_q[c];
  end

  always_comb begin
    words_left = out_valid_o[1] ? words_q >> 2 * ItemBits : out_valid_o[0] ? words_q >> ItemBits : words_q;
    words_d    = words_left;
    for (int unsigned d = 0; d < 3; d++) begin
      if (push[0] && left == 3'(d)) begin
        words_d[d] = {in_record_i[0], in_tag_i[0]};
      end
      if (push[1] && left + 3'(push[0]) == 3'(d)) begin
        words_d[d] = {in_record_i[1], in_tag_i[1]};
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      used_q  <= '0;
      ready_q <= 1'b0;
    end else if (start_i || clear_i) begin
      used_q  <= '0;
      ready_q <= 1'b0;
    end else begin
      used_q  <= left + 3'(push[0]) + 3'(push[1]);
      ready_q <= out_ready_i;
    end
  end

  always_ff @(posedge clk_i) begin
    words_q <= words_d;
  end

endmodule
