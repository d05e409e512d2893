// Colour store: colours that last from frame to frame (docs/reference/colour_store.md).
//
// Between the cull, the front's last stage, the fetch of colours and the lanes: heads of clusters are read as the cull keeps them, and tested
// (flk_colour_heads); turns of survivors at the end of the front learn which of them have a stored colour (there_o) and go when
// ready_o is high; stored colours come in rows and computed ones in parts, to the lanes in order (flk_colour_rows); colours that
// are stored leave as lines, in an order in which every prefix leaves the store without a wrong colour (flk_colour_keeper, flk_colour_heads).
// Without setup_i.enable nothing is read or written, and parts pass.
// A frame: start_i while idle_o; registers stay until idle_o. flush_i, from the front's end on: clusters whose turns do not come
// any more go. failing_i, until the frame's end: what has been read is wrong, and turns of some clusters do not come; nothing is shown or
// kept any more. An error of the memory: error_o rises and stays until the next start; the same holds, so that no wrong colour is kept.
// Combinational: out_ready_i to in_ready_o, in_* to out_*; ar_ready_i to the requests, r_valid_i and r_i to the buffer's write port.
module flk_colour_store
  import flk_axi_pkg::*;
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Lanes       = LANES, // 1, 2 or 4
  parameter  int unsigned Waiting     = 128,   // survivors of a lane that wait for colours
  parameter  int unsigned BufferBeats = 32,
  parameter  int unsigned Bursts      = 32,    // under way
  parameter  int unsigned Id          = 0,
  localparam int unsigned Width       = AXI_DATA_BITS
) (
  input  logic                     clk_i,
  input  logic                     rst_ni,
  // Frame
  input  logic                     start_i,
  input  logic                     flush_i,
  input  logic                     failing_i,
  output logic                     idle_o,
  input  store_setup_t             setup_i,
  input  cluster_t [2:0]           position_i,  // of the camera
  output logic                     error_o,
  output logic [31:0]              beats_o,     // read
  // Clusters that the cull keeps
  input  logic                     kept_valid_i,
  output logic                     kept_ready_o,
  input  boxed_t                   kept_i,
  // A turn of survivors
  output logic                     ready_o,
  output logic [Lanes-1:0]         there_o,
  input  logic                     go_i,
  input  logic [Lanes-1:0]         alive_i,
  input  logic [5:0]               group_i,
  input  logic [1:0]               at_i,
  input  logic                     last_i,      // of the cluster
  // Computed colours
  input  logic         [Lanes-1:0] in_valid_i,
  output logic         [Lanes-1:0] in_ready_o,
  input  colour_part_t [Lanes-1:0] in_data_i,
  // Colours
  output logic         [Lanes-1:0] out_valid_o,
  input  logic         [Lanes-1:0] out_ready_i,
  output colour_part_t [Lanes-1:0] out_data_o,
  // Records, in beats
  input  logic                     record_valid_i,
  output logic                     record_ready_o,
  input  store_entry_t [3:0]       record_i,
  // Lines to write
  output logic                     line_valid_o,
  input  logic                     line_ready_i,
  output logic [BEAT_BITS-1:0]     line_beat_o,
  output logic [Width-1:0]         line_o,
  // AXI4
  output logic                     ar_valid_o,
  input  logic                     ar_ready_i,
  output axi_ax_t                  ar_o,
  input  logic                     r_valid_i,
  output logic                     r_ready_o,
  input  axi_r_t                   r_i
);

  typedef struct packed {
    logic                 head;
    logic [BEAT_BITS-1:0] beat;
  } request_t;

  logic error_q;
  logic enable_q;  // heads are read
  logic shown_q;   // colours are shown and kept

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      enable_q <= 1'b0;
      shown_q  <= 1'b0;
    end else begin
      enable_q <= setup_i.enable;
      shown_q  <= setup_i.enable && !failing_i && !error_q;
    end
  end

  // ---- heads ----------------------------------------------------------------------------------------

  logic                 heads_idle, heads_ready, beat_valid, beat_is_head, head_ready, row_ready;
  logic [1:0]           request_valid, request_ready;
  request_t [1:0]       requests;
  logic                 clear_valid, clear_ready, stored_valid, stored_take;
  store_slot_t          request_head, clear_slot;
  logic [Width-1:0]     beat_data;
  store_head_t          head, clear;
  stored_t              stored;

  assign kept_ready_o = heads_ready || !enable_q;

  flk_colour_heads i_heads (
    .clk_i,
    .rst_ni,
    .flush_i        (flush_i || !shown_q),
    .idle_o         (heads_idle),
    .first_i        (setup_i.first),
    .generation_i   (setup_i.generation),
    .limit_i        (setup_i.limit),
    .position_i,
    .in_valid_i     (kept_valid_i && enable_q),
    .in_ready_o     (heads_ready),
    .in_data_i      (kept_i),
    .request_valid_o(request_valid[0]),
    .request_ready_i(request_ready[0]),
    .request_slot_o (request_head),
    .head_valid_i   (beat_valid && beat_is_head),
    .head_ready_o   (head_ready),
    .head_i         (head),
    .clear_valid_o  (clear_valid),
    .clear_ready_i  (clear_ready),
    .clear_slot_o   (clear_slot),
    .clear_o        (clear),
    .out_valid_o    (stored_valid),
    .out_ready_i    (stored_take),
    .out_data_o     (stored)
  );

  assign head             = {beat_data[511:256], beat_data[127:0]};
  assign requests[0].beat = {request_head, 5'd0};
  assign requests[0].head = 1'b1;
  assign requests[1].head = 1'b0;

  // ---- turns ----------------------------------------------------------------------------------------

  logic             rows_ready, keeper_ready, about_ready, opened_q, turn;
  logic [Lanes-1:0] there;

  assign there       = Lanes'(stored.there[group_i[5:4]] >> {group_i[3:0], at_i});
  assign there_o     = shown_q ? there : '0;
  assign ready_o     = rows_ready && (!shown_q || (stored_valid && keeper_ready && about_ready));
  assign turn        = go_i && shown_q;
  assign stored_take = turn && last_i;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      opened_q <= 1'b0;
    end else if (start_i) begin
      opened_q <= 1'b0;
    end else if (turn) begin
      opened_q <= !last_i;
    end
  end

  // ---- rows -----------------------------------------------------------------------------------------

  logic                         rows_idle;
  store_entry_t [STORE_ROW-1:0] row;

  for (genvar p = 0; p < STORE_ROW; p++) begin : gen_row
    assign row[p] = beat_data[40*p+:38];
  end

  logic unused_spare;
  assign unused_spare = ^beat_data;

  flk_colour_rows #(
    .Lanes  (Lanes),
    .Waiting(Waiting)
  ) i_rows (
    .clk_i,
    .rst_ni,
    .start_i,
    .idle_o         (rows_idle),
    .turn_valid_i   (go_i),
    .turn_ready_o   (rows_ready),
    .turn_alive_i   (alive_i),
    .turn_stored_i  (alive_i & there_o),
    .turn_group_i   (group_i),
    .turn_at_i      (at_i),
    .turn_slot_i    (stored.slot),
    .request_valid_o(request_valid[1]),
    .request_ready_i(request_ready[1]),
    .request_beat_o (requests[1].beat),
    .row_valid_i    (beat_valid && !beat_is_head),
    .row_ready_o    (row_ready),
    .row_i          (row),
    .in_valid_i,
    .in_ready_o,
    .in_data_i,
    .out_valid_o,
    .out_ready_i,
    .out_data_o
  );

  // ---- beats ----------------------------------------------------------------------------------------

  logic             request_any, fetch_ready, fetch_idle, fetch_valid, fetch_head, fetch_error;
  logic             freed_q;
  logic             buffer_empty, unused_index, unused_room;
  request_t         request;
  logic [Width-1:0] fetch_data;

  flk_stream_arbiter #(
    .Inputs(2),
    .Width ($bits(request_t))
  ) i_requests (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (request_valid),
    .in_ready_o (request_ready),
    .in_data_i  (requests),
    .out_valid_o(request_any),
    .out_ready_i(fetch_ready),
    .out_data_o (request),
    .out_index_o(unused_index)
  );

  flk_axi_fetch #(
    .Places  (BufferBeats),
    .AddrBits(AXI_ADDR_BITS),
    .BeatBits(2),
    .Width   (Width),
    .MaxBeats(2),
    .Bursts  (Bursts),
    .IdBits  (AXI_ID_BITS),
    .Id      (Id)
  ) i_fetch (
    .clk_i,
    .rst_ni,
    .stop_i     (1'b0),
    .idle_o     (fetch_idle),
    .in_valid_i (request_any),
    .in_ready_o (fetch_ready),
    .in_beat_i  (request.beat),
    .in_beats_i (2'd1),
    .in_tag_i   (request.head),
    .in_placed_i(1'b0),
    .freed_i    (freed_q),
    .out_valid_o(fetch_valid),
    .out_data_o (fetch_data),
    .out_tag_o  (fetch_head),
    .out_error_o(fetch_error),
    .ar_valid_o,
    .ar_ready_i,
    .ar_id_o    (ar_o.id),
    .ar_addr_o  (ar_o.addr),
    .ar_len_o   (ar_o.len),
    .ar_size_o  (ar_o.size),
    .ar_burst_o (ar_o.burst),
    .r_valid_i,
    .r_ready_o,
    .r_id_i     (r_i.id),
    .r_data_i   (r_i.data),
    .r_resp_i   (r_i.resp),
    .r_last_i   (r_i.last)
  );

  flk_sram_fifo #(
    .Width(1 + Width),
    .Depth(BufferBeats)
  ) i_buffer (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (fetch_valid),
    .in_ready_o (unused_room),
    .in_data_i  ({fetch_head, fetch_data}),
    .out_valid_o(beat_valid),
    .out_ready_i(beat_is_head ? head_ready : row_ready),
    .out_data_o ({beat_is_head, beat_data}),
    .empty_o    (buffer_empty)
  );

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      freed_q <= 1'b0;
      error_q <= 1'b0;
    end else begin
      freed_q <= beat_valid && (beat_is_head ? head_ready : row_ready);
      error_q <= !start_i && (error_q || (fetch_valid && fetch_error));
    end
  end

  flk_event_counter i_beats (
    .clk_i,
    .rst_ni,
    .clear_i(start_i),
    .count_i(fetch_valid),
    .value_o(beats_o)
  );

  // ---- lines ----------------------------------------------------------------------------------------

  logic                 keeper_idle, keep_valid, keep_ready, record_ready;
  logic [BEAT_BITS-1:0] keep_beat;
  logic [Width-1:0]     keep;

  flk_colour_keeper #(
    .Lanes(Lanes)
  ) i_keeper (
    .clk_i,
    .rst_ni,
    .start_i,
    .drop_i           (!shown_q),
    .idle_o           (keeper_idle),
    .generation_i     (setup_i.generation),
    .position_i,
    .cluster_valid_i  (turn && !opened_q),
    .cluster_ready_o  (about_ready),
    .cluster_slot_i   (stored.slot),
    .cluster_storing_i(stored.storing),
    .turn_valid_i     (turn),
    .turn_ready_o     (keeper_ready),
    .turn_alive_i     (alive_i),
    .turn_there_i     (there),
    .turn_last_i      (last_i),
    .record_valid_i   (record_valid_i && shown_q),
    .record_ready_o   (record_ready),
    .record_i,
    .line_valid_o     (keep_valid),
    .line_ready_i     (keep_ready),
    .line_beat_o      (keep_beat),
    .line_o           (keep)
  );

  assign record_ready_o = record_ready || !shown_q;

  // A cleared head goes first: its cluster's rows come later in any case. A line that is offered stays.
  logic keeping_q;  // the keeper's is offered

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      keeping_q <= 1'b0;
    end else begin
      keeping_q <= keep_valid && !keep_ready && (keeping_q || !clear_valid);
    end
  end

  assign clear_ready  = line_ready_i && !keeping_q;
  assign keep_ready   = line_ready_i && (keeping_q || !clear_valid);
  assign line_valid_o = clear_valid || keep_valid;
  assign line_beat_o  = clear_valid && !keeping_q ? {clear_slot, 5'd0} : keep_beat;
  assign line_o       = clear_valid && !keeping_q
                      ? {clear.there, 128'b0, clear.generation, clear.position} : keep;

  assign error_o = error_q;
  assign idle_o  = heads_idle && rows_idle && fetch_idle && buffer_empty && keeper_idle;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o)
  else $error("flk_colour_store: start while a frame is under way");

  assert property (@(posedge clk_i) disable iff (!rst_ni) fetch_valid |-> unused_room)
  else $error("flk_colour_store: a beat without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni) go_i |-> ready_o)
  else $error("flk_colour_store: a turn that was not let go");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      line_valid_o && !line_ready_i |=> line_valid_o && $stable({line_beat_o, line_o}))
  else $error("flk_colour_store: a line that changes before it leaves");
`endif

endmodule
