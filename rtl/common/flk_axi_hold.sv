// Keeps addresses of a part's managers from the memory port, and tells when the part has nothing under way: then it may be reset
// while others use the port.
//
// hold_reads_i, hold_writes_i: no address of a reader, of a writer passes; what has passed comes. drained_o: both are held, and every
// burst that has passed has its last read beat or its write response. Data of writes do not pass here: managers must
// give them for every address that has passed, which those do that have their data before their address.
// At most 2^CountBits - 1 bursts of a manager are under way, and while few_i is high Few; an address beyond that waits.
// Combinational: hold_*_i, few_i, *_valid_i and *_ready_i to the other side; drained_o depends on registers and hold_*_i.
module flk_axi_hold #(
  parameter int unsigned Readers   = 4,
  parameter int unsigned Writers   = 2,
  parameter int unsigned CountBits = 12,
  parameter int unsigned Few       = 3
) (
  input  logic               clk_i,
  input  logic               rst_ni,
  input  logic               clear_i,       // the memory has forgotten what is under way
  input  logic               hold_reads_i,
  input  logic               hold_writes_i,
  output logic               drained_o,
  input  logic               few_i,
  // Managers
  input  logic [Readers-1:0] ar_valid_i,
  output logic [Readers-1:0] ar_ready_o,
  input  logic [Writers-1:0] aw_valid_i,
  output logic [Writers-1:0] aw_ready_o,
  // Port
  output logic [Readers-1:0] ar_valid_o,
  input  logic [Readers-1:0] ar_ready_i,
  output logic [Writers-1:0] aw_valid_o,
  input  logic [Writers-1:0] aw_ready_i,
  // Last beats of reads, responses of writes
  input  logic [Readers-1:0] r_last_i,
  input  logic [Writers-1:0] b_valid_i
);

  localparam int unsigned Managers = Readers + Writers;

  if (Few == 0 || Few >= 1 << CountBits) begin : gen_check_few
    $error("flk_axi_hold: Few must be 1 to 2^CountBits - 1");
  end

  logic [Managers-1:0] taken, ended, full, none;

  assign ar_valid_o = ar_valid_i & ~full[Readers-1:0] & {Readers{!hold_reads_i}};
  assign ar_ready_o = ar_ready_i & ~full[Readers-1:0] & {Readers{!hold_reads_i}};
  assign aw_valid_o = aw_valid_i & ~full[Managers-1:Readers] & {Writers{!hold_writes_i}};
  assign aw_ready_o = aw_ready_i & ~full[Managers-1:Readers] & {Writers{!hold_writes_i}};
  assign taken      = {aw_valid_o & aw_ready_i, ar_valid_o & ar_ready_i};
  assign ended      = {b_valid_i, r_last_i};

  for (genvar k = 0; k < Managers; k++) begin : gen_manager
    logic [CountBits-1:0] count_q;  // bursts under way

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        count_q <= '0;
      end else if (clear_i) begin
        count_q <= '0;
      end else begin
        count_q <= count_q + CountBits'(taken[k]) - CountBits'(ended[k]);
      end
    end

    assign full[k] = &count_q || (few_i && count_q >= CountBits'(Few));
    assign none[k] = count_q == '0;

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni || clear_i) ended[k] |-> count_q != '0)
    else $error("flk_axi_hold: the end of a burst that has not passed");
`endif
  end

  assign drained_o = hold_reads_i && hold_writes_i && (&none);

endmodule
