// Throttle of the front end's memory traffic: says when the front end is no less far in its frame than the rendering half in the one before, so
// that flk_axi_hold lets few of its bursts be under way and they delay the rendering half's single lines less (docs/reference/memory_port.md).
//
// In a row of frames both halves begin at once, and who ends first waits for the other one. What each has done is counted as a share: of the
// pairs of tiles those that are written, of the table's clusters those before the one that the front end is at. All clusters are three
// quarters of its frame: the ends of the lists are to come. Both shares stand times clusters_i * pairs_i, so that steps are added and nothing
// is divided; clusters that are passed at once are counted one a cycle.
// start_i: the rendering half begins; done_i: it ends; clear_i: it is reset. few_o is low while it does not run. pairs_i, clusters_i stay during
// a frame. left_i: pairs not written, which falls one by one and rises at a start. cluster_i: that the front end is at, below clusters_i; 0 at
// a start, before its frame's first and behind its last one.
// Latency of left_i 4, of cluster_i 5, of start_i, done_i and clear_i 1; few_o comes from registers.
module flk_front_throttle #(
  parameter  int unsigned ClusterBits = 24,
  parameter  int unsigned PairBits    = 16,
  localparam int unsigned Bits        = ClusterBits + PairBits + 1  // of a signed sum
) (
  input  logic                   clk_i,
  input  logic                   rst_ni,
  input  logic                   clear_i,
  // Rendering half
  input  logic                   start_i,
  input  logic                   done_i,
  input  logic [PairBits-1:0]    pairs_i,
  input  logic [PairBits-1:0]    left_i,
  // Front end
  input  logic [ClusterBits-1:0] clusters_i,
  input  logic [ClusterBits-1:0] cluster_i,
  output logic                   few_o
);

  localparam int unsigned StepBits = (ClusterBits > PairBits ? ClusterBits : PairBits) + 1;
  localparam int unsigned HighBits = Bits - StepBits;

  logic                   runs_q, passes, passes_q, wrote_q;
  logic [ClusterBits-1:0] cluster_q;
  logic [ClusterBits-1:0] passed_q;         // clusters that count
  logic [PairBits-1:0]    left_q;
  logic [StepBits-1:0]    step_q, low_q;    // a step may be negative; the sum's low bits
  logic                   carry, carry_q, negative_q;
  logic [StepBits-1:0]    low;
  logic [HighBits-1:0]    high_q;           // a cycle behind: its top bit is the sum's sign

  assign passes       = runs_q && passed_q < cluster_q;
  assign {carry, low} = {1'b0, low_q} + {1'b0, step_q};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      runs_q     <= 1'b0;
      cluster_q  <= '0;
      passes_q   <= 1'b0;
      passed_q   <= '0;
      wrote_q    <= 1'b0;
      left_q     <= '0;
      step_q     <= '0;
      low_q      <= '0;
      carry_q    <= 1'b0;
      negative_q <= 1'b0;
      high_q     <= '0;
    end else begin
      runs_q     <= !clear_i && (start_i || (runs_q && !done_i));
      cluster_q  <= cluster_i;
      passes_q   <= passes;
      passed_q   <= start_i ? '0 : passed_q + ClusterBits'(passes);
      wrote_q    <= runs_q && left_i < left_q;
      left_q     <= left_i;
      step_q     <= (passes_q ? StepBits'(pairs_i) - StepBits'(pairs_i >> 2) : '0) -
                    (wrote_q ? StepBits'(clusters_i) : '0);
      low_q      <= start_i ? '0 : low;
      carry_q    <= !start_i && carry;
      negative_q <= !start_i && step_q[StepBits-1];
      high_q     <= start_i ? '0 : high_q + HighBits'(carry_q) - HighBits'(negative_q);
    end
  end

  assign few_o = runs_q && !high_q[HighBits-1];

endmodule
