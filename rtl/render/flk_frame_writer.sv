// Frame writer: finished pixels of Cores cores into lines of a frame buffer in memory (docs/reference/frame_writer.md).
//
// Sub-tile s of a tile (column s % 2, row s / 2) is of core s mod Cores, which sends the pixels of its sub-tiles of one tile after the other. Groups
// of its pixels go on by themselves: the four mini-tiles, or with Lanes each lane's pixels (flk_lane_pkg). All pixels of a group come, in any order, before any
// of the next tile. All groups have the same order of tiles, which come in pairs: an even column and the one right of it. A pair of
// tiles, 32 x 16 pixels, is written when all its pixels are there, row by row from the top: 96 bytes in RGB8, 256 in RGBA16F, whole
// bursts of 32 bytes. Pixel formats: golden/frame_buffer.py.
// Pairs of tiles are held, and no pixel waits: who gives a core its tiles keeps at most so many pairs begun there that were not
// freed (freed_o, high for a cycle: the oldest is on its way out). A group that is ahead would else stop those behind.
//
// Frame: start_i while idle_o; rgba_i, background_i, base_i (in beats of 64 bytes), stride_i (of a row of pixels, in 32 bytes) and
// pairs_i (of the frame, at least 1) stay until done_o, high for the cycle after the last line has left. clear_i aborts: as after
// reset in the next cycle, a line that is offered may be withdrawn.
// stop_i (a level): no further pair leaves; stopped_o: nor is one on its way out. left_o: pairs of the frame that have not left.
// Lines: a beat of memory, out_strobe_o a bit for each 16 bytes; the others hold anything. Throughput: a pixel a cycle and core in, always;
// four pixels a cycle out, 128 cycles a pair and 4 between pairs; done_o 141 cycles after the last pixel.
// out_ready_i goes to register enables and the memories' read enables.
module flk_frame_writer
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Pairs      = 4,   // of tiles that are held: 2, 4 or 8
  parameter int unsigned BeatBits   = 34,  // addresses in 64 bytes
  parameter int unsigned StrideBits = 12,
  parameter int unsigned Lanes      = 0,   // of all cores, 4 to 32 each; 0: groups are mini-tiles
  parameter int unsigned Cores      = CORES  // 1, 2 or 4; 4 where groups are mini-tiles
) (
  input  logic                    clk_i,
  input  logic                    rst_ni,
  input  logic                    clear_i,
  // Frame
  input  logic                    start_i,
  output logic                    idle_o,
  input  logic                    rgba_i,
  input  logic [2:0][7:0]         background_i,  // red lowest
  input  logic [BeatBits-1:0]     base_i,
  input  logic [StrideBits-1:0]   stride_i,
  input  logic [15:0]             pairs_i,
  output logic                    done_o,
  output logic                    freed_o,
  input  logic                    stop_i,
  output logic                    stopped_o,
  output logic [15:0]             left_o,
  // Pixels
  input  logic        [Cores-1:0] in_valid_i,
  input  core_pixel_t [Cores-1:0] in_data_i,
  // Lines
  output logic                    out_valid_o,
  input  logic                    out_ready_i,
  output logic [BeatBits-1:0]     out_beat_o,
  output logic [3:0]              out_strobe_o,
  output logic [511:0]            out_data_o
);

  if (Pairs != 2 && Pairs != 4 && Pairs != 8) begin : gen_check_pairs
    $error("flk_frame_writer: Pairs must be 2, 4 or 8");
  end
  if (Cores != 1 && Cores != 2 && Cores != 4) begin : gen_check_cores
    $error("flk_frame_writer: Cores must be 1, 2 or 4");
  end
  if (Lanes != 4 * Cores && Lanes != 8 * Cores && Lanes != 16 * Cores && Lanes != 32 * Cores &&
      (Lanes != 0 || Cores != CORES)) begin : gen_check_lanes
    $error("flk_frame_writer: Lanes must be 4, 8, 16 or 32 times Cores, or 0 with four cores");
  end

  localparam int unsigned PairBits = SUBTILE_COORD_BITS - 2;  // of a pair's column
  localparam int unsigned TileBits = SUBTILE_COORD_BITS - 1;  // of a tile's row
  localparam int unsigned HalfBits = BeatBits + 1;  // addresses in 32 bytes
  localparam int unsigned LowBits = HalfBits / 2;  // they are added up in two halves
  localparam int unsigned HighBits = HalfBits - LowBits;

  // ---- pixels come ----------------------------------------------------------------------------------

  localparam int unsigned IndexBits = $clog2(Pairs);
  localparam int unsigned FullBits = $clog2(Pairs + 1);
  localparam int unsigned Share = CORES / Cores;  // sub-tiles of a core
  localparam int unsigned PlaceBits = $clog2(Share * Pairs) + 4;
  localparam int unsigned Groups = (Lanes == 0) ? CHANNELS : Lanes / Cores;
  localparam int unsigned GroupBits = $clog2(Groups);
  localparam int unsigned CountBits = $clog2(2 * Share * SUBTILE * SUBTILE / Groups);

  logic [Cores-1:0][Groups-1:0]     complete;  // by core and group: a whole pair is there
  logic [IndexBits-1:0]             from_q;    // buffer that leaves
  logic [IndexBits-1:0]             first_into;
  logic                             freed, running_q;
  logic [Pairs-1:0][PairBits-1:0]   columns_q;
  logic [Pairs-1:0][TileBits-1:0]   rows_q;

  // Reads: of each core 8 columns of the one of its sub-tiles that the group is of; four of one core are used.
  logic                             en, read;
  logic [3:0]                       line_q;   // row of pixels
  logic [2:0]                       group_q;  // four pixels of it
  logic [1:0]                       which_from;
  logic [PlaceBits-1:0]             from;
  pixel_t [Cores-1:0][7:0]          pixel;

  assign which_from = {line_q[3], group_q[1]};
  assign from       = PlaceBits'({which_from >> $clog2(Cores), from_q, group_q[2], line_q[2:0]});

  for (genvar k = 0; k < Cores; k++) begin : gen_core
    logic [Groups-1:0][CountBits-1:0] count_q;  // pixels of a group in the pair that comes
    logic [Groups-1:0][IndexBits-1:0] into_q;   // buffer that it goes to
    logic [Groups-1:0][FullBits-1:0]  full_q;   // pairs that are there
    logic [2:0]                       row, column;
    logic [GroupBits-1:0]             group;
    logic [1:0]                       which;  // sub-tile of the tile
    logic [PlaceBits-1:0]             place;

    assign row    = {in_data_i[k].minitile[1], in_data_i[k].index[3:2]};
    assign column = {in_data_i[k].minitile[0], in_data_i[k].index[1:0]};
    assign group  = (Lanes == 0) ? GroupBits'(in_data_i[k].minitile)
                                 : GroupBits'(flk_lane_pkg::lane_of(Groups, row, column));
    assign which  = {in_data_i[k].subtile.row[0], in_data_i[k].subtile.col[0]};
    // Which of the core's sub-tiles, buffer, tile of the pair, row.
    assign place  = PlaceBits'({which >> $clog2(Cores), into_q[group],
                                in_data_i[k].subtile.col[1], row});

    for (genvar x = 0; x < 8; x++) begin : gen_column
      flk_sram #(
        .Width($bits(pixel_t)),
        .Depth(16 * Pairs * Share)
      ) i_pixels (
        .clk_i,
        .wr_en_i  (in_valid_i[k] && column == 3'(x)),
        .wr_addr_i(place),
        .wr_data_i(in_data_i[k].pixel),
        .rd_en_i  (en && read),
        .rd_addr_i(from),
        .rd_data_o(pixel[k][x])
      );
    end

    for (genvar i = 0; i < Groups; i++) begin : gen_group
      logic taken, last;

      assign taken          = in_valid_i[k] && group == GroupBits'(i);
      assign last           = taken && (&count_q[i]);
      assign complete[k][i] = full_q[i] != '0;

      always_ff @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) begin
          count_q[i] <= '0;
          into_q[i]  <= '0;
          full_q[i]  <= '0;
        end else if (clear_i || start_i) begin
          count_q[i] <= '0;
          into_q[i]  <= '0;
          full_q[i]  <= '0;
        end else begin
          count_q[i] <= count_q[i] + CountBits'(taken);
          into_q[i]  <= into_q[i] + IndexBits'(last);
          full_q[i]  <= full_q[i] + FullBits'(last) - FullBits'(freed);
        end
      end

