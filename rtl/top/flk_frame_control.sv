// Frames of the chip: two are under way, one in the front end and one in the rendering half.
//
// start_i takes nothing by itself: the descriptor is taken when the front end's place is free; from the cycle of start_i until
// then descriptor_i must stay (locked_o). It is checked; then the front end works, its counters are kept, and the frame goes to the
// rendering half's place, as soon as that is free, with all that it needs. Frames are posted in the order of their starts:
// a frame whose descriptor was refused, or whose front end met an error, passes the rendering half by, and its
// frame buffer is not touched.
// A frame whose deadline has passed, so many cycles behind its start, ends as it is, with error_o.late. A half that works on it is stopped: *_stop_o until
// *_stopped_i, which says that nothing of it is under way at the memory; its counters are kept, and *_reset_o resets it for four cycles. The other half goes on.
// A half that ends by itself between *_stopped_i and its reset counts as stopped.
// A late frame passes by the halves that it has not reached. The rendering half that has written all pairs of tiles by then is not late.
// post_o is high for a cycle when a frame has ended; tag_o, error_o, pairs_o (of tiles written) and bank_o are its until the next one, which is posted only
// after acknowledged_i, a pulse behind that cycle: what comes before or with post_o is of an earlier frame. Before the first
// post, and after reset_i, all four are 0.
// copy_front_o and copy_rendering_o are high until their done: the frame's counters are to be kept in bank *_bank_o, of
// which there are two; a bank is not written again before its frame was posted and acknowledged. copy_*_none_o: that half
// has not run, its counters are 0.
// stamps_o: now_i when the frame that ends was taken, left the front end, entered the rendering half and left it.
// started_o, finished_o: frames started and posted since reset_i, modulo 2^16.
// clear_i: all frames under way are forgotten and count as finished; the halves must be reset with it. A posted frame is not under
// way: it stays, with its bank, until it is acknowledged; aborted_i adds its bit to error_o. aborted_i, timed_out_i, with clear_i:
// once no posted frame waits, error_o is that bit alone until the next post. reset_i, with clear_i or in the cycle before it: the posted frame is forgotten too, frames count from 0.
// A descriptor is refused where an address is no multiple of 64, the stride no multiple of 32 or less than a row of whole
// pairs of tiles, a side 0 or beyond 4096, the mode not one of CAT_*, there is no cluster, a list writer would have
// more lists than Lists, or colours are to be kept where the chip cannot (ColourStore), of an image that is not in chunks, or in a region
// that is too small.
// Combinational: start_i to locked_o and refused_o, *_idle_i to *_start_o, copy_front_done_i to front_done_o, reset_i to post_o;
// all else depends on registers alone.
module flk_frame_control
  import flk_param_pkg::*;
  import flk_preproc_pkg::*;
  import flk_rendering_pkg::*;
  import flk_top_pkg::*;
