// Counters of frames: kept in two banks of 256 words, copied when a half of the chip has ended a frame.
//
// front_valid_i and rendering_valid_i stay until *_done_o, high for a cycle; what is copied stays as long. The front end's
// FRONT_WORDS go to words 0 on, the last FRONT_WAITS of them to words COUNTER_FRONT_WAITS on, the rendering half's RENDERING_WORDS to words
// COUNTER_RENDERING on, the stage's to words 128 on (core, then index CNT_*): read through counter_addr_o, COUNTER_LATENCY cycles
// later. *_none_i: zeros instead.
// value_o is the word addr_i of bank_i, a cycle later; of a word that is being written it is undefined. The front end goes first;
// a copy takes a cycle a word.
module flk_frame_counters
  import flk_param_pkg::*;
  import flk_counter_pkg::*;
#(
  localparam int unsigned IndexBits = 8
) (
  input  logic                             clk_i,
  input  logic                             rst_ni,
  input  logic                             clear_i,
  input  logic                             front_valid_i,
  input  logic                             front_bank_i,
  input  logic                             front_none_i,
  input  logic [FRONT_WORDS-1:0][31:0]     front_words_i,
  output logic                             front_done_o,
  input  logic                             rendering_valid_i,
  input  logic                             rendering_bank_i,
  input  logic                             rendering_none_i,
  input  logic [RENDERING_WORDS-1:0][31:0] rendering_words_i,
  output logic [COUNTER_ADDR_BITS-1:0]     counter_addr_o,
  input  logic [COUNTER_BITS-1:0]          counter_data_i,
  output logic                             rendering_done_o,
  // Reader
  input  logic                             bank_i,
  input  logic [IndexBits-1:0]             addr_i,
  output logic [31:0]                      value_o
);

  localparam int unsigned StageWords = 2 ** COUNTER_ADDR_BITS;
  localparam int unsigned Steps = StageWords + COUNTER_LATENCY;

  typedef enum logic [1:0] {IDLE, FRONT, RENDERING, STAGE} state_e;

  state_e               state_q;
  logic [IndexBits-1:0] step_q;
  logic                 write, last;
  logic                 bank;
  logic [IndexBits-1:0] index;
  logic [31:0]          word;

  always_comb begin
    unique case (state_q)
      FRONT:     last = 32'(step_q) == FRONT_WORDS - 1;
      RENDERING: last = 32'(step_q) == RENDERING_WORDS - 1;
      STAGE:     last = 32'(step_q) == Steps - 1;
      default:   last = 1'b1;
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      step_q  <= '0;
    end else if (clear_i) begin
      state_q <= IDLE;
      step_q  <= '0;
    end else begin
      step_q <= last ? '0 : step_q + 1'b1;
      unique case (state_q)
        IDLE: begin
          if (front_valid_i && !front_done_o) begin
            state_q <= FRONT;
          end else if (rendering_valid_i && !rendering_done_o) begin
            state_q <= RENDERING;
          end
        end
        RENDERING: begin
          if (last) begin
            state_q <= STAGE;
          end
        end
        default: begin
          if (last) begin
            state_q <= IDLE;
          end
        end
      endcase
    end
  end

  assign counter_addr_o = step_q[COUNTER_ADDR_BITS-1:0];

  always_comb begin
    write = 1'b0;
    bank  = rendering_bank_i;
    index = step_q;
    word  = '0;
    unique case (state_q)
      FRONT: begin
        write = 1'b1;
        bank  = front_bank_i;
        if (32'(step_q) >= FRONT_WORDS - FRONT_WAITS) begin
          index = step_q + IndexBits'(COUNTER_FRONT_WAITS - (FRONT_WORDS - FRONT_WAITS));
        end
        word  = front_none_i ? '0 : front_words_i[step_q[$clog2(FRONT_WORDS)-1:0]];
      end
      RENDERING: begin
        write = 1'b1;
        index = IndexBits'(COUNTER_RENDERING) + step_q;
        word  = rendering_none_i ? '0 : rendering_words_i[step_q[$clog2(RENDERING_WORDS)-1:0]];
      end
      STAGE: begin
        write = 32'(step_q) >= COUNTER_LATENCY;
        index = IndexBits'(COUNTER_STAGE) + step_q - IndexBits'(COUNTER_LATENCY);
        word  = rendering_none_i ? '0 : counter_data_i;
      end
      default: ;
    endcase
  end

  logic write_q, bank_q, front_done_q, rendering_done_q;
  logic [IndexBits-1:0] index_q;
  logic [31:0] word_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      write_q          <= 1'b0;
      front_done_q     <= 1'b0;
      rendering_done_q <= 1'b0;
    end else begin
      write_q          <= write && !clear_i;
      front_done_q     <= state_q == FRONT && last && !clear_i;
      rendering_done_q <= state_q == STAGE && last && !clear_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (write) begin
      bank_q  <= bank;
      index_q <= index;
      word_q  <= word;
    end
  end

  assign front_done_o     = front_done_q;
  assign rendering_done_o = rendering_done_q;

  flk_sram #(
    .Width(32),
    .Depth(2 ** (IndexBits + 1))
  ) i_words (
    .clk_i,
    .wr_en_i  (write_q),
    .wr_addr_i({bank_q, index_q}),
    .wr_data_i(word_q),
    .rd_en_i  (1'b1),
    .rd_addr_i({bank_i, addr_i}),
    .rd_data_o(value_o)
  );

endmodule
