// Rows of the colour store: stored colours of survivors to the preprocessing lanes, in order with those that are computed (docs/reference/colour_store.md).
//
// A turn's survivors come in the order of the scene, with those whose colours are stored; a row that holds one of them is requested once, when it
// is not the row requested last. When it comes, each lane gets its entries. Of what a lane gets in in_* (parts of computed colours) and from rows,
// it is given each survivor's, in the order of the survivors; a stored colour is one part, first and last, with its codes in dc.
// turn_ready_o does not depend on turn_valid_i. A lane holds Waiting survivors that have no colour yet; who sends turns sees to it.
// Throughput: a turn every two cycles, a colour a cycle and lane. Latency: the memory's and 7.
// Combinational: out_ready_i to in_ready_o, in_* to out_*.
module flk_colour_rows
  import flk_preproc_pkg::*;
#(
  parameter int unsigned Lanes   = LANES,  // 1, 2 or 4
  parameter int unsigned Waiting = 128,
  parameter int unsigned Items   = 64      // turns whose rows are under way
) (
  input  logic                     clk_i,
  input  logic                     rst_ni,
  input  logic                     start_i,
  output logic                     idle_o,
  // Survivors
  input  logic                     turn_valid_i,
  output logic                     turn_ready_o,
  input  logic [Lanes-1:0]         turn_alive_i,
  input  logic [Lanes-1:0]         turn_stored_i,  // of the alive ones
  input  logic [5:0]               turn_group_i,
  input  logic [1:0]               turn_at_i,      // place in the group of the first lane's
  input  store_slot_t              turn_slot_i,    // of the cluster
  // Requests for rows, in order
  output logic                     request_valid_o,
  input  logic                     request_ready_i,
  output logic [BEAT_BITS-1:0]     request_beat_o,
  // Rows
  input  logic                     row_valid_i,
  output logic                     row_ready_o,
  input  store_entry_t [STORE_ROW-1:0] row_i,
  // Computed colours
  input  logic         [Lanes-1:0] in_valid_i,
  output logic         [Lanes-1:0] in_ready_o,
  input  colour_part_t [Lanes-1:0] in_data_i,
  // Colours
  output logic         [Lanes-1:0] out_valid_o,
  input  logic         [Lanes-1:0] out_ready_i,
  output colour_part_t [Lanes-1:0] out_data_o
);

  // ---- requests -------------------------------------------------------------------------------------

  typedef struct packed {
    logic             fresh;  // the first of its row
    logic [3:0]       place;  // of the first lane's in the row
    logic [Lanes-1:0] stored;
  } item_t;

  logic                 a_valid_q, a_move, known_q, same, item_room, requesting;
  logic [Lanes-1:0]     a_stored_q;
  logic [4:0]           row, a_row_q, row_q;  // the latter two: of the cluster's beats
  logic [3:0]           a_place_q;
  store_slot_t          a_cluster_q, cluster_q;

  assign row             = store_row(turn_group_i);
  assign turn_ready_o    = !a_valid_q;
  assign same            = known_q && row_q == a_row_q && cluster_q == a_cluster_q;
  assign requesting      = a_valid_q && !same && item_room;
  assign a_move          = a_valid_q && item_room && (same || request_ready_i);
  assign request_valid_o = requesting;
  assign request_beat_o  = {a_cluster_q, a_row_q};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      a_valid_q <= 1'b0;
      known_q   <= 1'b0;
    end else begin
      a_valid_q <= a_valid_q ? !a_move : turn_valid_i && turn_stored_i != '0;
      known_q   <= !start_i && (known_q || a_move);
    end
  end

  always_ff @(posedge clk_i) begin
    if (turn_ready_o) begin  // turn_stored_i comes late
      a_stored_q  <= turn_stored_i;
      a_row_q     <= row + 1'b1;
      a_place_q   <= 4'({turn_group_i - 6'(6'(row) * 6'd3), 2'b0}) | 4'(turn_at_i);
      a_cluster_q <= turn_slot_i;
    end
    if (a_move) begin
      row_q     <= a_row_q;
      cluster_q <= a_cluster_q;
    end
  end

  // ---- entries --------------------------------------------------------------------------------------

  logic                        item_valid, item_move, items_empty, loaded_q, load;
  item_t                       item;
  logic [Lanes-1:0]            entry_room;
  store_entry_t [STORE_ROW-1:0] entries_q;

  flk_sram_fifo #(
    .Width($bits(item_t)),
    .Depth(Items)
  ) i_items (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (a_move),
    .in_ready_o (item_room),
    .in_data_i  ({!same, a_place_q, a_stored_q}),
    .out_valid_o(item_valid),
    .out_ready_i(item_move),
    .out_data_o (item),
    .empty_o    (items_empty)
  );

  assign load        = item_valid && item.fresh && !loaded_q && row_valid_i;
  assign row_ready_o = load;
  assign item_move   = item_valid && (!item.fresh || loaded_q) &&
                       (&(entry_room | ~item.stored));

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      loaded_q <= 1'b0;
    end else begin
      loaded_q <= load || (loaded_q && !item_move);
    end
  end

  always_ff @(posedge clk_i) begin
    if (load) begin
      entries_q <= row_i;
    end
  end

  // ---- lanes ----------------------------------------------------------------------------------------

  logic [Lanes-1:0] order_empty, entry_empty, parts_left;

  for (genvar k = 0; k < Lanes; k++) begin : gen_lanes
    logic         order_room, order_valid, order_stored, order_take, entry_valid;
    logic         inside_q;  // of a computed colour parts are to come
    logic         stored, computed, move;
    logic         unused_full;
    logic [1:0]   unused_usage;
    store_entry_t entry_in, entry;
    colour_part_t part;

    flk_sram_fifo #(
      .Width(1),
      .Depth(Waiting)
    ) i_order (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (turn_valid_i && turn_ready_o && turn_alive_i[k]),
      .in_ready_o (order_room),
      .in_data_i  (turn_stored_i[k]),
      .out_valid_o(order_valid),
      .out_ready_i(order_take),
      .out_data_o (order_stored),
      .empty_o    (order_empty[k])
    );

    // Lanes follow each other in a row: this one's are at every Lanes-th place.
    always_comb begin
      entry_in = entries_q[k];
      for (int unsigned p = k; p < STORE_ROW; p += Lanes) begin
        if (item.place == 4'(p - k)) begin
          entry_in = entries_q[p];
        end
      end
    end

    flk_fifo #(
      .Width($bits(store_entry_t)),
      .Depth(2)
    ) i_entries (
      .clk_i,
      .rst_ni,
      .clear_i    (1'b0),
      .in_valid_i (item_move && item.stored[k]),
      .in_ready_o (entry_room[k]),
      .in_data_i  (entry_in),
      .out_valid_o(entry_valid),
      .out_ready_i(out_ready_i[k] && stored),
      .out_data_o (entry),
      .usage_o    (unused_usage),
      .full_o     (unused_full),
      .empty_o    (entry_empty[k])
    );

    always_comb begin
      part         = '0;
      part.first   = 1'b1;
      part.last    = 1'b1;
      part.stored  = 1'b1;
      part.opacity = 16'(entry.opacity);
      for (int unsigned c = 0; c < 3; c++) begin
        part.dc[c] = 16'(entry.colour[c]);
      end
    end

    // A survivor leaves its order with its first part, as it leaves the lane's own queue: this one never holds more.
    assign stored         = order_valid && order_stored && !inside_q;
    assign computed       = inside_q || (order_valid && !order_stored);
    assign out_valid_o[k] = stored ? entry_valid : computed && in_valid_i[k];
    assign out_data_o[k]  = stored ? part : in_data_i[k];
    assign in_ready_o[k]  = out_ready_i[k] && computed;
    assign move           = out_valid_o[k] && out_ready_i[k];
    assign order_take     = move && !inside_q;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        inside_q <= 1'b0;
      end else if (move) begin
        inside_q <= !out_data_o[k].last;
      end
    end

    assign parts_left[k] = inside_q;

    logic unused_room;
    assign unused_room = order_room;

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        turn_valid_i && turn_ready_o && turn_alive_i[k] |-> order_room)
    else $error("flk_colour_rows: a survivor more than a lane holds");
`endif
  end

  assign idle_o = !a_valid_q && items_empty && !loaded_q && (&order_empty) && (&entry_empty) &&
                  parts_left == '0;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      turn_valid_i |-> (turn_stored_i & ~turn_alive_i) == '0)
  else $error("flk_colour_rows: a stored colour of no survivor");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      request_valid_o && !request_ready_i |=> request_valid_o && $stable(request_beat_o))
  else $error("flk_colour_rows: a request that is withdrawn");
`endif

endmodule
