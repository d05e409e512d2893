// What a rendering stage has beside its cores: the frame (its mode, its end, its abort) and the counters' read port.
//
// It lies in the handshake of the cores' input streams: nothing is taken while clear_i is high, and the first element of a frame that
// comes together with a new mode waits one cycle.
// mode_o follows mode_i while the stage is idle and keeps what the first element came with until it is idle again.
// idle_o: the cores are idle and no list has begun without having ended.
// Combinational: valid_o and in_ready_o from valid, ready, clear_i and mode_i; idle_o from idle_i. counter_data_o is a register
// (COUNTER_LATENCY 1).
module flk_stage_control
  import flk_param_pkg::*;
#(
  parameter int unsigned Cores = CORES
) (
  input  logic                                clk_i,
  input  logic                                rst_ni,
  input  logic                                clear_i,
  input  logic [2:0]                          mode_i,
  output logic [2:0]                          mode_o,
  output logic                                idle_o,
  // input streams of the stage
  input  logic [Cores-1:0]                    in_valid_i,
  output logic [Cores-1:0]                    in_ready_o,
  input  logic [Cores-1:0]                    in_eos_i,
  // and of its cores
  output logic [Cores-1:0]                    valid_o,
  input  logic [Cores-1:0]                    ready_i,
  input  logic [Cores-1:0]                    idle_i,
  // counters
  input  logic [$clog2(CORES)-1:0]            counter_core_i,
  input  logic [CORES-1:0][COUNTER_BITS-1:0]  counter_i,       // of each core, at one index
  output logic [COUNTER_BITS-1:0]             counter_data_o
);

  // ---- Frame -----------------------------------------------------------------------------------------------

  logic [2:0] mode_q;
  logic [Cores-1:0] list_d, list_q;  // a list has begun whose token has not come
  logic open;  // elements may be taken

  assign idle_o     = (&idle_i) && (list_q == '0);
  assign open       = !clear_i && (!idle_o || (mode_q == mode_i));
  assign valid_o    = open ? in_valid_i : '0;
  assign in_ready_o = open ? ready_i : '0;
  assign mode_o     = mode_q;

  always_comb begin
    list_d = clear_i ? '0 : list_q;
    for (int unsigned k = 0; k < Cores; k++) begin
      if (valid_o[k] && ready_i[k]) begin
        list_d[k] = !in_eos_i[k];
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      list_q <= '0;
    end else begin
      list_q <= list_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (idle_o) begin
      mode_q <= mode_i;
    end
  end

  // ---- Counters ----------------------------------------------------------------------------------------------

  logic [COUNTER_BITS-1:0] counter_data_q;

  always_ff @(posedge clk_i) begin
    counter_data_q <= counter_i[counter_core_i];
  end

  assign counter_data_o = counter_data_q;

endmodule
