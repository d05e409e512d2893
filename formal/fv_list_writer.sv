// flk_list_writer: of every frame that memory suffices for, each entry taken is written exactly once;
// otherwise at most once. Lines go to chunks that were taken, of this writer; pointers to its lines of
// the table. Numbers of chunks taken never exceed what there is.
//
// One entry of a frame, whichever pick_i chooses, has bit 0 set; the proof counts the places where it
// is. Two columns of tiles, four lists. The assertions l_* describe the pipeline for induction.
module fv_list_writer (
  input logic       clk_i,
  input logic       again_i,
  input logic       pick_i,
  input logic       start_i,
  input logic [1:0] writer_i,
  input logic [2:0] chunks_i,
  input logic [5:0] list_base_i,
  input logic [5:0] pointer_base_i,
  input logic       in_valid_i,
  input logic       in_end_i,
  input logic       in_u_i,
  input logic       in_v_i,
  input logic       in_value_i,
  input logic       out_ready_i
);

  localparam logic [2:0] CLEAR = 3'd0;
  localparam logic [2:0] IDLE = 3'd1;
  localparam logic [2:0] ENTRIES = 3'd2;
  localparam logic [2:0] OPEN_LINES = 3'd3;
  localparam logic [2:0] DRAIN = 3'd4;
  localparam logic [2:0] POINTERS = 3'd5;
  localparam logic [2:0] LAST = 3'd6;

  logic        rst_n, idle, done, failed, in_ready, out_valid, tag;
  logic [2:0]  taken;
  logic [5:0]  out_address;
  logic [15:0] out_data;
  logic        picked_q;
  logic [1:0]  delivered_q;
  logic [5:0]  list_base_q;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  assign tag = pick_i && !picked_q;

  flk_list_writer #(
    .SetBitsU   (1),
    .SetBitsV   (0),
    .Ways       (2),
    .Pointers   (4),
    .CoordBits  (1),
    .ChunkLines (2),
    .ChunkBits  (2),
    .EntryBits  (2),
    .LineEntries(2),
    .LineBits   (16),
    .PointerBits(8),
    .AddressBits(6)
  ) dut (
    .clk_i,
    .rst_ni         (rst_n),
    .start_i        (start_i && idle),
    .idle_o         (idle),
    .writer_i,
    .columns_i      (2'd2),
    .pointer_lines_i(2'd2),
    .chunks_i,
    .list_base_i,
    .pointer_base_i,
    .done_o         (done),
    .failed_o       (failed),
    .entries_o      (),
    .lines_o        (),
    .evicted_o      (),
    .taken_o        (taken),
    .in_valid_i,
    .in_ready_o     (in_ready),
    .in_end_i,
    .in_u_i,
    .in_v_i,
    .in_entry_i     ({in_value_i, tag}),
    .out_valid_o    (out_valid),
    .out_ready_i,
    .out_address_o  (out_address),
    .out_data_o     (out_data)
  );

  // What is held where. Places are set and way.

  logic [3:0][1:0]      count;   // entries of the open line
  logic [3:0][1:0]      list;
  logic [3:0][1:0]      stored;  // bit 0 of the entries in memory, by place and column
  logic [3:0][1:0]      pointer_used;
  logic [3:0][1:0]      pointer_chunk;
  logic [2:0]           state;

  assign state = dut.state_q;

  for (genvar s = 0; s < 2; s++) begin : gen_set
    for (genvar w = 0; w < 2; w++) begin : gen_way
      assign count[2*s+w] = dut.i_rows.storage_q[s][4*w+2+:2];
      assign list[2*s+w]  = dut.i_rows.storage_q[s][4*w+:2];
    end
  end
  for (genvar p = 0; p < 4; p++) begin : gen_place
    assign stored[p] = {dut.gen_columns[1].i_column.storage_q[p][0],
                        dut.gen_columns[0].i_column.storage_q[p][0]};
    assign pointer_used[p]  = dut.i_pointers.storage_q[p][3:2];
    assign pointer_chunk[p] = dut.i_pointers.storage_q[p][1:0];
  end

  // Bit 0 of column c of the line in place p, as stage D finds it, and as it will be.
  function automatic logic now(logic [1:0] p, logic c);
    if (dut.e_entry_q && dut.e_place_q == p && dut.e_column_q == 2'(c)) begin
      return dut.e_word_q[0];
    end
    return stored[p][c];
  endfunction

  function automatic logic then_(logic [1:0] p, logic c);
    if (dut.d_entry_q && dut.d_place_q == p && dut.d_column_q == 2'(c)) begin
      return dut.d_word_q[0];
    end
    return now(p, c);
  endfunction

  // Places where the chosen entry is.

  logic [3:0] places;
  logic       out_list;  // what is at the output is a line of a list

  assign out_list = out_valid && state != POINTERS && state != LAST;

  always_comb begin
    places = 4'(dut.a_valid_q && !dut.a_flush_q && dut.a_entry_q[0]);
    places += 4'(dut.b_valid_q && !dut.b_flush_q && dut.b_entry_q[0]);
    for (int unsigned p = 0; p < 4; p++) begin
      for (int unsigned c = 0; c < 2; c++) begin
        places += 4'(2'(c) < count[p] && then_(2'(p), 1'(c)));
      end
    end
    for (int unsigned c = 0; c < 2; c++) begin
      if (dut.d_event_q && 2'(c) < dut.d_count_q) begin
        places += 4'(dut.d_full_q && c == 1 ? dut.d_word_q[0] : now(dut.d_place_q, 1'(c)));
      end
      places += 4'(dut.e_event_q && 2'(c) < dut.e_count_q && dut.line[2*c]);
      places += 4'(out_list && 4'(c) < out_data[7:4] && out_data[2*c]);
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      picked_q    <= 1'b0;
      delivered_q <= 2'd0;
    end else begin
      if (start_i && idle) begin
        picked_q    <= 1'b0;
        delivered_q <= 2'd0;
        list_base_q <= list_base_i;
      end else begin
        if (in_valid_i && in_ready && !in_end_i && tag) begin
          picked_q <= 1'b1;
        end
        if (out_list && out_ready_i) begin
          for (int unsigned c = 0; c < 2; c++) begin
            if (4'(c) < out_data[7:4] && out_data[2*c] && delivered_q != 2'd3) begin
              delivered_q <= delivered_q + 2'd1;
            end
          end
        end
      end
    end
  end

  logic [5:0] list_at, pointer_at;

  assign list_at    = out_address - list_base_q;
  assign pointer_at = out_address - dut.pointer_base_q;

  // An open line is still to be closed.
  function automatic logic pending(logic [1:0] p);
    return (dut.a_valid_q && dut.a_flush_q && {dut.a_set_q, dut.a_way_q} == p) ||
        (dut.b_valid_q && dut.b_flush_q && {dut.b_set_q, dut.b_way_q} == p) ||
        (state == OPEN_LINES && dut.step_q <= 3'(p));
  endfunction

  always_comb begin
    if (rst_n) begin
      // The specification.
      a_once: assert (delivered_q <= 2'd1);
      a_written: assert (!(done && picked_q && !failed) || delivered_q == 2'd1);
      a_taken: assert (idle || state == CLEAR || taken <= dut.chunks_q);
      if (out_list) begin
        a_chunk: assert (3'(list_at >> 3) < taken && list_at[2:1] == dut.writer_q);
      end
      if (out_valid && !out_list) begin
        a_pointer: assert (pointer_at[1:0] == dut.writer_q && pointer_at[5:2] < 4'd2 && !failed);
      end

      // The chosen entry is in one place.
      l_sum: assert (state == CLEAR || 4'(delivered_q) + places <= 4'(picked_q));
      l_kept: assert (failed || 4'(delivered_q) + places == 4'(picked_q) || idle || state == CLEAR);
      l_done: assert (!done || idle);
      l_fresh: assert (state != CLEAR || (delivered_q == 2'd0 && !picked_q && taken == 3'd0 && !failed));

      // States.
      l_state: assert (state <= LAST);
      l_step: assert (dut.step_q <= 3'd4 && (state != OPEN_LINES || dut.step_q < 3'd4) &&
                      (state != POINTERS || dut.step_q < 3'd4) &&
                      (state != CLEAR || dut.step_q < 3'd4));
      l_lines: assert (state == CLEAR || state == IDLE || dut.pointer_lines_q == 2'd2 && dut.columns_q == 2'd2);
      if (state == CLEAR || state == IDLE || state == POINTERS || state == LAST) begin
        l_empty: assert (!dut.a_valid_q && !dut.b_valid_q && !dut.d_entry_q && !dut.d_event_q &&
                         !dut.e_entry_q && !dut.e_event_q);
      end
      if (state == CLEAR || state == IDLE) begin
        l_quiet: assert (!out_valid);
      end
      l_walk: assert (!(dut.walk_q || dut.walk_last_q || dut.e_walk_q || dut.e_walk_last_q) || state == POINTERS || state == LAST);
      l_walk_last: assert (!dut.walk_last_q || dut.walk_q && dut.walk_list_q[0]);
      l_walk_last_e: assert (!dut.e_walk_last_q || dut.e_walk_q && !failed);
      if (dut.e_walk_q) begin
        l_walk_at: assert (dut.e_at_q[1:0] == dut.writer_q && dut.e_at_q[5:2] < 4'd2);
      end
      if (state == ENTRIES || state == OPEN_LINES || state == DRAIN) begin
        l_base: assert (dut.base_q == list_base_q);
      end
      if (dut.walk_q || dut.e_walk_q || state == LAST) begin
        l_base_then: assert (dut.base_q == dut.pointer_base_q);
      end
      if (dut.walk_q) begin
        l_walked: assert (state == POINTERS ? 3'(dut.walk_list_q) + 3'd1 == dut.step_q : dut.walk_list_q == 2'd3);
      end
      l_flush: assert (!dut.a_valid_q || (dut.a_flush_q ? state == OPEN_LINES || state == DRAIN : state == ENTRIES));
      l_flush_b: assert (!(dut.b_valid_q && dut.b_flush_q) || state == OPEN_LINES || state == DRAIN);
      l_order: assert (!(dut.b_valid_q && !dut.b_flush_q) || state == ENTRIES ||
                       (state == OPEN_LINES && dut.step_q == 3'd0 && !dut.a_valid_q));

      // Rows.
      l_row: assert (!dut.b_valid_q || dut.row == dut.i_rows.storage_q[dut.b_set_q]);
      l_set_a: assert (!dut.a_valid_q || dut.a_flush_q || dut.a_set_q == dut.a_list_q[0]);
      l_set_b: assert (!dut.b_valid_q || dut.b_flush_q || dut.b_set_q == dut.b_list_q[0]);
      // Stages.
      if (dut.d_entry_q) begin
        l_column: assert (dut.d_full_q ? dut.d_event_q && dut.d_column_q == 2'd1 && count[dut.d_place_q] == 2'd0 :
                          dut.d_column_q == 2'd0 && count[dut.d_place_q] == 2'd1);
      end
      if (dut.d_event_q) begin
        l_counted: assert (dut.d_full_q ? dut.d_entry_q && dut.d_count_q == 2'd2 : dut.d_count_q == 2'd1);
      end
      if (dut.e_event_q) begin
        l_counted_e: assert (dut.e_full_q ? dut.e_entry_q && dut.e_count_q == 2'd2 : dut.e_count_q == 2'd1);
        l_sends: assert (dut.e_sends_q || failed);
      end
      if (dut.e_sends_q) begin
        l_at: assert (dut.e_event_q && 4'(dut.e_at_q >> 3) < 4'(taken) && dut.e_at_q[2:1] == dut.writer_q);
      end
      if (dut.d_event_q) begin
        l_lists: assert (!(dut.b_valid_q && dut.c_event) || dut.c_list != dut.d_list_q);
        l_pointer: assert (dut.pointer.used <= 2'd2 && (dut.pointer.used == 2'd0 || 3'(dut.pointer.chunk) < taken));
        l_pointer_is: assert (dut.pointer == {pointer_used[dut.d_list_q], pointer_chunk[dut.d_list_q]});
      end
      if (dut.e_entry_q) begin
        l_column_e: assert (dut.e_column_q == 2'(dut.e_event_q && dut.e_full_q));
      end
      if (dut.e_entry_q && !(dut.e_event_q && dut.e_full_q)) begin
        l_entry: assert (
            (dut.d_event_q && dut.d_place_q == dut.e_place_q && dut.e_column_q < dut.d_count_q &&
             !(dut.d_full_q && dut.e_column_q == 2'd1)) ||
            (dut.e_column_q < count[dut.e_place_q] &&
             !(dut.d_entry_q && dut.d_place_q == dut.e_place_q && dut.d_column_q == dut.e_column_q)));
      end

      c_written: cover (done && picked_q && !failed && taken == 3'd2);
      c_failed: cover (done && failed && delivered_q == 2'd1);
    end
  end

  for (genvar p = 0; p < 4; p++) begin : gen_open
    always_comb begin
      if (rst_n) begin
        if (state == CLEAR) begin
          l_clear: assert (dut.step_q <= 3'(p >> 1) || count[p] == 2'd0);
          l_clear_pointer: assert (dut.step_q <= 3'(p) || pointer_used[p] == 2'd0);
        end else begin
          l_count: assert (count[p] <= 2'd1);
          l_list: assert (count[p] == 2'd0 || list[p][0] == 1'(p >> 1));
          l_open: assert (count[p] == 2'd0 || state == ENTRIES || pending(2'(p)) ||
                          (state == OPEN_LINES && dut.step_q == 3'd0));
          l_gone: assert (!dut.d_event_q || count[p] == 2'd0 || list[p] != dut.d_list_q);
          l_used: assert (pointer_used[p] <= 2'd2);
          l_inside: assert (pointer_used[p] == 2'd0 || 3'(pointer_chunk[p]) < taken);
          l_zero: assert (
              !(state == IDLE || (state == LAST && !(dut.walk_q && dut.walk_list_q == 2'(p))) ||
                (state == POINTERS && dut.step_q > 3'(p) &&
                 !(dut.walk_q && dut.walk_list_q == 2'(p)))) || pointer_used[p] == 2'd0);
        end
      end
    end
  end

  for (genvar s = 0; s < 2; s++) begin : gen_unique
    always_comb begin
      if (rst_n && state != CLEAR) begin
        l_unique: assert (count[2*s] == 2'd0 || count[2*s+1] == 2'd0 || list[2*s] != list[2*s+1]);
      end
    end
  end

endmodule