#(
  parameter int unsigned Lists       = 16384,
  parameter bit          ColourStore = 1'b1   // colours can be kept
) (
  input  logic                 clk_i,
  input  logic                 rst_ni,
  input  logic                 clear_i,
  input  logic                 aborted_i,
  input  logic                 timed_out_i,
  input  logic                 reset_i,
  // Host
  input  logic [31:0]          now_i,         // cycles
  input  logic                 start_i,
  input  descriptor_t          descriptor_i,
  output logic                 locked_o,
  output logic                 refused_o,     // a start while locked_o
  output logic                 front_done_o,  // pulse: a frame's front end has ended
  output logic                 post_o,
  output logic [15:0]          tag_o,
  output frame_error_t         error_o,
  output logic [15:0]          pairs_o,       // of tiles written, of the posted frame
  output logic                 bank_o,        // of the posted frame
  input  logic                 acknowledged_i,
  output logic [15:0]          started_o,
  output logic [15:0]          finished_o,
  output logic                 front_busy_o,
  output logic                 rendering_busy_o,
  // Front end
  output logic                 front_start_o,
  input  logic                 front_idle_i,
  input  logic                 front_done_i,
  input  logic [FRONT_ERRORS-1:0] front_error_i,
  output front_registers_t     front_o,
  output logic                 front_stop_o,
  input  logic                 front_stopped_i,
  output logic                 front_reset_o,
  // Rendering half
  output logic                 rendering_start_o,
  input  logic                 rendering_idle_i,
  input  logic                 rendering_done_i,
  input  logic [2:0]           rendering_error_i,
  output rendering_registers_t rendering_o,
  output logic                 rendering_stop_o,
  input  logic                 rendering_stopped_i,
  output logic                 rendering_reset_o,
  input  logic [15:0]          rendering_left_i,  // pairs of tiles that are not written
  // Counters
  output logic                 copy_front_o,
  output logic                 copy_front_bank_o,
  output logic                 copy_front_none_o,
  input  logic                 copy_front_done_i,
  output logic                 copy_rendering_o,
  output logic                 copy_rendering_bank_o,
  output logic                 copy_rendering_none_o,
  output logic [3:0][31:0]     stamps_o,
  input  logic                 copy_rendering_done_i
);

  localparam int unsigned BeatShift = 6;  // a beat has 64 bytes

  function automatic logic [BEAT_BITS-1:0] beat(input address_t address);
    return BEAT_BITS'(address >> BeatShift);
  endfunction

  typedef enum logic [2:0] {FREE, CHECK, START, RUN, STOP, COPY, RESET, POST} state_e;

  // ---- front end --------------------------------------------------------------------------------------

  state_e       front_q, render_q;
  logic         pending_q, take, hand_over, unacknowledged_q, may_copy;
  logic         front_bank_q, render_bank_q;
  logic         front_due_q, render_due_q, cut_q;
  logic [1:0]   check_q;
  descriptor_t  frame_q;
  frame_error_t front_error_q, render_error_q;

  // Tiles: derived from the size in two steps.
  logic [8:0]   cols_q, rows_q;        // of tiles
  logic [7:0]   pairs;                 // columns of a list writer, pairs of tiles in a row
  logic [7:0]   half_rows;
  logic [14:0]  lists_q;               // of a list writer
  logic [15:0]  all_pairs_q;
  logic [10:0]  pointer_lines;
  logic [16:0]  row_bytes;
  logic         misaligned_q, unfit_q, unkept_q;

  assign pairs         = 8'((cols_q + 1'b1) >> 1);
  assign half_rows     = 8'((rows_q + 1'b1) >> 1);
  assign pointer_lines = 11'((lists_q + 15'd15) >> 4);
  assign row_bytes     = frame_q.rgba ? {1'b0, pairs, 8'b0}
                                      : {4'b0, pairs, 5'b0} + {3'b0, pairs, 6'b0};

  assign take         = pending_q && front_q == FREE;
  assign hand_over    = front_q == POST && render_q == FREE;
  assign refused_o    = start_i && pending_q;
  assign locked_o     = pending_q || start_i;
  // The frame before last has been acknowledged: the last one waits for its turn, or has been posted.
  assign may_copy     = render_q == FREE || !unacknowledged_q;
  assign copy_front_o = front_q == COPY && may_copy;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      pending_q <= 1'b0;
      front_q   <= FREE;
      check_q   <= '0;
    end else if (clear_i) begin
      pending_q <= 1'b0;
      front_q   <= FREE;
      check_q   <= '0;
    end else begin
      pending_q <= (pending_q || start_i) && !take;
      check_q   <= (front_q == CHECK || front_q == RESET) ? check_q + 1'b1 : '0;
      unique case (front_q)
        FREE: begin
          if (pending_q) begin
            front_q <= CHECK;
          end
        end
        CHECK: begin
          if (check_q == 2'd3) begin
            front_q <= front_error_q.descriptor ? COPY : START;
          end
        end
        START: begin
          if (front_idle_i) begin
            front_q <= RUN;
          end
        end
        RUN: begin
          if (front_done_i) begin
            front_q <= COPY;
          end else if (front_due_q) begin
            front_q <= STOP;
          end
        end
        STOP: begin
          if (front_done_i || front_stopped_i) begin
            front_q <= COPY;
          end
        end
        COPY: begin
          if (may_copy && copy_front_done_i) begin
            front_q <= front_due_q ? RESET : POST;
          end
        end
        RESET: begin
          if (check_q == 2'd3) begin
            front_q <= POST;
          end
        end
        default: begin  // POST: its turn comes
          if (render_q == FREE) begin
            front_q <= FREE;
          end
        end
      endcase
    end
  end

  assign front_start_o = front_q == START && front_idle_i;
  assign front_stop_o  = front_q == STOP || (front_due_q && front_q == COPY) || front_q == RESET;
  assign front_reset_o = front_q == RESET;

  always_ff @(posedge clk_i) begin
    if (take) begin
      frame_q <= descriptor_i;
    end
    cols_q       <= 9'((frame_q.lane.width + 13'd15) >> 4);
    rows_q       <= 9'((frame_q.lane.height + 13'd15) >> 4);
    lists_q      <= 15'(pairs) * 15'(half_rows);
    all_pairs_q  <= 16'(pairs) * 16'(rows_q);
    misaligned_q <= (frame_q.scene_table[5:0] | frame_q.headers[5:0] | frame_q.geometry[5:0] |
                     frame_q.colours[5:0] | frame_q.records[5:0] | frame_q.lists[5:0] |
                     frame_q.pointers[5:0] | frame_q.frame_buffer[5:0] |
                     {1'b0, frame_q.stride[4:0]}) != '0;
    unfit_q      <= frame_q.lane.width == '0 || frame_q.lane.width > 13'd4096 ||
                    frame_q.lane.height == '0 || frame_q.lane.height > 13'd4096 ||
                    frame_q.mode > CAT_AUTO || frame_q.clusters == '0;
    unkept_q     <= frame_q.generation != '0 && (!ColourStore || !frame_q.lane.chunked ||
                                                 frame_q.store[10:0] != '0 ||
                                                 frame_q.clusters > frame_q.store_clusters);
    if (take) begin
      front_error_q <= '0;
    end else if (front_q == CHECK && check_q == 2'd2) begin
      front_error_q.descriptor <= misaligned_q || unfit_q || unkept_q || 32'(lists_q) > Lists ||
                                  frame_q.stride < row_bytes;
    end else if ((front_q == RUN || front_q == STOP) && front_done_i) begin
      front_error_q.front_read    <= front_error_i[FRONT_ERROR_READ];
      front_error_q.front_write   <= front_error_i[FRONT_ERROR_WRITE];
      front_error_q.record_region <= front_error_i[FRONT_ERROR_RECORDS];
      front_error_q.list_memory   <= front_error_i[FRONT_ERROR_LISTS];
      front_error_q.bad_table     <= front_error_i[FRONT_ERROR_TABLE];
      front_error_q.bad_header    <= front_error_i[FRONT_ERROR_HEADER];
    end
  end

  assign front_o.cull          = frame_q.cull;
  assign front_o.lane          = frame_q.lane;
  assign front_o.store         = '{enable: frame_q.generation != '0, first: frame_q.store[39:11],
                                   generation: frame_q.generation, limit: frame_q.tolerance};
  assign front_o.table_beat    = beat(frame_q.scene_table);
  assign front_o.headers_beat  = beat(frame_q.headers);
  assign front_o.geometry_beat = beat(frame_q.geometry);
  assign front_o.colours_beat  = beat(frame_q.colours);
  assign front_o.clusters      = frame_q.clusters;
  assign front_o.records_beat  = beat(frame_q.records);
  assign front_o.record_beats  = frame_q.record_beats;
  assign front_o.lists_beat    = beat(frame_q.lists);
  assign front_o.chunks        = frame_q.chunks;
  assign front_o.pointers_beat = beat(frame_q.pointers);
  assign front_o.pointer_lines = pointer_lines;
  assign front_o.list_columns  = pairs;

  // ---- deadlines --------------------------------------------------------------------------------------

  // Cycles since the host started a frame, wherever it is. A frame is due when it is as old as its deadline, which is known a cycle
  // later: in the front end from its start on, in the rendering half while that runs; it stays due, however old it becomes.
  logic [31:0] pending_age_q, front_age_q, render_age_q, render_deadline_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      pending_age_q <= '0;
      front_age_q   <= '0;
      render_age_q  <= '0;
    end else begin
      pending_age_q <= start_i && !pending_q ? '0 : pending_age_q + 1'b1;
      front_age_q   <= (take ? pending_age_q : front_age_q) + 1'b1;
      render_age_q  <= (hand_over ? front_age_q : render_age_q) + 1'b1;
    end
  end

  always_ff @(posedge clk_i) begin
    if (hand_over) begin
      render_deadline_q <= frame_q.deadline;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      front_due_q  <= 1'b0;
      render_due_q <= 1'b0;
      cut_q        <= 1'b0;
    end else begin
      cut_q        <= render_q != POST && (cut_q || (render_q == STOP && rendering_stopped_i &&
                                                      !rendering_done_i));
      front_due_q  <= front_q != FREE && front_q != CHECK && !clear_i &&
                      !front_error_q.descriptor &&
                      (front_due_q || (frame_q.deadline != '0 && front_age_q >= frame_q.deadline));
      render_due_q <= render_q == RUN && !clear_i &&
                      (render_due_q ||
                       (render_deadline_q != '0 && render_age_q >= render_deadline_q));
    end
  end

  // ---- rendering half ---------------------------------------------------------------------------------

  logic                 post, post_q, rendered_q, render_leaves, render;
  logic [1:0]           render_reset_q;
  logic [15:0]          tag_q, pairs_q;
  logic [3:0][31:0]     stamps_q;
  logic [1:0][31:0]     front_stamps_q;
  rendering_registers_t rendering_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      unacknowledged_q <= 1'b0;
    end else if (reset_i) begin
      unacknowledged_q <= 1'b0;
    end else begin
      unacknowledged_q <= post || (unacknowledged_q && !(acknowledged_i && !post_q));
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      render_q       <= FREE;
      render_reset_q <= '0;
    end else if (clear_i) begin
      render_q       <= FREE;
      render_reset_q <= '0;
    end else begin
      render_reset_q <= render_q == RESET ? render_reset_q + 1'b1 : '0;
      unique case (render_q)
        FREE: begin
          if (front_q == POST) begin
            render_q <= render ? START : COPY;
          end
        end
        START: begin
          if (rendering_idle_i) begin
            render_q <= RUN;
          end
        end
        RUN: begin
          if (rendering_done_i) begin
            render_q <= COPY;
          end else if (render_due_q) begin
            render_q <= STOP;
          end
        end
        STOP: begin
          if (rendering_done_i || rendering_stopped_i) begin
            render_q <= COPY;
          end
        end
        COPY: begin
          if (copy_rendering_done_i) begin
            render_q <= cut_q ? RESET : POST;
          end
        end
        RESET: begin
          if (&render_reset_q) begin
            render_q <= POST;
          end
        end
        default: begin  // POST
          if (!unacknowledged_q) begin
            render_q <= FREE;
          end
        end
      endcase
    end
  end

  assign render            = front_error_q == '0 && !front_due_q;
  assign render_leaves     = (render_q == RUN || render_q == STOP) && rendering_done_i;
  assign rendering_start_o = render_q == START && rendering_idle_i;
  assign rendering_stop_o  = render_q == STOP || (render_q == COPY && cut_q) || render_q == RESET;
  assign rendering_reset_o = render_q == RESET;
  assign copy_rendering_o  = render_q == COPY;
  assign post              = render_q == POST && !unacknowledged_q && !clear_i && !reset_i;
  assign rendering_o       = rendering_q;

  always_ff @(posedge clk_i) begin
    if (hand_over) begin
      tag_q                     <= frame_q.tag;
      rendered_q                <= render;
      pairs_q                   <= '0;
      render_error_q            <= front_error_q;
      render_error_q.late       <= front_due_q;
      rendering_q.mode          <= frame_q.mode;
      rendering_q.rgba          <= frame_q.rgba;
      rendering_q.background    <= frame_q.background;
      rendering_q.pairs         <= pairs;
      rendering_q.rows          <= rows_q;
      rendering_q.all_pairs     <= all_pairs_q;
      rendering_q.lists_beat    <= beat(frame_q.lists);
      rendering_q.chunks        <= frame_q.chunks;
      rendering_q.pointers_beat <= beat(frame_q.pointers);
      rendering_q.records_beat  <= beat(frame_q.records);
      rendering_q.frame_beat    <= beat(frame_q.frame_buffer);
      rendering_q.stride        <= frame_q.stride[16:5];
    end else if (render_leaves || (render_q == STOP && rendering_stopped_i)) begin
      pairs_q                    <= rendering_q.all_pairs - rendering_left_i;
      render_error_q.late        <= rendering_left_i != '0;
      render_error_q.list_read   <= rendering_error_i[0];
      render_error_q.record_read <= rendering_error_i[1];
      render_error_q.frame_write <= rendering_error_i[2];
    end
  end

  // ---- banks, numbers -----------------------------------------------------------------------------------

  logic [15:0]  started_q, finished_q, posted_tag_q, posted_pairs_q;
  frame_error_t posted_error_q;
  logic         posted_bank_q;
  logic         aborted, timed_out, aborted_q, timed_out_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      front_bank_q  <= 1'b0;
      render_bank_q <= 1'b0;
      started_q     <= '0;
      finished_q    <= '0;
      post_q        <= 1'b0;
    end else begin
      post_q <= post;
      if (clear_i) begin
        front_bank_q <= posted_bank_q;  // the next frame takes the other one
      end else if (take) begin
        front_bank_q <= !front_bank_q;
      end
      if (hand_over) begin
        render_bank_q <= front_bank_q;
      end
      if (reset_i) begin
        started_q  <= '0;
        finished_q <= '0;
      end else if (clear_i) begin
        finished_q <= started_q;
      end else begin
        started_q  <= started_q + 16'(start_i && !pending_q);
        finished_q <= finished_q + 16'(post);
      end
    end
  end

  // What a posted frame has left is shown until it is acknowledged, with an abort added to it; an abort or a time-out alone after that.
  assign timed_out = timed_out_i || timed_out_q;
  assign aborted   = (aborted_i || aborted_q) && !timed_out;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      posted_tag_q   <= '0;
      posted_error_q <= '0;
      posted_pairs_q <= '0;
      posted_bank_q  <= 1'b0;
      aborted_q      <= 1'b0;
      timed_out_q    <= 1'b0;
    end else if (reset_i) begin
      posted_tag_q   <= '0;
      posted_error_q <= '0;
      posted_pairs_q <= '0;
      posted_bank_q  <= 1'b0;
      aborted_q      <= 1'b0;
      timed_out_q    <= 1'b0;
    end else begin
      aborted_q   <= aborted && unacknowledged_q;
      timed_out_q <= timed_out && unacknowledged_q;
      if (post) begin
        posted_tag_q   <= tag_q;
        posted_error_q <= render_error_q;
        posted_pairs_q <= pairs_q;
        posted_bank_q  <= render_bank_q;
      end else if ((aborted || timed_out) && !unacknowledged_q) begin
        posted_error_q           <= '0;
        posted_pairs_q           <= '0;
        posted_error_q.aborted   <= aborted;
        posted_error_q.timed_out <= timed_out;
      end else if (aborted_i) begin
        posted_error_q.aborted <= 1'b1;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (take) begin
      front_stamps_q[0] <= now_i;
    end
    if (front_q == RUN || front_q == STOP) begin
      front_stamps_q[1] <= now_i;
    end
    if (hand_over) begin
      stamps_q[1:0] <= front_stamps_q;
    end
    if (render_q == START) begin
      stamps_q[2] <= now_i;
    end
    if (render_q == START || render_q == RUN || render_q == STOP) begin
      stamps_q[3] <= now_i;
    end
  end

  assign post_o                = post_q && !reset_i;
  assign tag_o                 = posted_tag_q;
  assign error_o               = posted_error_q;
  assign pairs_o               = posted_pairs_q;
  assign bank_o                = posted_bank_q;
  assign stamps_o              = stamps_q;
  assign copy_front_bank_o     = front_bank_q;
  assign copy_front_none_o     = front_error_q.descriptor;
  assign copy_rendering_bank_o = render_bank_q;
  assign copy_rendering_none_o = !rendered_q;
  assign started_o             = started_q;
  assign finished_o            = finished_q;
  assign front_busy_o          = front_q != FREE;
  assign rendering_busy_o      = render_q != FREE;
  assign front_done_o          = copy_front_o && copy_front_done_i && !copy_front_none_o &&
                                 !front_due_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      front_done_i && !clear_i |-> front_q == RUN || front_stop_o)
  else $error("flk_frame_control: the front end ends a frame that it was not given");
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      rendering_done_i && !clear_i |-> render_q == RUN || rendering_stop_o)
  else $error("flk_frame_control: the rendering half ends a frame that it was not given");
`endif

endmodule