`ifndef SYNTHESIS
      assert property (@(posedge clk_i) disable iff (!rst_ni)
          taken |-> running_q && 32'(full_q[i]) < Pairs)
      else $error("flk_frame_writer: a pixel of a pair that has no place");
      logic first_q;  // the tile of the pair that came first
      always_ff @(posedge clk_i) begin
        if (taken && !count_q[i][CountBits-1]) begin
          first_q <= in_data_i[k].subtile.col[1];
        end
      end
      assert property (@(posedge clk_i) disable iff (!rst_ni)
          taken && count_q[i] != '0 |->
          in_data_i[k].subtile.col[1] == (first_q ^ count_q[i][CountBits-1]))
      else $error("flk_frame_writer: tiles do not come in pairs");
`endif
    end

    if (k == 0) begin : gen_first
      assign first_into = into_q[group];
    end

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        in_valid_i[k] |->
        32'(which) % Cores == k)
    else $error("flk_frame_writer: a sub-tile from another core");
`endif
  end

  always_ff @(posedge clk_i) begin
    if (in_valid_i[0]) begin
      columns_q[first_into] <= in_data_i[0].subtile.col[SUBTILE_COORD_BITS-1:2];
      rows_q[first_into]    <= in_data_i[0].subtile.row[SUBTILE_COORD_BITS-1:1];
    end
  end

  // ---- a pair leaves --------------------------------------------------------------------------------

  typedef enum logic [2:0] {WAIT, ROWS, LOW, HIGH, READ} state_e;

  state_e                             state_q;
  logic [15:0]                        left_q;  // pairs of the frame
  logic [PairBits-1:0]                column_q;
  logic [TileBits-1:0]                row_q;
  logic [StrideBits-1:0]              stride_q;
  logic [TileBits+StrideBits-1:0]     down_q;
  logic [PairBits+3:0]                across_q;
  logic [HalfBits-1:0]                half_q, next_q;  // where the row begins, and the next one
  logic [HalfBits-1:0]                rows;
  logic [1:0]                         carry_q;
  logic                               last_group, flow, drained;

  assign read       = state_q == READ;
  assign last_group = read && (&group_q);
  assign freed      = en && last_group && (&line_q);
  assign freed_o    = freed;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= WAIT;
      left_q  <= '0;
      from_q  <= '0;
      line_q  <= '0;
      group_q <= '0;
    end else if (clear_i || start_i) begin
      state_q <= WAIT;
      left_q  <= clear_i ? '0 : pairs_i;
      from_q  <= '0;
      line_q  <= '0;
      group_q <= '0;
    end else if (en) begin
      unique case (state_q)
        WAIT: begin
          if ((&complete) && !stop_i) begin
            state_q <= ROWS;
          end
        end
        ROWS: state_q <= LOW;
        LOW:  state_q <= HIGH;
        HIGH: state_q <= READ;
        default: begin
          if (freed) begin
            state_q <= WAIT;
            left_q  <= left_q - 1'b1;
            from_q  <= from_q + 1'b1;
          end
        end
      endcase
      if (read) begin
        group_q <= group_q + 1'b1;
        line_q  <= line_q + 4'(last_group);
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (en) begin
      if (state_q == WAIT) begin
        row_q    <= rows_q[from_q];
        stride_q <= stride_i;
        column_q <= columns_q[from_q];
      end
      if (state_q == ROWS) begin
        down_q   <= (TileBits + StrideBits)'(row_q) * (TileBits + StrideBits)'(stride_q);
        across_q <= rgba_i ? {1'b0, column_q, 3'b0}
                           : (PairBits + 4)'(column_q) + (PairBits + 4)'({column_q, 1'b0});
      end
      if (state_q == LOW) begin
        {carry_q, half_q[LowBits-1:0]} <= (LowBits + 2)'({base_i[LowBits-2:0], 1'b0}) +
            (LowBits + 2)'(rows[LowBits-1:0]) + (LowBits + 2)'(across_q);
      end
      if (state_q == HIGH) begin
        half_q[HalfBits-1:LowBits] <= base_i[BeatBits-1:LowBits-1] + rows[HalfBits-1:LowBits] +
                                      HighBits'(carry_q);
      end
      if (read && group_q == 3'd1) begin
        {carry_q[0], next_q[LowBits-1:0]} <= {1'b0, half_q[LowBits-1:0]} + (LowBits + 1)'(stride_q);
      end
      if (read && group_q == 3'd2) begin
        next_q[HalfBits-1:LowBits] <= half_q[HalfBits-1:LowBits] + HighBits'(carry_q[0]);
      end
      if (last_group) begin
        half_q <= next_q;
      end
    end
  end

  assign rows = HalfBits'({down_q, 4'b0});

  // ---- four pixels become bytes -----------------------------------------------------------------

  localparam int unsigned STAGES = 5;  // memory, choice, pixels' three

  // half: where the row begins, then the burst that the group fills.
  typedef struct packed {
    logic [2:0]          group;
    logic                carry;
    logic [HalfBits-1:0] half;
  } mark_t;

  logic  [STAGES-1:0] valid_q;
  mark_t [STAGES-1:0] mark_q;
  logic  [2:0]        number;  // of the burst in its row
  logic  [1:0]        which_q;
  pixel_t [7:0]       chosen;
  pixel_t [3:0]       four_q;
  logic  [3:0][2:0][7:0]  rgb;
  logic  [3:0][3:0][15:0] rgba;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      valid_q <= '0;
    end else if (clear_i) begin
      valid_q <= '0;
    end else if (en) begin
      valid_q <= {valid_q[STAGES-2:0], read};
    end
  end

  always_ff @(posedge clk_i) begin
    if (en) begin
      which_q <= which_from;
      mark_q[0] <= '{group: group_q, carry: 1'b0, half: half_q};
      for (int unsigned s = 1; s < STAGES; s++) begin
        mark_q[s] <= mark_q[s-1];
      end
      {mark_q[2].carry, mark_q[2].half[LowBits-1:0]} <=
          {1'b0, mark_q[1].half[LowBits-1:0]} + (LowBits + 1)'(number);
      mark_q[3].half[HalfBits-1:LowBits] <=
          mark_q[2].half[HalfBits-1:LowBits] + HighBits'(mark_q[2].carry);
      four_q <= mark_q[0].group[0] ? chosen[7:4] : chosen[3:0];
    end
  end

  assign chosen = pixel[32'(which_q) % Cores];

  assign number = rgba_i ? mark_q[1].group
                         : {1'b0, &mark_q[1].group, mark_q[1].group == 3'd5};

  for (genvar i = 0; i < 4; i++) begin : gen_out
    flk_pixel_out i_out (
      .clk_i,
      .en_i        (en),
      .background_i,
      .pixel_i     (four_q[i]),
      .rgb8_o      (rgb[i]),
      .rgba_o      (rgba[i])
    );
  end

  // ---- bytes become bursts of 32 ----------------------------------------------------------------

  // RGB8: groups of 12 bytes; the third, the sixth and the last fill a burst, what is over goes into the next one.
  logic [2:0]          now_group;
  logic [HalfBits-1:0] now_half;
  logic                unused_carry;
  logic          now_valid, fills, burst_valid_q, burst_last_q;
  logic [4:0]    at;
  logic [351:0]  wide;
  logic [255:0]  held, held_q, burst_q;
  logic [HalfBits-1:0] burst_half_q;

  assign {now_group, unused_carry, now_half} = mark_q[STAGES-1];
  assign now_valid = valid_q[STAGES-1];

  always_comb begin
    unique case (now_group)
      3'd0: at = 5'd0;
      3'd1: at = 5'd12;
      3'd2: at = 5'd24;
      3'd3: at = 5'd4;
      3'd4: at = 5'd16;
      3'd5: at = 5'd28;
      3'd6: at = 5'd8;
      default: at = 5'd20;
    endcase
  end

  assign held = now_group == '0 ? '0 : held_q;
  assign wide = 352'(rgb) << {at, 3'b0} | 352'(held);

  assign fills = rgba_i || now_group == 3'd2 || now_group == 3'd5 || (&now_group);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      burst_valid_q <= 1'b0;
    end else if (clear_i) begin
      burst_valid_q <= 1'b0;
    end else if (en) begin
      burst_valid_q <= now_valid && fills;
    end
  end

  always_ff @(posedge clk_i) begin
    if (en) begin
      burst_q      <= rgba_i ? rgba : wide[255:0];
      burst_last_q <= &now_group;
      burst_half_q <= now_half;
      if (now_valid) begin
        held_q <= fills ? 256'(wide[351:256]) : wide[255:0];
      end
    end
  end

  // ---- bursts become lines ------------------------------------------------------------------------

  logic                low_valid_q, out_valid_q, send;
  logic [BeatBits-1:0] out_beat_q;
  logic [3:0]          out_strobe_q;
  logic [511:0]        out_data_q;

  assign send = burst_valid_q && (burst_half_q[0] || burst_last_q);
  assign en   = !out_valid_q || out_ready_i;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      low_valid_q <= 1'b0;
      out_valid_q <= 1'b0;
    end else if (clear_i) begin
      low_valid_q <= 1'b0;
      out_valid_q <= 1'b0;
    end else if (en) begin
      out_valid_q <= send;
      if (burst_valid_q) begin
        low_valid_q <= !send;
      end
    end
  end

  always_ff @(posedge clk_i) begin
    if (en && burst_valid_q) begin
      out_beat_q   <= burst_half_q[HalfBits-1:1];
      out_strobe_q <= {{2{burst_half_q[0]}}, {2{low_valid_q || !burst_half_q[0]}}};
      // The burst before it, which may be of the same line, is above.
      out_data_q   <= {burst_q, burst_half_q[0] ? out_data_q[511:256] : burst_q};
    end
  end

  assign out_valid_o  = out_valid_q;
  assign out_beat_o   = out_beat_q;
  assign out_strobe_o = out_strobe_q;
  assign out_data_o   = out_data_q;

  // ---- frame ----------------------------------------------------------------------------------------

  logic done_q;

  assign flow    = valid_q != '0 || burst_valid_q || out_valid_q;
  assign drained = running_q && left_q == '0 && !flow;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      running_q <= 1'b0;
      done_q    <= 1'b0;
    end else begin
      running_q <= !clear_i && (start_i || (running_q && !drained));
      done_q    <= !clear_i && drained;
    end
  end

  assign idle_o    = !running_q;
  assign done_o    = done_q;
  assign stopped_o = stop_i && state_q == WAIT && !flow;
  assign left_o    = left_q;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) start_i |-> idle_o)
  else $error("flk_frame_writer: start while a frame is under way");
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      start_i |-> pairs_i != '0)
  else $error("flk_frame_writer: a frame without tiles");
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=>
      out_valid_o && $stable(out_beat_o) && $stable(out_data_o) && $stable(out_strobe_o))
  else $error("flk_frame_writer: output changed before its transfer");
`endif

endmodule
