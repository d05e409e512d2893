// Lines of 64 bytes to memory: gathered, then written together, so that the memory's bus turns rarely.
//
// A line has an address in beats and a strobe for each of its quarters (16 bytes); it is one AXI4 burst of one beat, under the
// identifier Id. Lines wait in memories until Gather - 2 are there, none has come for 127 cycles, or flush_i is high; then all that
// wait leave, those that come meanwhile with them. Order is kept. answered_o is high for a cycle with each answer, of lines in their order; failed_o when it was an error.
// empty_o: no line waits here; idle_o: none is under way at the memory either.
// Throughput a line a cycle. Combinational: w_ready_i to the memory's read enable; in_ready_o comes from registers.
module flk_line_writer #(
  parameter  int unsigned Gather   = 256,
  parameter  int unsigned Bursts   = 256,  // under way
  parameter  int unsigned BeatBits = 34,   // of an address
  parameter  int unsigned IdBits   = 4,
  parameter  int unsigned Id       = 0,
  localparam int unsigned Width    = 512,
  localparam int unsigned Bytes    = Width / 8,
  localparam int unsigned AddrBits = BeatBits + 6
) (
  input  logic                clk_i,
  input  logic                rst_ni,
  output logic                empty_o,
  output logic                idle_o,
  input  logic                flush_i,
  output logic                answered_o,
  output logic                failed_o,
  // Lines
  input  logic                in_valid_i,
  output logic                in_ready_o,
  input  logic [BeatBits-1:0] in_beat_i,
  input  logic [3:0]          in_strobe_i,
  input  logic [Width-1:0]    in_data_i,
  // AXI4
  output logic                aw_valid_o,
  input  logic                aw_ready_i,
  output logic [IdBits-1:0]   aw_id_o,
  output logic [AddrBits-1:0] aw_addr_o,
  output logic [7:0]          aw_len_o,
  output logic [2:0]          aw_size_o,
  output logic [1:0]          aw_burst_o,
  output logic                w_valid_o,
  input  logic                w_ready_i,
  output logic [Width-1:0]    w_data_o,
  output logic [Bytes-1:0]    w_strb_o,
  output logic                w_last_o,
  input  logic                b_valid_i,
  output logic                b_ready_o,
  input  logic [IdBits-1:0]   b_id_i,
  input  logic [1:0]          b_resp_i
);

  localparam int unsigned COUNT_BITS = $clog2(Gather + 1);

  logic [COUNT_BITS-1:0] gathered_q;  // lines that wait
  logic [6:0]            waited_q;    // cycles since the last one came
  logic                  drain_q, gather, left;
  logic                  address_room, address_valid, address_ready, address_empty;
  logic                  data_room, data_valid, data_ready, data_empty;
  logic [BeatBits-1:0]   beat;
  logic [3:0]            strobe;
  logic [Width-1:0]      data;
  logic [Bytes-1:0]      strobes;
  logic                  answer, failed, unused_tag, write_idle;

  assign in_ready_o = address_room && data_room;
  assign gather     = in_valid_i && in_ready_o;
  assign left       = data_valid && data_ready;
  assign empty_o    = address_empty && data_empty;
  assign idle_o     = empty_o && write_idle;
  assign answered_o = answer;
  assign failed_o   = answer && failed;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      gathered_q <= '0;
      waited_q   <= '0;
      drain_q    <= 1'b0;
    end else begin
      gathered_q <= gathered_q + COUNT_BITS'(gather) - COUNT_BITS'(left);
      waited_q   <= gather ? '0 : waited_q + 7'(!(&waited_q));
      drain_q    <= drain_q ? gathered_q != '0
                            : 32'(gathered_q) >= Gather - 2 || (&waited_q) || flush_i;
    end
  end

  flk_sram_fifo #(
    .Width(BeatBits),
    .Depth(Gather)
  ) i_addresses (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (in_valid_i && data_room),
    .in_ready_o (address_room),
    .in_data_i  (in_beat_i),
    .out_valid_o(address_valid),
    .out_ready_i(address_ready && drain_q),
    .out_data_o (beat),
    .empty_o    (address_empty)
  );

  flk_sram_fifo #(
    .Width(Width + 4),
    .Depth(Gather)
  ) i_lines (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (in_valid_i && address_room),
    .in_ready_o (data_room),
    .in_data_i  ({in_strobe_i, in_data_i}),
    .out_valid_o(data_valid),
    .out_ready_i(data_ready),
    .out_data_o ({strobe, data}),
    .empty_o    (data_empty)
  );

  always_comb begin
    for (int unsigned q = 0; q < 4; q++) begin
      strobes[q*(Bytes/4)+:Bytes/4] = {Bytes / 4{strobe[q]}};
    end
  end

  flk_axi_write #(
    .AddrBits(AddrBits),
    .BeatBits(1),
    .TagBits (1),
    .Width   (Width),
    .MaxBeats(1),
    .Bursts  (Bursts),
    .Tagged  (1'b0),
    .IdBits  (IdBits),
    .Id      (Id)
  ) i_write (
    .clk_i,
    .rst_ni,
    .idle_o      (write_idle),
    .in_valid_i  (address_valid && drain_q),
    .in_ready_o  (address_ready),
    .in_addr_i   ({beat, 6'b0}),
    .in_beats_i  (1'b1),
    .in_tag_i    (1'b0),
    .data_valid_i(data_valid),
    .data_ready_o(data_ready),
    .data_data_i (data),
    .data_strb_i (strobes),
    .done_valid_o(answer),
    .done_error_o(failed),
    .done_tag_o  (unused_tag),
    .aw_valid_o,
    .aw_ready_i,
    .aw_id_o,
    .aw_addr_o,
    .aw_len_o,
    .aw_size_o,
    .aw_burst_o,
    .w_valid_o,
    .w_ready_i,
    .w_data_o,
    .w_strb_o,
    .w_last_o,
    .b_valid_i,
    .b_ready_o,
    .b_id_i,
    .b_resp_i
  );

endmodule
