// A cache as its user sees it: each channel's elements in order, taken and given whenever it likes; a record's
// number in place of the record. What is taken and given is up to the solver (signals without driver).
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
  input  logic [AddrBits-6:0]         record_base_i,
  input  logic [1:0]                  in_valid_i,
  output logic [1:0]                  in_ready_o,
  input  logic [1:0]                  in_skip_i,
  input  logic [1:0][NumberBits-1:0]  in_record_i,
  input  logic [1:0][TagBits-1:0]     in_tag_i,
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

  logic [1:0]                    takes, gives;  // the solver's
  logic                          ready;
  logic [1:0][1:0]               used_q;        // elements of a channel
  logic [1:0][1:0][ItemBits-1:0] words_q;       // the oldest first

  assign idle_o     = used_q == '0 && ready;
  assign ar_valid_o = 1'b0;
  assign r_ready_o  = 1'b1;

  for (genvar c = 0; c < 2; c++) begin : gen_channel
    logic push, pop;
    logic [1:0] left;
    logic [1:0][ItemBits-1:0] words;

    assign in_ready_o[c]   = takes[c] && used_q[c] != 2'd2;
    assign out_valid_o[c]  = gives[c] && used_q[c] != 2'd0;
    assign {out_record_o[c], out_tag_o[c]} = words_q[c][0];
    assign push            = in_valid_i[c] && in_ready_o[c];
    assign pop             = out_valid_o[c];
    assign left            = used_q[c] - 2'(pop);

    always_comb begin
      words = pop ? {words_q[c][1], words_q[c][1]} : words_q[c];
      if (push) begin
        words[left[0]] = {in_record_i[c], in_tag_i[c]};
      end
    end

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        used_q[c] <= '0;
      end else if (start_i || clear_i) begin
        used_q[c] <= '0;
      end else begin
        used_q[c] <= left + 2'(push);
      end
    end

    always_ff @(posedge clk_i) begin
      words_q[c] <= words;
    end
  end

endmodule
