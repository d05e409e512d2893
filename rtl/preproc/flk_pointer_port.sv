// Lines of list pointers between the list writers and their table in memory (docs/reference/list_writer.md).
//
// A writer's request is taken in turn and is done before the next one: the line that goes (put) is
// read from the writer, written, and answered by the memory; then the line that comes (get) is read,
// or zeros stand for it, and goes to the writer. So no read passes the write of its line, and at the
// end of a request nothing is under way. One of in_put_i and in_get_i is 1 at least.
// For the writer that is served: index_o and read_o ask for a pointer, which is in_pointer_i in the
// next cycle; index_o, write_o and pointer_o are one for it; done_o, with the last of these, ends its
// request. A put takes 17 cycles and a write, a get 2 and a read; then 16 pointers go to the writer.
// Line n of writer b is line base_i + Writers n + b of memory; base_i stays for the frame.
// Errors of the memory are kept until start_i, which comes while nothing is asked for. After one,
// zeros stand for what is read: what comes of it are lists of the writer's own chunks, in any case.
// Combinational: in_valid_i to in_ready_o (of several writers); all else depends on registers alone.
module flk_pointer_port
  import flk_axi_pkg::*;
#(
  parameter  int unsigned Writers     = 4,
  parameter  int unsigned NumberBits  = 10,  // of a line
  parameter  int unsigned PointerBits = 32,
  parameter  int unsigned MoveBits    = 28,  // of a pointer that are not always zero
  localparam int unsigned AddressBits = AXI_BEAT_BITS,  // of a line
  localparam int unsigned Width       = AXI_DATA_BITS,
  localparam int unsigned Bytes       = Width / 8,
  localparam int unsigned WriterShift = $clog2(Writers),
  localparam int unsigned WriterBits  = Writers > 1 ? WriterShift : 1,
  localparam int unsigned PerLine     = Width / PointerBits,
  localparam int unsigned IndexBits   = $clog2(PerLine),
  localparam int unsigned AtBits      = NumberBits + WriterShift
) (
  input  logic                                clk_i,
  input  logic                                rst_ni,
  input  logic                                start_i,
  input  logic [AddressBits-1:0]              base_i,
  output logic                                read_error_o,
  output logic                                write_error_o,
  output logic [31:0]                         put_o,  // lines since start_i
  output logic [31:0]                         got_o,
  // List writers
  input  logic [Writers-1:0]                  in_valid_i,
  output logic [Writers-1:0]                  in_ready_o,
  input  logic [Writers-1:0]                  in_put_i,
  input  logic [Writers-1:0][NumberBits-1:0]  in_put_line_i,
  input  logic [Writers-1:0]                  in_get_i,
  input  logic [Writers-1:0][NumberBits-1:0]  in_get_line_i,
  output logic [IndexBits-1:0]                index_o,
  output logic [Writers-1:0]                  read_o,
  input  logic [Writers-1:0][MoveBits-1:0]    in_pointer_i,
  output logic [Writers-1:0]                  write_o,
  output logic [MoveBits-1:0]                 pointer_o,
  output logic [Writers-1:0]                  done_o,
  // AXI4
  output logic                                ar_valid_o,
  input  logic                                ar_ready_i,
  output axi_ax_t                             ar_o,
  input  logic                                r_valid_i,
  output logic                                r_ready_o,
  input  axi_r_t                              r_i,
  output logic                                aw_valid_o,
  input  logic                                aw_ready_i,
  output axi_ax_t                             aw_o,
  output logic                                w_valid_o,
  input  logic                                w_ready_i,
  output axi_w_t                              w_o,
  input  logic                                b_valid_i,
  output logic                                b_ready_o,
  input  axi_b_t                              b_i
);

  if (Writers != 1 << WriterShift) begin : gen_check
    $error("flk_pointer_port: Writers must be a power of two");
  end

  typedef struct packed {
    logic                  put;
    logic [NumberBits-1:0] put_line;
    logic                  get;
    logic [NumberBits-1:0] get_line;
  } request_t;

  // TURN: two cycles for the sum of an address.
  typedef enum logic [2:0] {IDLE, GATHER, PUT, TURN, GET, GIVE} state_e;

  state_e                  state_q;
  request_t [Writers-1:0]  requests;
  request_t                chosen;
  logic                    get_q;
  logic [NumberBits-1:0]   get_line_q;
  logic [WriterBits-1:0]   index, owner_q;
  logic [Writers-1:0]      owner;  // one bit
  logic                    chosen_valid, take;
  logic [IndexBits:0]      step_q;
  logic                    gathered_q;     // a pointer comes
  logic                    ask_q, data_q;  // address, data are still to go
  logic                    ask_ready, data_ready, put_done, put_error, get_valid, get_error;
  logic                    get_ready, read_error_q, write_error_q;
  logic                    last;
  logic [AtBits-1:0]       at_q;      // of a line, from base_i
  logic [AtBits:0]         low_q;
  logic [AddressBits-1:0]  address_q;
  logic [Width-1:0]        line_q, get_data;

  for (genvar k = 0; k < Writers; k++) begin : gen_requests
    assign requests[k] = '{put: in_put_i[k], put_line: in_put_line_i[k],
                           get: in_get_i[k], get_line: in_get_line_i[k]};
  end

  if (Writers == 1) begin : gen_one
    assign chosen_valid = in_valid_i[0];
    assign in_ready_o   = state_q == IDLE;
    assign chosen       = requests[0];
    assign index        = '0;
  end else begin : gen_turns
    flk_stream_arbiter #(
      .Inputs(Writers),
      .Width ($bits(request_t))
    ) i_turns (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i,
      .in_ready_o,
      .in_data_i  (requests),
      .out_valid_o(chosen_valid),
      .out_ready_i(state_q == IDLE),
      .out_data_o (chosen),
      .out_index_o(index)
    );
  end

  assign take  = state_q == IDLE && chosen_valid;
  assign last  = &step_q[IndexBits-1:0];
  assign owner = Writers'(1) << owner_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q    <= IDLE;
      step_q     <= '0;
      ask_q      <= 1'b0;
      data_q     <= 1'b0;
      gathered_q <= 1'b0;
    end else begin
      gathered_q <= read_o != '0;
      unique case (state_q)
        IDLE: begin
          step_q <= '0;
          if (take) begin
            state_q <= chosen.put ? GATHER : TURN;
          end
        end
        GATHER: begin
          step_q <= step_q + 1'b1;
          if (step_q[IndexBits]) begin
            state_q <= PUT;
            ask_q   <= 1'b1;
            data_q  <= 1'b1;
          end
        end
        PUT: begin
          step_q <= '0;
          if (ask_ready) begin
            ask_q <= 1'b0;
          end
          if (data_ready) begin
            data_q <= 1'b0;
          end
          // An answer without the data having gone: the port is being drained, a reset follows.
          if (put_done && !data_q) begin
            state_q <= get_q ? TURN : GIVE;
          end
        end
        TURN: begin
          step_q <= step_q + 1'b1;
          if (step_q[0]) begin
            state_q <= GET;
            ask_q   <= 1'b1;
          end
        end
        GET: begin
          step_q <= '0;
          if (get_ready) begin
            ask_q <= 1'b0;
          end
          if (get_valid) begin
            state_q <= GIVE;
          end
        end
        default: begin  // GIVE
          step_q <= step_q + 1'b1;
          if (last) begin
            state_q <= IDLE;
          end
        end
      endcase
    end
  end

  always_ff @(posedge clk_i) begin
    if (take) begin
      owner_q    <= index;
      get_q      <= chosen.get;
      get_line_q <= chosen.get_line;
    end
    // The sum of an address, its lower part first.
    if (take) begin
      at_q <= (AtBits'(chosen.put ? chosen.put_line : chosen.get_line) << WriterShift) |
              AtBits'(index);
    end else if (state_q == PUT && put_done) begin
      at_q <= (AtBits'(get_line_q) << WriterShift) | AtBits'(owner_q);
    end
    low_q     <= {1'b0, base_i[AtBits-1:0]} + {1'b0, at_q};
    address_q <= {base_i[AddressBits-1:AtBits] + (AddressBits - AtBits)'(low_q[AtBits]),
                  low_q[AtBits-1:0]};
    if (state_q == GET) begin
      line_q <= get_error || read_error_q || write_error_q ? '0 : get_data;
    end else if (gathered_q || state_q == GIVE) begin
      line_q <= {PointerBits'(in_pointer_i[owner_q]), line_q[Width-1:PointerBits]};
    end
  end

  assign index_o   = step_q[IndexBits-1:0];
  assign read_o    = state_q == GATHER && !step_q[IndexBits] ? owner : '0;
  assign write_o   = state_q == GIVE ? owner : '0;
  assign pointer_o = get_q ? line_q[MoveBits-1:0] : '0;
  assign done_o    = state_q == GIVE && last ? owner : '0;

  // ---- memory ---------------------------------------------------------------------------------------

  logic unused_tag, unused_last, unused_ar_tag, unused_read_tag;
  logic unused_read_idle, unused_write_idle;

  flk_axi_write #(
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(1),
    .MaxBeats(1),
    .Bursts  (1),
    .Tagged  (1'b0),
    .IdBits  (AXI_ID_BITS)
  ) i_write (
    .clk_i,
    .rst_ni,
    .idle_o      (unused_write_idle),
    .in_valid_i  (state_q == PUT && ask_q),
    .in_ready_o  (ask_ready),
    .in_addr_i   ({address_q, $clog2(Bytes)'(0)}),
    .in_beats_i  (1'b1),
    .in_tag_i    (1'b0),
    .data_valid_i(data_q),
    .data_ready_o(data_ready),
    .data_data_i (line_q),
    .data_strb_i ('1),
    .done_valid_o(put_done),
    .done_error_o(put_error),
    .done_tag_o  (unused_tag),
    .aw_valid_o,
    .aw_ready_i,
    .aw_id_o     (aw_o.id),
    .aw_addr_o   (aw_o.addr),
    .aw_len_o    (aw_o.len),
    .aw_size_o   (aw_o.size),
    .aw_burst_o  (aw_o.burst),
    .w_valid_o,
    .w_ready_i,
    .w_data_o    (w_o.data),
    .w_strb_o    (w_o.strb),
    .w_last_o    (w_o.last),
    .b_valid_i,
    .b_ready_o,
    .b_id_i      (b_i.id),
    .b_resp_i    (b_i.resp)
  );

  flk_axi_read #(
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(1),
    .MaxBeats(1),
    .Bursts  (1),
    .IdBits  (AXI_ID_BITS)
  ) i_read (
    .clk_i,
    .rst_ni,
    .idle_o     (unused_read_idle),
    .in_valid_i (state_q == GET && ask_q),
    .in_ready_o (get_ready),
    .in_addr_i  ({address_q, $clog2(Bytes)'(0)}),
    .in_beats_i (1'b1),
    .in_tag_i   (1'b0),
    .out_valid_o(get_valid),
    .out_ready_i(1'b1),
    .out_data_o (get_data),
    .out_tag_o  (unused_read_tag),
    .out_last_o (unused_last),
    .out_error_o(get_error),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o    (ar_o.id),
    .ar_addr_o  (ar_o.addr),
    .ar_len_o   (ar_o.len),
    .ar_size_o  (ar_o.size),
    .ar_burst_o (ar_o.burst),
    .ar_tag_o   (unused_ar_tag),
    .r_valid_i,
    .r_ready_o,
    .r_id_i     (r_i.id),
    .r_data_i   (r_i.data),
    .r_resp_i   (r_i.resp),
    .r_last_i   (r_i.last)
  );

  // ---- errors and counters --------------------------------------------------------------------------

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      read_error_q  <= 1'b0;
      write_error_q <= 1'b0;
    end else if (start_i) begin
      read_error_q  <= 1'b0;
      write_error_q <= 1'b0;
    end else begin
      read_error_q  <= read_error_q || (get_valid && get_error);
      write_error_q <= write_error_q || (put_done && put_error);
    end
  end

  assign read_error_o  = read_error_q;
  assign write_error_o = write_error_q;

  flk_event_counter i_put (
    .clk_i,
    .rst_ni,
    .clear_i(start_i),
    .count_i(put_done),
    .value_o(put_o)
  );

  flk_event_counter i_got (
    .clk_i,
    .rst_ni,
    .clear_i(start_i),
    .count_i(get_valid),
    .value_o(got_o)
  );

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) take |-> chosen.put || chosen.get)
  else $error("flk_pointer_port: a request without a line");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      start_i |-> state_q == IDLE && !chosen_valid)
  else $error("flk_pointer_port: start while a line moves");
`endif

endmodule
