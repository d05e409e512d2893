// flk_list_writer: of every frame that memory suffices for, each entry taken is written exactly once;
// otherwise at most once. Lines go to chunks that were taken, of this writer; pointers to its lines of
// the table. Numbers of chunks taken never exceed what there is. At the end of a frame that memory
// suffices for, the table has every list's pointer, and each of its lines was written at most
// once at the end. Each line goes behind the line of its list that went before.
//
// Chains, of one list, whichever list_i chooses: a chunk's first line goes to a chunk that no line went to before,
// the lowest such one, and only when the list's chunk before it is full. It links to that one, which the list began
// last and which has a lower number; the list's first chunk and all other lines have no link. So links end after fewer
// steps than there are chunks. The list's pointer at the end is its newest chunk and the number of lines there. A line
// has entries of one list alone, and no two lines of a frame's lists go to one address (at_i chooses it).
//
// With two pointers on the chip for four lists (Pointers 2), lines of pointers move to the table and
// back, by an agent of any speed.
//
// One entry of a frame, whichever pick_i chooses, has its mask bit set; the proof counts the places where it
// is. The key bit is set in all entries of the chosen list, which tells its lines at the output. The record bit is free: entries
// with the same one are near each other, and of these five are in a line, of others three. At most as many
// chunks as a link can name. Two columns of tiles, four lists. The assertions l_* describe the pipeline for induction.
module fv_list_writer #(
  parameter int unsigned Pointers = 4,
  parameter int unsigned Easy     = 0   // 1: ten entries of two lists, and nothing waits
) (
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
  input logic       in_record_i,
  input logic [1:0] list_i,
  input logic [5:0] at_i,
  input logic       out_ready_i,
  input logic       mover_ready_i,
  input logic       mover_step_i
);

  localparam bit Large = Pointers == 2;

  localparam logic [2:0] CLEAR = 3'd0;
  localparam logic [2:0] IDLE = 3'd1;
  localparam logic [2:0] ENTRIES = 3'd2;
  localparam logic [2:0] OPEN_LINES = 3'd3;
  localparam logic [2:0] DRAIN = 3'd4;
  localparam logic [2:0] POINTERS = 3'd5;
  localparam logic [2:0] LAST = 3'd6;
  // Of look_q.
  localparam logic [2:0] LOOK = 3'd0;
  localparam logic [2:0] COMPARE = 3'd1;
  localparam logic [2:0] ASK = 3'd2;
  localparam logic [2:0] MOVE = 3'd3;
  localparam logic [2:0] AGAIN = 3'd4;
  localparam logic [2:0] WALK = 3'd5;

  logic        rst_n, idle, done, failed, in_ready, out_valid, tag;
  logic [2:0]  taken;
  logic [5:0]  out_address;
  logic [31:0] out_data;
  logic        picked_q, mark;
  logic [1:0]  list_q;  // that is followed
  logic [5:0]  at_q;    // the address, from list_base_q
  logic [1:0]  delivered_q;
  logic [5:0]  list_base_q, list_at, pointer_at;
  logic [2:0]  state;

  // Who moves lines of pointers, and the table.
  typedef enum logic [1:0] {STANDS, READS, WRITES} mover_e;

  mover_e          mover_state_q;
  logic [1:0]      mover_q;          // pointers asked for, or given
  logic            came_q;           // the one asked for last comes
  logic            put_q, put_line_q, get_q, get_line_q, spilled_q, fetched_q;
  logic [3:0][3:0] table_q;
  logic [1:0]      written_q;        // lines, at the end
  logic [3:0][3:0] due_q;            // each list's pointer
  logic            move_valid, move_ready, move_put, move_put_line, move_get, move_get_line;
  logic            move_read, move_write, move_done, out_pointers, out_line;
  logic [3:0]      move_from, move_to;

  fv_reset i_reset (.clk_i, .again_i, .rst_no(rst_n));

  assign tag  = pick_i && !picked_q;
  assign mark = {in_v_i, in_u_i} == list_q;

  flk_list_writer #(
    .SetBitsU   (1),
    .SetBitsV   (0),
    .Ways       (2),
    .Pointers   (Pointers),
    .Lists      (4),
    .CoordBits  (1),
    .ChunkLines (2),
    .ChunkBits  (2),
    .MaskBits   (1),
    .RecordBits (1),
    .KeyBits    (1),
    .RecordKept (0),
    .KeyKept    (1),
    .LineEntries(3),
    .ShortEntries(5),
    .LineBits   (32),
    .PointerBits(16),
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
    .in_bank_i      (1'b0),
    .in_u_i,
    .in_v_i,
    .in_entry_i     ({mark, in_record_i, tag}),
    .out_valid_o    (out_valid),
    .out_ready_i,
    .out_address_o  (out_address),
    .out_data_o     (out_data),
    .move_valid_o   (move_valid),
    .move_ready_i   (move_ready),
    .move_put_o     (move_put),
    .move_put_line_o(move_put_line),
    .move_get_o     (move_get),
    .move_get_line_o(move_get_line),
    .move_index_i   (mover_q[0]),
    .move_read_i    (move_read),
    .move_pointer_o (move_from),
    .move_write_i   (move_write),
    .move_pointer_i (move_to),
    .move_done_i    (move_done)
  );

  assign move_ready = mover_state_q == STANDS && mover_ready_i;
  assign move_read  = mover_state_q == READS && mover_step_i && !mover_q[1];
  assign move_write = mover_state_q == WRITES && mover_step_i;
  assign move_done  = move_write && mover_q[0];
  assign move_to    = get_q ? table_q[{get_line_q, mover_q[0]}] : 4'd0;

  assign out_pointers = out_valid && (state == POINTERS || state == LAST);
  assign out_line     = pointer_at[2];

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      mover_state_q <= STANDS;
      mover_q       <= 2'd0;
      came_q        <= 1'b0;
    end else begin
      came_q <= move_read;
      case (mover_state_q)
        STANDS: begin
          mover_q <= 2'd0;
          if (move_valid && move_ready) begin
            mover_state_q <= move_put ? READS : WRITES;
          end
        end
        READS: begin
          if (move_read) begin
            mover_q <= mover_q + 2'd1;
          end
          if (mover_q[1] && !came_q) begin
            mover_state_q <= WRITES;
            mover_q       <= 2'd0;
          end
        end
        default: begin
          if (move_write) begin
            mover_q <= mover_q + 2'd1;
          end
          if (move_done) begin
            mover_state_q <= STANDS;
          end
        end
      endcase
    end
  end

  always_ff @(posedge clk_i) begin
    if (move_valid && move_ready) begin
      put_q      <= move_put;
      put_line_q <= move_put_line;
      get_q      <= move_get;
      get_line_q <= move_get_line;
    end
    if (came_q) begin
      table_q[{put_line_q, mover_q[1]}] <= move_from;  // 1 or 2 were asked for
    end
    if (out_pointers && out_ready_i) begin
      table_q[{out_line, 1'b0}] <= out_data[3:0];
      table_q[{out_line, 1'b1}] <= out_data[19:16];
    end
    if (start_i && idle) begin
      due_q     <= '0;
      written_q <= '0;
      spilled_q <= 1'b0;
      fetched_q <= 1'b0;
    end else begin
      if (dut.pointer_write) begin
        due_q[dut.d_list_q] <= dut.pointer_d;
      end
      if (out_pointers && out_ready_i) begin
        written_q[out_line] <= 1'b1;
      end
      if (move_done) begin
        spilled_q <= spilled_q || put_q;
        fetched_q <= fetched_q || get_q;
      end
    end
  end

  // What is held where. Places are set and way.

  logic [3:0][2:0]      count;   // entries of the open line
  logic [3:0][1:0]      list;
  logic [3:0][3:0][1:0] stored;  // entries in columns, by place and column: mask and key
  logic [3:0][2:0]      newest;  // the newest one of each line
  logic [3:0][3:0]      kept;    // the pointers on the chip
  logic [3:0][3:0]      value;   // of each list, wherever it is

  assign state = dut.state_q;

  for (genvar s = 0; s < 2; s++) begin : gen_set
    for (genvar w = 0; w < 2; w++) begin : gen_way
      assign count[2*s+w]  = dut.i_rows.storage_q[s][6*w+2+:3];
      assign list[2*s+w]   = dut.i_rows.storage_q[s][6*w+:2];
      assign newest[2*s+w] = dut.gen_newest[w].i_newest.storage_q[s];
    end
  end
  for (genvar p = 0; p < 4; p++) begin : gen_place
    assign stored[p] = {dut.gen_over[1].gen_rest[0].gen_piece.i_rest.storage_q[p],
                        dut.gen_over[1].i_gap.storage_q[p],
                        dut.gen_over[0].gen_rest[0].gen_piece.i_rest.storage_q[p],
                        dut.gen_over[0].i_gap.storage_q[p],
                        dut.gen_columns[1].i_kept.storage_q[p], dut.gen_columns[0].i_kept.storage_q[p]};
    assign kept[p] = dut.i_pointers.storage_q[p % Pointers];
  end

  // The place of the two lines of pointers, as it is, and as it was before a line moves.
  logic       held, tag_held, was_held, was_tag, line, moves;
  logic [1:0] in_table, was_in_table, gone;

  if (Large) begin : gen_store
    assign {in_table, held, tag_held}       = dut.i_places.storage_q[0];
    assign {was_in_table, was_held, was_tag} = dut.place_read;
  end else begin : gen_no_store
    assign {in_table, held, tag_held, was_in_table, was_held, was_tag} = '0;
  end

  assign line  = dut.d_list_q[1];  // that comes
  assign moves = Large && dut.hold_q && (dut.look_q == ASK || dut.look_q == MOVE);
  assign gone  = mover_state_q == READS ? mover_q - 2'(came_q) : mover_state_q == WRITES ? 2'd2 : 2'd0;

  for (genvar p = 0; p < 4; p++) begin : gen_value
    localparam bit Of = p / 2;
    localparam bit At = p % 2;
    always_comb begin
      if (!Large) begin
        value[p] = kept[p];
      end else if (moves && line == Of) begin
        value[p] = mover_state_q == WRITES && 2'(At) < mover_q ? kept[At]
                 : was_in_table[Of] ? table_q[p] : 4'd0;
      end else if (moves && was_held) begin
        value[p] = 2'(At) < gone ? table_q[p] : kept[At];
      end else if (!moves && held && tag_held == Of) begin
        value[p] = kept[At];
      end else begin
        value[p] = in_table[Of] ? table_q[p] : 4'd0;
      end
    end
  end

  // Lists whose pointers are in stage E and, last, in the output register.
  logic [1:0] e_list_q;
  logic [3:0] walked;

  assign walked = dut.walk_blank_q ? 4'd0 : dut.pointer;

  always_ff @(posedge clk_i) begin
    if (dut.advance) begin
      e_list_q <= dut.walk_list_q;
    end
  end

  // Mask (b 0) or key (1) of column c of the line in place p, as stage D finds it, and as it will be.
  function automatic logic now(logic [1:0] p, logic [1:0] c, logic b);
    if (dut.e_push_q && dut.e_place_q == p && dut.e_column_q == 3'(c)) begin
      return dut.e_newest_q[{b, 1'b0}];
    end
    return stored[p][c][b];
  endfunction

  function automatic logic then_(logic [1:0] p, logic [1:0] c, logic b);
    if (dut.d_push_q && dut.d_place_q == p && dut.d_column_q == 3'(c)) begin
      return dut.d_newest_q[{b, 1'b0}];
    end
    return now(p, c, b);
  endfunction

  // Entries of a line: the newest, two more in places of their own, two in gaps and tail.
  function automatic logic [4:0] masks(logic [31:0] data);
    return {data[7], data[4], data[6], data[3], data[0]};
  endfunction

  function automatic logic [4:0] keys(logic [31:0] data);
    return {data[10], data[9], data[8], data[5], data[2]};
  endfunction

  // Places where the chosen entry is.

  logic [4:0] places;
  logic       out_list;  // what is at the output is a line of a list
  logic [4:0] e_masks, e_keys, out_masks, out_keys, out_has, e_has;

  assign out_list  = out_valid && state != POINTERS && state != LAST;
  assign e_masks   = masks(dut.line);
  assign e_keys    = keys(dut.line);
  assign out_masks = masks(out_data);
  assign out_keys  = keys(out_data);

  for (genvar c = 0; c < 5; c++) begin : gen_has
    assign out_has[c] = 4'(c) < out_data[14:11];
    assign e_has[c]   = 3'(c) < dut.e_count_q;
  end

  always_comb begin
    places = 5'(dut.a_valid_q && !dut.a_flush_q && dut.a_entry_q[0]);
    places += 5'(dut.r_valid_q && !dut.r_flush_q && dut.r_entry_q[0]);
    places += 5'(dut.b_valid_q && !dut.b_flush_q && dut.b_entry_q[0]);
    for (int unsigned p = 0; p < 4; p++) begin
      places += 5'(count[p] != 3'd0 && newest[p][0]);
      for (int unsigned c = 0; c < 4; c++) begin
        places += 5'(3'(c + 1) < count[p] && then_(2'(p), 2'(c), 1'b0));
      end
    end
    places += 5'(dut.d_event_q && (dut.d_full_q ? dut.d_word_q[0] : dut.d_newest_q[0]));
    for (int unsigned c = 0; c < 4; c++) begin
      if (dut.d_event_q && 3'(c + 1) < dut.d_count_q) begin
        places += 5'(dut.d_full_q && dut.d_column_q == 3'(c) ? dut.d_newest_q[0]
                                                             : now(dut.d_place_q, 2'(c), 1'b0));
      end
    end
    for (int unsigned c = 0; c < 5; c++) begin
      places += 5'(dut.e_event_q && e_has[c] && e_masks[c]);
      places += 5'(out_list && out_has[c] && out_masks[c]);
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
          for (int unsigned c = 0; c < 5; c++) begin
            if (out_has[c] && out_masks[c] && delivered_q != 2'd3) begin
              delivered_q <= delivered_q + 2'd1;
            end
          end
        end
      end
    end
  end

  assign list_at    = out_address - list_base_q;
  assign pointer_at = out_address - dut.pointer_base_q;

  // ---- chains ---------------------------------------------------------------------------------------

  logic [3:0] chain_q;               // the chosen list's pointer, by the lines that have left
  logic [2:0] begun_q;               // chunks whose first line has left
  logic       seen_q;                // a line has left to the chosen address
  logic [1:0] line_list_q, f_list_q;  // lists of the lines in stages E and F
  logic       chosen, first, e_chosen, frame;
  logic [3:0] chain_out, chain_e;
  logic [2:0] link;

  assign chosen    = out_list && out_data[2];
  assign first     = !list_at[0];
  assign link      = out_data[17:15];
  assign chain_out = {first ? 2'd1 : 2'd2, list_at[4:3]};
  assign e_chosen  = dut.e_sends_q && line_list_q == list_q;
  assign chain_e   = {dut.e_at_q[0] ? 2'd2 : 2'd1, dut.e_at_q[4:3]};
  assign frame     = state != CLEAR && state != IDLE;

  always_ff @(posedge clk_i) begin
    list_q <= list_q;
    at_q   <= at_q;
    if (dut.advance) begin
      line_list_q <= dut.d_list_q;
      f_list_q  <= line_list_q;
    end
    if (start_i && idle) begin
      chain_q <= '0;
    end else if (chosen && out_ready_i) begin
      chain_q <= chain_out;
    end
  end

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      begun_q <= '0;
      seen_q  <= 1'b0;
    end else if (start_i && idle) begin
      begun_q <= '0;
      seen_q  <= 1'b0;
    end else if (out_list && out_ready_i) begin
      begun_q <= begun_q + 3'(first);
      seen_q  <= seen_q || list_at == at_q;
    end
  end

  // Entries of the frame, for easy traces.
  logic [3:0] count_q;

  always_ff @(posedge clk_i or negedge rst_n) begin
    if (!rst_n) begin
      count_q <= 4'd0;
    end else if (start_i && idle) begin
      count_q <= 4'd0;
    end else if (in_valid_i && in_ready && !in_end_i && count_q != 4'd15) begin
      count_q <= count_q + 4'd1;
    end
  end

  always_comb begin
    m_list: assume (list_i == list_q && at_i == at_q);
    m_chunks: assume (chunks_i <= 3'd4);
    m_easy: assume (Easy == 0 || (start_i && in_valid_i && out_ready_i && mover_ready_i && mover_step_i && !again_i &&
                                  !in_v_i && in_record_i == count_q[0] && in_end_i == (count_q == 4'd10)));
    if (rst_n) begin
      if (out_list) begin
        a_count: assert (out_data[14:11] >= 4'd1 && out_data[14:11] <= 4'd5);
        a_one_list: assert ((out_keys & out_has) == ({5{out_keys[0]}} & out_has));
        a_zero: assert (out_data[31:18] == 14'd0 && (out_masks & ~out_has & {2'b00, 3'b111}) == 5'd0 &&
                        (out_keys & ~out_has) == 5'd0);
        a_fresh: assert (!first || 3'(list_at >> 3) == begun_q);
        a_down: assert (link[2] ? first && link[1:0] < list_at[4:3] : link == 3'd0);
        a_single: assert (!seen_q || list_at != at_q);
      end
      if (chosen) begin
        if (first) begin
          a_full: assert (chain_q[3:2] == 2'd0 || chain_q[3:2] == 2'd2);
          a_link: assert (link == (chain_q[3:2] == 2'd0 ? 3'd0 : {1'b1, chain_q[1:0]}));
        end else begin
          a_next: assert (chain_q == {2'd1, list_at[4:3]} && link == 3'd0);
        end
      end
      if (done && !failed) begin
        a_newest: assert (table_q[list_q] == chain_q);
      end

      // Keys.
      l_mark_a: assert (!dut.a_valid_q || dut.a_flush_q || dut.a_entry_q[2] == (dut.a_list_q == list_q));
      l_mark_r: assert (!dut.r_valid_q || dut.r_flush_q || dut.r_entry_q[2] == (dut.r_list_q == list_q));
      l_mark_b: assert (!dut.b_valid_q || dut.b_flush_q || dut.b_entry_q[2] == (dut.b_list_q == list_q));
      if (dut.d_push_q || dut.d_event_q) begin
        l_mark_d: assert (dut.d_newest_q[2] == (dut.d_list_q == list_q));
      end
      if (dut.d_event_q && dut.d_full_q) begin
        l_mark_word: assert (dut.d_word_q[2] == (dut.d_list_q == list_q));
      end
      if (dut.d_push_q && !dut.d_full_q) begin
        l_push_list: assert (list[dut.d_place_q] == dut.d_list_q);
      end
      if (dut.e_event_q) begin
        l_mark_e: assert ((e_keys & e_has) == ({5{line_list_q == list_q}} & e_has));
        l_apart: assert (!dut.d_event_q || dut.d_list_q != line_list_q);
        l_apart_f: assert (!out_list || f_list_q != line_list_q);
      end
      if (out_list) begin
        l_mark_f: assert ((out_keys & out_has) == ({5{f_list_q == list_q}} & out_has));
        l_part: assert (list_at[5] == 1'b0);
      end

      // The chosen list's lines in stages E and F, and its pointer.
      if (frame) begin
        l_chunks: assert (dut.chunks_q <= 3'd4);
        l_spent: assert (dut.spent_q == (taken == dut.chunks_q));
        l_taken: assert (taken == begun_q + 3'(out_list && first) + 3'(dut.e_sends_q && dut.e_begins_q));
        l_begun: assert (chain_q == 4'd0 ||
                         (chain_q[3:2] != 2'd0 && chain_q[3:2] <= 2'd2 && 3'(chain_q[1:0]) < begun_q));
      end
      if (dut.e_sends_q) begin
        l_first: assert (dut.e_begins_q == !dut.e_at_q[0] && dut.e_at_q[5] == 1'b0);
        l_fresh_e: assert (!dut.e_begins_q || 3'(dut.e_at_q >> 3) == begun_q + 3'(out_list && first));
        l_pointer_e: assert (dut.e_begins_q ? dut.e_pointer_q == 4'd0 || (dut.e_pointer_q[3:2] == 2'd2 &&
                                              dut.e_pointer_q[1:0] < dut.e_at_q[4:3])
                                            : dut.e_pointer_q == {2'd1, dut.e_at_q[4:3]});
      end
      if (frame || done) begin
        l_chain: assert (due_q[list_q] == (e_chosen ? chain_e : chosen ? chain_out : chain_q));
      end
      if (e_chosen) begin
        l_chain_e: assert (dut.e_pointer_q == chain_q);
      end
      // Addresses.
      if (seen_q && frame) begin
        l_seen: assert (at_q[5] == 1'b0 && 3'(at_q >> 3) < taken && at_q[2:1] == dut.writer_q &&
                        !(dut.e_sends_q && dut.e_at_q == at_q));
      end
      if (dut.e_sends_q && out_list) begin
        l_two: assert (dut.e_at_q != list_at);
      end
      c_link: cover (chosen && link == 3'b101 && seen_q);
    end
  end

  // A line that was written is not where a list's next one goes.
  function automatic logic behind(logic [3:0] pointer, logic [5:0] at);
    return pointer[3:2] == 2'd0 || pointer[1:0] != at[4:3] || pointer[3:2] > 2'(at[0]);
  endfunction

  for (genvar p = 0; p < 4; p++) begin : gen_chain
    for (genvar c = 0; c < 4; c++) begin : gen_mark
      always_comb begin
        if (rst_n && state != CLEAR) begin
          l_mark: assert (3'(c + 1) >= count[p] || then_(2'(p), 2'(c), 1'b1) == (list[p] == list_q));
        end
        if (rst_n && dut.d_event_q && dut.d_place_q == 2'(p) && 3'(c + 1) < dut.d_count_q &&
            !(dut.d_full_q && dut.d_column_q == 3'(c))) begin
          l_mark_line: assert (now(2'(p), 2'(c), 1'b1) == (dut.d_list_q == list_q));
        end
      end
    end
    always_comb begin
      if (rst_n && state != CLEAR) begin
        l_mark_newest: assert (count[p] == 3'd0 || newest[p][2] == (list[p] == list_q));
      end
    end
    for (genvar q = 0; q < p; q++) begin : gen_apart
      always_comb begin
        if (rst_n && frame) begin
          l_own: assert (due_q[p] == 4'd0 || due_q[q] == 4'd0 || due_q[p][1:0] != due_q[q][1:0]);
        end
      end
    end
    always_comb begin
      if (rst_n && frame) begin
        l_behind_seen: assert (!seen_q || behind(due_q[p], at_q));
        l_behind_e: assert (!dut.e_sends_q || behind(due_q[p], dut.e_at_q));
        l_behind_f: assert (!out_list || behind(due_q[p], list_at));
      end
    end
  end

  // ---- what is where --------------------------------------------------------------------------------

  // An open line is still to be closed.
  function automatic logic pending(logic [1:0] p);
    return (dut.a_valid_q && dut.a_flush_q && {dut.a_set_q, dut.a_way_q} == p) ||
        (dut.r_valid_q && dut.r_flush_q && {dut.r_set_q, dut.r_way_q} == p) ||
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
      a_behind: assert (!dut.pointer_write || dut.pointer == due_q[dut.d_list_q]);
      a_table: assert (!(done && !failed) || table_q == due_q);
      if (out_pointers) begin
        a_once_more: assert (!written_q[out_line]);
      end
      if (out_valid && !out_list) begin
        a_pointer: assert (pointer_at[1:0] == dut.writer_q && pointer_at[5:2] < 4'd2 && !failed);
      end

      // The chosen entry is in one place.
      l_sum: assert (state == CLEAR || 5'(delivered_q) + places <= 5'(picked_q));
      l_kept: assert (failed || 5'(delivered_q) + places == 5'(picked_q) || idle || state == CLEAR);
      l_done: assert (!done || idle || Large && state == CLEAR);
      l_fresh: assert (state != CLEAR || Large || (delivered_q == 2'd0 && !picked_q && taken == 3'd0 && !failed));
      l_fresh_large: assert (state != CLEAR || delivered_q <= 2'(picked_q));

      // States.
      l_state: assert (state <= LAST);
      l_step: assert (dut.step_q <= 3'd4 && (state != OPEN_LINES || dut.step_q < 3'd4) &&
                      (state != POINTERS || dut.step_q < 3'd4) &&
                      (state != CLEAR || dut.step_q < 3'(Pointers)));
      l_size: assert (state == CLEAR || state == IDLE || dut.large_q == Large);

      // Moves.
      l_hold: assert (!dut.hold_q || (Large && dut.d_event_q &&
                      (state == ENTRIES || state == OPEN_LINES || state == DRAIN)));
      l_look: assert (dut.look_q == LOOK || (dut.hold_q ? dut.look_q <= AGAIN :
                      Large && state == POINTERS && (dut.look_q == COMPARE || dut.look_q == WALK)));
      l_mover: assert ((mover_state_q != STANDS) == (dut.hold_q && dut.look_q == MOVE));
      l_moves: assert (mover_q <= 2'd2 && (mover_state_q != WRITES || mover_q <= 2'd1) &&
                       mover_state_q <= WRITES && (mover_state_q != READS || put_q));
      if (mover_state_q != STANDS) begin
        l_request: assert (put_q == was_held && (!put_q || put_line_q == was_tag) &&
                           get_q == was_in_table[line] && get_line_q == line);
      end
      l_came: assert (!came_q || (mover_state_q == READS && mover_q != 2'd0 &&
                                  dut.pointer == kept[mover_q - 2'd1]));
      if (Large && moves) begin
        l_place: assert (held && tag_held == line && !dut.failed_q &&
                         in_table == (was_in_table | (2'(was_held) << was_tag)) &&
                         (was_held ? was_tag != line : was_in_table[line]));
      end
      if (Large && dut.hold_q && dut.look_q == COMPARE) begin
        l_compare: assert ({was_in_table, was_held, was_tag} == {in_table, held, tag_held});
      end
      if (Large && dut.hold_q && dut.look_q == AGAIN) begin
        l_again: assert (held && tag_held == line);
      end
      if (Large && dut.hold_q && dut.look_q <= COMPARE) begin
        l_found: assert (held ? tag_held != line || dut.pointer == kept[{1'b0, dut.d_list_q[0]}]
                              : dut.pointer == 4'd0);
      end
      if (Large && state != CLEAR && !held) begin
        l_unused: assert (kept[0] == 4'd0 && kept[1] == 4'd0 && in_table == 2'd0);
      end
      if (Large && state == IDLE) begin
        l_idle_place: assert (!held);
      end
      if (state == CLEAR) begin
        l_clear_place: assert (dut.step_q == 3'd0 || dut.i_places.storage_q[0] == '0);
        l_clear_place_1: assert (Large || dut.step_q <= 3'd1 || dut.i_places.storage_q[Large ? 0 : 1] == '0);
      end
      if (!Large && state != CLEAR) begin
        l_no_place: assert (dut.i_places.storage_q[0] == '0 && dut.i_places.storage_q[Large ? 0 : 1] == '0);
      end

      // The pointers at the end.
      if (state == POINTERS && Large && dut.look_q == COMPARE) begin
        l_compare_walk: assert ({was_in_table, was_held, was_tag} == {in_table, held, tag_held});
      end
      if (Large && state == POINTERS) begin
        l_step_walk: assert (dut.look_q == WALK || !dut.step_q[0]);
        if (dut.look_q == WALK) begin
          l_kind: assert (dut.blank_q ? !(held && tag_held == dut.step_q[1]) && !in_table[dut.step_q[1]]
                                      : held && tag_held == dut.step_q[1]);
        end
      end
      l_blank: assert (!dut.blank_q || (Large && state == POINTERS || state == LAST));
      if (dut.walk_q) begin
        l_walk_value: assert (walked == due_q[dut.walk_list_q]);
        l_walk_pair: assert (!dut.walk_list_q[0] || (dut.e_walk_q && e_list_q == {dut.walk_list_q[1], 1'b0}));
        l_walk_last_is: assert (dut.walk_last_q == dut.walk_list_q[0]);
      end
      if (dut.e_walk_q) begin
        l_e_value: assert (dut.e_pointer_q == due_q[e_list_q]);
        l_e_last: assert (failed || dut.e_walk_last_q == e_list_q[0]);
        l_e_at: assert (dut.e_at_q == {3'd0, e_list_q[1], dut.writer_q});
        l_e_pair: assert (!e_list_q[0] || out_data[19:16] == due_q[{e_list_q[1], 1'b0}]);
      end
      if (state == POINTERS && dut.step_q[0]) begin
        l_step_pair: assert (dut.walk_q && 3'(dut.walk_list_q) + 3'd1 == dut.step_q);
      end
      // In order.
      if (out_pointers) begin
        l_order_out: assert ((state == LAST || 3'(out_line) < (dut.step_q >> 1)) &&
                             !(dut.walk_q && dut.walk_list_q[1] <= out_line) &&
                             !(dut.e_walk_q && e_list_q[1] <= out_line));
      end
      if (dut.e_walk_q) begin
        l_order_e: assert ((state == LAST || 3'(e_list_q) < dut.step_q) && !(dut.walk_q && dut.walk_list_q <= e_list_q));
      end
      if (out_pointers) begin
        l_out_value: assert (out_data[3:0] == due_q[{out_line, 1'b0}] &&
                             out_data[19:16] == due_q[{out_line, 1'b1}]);
      end
      l_lines: assert (state == CLEAR || state == IDLE || dut.pointer_lines_q == 2'd2 && dut.columns_q == 2'd2);
      if (state == CLEAR || state == IDLE || state == POINTERS || state == LAST) begin
        l_empty: assert (!dut.a_valid_q && !dut.r_valid_q && !dut.b_valid_q && !dut.d_push_q &&
                         !dut.d_event_q && !dut.e_push_q && !dut.e_event_q);
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
      if (dut.walk_q || dut.e_walk_q || (!Large && state == LAST)) begin
        l_base_then: assert (dut.base_q == dut.pointer_base_q);
      end
      if (dut.walk_q && !Large) begin
        l_walked: assert (state == POINTERS ? 3'(dut.walk_list_q) + 3'd1 == dut.step_q : dut.walk_list_q == 2'd3);
      end
      if (dut.walk_q && state == POINTERS) begin
        l_walked_before: assert (3'(dut.walk_list_q) < dut.step_q);
      end
      l_flush: assert (!dut.a_valid_q || (dut.a_flush_q ? state == OPEN_LINES || state == DRAIN : state == ENTRIES));
      l_flush_r: assert (!(dut.r_valid_q && dut.r_flush_q) || state == OPEN_LINES || state == DRAIN);
      l_flush_b: assert (!(dut.b_valid_q && dut.b_flush_q) || state == OPEN_LINES || state == DRAIN);
      l_order_r: assert (!(dut.r_valid_q && !dut.r_flush_q) || state == ENTRIES ||
                         (state == OPEN_LINES && dut.step_q == 3'd0 && !dut.a_valid_q));
      l_order: assert (!(dut.b_valid_q && !dut.b_flush_q) || state == ENTRIES ||
                       (state == OPEN_LINES && (dut.step_q == 3'd0 ? !dut.a_valid_q && !(dut.r_valid_q && dut.r_flush_q)
                                                : dut.step_q == 3'd1 && !dut.r_valid_q && dut.a_valid_q)));
      l_place_a: assert (!dut.a_valid_q || !dut.a_flush_q || state != OPEN_LINES ||
                         3'({dut.a_set_q, dut.a_way_q}) + 3'd1 == dut.step_q);
      l_order_d: assert (!(dut.d_event_q && count[dut.d_place_q] != 3'd0) || !(dut.b_valid_q && dut.b_flush_q));

      // Rows.
      l_row_r: assert (!dut.r_valid_q || dut.r_row == dut.i_rows.storage_q[dut.r_set_q]);
      l_row: assert (!dut.b_valid_q || dut.row == dut.i_rows.storage_q[dut.b_set_q]);
      l_set_a: assert (!dut.a_valid_q || dut.a_flush_q || dut.a_set_q == dut.a_list_q[0]);
      l_set_r: assert (!dut.r_valid_q || dut.r_flush_q || dut.r_set_q == dut.r_list_q[0]);
      l_set_b: assert (!dut.b_valid_q || dut.b_flush_q || dut.b_set_q == dut.b_list_q[0]);
      // Stages.
      if (dut.d_push_q) begin
        l_column: assert (dut.d_full_q ? dut.d_event_q && dut.d_count_q == dut.d_column_q + 3'd2 &&
                                         count[dut.d_place_q] == 3'd0
                                       : !dut.d_event_q && dut.d_column_q <= 3'd2 &&
                                         count[dut.d_place_q] == dut.d_column_q + 3'd2);
      end
      if (dut.d_event_q) begin
        l_counted: assert (dut.d_full_q ? dut.d_push_q && (dut.d_count_q == 3'd3 || dut.d_count_q == 3'd5)
                                        : !dut.d_push_q && dut.d_count_q != 3'd0 && dut.d_count_q <= 3'd4);
        l_anew: assert (count[dut.d_place_q] <= 3'd1);
      end
      if (dut.e_event_q) begin
        l_counted_e: assert (dut.e_full_q ? dut.e_push_q && dut.e_count_q == dut.e_column_q + 3'd2 &&
                                            (dut.e_count_q == 3'd3 || dut.e_count_q == 3'd5)
                                          : !dut.e_push_q && dut.e_count_q != 3'd0 && dut.e_count_q <= 3'd4);
        if (dut.e_full_q) begin
          l_full_e: assert (count[dut.e_place_q] <= 3'd1 &&
                            !((dut.d_push_q || dut.d_event_q) && dut.d_place_q == dut.e_place_q));
        end
        l_sends: assert (dut.e_sends_q || failed);
      end
      if (dut.e_sends_q) begin
        l_at: assert (dut.e_event_q && 4'(dut.e_at_q >> 3) < 4'(taken) && dut.e_at_q[2:1] == dut.writer_q);
      end
      if (dut.d_event_q) begin
        l_lists: assert (!(dut.b_valid_q && dut.c_event) || dut.c_list != dut.d_list_q);
        if (!dut.hold_q && !dut.failed_q) begin
          l_pointer_is: assert (dut.pointer == value[dut.d_list_q] &&
                                (!Large || (held && tag_held == line)));
        end
      end
      if (dut.e_push_q && !(dut.e_event_q && dut.e_full_q)) begin
        l_column_e: assert (!dut.e_event_q && dut.e_column_q <= 3'd2);
        l_recent: assert (dut.d_event_q && dut.d_place_q == dut.e_place_q
                          ? dut.d_count_q == dut.e_column_q + 3'd2 + 3'(dut.d_full_q)
                          : count[dut.e_place_q] == dut.e_column_q + 3'd2 +
                            3'(dut.d_push_q && dut.d_place_q == dut.e_place_q));
        l_entry: assert (
            (dut.d_event_q && dut.d_place_q == dut.e_place_q && dut.e_column_q + 3'd1 < dut.d_count_q &&
             !(dut.d_full_q && dut.d_column_q == dut.e_column_q)) ||
            (dut.e_column_q + 3'd1 < count[dut.e_place_q] &&
             !(dut.d_push_q && dut.d_place_q == dut.e_place_q && dut.d_column_q == dut.e_column_q)));
      end

      c_short: cover (out_list && out_data[14:11] == 4'd5 && picked_q);
      c_part: cover (dut.d_event_q && count[dut.d_place_q] == 3'd1 && list[dut.d_place_q] == dut.d_list_q);
      c_written: cover (done && picked_q && !failed && taken == 3'd2);
      c_moved: cover (!Large || (!failed && spilled_q && fetched_q));
      c_failed: cover (done && failed && delivered_q == 2'd1);
    end
  end

  for (genvar p = 0; p < 4; p++) begin : gen_open
    always_comb begin
      if (rst_n) begin
        if (state == CLEAR) begin
          l_clear: assert (dut.step_q <= 3'(p >> 1) || count[p] == 3'd0);
          l_clear_pointer: assert (dut.step_q <= 3'(p) || kept[p] == 4'd0);
        end else begin
          l_count: assert (count[p] <= 3'd4);
          l_list: assert (count[p] == 3'd0 || list[p][0] == 1'(p >> 1));
          l_open: assert (count[p] == 3'd0 || state == ENTRIES || pending(2'(p)) ||
                          (state == OPEN_LINES && dut.step_q == 3'd0));
          l_gone: assert (!dut.d_event_q || count[p] == 3'd0 || list[p] != dut.d_list_q ||
                          (dut.d_place_q == 2'(p) && count[p] == 3'd1 && !dut.d_full_q &&
                           dut.i_rows.storage_q[p/2][12] != 1'(p)));
          if (state != IDLE) begin
            l_used: assert (due_q[p][3:2] <= 2'd2);
            l_inside: assert (due_q[p] == 4'd0 || (due_q[p][3:2] != 2'd0 && 3'(due_q[p][1:0]) < taken));
          end
          if (state == IDLE || (!Large && (state == LAST || (state == POINTERS && dut.step_q > 3'(p))) &&
                                !(dut.walk_q && dut.walk_list_q == 2'(p)))) begin
            l_zero: assert (kept[p] == 4'd0);
          end else begin
            l_value: assert (value[p] == due_q[p]);
          end
          if (!failed && (state == LAST || (state == POINTERS && (dut.step_q >> 1) > 3'(p / 2)))) begin
            l_settled: assert (table_q[p] == due_q[p] ||
                (dut.walk_q && dut.walk_list_q == {1'(p / 2), 1'b1}) ||
                (dut.e_walk_q && e_list_q == {1'(p / 2), 1'b1}) ||
                (out_pointers && out_line == 1'(p / 2)));
          end
          if (state == ENTRIES || state == OPEN_LINES || state == DRAIN) begin
            l_unwritten: assert (written_q == 2'd0);
          end
          // A line that is still to be written.
          if ((state == POINTERS && (dut.step_q >> 1) <= 3'(p / 2)) ||
              (dut.walk_q && dut.walk_list_q[1] == 1'(p / 2)) ||
              (dut.e_walk_q && e_list_q[1] == 1'(p / 2)) || (out_pointers && out_line == 1'(p / 2))) begin
            l_once_more: assert (!written_q[p / 2]);
          end
        end
      end
    end
  end

  for (genvar w = 0; w < 2; w++) begin : gen_newest
    always_comb begin
      if (rst_n) begin
        l_newest_r: assert (!dut.r_valid_q || dut.r_newest[w] == newest[{dut.r_set_q, 1'(w)}]);
        l_newest: assert (!dut.b_valid_q || dut.b_newest_q[w] == newest[{dut.b_set_q, 1'(w)}]);
        l_hit: assert (!dut.b_valid_q || dut.b_flush_q || count[{dut.b_set_q, 1'(w)}] == 3'd0 ||
                       dut.b_lists_q[w] == (list[{dut.b_set_q, 1'(w)}] == dut.b_list_q));
      end
    end
  end

  for (genvar s = 0; s < 2; s++) begin : gen_unique
    always_comb begin
      if (rst_n && state != CLEAR) begin
        l_unique: assert (count[2*s] == 3'd0 || count[2*s+1] == 3'd0 || list[2*s] != list[2*s+1]);
      end
    end
  end

endmodule
