// Preprocessing core: a lane of the front end (docs/reference/front_end.md).
//
// Front: a Gaussian as it lies in memory goes through decoding and projection. All lanes move
// together: front_en_i, front_phase_i and the cluster's numbers come from outside, low_i and step_i
// geometry_decode_latency(Interval) enabled cycles after the words. alive_o stands when the outputs of
// flk_projection (of records in conic form flk_projection_conic) do; push_i then takes the survivor
// with its seq, record number and place; ready_o: there is room for it.
// Back: with its colours (parts, in order) a survivor becomes a record in the form that Form says, and
// entries of tile lists. record_o: without the zeros above that fill a record of 32 bytes.
// Spherical harmonics of those that wait are ready when their colours come. progress_o: no entry of
// this lane with a seq before it is to come; issued_i is the next seq that will be given to any lane.
// Counters are pulses: a survivor whose mean was saturated, whose colour was clipped, whose opacity
// code is 0, that has no entry. setup_i stays while idle_o is low.
// Throughput: a Gaussian every Interval cycles in front, behind every Interval (SH degree 3: four) cycles,
// a band of tiles every Interval / 2, an entry a cycle. No combinational path from ready to ready but
// within the streams' own stages.
module flk_preprocessing_core
  import flk_param_pkg::*;
  import flk_front_pkg::*;
  import flk_preproc_pkg::*;
#(
  parameter  int unsigned Form       = FORM_FACTORED,
  parameter  int unsigned Interval   = 2,    // cycles from a Gaussian to the next: 2 or 4
  parameter  int unsigned Waiting    = 128,  // survivors that wait for colours
  parameter  int unsigned Unfinished = 256,  // survivors that are not listed yet
  localparam int unsigned PhaseBits  = $clog2(Interval),
  localparam int unsigned HeaderBits = $clog2(COLOUR_CLUSTERS),
  localparam int unsigned RecordBits = (Form == FORM_FACTORED) ? FACTORED_RECORD_BITS
                                                               : CONIC_RECORD_BITS
) (
  input  logic                        clk_i,
  input  logic                        rst_ni,
  input  lane_setup_t                 setup_i,
  output logic                        idle_o,       // nothing behind the front
  // Front, in step with the other lanes
  input  logic                        front_en_i,
  input  logic [PhaseBits-1:0]        front_phase_i,
  input  logic [4:0][31:0]            words_i,
  input  logic [2:0][26:0]            scale_low_i,
  input  logic [2:0][16:0]            scale_step_i,
  input  position_t [2:0]             low_i,
  input  position_t [2:0]             step_i,
  output logic                        near_o,
  output logic                        outside_o,
  input  logic                        push_i,
  output logic                        ready_o,
  input  logic [SEQ_BITS-1:0]         seq_i,
  input  logic [NUMBER_BITS-1:0]      number_i,
  input  place_t                      place_i,
  // Headers of clusters
  input  logic                        header_valid_i,
  input  logic [HeaderBits-1:0]       header_index_i,
  input  colour_header_t              header_i,
  // Colours
  input  logic                        part_valid_i,
  output logic                        part_ready_o,
  input  colour_part_t                part_i,
  // Records
  output logic                        record_valid_o,
  input  logic                        record_ready_i,
  output place_t                      record_place_o,
  output logic [7:0]                  record_opacity_o,  // code in the image, of chunks
  output logic [RecordBits-1:0]       record_o,
  // Entries
  output logic                        entry_valid_o,
  input  logic                        entry_ready_i,
  output entry_t                      entry_o,
  input  logic [SEQ_BITS-1:0]         issued_i,
  output logic [SEQ_BITS-1:0]         progress_o,
  // Counters
  output logic                        saturated_o,
  output logic                        clipped_o,
  output logic                        faint_o,
  output logic                        unlisted_o
);

  if (Interval != 2 && Interval != 4) begin : gen_check_interval
    $error("flk_preprocessing_core: Interval must be 2 or 4");
  end
  if (Form != FORM_FACTORED && Form != FORM_CONIC) begin : gen_check_form
    $error("flk_preprocessing_core: Form must be FORM_CONIC or FORM_FACTORED");
  end

  // ---- front ----------------------------------------------------------------------------------------

  // Of the shape in a record beside l2, which lists take too: l0, l1, or a / 2, b, c / 2.
  localparam int unsigned Shapes = (Form == FORM_FACTORED) ? 2 : 3;

  // A survivor that waits for its colours; its direction goes ahead of the rest.
  typedef struct packed {
    logic [SEQ_BITS-1:0]    seq;
    logic [NUMBER_BITS-1:0] number;
    place_t                 place;
    logic [23:0]            key;
    logic                   spiky;
    logic signed [30:0]     x;
    logic signed [30:0]     y;
    shape_t                 sx;
    shape_t                 sy;
    shape_t [Shapes-1:0]    shape;
    shape_t                 l2;
    shape_t                 i0;
    shape_t                 kappa;
    shape_t                 lean;
    shape_t                 scale;
  } survivor_t;

  position_t [2:0] q;
  shape_t [2:0]    s;
  shape_t [3:0]    quat;
  survivor_t       survivor_in, survivor;
  colour_t [2:0]   direction_in, direction;
  logic            far;  // the mean was saturated
  logic            chunked_q;     // registers near what they reach
  logic            projected_q;   // the projection's, behind the other

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      chunked_q   <= 1'b0;
      projected_q <= 1'b0;
    end else begin
      chunked_q   <= setup_i.chunked;
      projected_q <= chunked_q;
    end
  end

  flk_geometry_decode #(
    .Interval(Interval)
  ) i_decode (
    .clk_i,
    .en_i          (front_en_i),
    .phase_i       (front_phase_i),
    .chunked_i     (chunked_q),
    .word_0_i      (words_i[0]),
    .word_1_i      (words_i[1]),
    .word_2_i      (words_i[2]),
    .word_3_i      (words_i[3]),
    .word_4_i      (words_i[4]),
    .scale_low_0_i ($signed(scale_low_i[0])),
    .scale_low_1_i ($signed(scale_low_i[1])),
    .scale_low_2_i ($signed(scale_low_i[2])),
    .scale_step_0_i(scale_step_i[0]),
    .scale_step_1_i(scale_step_i[1]),
    .scale_step_2_i(scale_step_i[2]),
    .q_0_o         (q[0]),
    .q_1_o         (q[1]),
    .q_2_o         (q[2]),
    .s_0_o         (s[0]),
    .s_1_o         (s[1]),
    .s_2_o         (s[2]),
    .qw_o          (quat[0]),
    .qx_o          (quat[1]),
    .qy_o          (quat[2]),
    .qz_o          (quat[3])
  );

  if (Form == FORM_FACTORED) begin : gen_projection
    flk_projection #(
      .Interval(Interval)
    ) i_projection (
      .clk_i,
      .rst_ni,
      .en_i         (front_en_i),
      .phase_i      (front_phase_i),
      .low_0_i      (low_i[0]),
      .low_1_i      (low_i[1]),
      .low_2_i      (low_i[2]),
      .step_0_i     (step_i[0]),
      .step_1_i     (step_i[1]),
      .step_2_i     (step_i[2]),
      .q_0_i        (q[0]),
      .q_1_i        (q[1]),
      .q_2_i        (q[2]),
      .s_0_i        (s[0]),
      .s_1_i        (s[1]),
      .s_2_i        (s[2]),
      .qw_i         (quat[0]),
      .qx_i         (quat[1]),
      .qy_i         (quat[2]),
      .qz_i         (quat[3]),
      .view_00_i    (setup_i.view[0][0]),
      .view_01_i    (setup_i.view[0][1]),
      .view_02_i    (setup_i.view[0][2]),
      .view_10_i    (setup_i.view[1][0]),
      .view_11_i    (setup_i.view[1][1]),
      .view_12_i    (setup_i.view[1][2]),
      .view_20_i    (setup_i.view[2][0]),
      .view_21_i    (setup_i.view[2][1]),
      .view_22_i    (setup_i.view[2][2]),
      .focal_0_i    (setup_i.focal[0]),
      .focal_1_i    (setup_i.focal[1]),
      .row_x_0_i    (setup_i.row_x[0]),
      .row_x_1_i    (setup_i.row_x[1]),
      .row_x_2_i    (setup_i.row_x[2]),
      .row_x_z_0_i  (setup_i.row_x_z[0]),
      .row_x_z_1_i  (setup_i.row_x_z[1]),
      .row_x_z_2_i  (setup_i.row_x_z[2]),
      .row_y_0_i    (setup_i.row_y[0]),
      .row_y_1_i    (setup_i.row_y[1]),
      .row_y_2_i    (setup_i.row_y[2]),
      .row_y_z_0_i  (setup_i.row_y_z[0]),
      .row_y_z_1_i  (setup_i.row_y_z[1]),
      .row_y_z_2_i  (setup_i.row_y_z[2]),
      .least_0_i    (setup_i.least[0]),
      .least_1_i    (setup_i.least[1]),
      .limit_0_i    (setup_i.limit[0]),
      .limit_1_i    (setup_i.limit[1]),
      .middle_0_i   ($signed(setup_i.middle[0])),
      .middle_1_i   ($signed(setup_i.middle[1])),
      .width_i      (setup_i.width),
      .height_i     (setup_i.height),
      .chunked_i    (projected_q),
      .antialiased_i(setup_i.antialiased),
      .by_distance_i(setup_i.by_distance),
      .near_o,
      .outside_o,
      .far_o        (far),
      .x_o          (survivor_in.x),
      .y_o          (survivor_in.y),
      .sx_o         (survivor_in.sx),
      .sy_o         (survivor_in.sy),
      .l0_o         (survivor_in.shape[0]),
      .l1_o         (survivor_in.shape[1]),
      .l2_o         (survivor_in.l2),
      .spiky_o      (survivor_in.spiky),
      .scale_o      (survivor_in.scale),
      .i0_o         (survivor_in.i0),
      .kappa_o      (survivor_in.kappa),
      .lean_o       (survivor_in.lean),
      .key_o        (survivor_in.key),
      .direction_0_o(direction_in[0]),
      .direction_1_o(direction_in[1]),
      .direction_2_o(direction_in[2])
    );
  end else begin : gen_projection_conic
    flk_projection_conic #(
      .Interval(Interval)
    ) i_projection (
      .clk_i,
      .rst_ni,
      .en_i         (front_en_i),
      .phase_i      (front_phase_i),
      .low_0_i      (low_i[0]),
      .low_1_i      (low_i[1]),
      .low_2_i      (low_i[2]),
      .step_0_i     (step_i[0]),
      .step_1_i     (step_i[1]),
      .step_2_i     (step_i[2]),
      .q_0_i        (q[0]),
      .q_1_i        (q[1]),
      .q_2_i        (q[2]),
      .s_0_i        (s[0]),
      .s_1_i        (s[1]),
      .s_2_i        (s[2]),
      .qw_i         (quat[0]),
      .qx_i         (quat[1]),
      .qy_i         (quat[2]),
      .qz_i         (quat[3]),
      .view_00_i    (setup_i.view[0][0]),
      .view_01_i    (setup_i.view[0][1]),
      .view_02_i    (setup_i.view[0][2]),
      .view_10_i    (setup_i.view[1][0]),
      .view_11_i    (setup_i.view[1][1]),
      .view_12_i    (setup_i.view[1][2]),
      .view_20_i    (setup_i.view[2][0]),
      .view_21_i    (setup_i.view[2][1]),
      .view_22_i    (setup_i.view[2][2]),
      .focal_0_i    (setup_i.focal[0]),
      .focal_1_i    (setup_i.focal[1]),
      .row_x_0_i    (setup_i.row_x[0]),
      .row_x_1_i    (setup_i.row_x[1]),
      .row_x_2_i    (setup_i.row_x[2]),
      .row_x_z_0_i  (setup_i.row_x_z[0]),
      .row_x_z_1_i  (setup_i.row_x_z[1]),
      .row_x_z_2_i  (setup_i.row_x_z[2]),
      .row_y_0_i    (setup_i.row_y[0]),
      .row_y_1_i    (setup_i.row_y[1]),
      .row_y_2_i    (setup_i.row_y[2]),
      .row_y_z_0_i  (setup_i.row_y_z[0]),
      .row_y_z_1_i  (setup_i.row_y_z[1]),
      .row_y_z_2_i  (setup_i.row_y_z[2]),
      .least_0_i    (setup_i.least[0]),
      .least_1_i    (setup_i.least[1]),
      .limit_0_i    (setup_i.limit[0]),
      .limit_1_i    (setup_i.limit[1]),
      .middle_0_i   ($signed(setup_i.middle[0])),
      .middle_1_i   ($signed(setup_i.middle[1])),
      .width_i      (setup_i.width),
      .height_i     (setup_i.height),
      .chunked_i    (projected_q),
      .antialiased_i(setup_i.antialiased),
      .by_distance_i(setup_i.by_distance),
      .near_o,
      .outside_o,
      .far_o        (far),
      .x_o          (survivor_in.x),
      .y_o          (survivor_in.y),
      .sx_o         (survivor_in.sx),
      .sy_o         (survivor_in.sy),
      .l2_o         (survivor_in.l2),
      .conic_0_o    (survivor_in.shape[0]),
      .conic_1_o    (survivor_in.shape[1]),
      .conic_2_o    (survivor_in.shape[2]),
      .spiky_o      (survivor_in.spiky),
      .scale_o      (survivor_in.scale),
      .i0_o         (survivor_in.i0),
      .kappa_o      (survivor_in.kappa),
      .lean_o       (survivor_in.lean),
      .key_o        (survivor_in.key),
      .direction_0_o(direction_in[0]),
      .direction_1_o(direction_in[1]),
      .direction_2_o(direction_in[2])
    );
  end

  assign survivor_in.seq    = seq_i;
  assign survivor_in.number = number_i;
  assign survivor_in.place  = place_i;
  assign saturated_o        = push_i && far;

  // ---- survivors that wait --------------------------------------------------------------------------

  logic            survivor_valid, survivor_ready, survivor_room, survivors_empty;
  logic            direction_valid, direction_ready, direction_room, directions_empty;
  logic            seq_room;

  assign ready_o = survivor_room && direction_room && seq_room;

  flk_sram_fifo #(
    .Width($bits(survivor_t)),
    .Depth(Waiting)
  ) i_survivors (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (push_i),
    .in_ready_o (survivor_room),
    .in_data_i  (survivor_in),
    .out_valid_o(survivor_valid),
    .out_ready_i(survivor_ready),
    .out_data_o (survivor),
    .empty_o    (survivors_empty)
  );

  flk_sram_fifo #(
    .Width($bits(colour_t) * 3),
    .Depth(Waiting)
  ) i_directions (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (push_i),
    .in_ready_o (direction_room),
    .in_data_i  (direction_in),
    .out_valid_o(direction_valid),
    .out_ready_i(direction_ready),
    .out_data_o (direction),
    .empty_o    (directions_empty)
  );

  // ---- spherical harmonics --------------------------------------------------------------------------

  localparam int unsigned BasisLatency = colour_basis_latency(Interval);

  logic                    basis_en, basis_take, basis_out, held_q, held_pop;
  logic [PhaseBits-1:0]    basis_phase_q;
  logic [BasisLatency-1:0] basis_valid_q;
  basis_t [15:1]           basis, basis_q;

  flk_colour_basis #(
    .Interval(Interval)
  ) i_basis (
    .clk_i,
    .en_i         (basis_en),
    .phase_i      (basis_phase_q),
    .direction_0_i(direction[0]),
    .direction_1_i(direction[1]),
    .direction_2_i(direction[2]),
    .basis_1_o    (basis[1]),
    .basis_2_o    (basis[2]),
    .basis_3_o    (basis[3]),
    .basis_4_o    (basis[4]),
    .basis_5_o    (basis[5]),
    .basis_6_o    (basis[6]),
    .basis_7_o    (basis[7]),
    .basis_8_o    (basis[8]),
    .basis_9_o    (basis[9]),
    .basis_10_o   (basis[10]),
    .basis_11_o   (basis[11]),
    .basis_12_o   (basis[12]),
    .basis_13_o   (basis[13]),
    .basis_14_o   (basis[14]),
    .basis_15_o   (basis[15])
  );

  assign basis_out       = basis_valid_q[BasisLatency-1];
  assign basis_en        = !basis_out || !held_q || held_pop;
  assign basis_take      = basis_en && basis_phase_q == '0 && direction_valid;
  assign direction_ready = basis_en && basis_phase_q == '0;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      basis_phase_q <= '0;
      basis_valid_q <= '0;
      held_q        <= 1'b0;
    end else begin
      if (basis_en) begin
        basis_phase_q <= basis_phase_q + 1'b1;
        basis_valid_q <= {basis_valid_q[BasisLatency-2:0], basis_take};
      end
      held_q <= (basis_out && basis_en) || (held_q && !held_pop);
    end
  end

  always_ff @(posedge clk_i) begin
    if (basis_out && basis_en) begin
      basis_q <= basis;
    end
  end

  // ---- a part of a colour ---------------------------------------------------------------------------

  logic           part_valid_q, part_move, part_go, side_room, record_room, bounds_room;
  colour_part_t   part_q;
  colour_header_t header;
  basis_t [3:0]   part_basis;
  colour_t [2:0]  part_step;
  logic           colour_en;

  assign part_ready_o = !part_valid_q || part_move;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      part_valid_q <= 1'b0;
    end else if (part_ready_o) begin
      part_valid_q <= part_valid_i;
    end
  end

  always_ff @(posedge clk_i) begin
    if (part_valid_i && part_ready_o) begin
      part_q <= part_i;
    end
  end

  flk_sram #(
    .Width($bits(colour_header_t)),
    .Depth(COLOUR_CLUSTERS)
  ) i_headers (
    .clk_i,
    .wr_en_i  (header_valid_i),
    .wr_addr_i(header_index_i),
    .wr_data_i(header_i),
    .rd_en_i  (part_valid_i && part_ready_o),
    .rd_addr_i(part_i.cluster[HeaderBits-1:0]),
    .rd_data_o(header)
  );

  logic unused_cluster;
  assign unused_cluster = ^part_q.cluster;

  // Its first part takes a survivor out of the queue, its last one the spherical harmonics.
  assign part_go        = held_q && (!part_q.first || (survivor_valid && side_room && record_room &&
                                                       bounds_room));
  assign part_move      = part_valid_q && part_go && colour_en;
  assign survivor_ready = part_move && part_q.first;
  assign held_pop       = part_move && part_q.last;

  // Of the degree that ends with the part.
  always_comb begin
    for (int unsigned i = 0; i < 4; i++) begin
      part_basis[i] = i < 3 || part_q.part != 2'd3 ? basis_q[4'(4 * 32'(part_q.part) + 1 + i)] : '0;
    end
    unique case (part_q.part)
      2'd0: part_step = header.sh_step[0];
      2'd1: part_step = header.sh_step[1];
      default: part_step = header.sh_step[2];
    endcase
  end

  // Stored colours go round their own parts' arithmetic.
  logic            codes_room, codes_valid, codes_take, codes_empty;
  logic [2:0][9:0] codes;

  flk_sram_fifo #(
    .Width(30),
    .Depth(16)
  ) i_stored (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (part_move && part_q.stored),
    .in_ready_o (codes_room),
    .in_data_i  ({part_q.dc[2][9:0], part_q.dc[1][9:0], part_q.dc[0][9:0]}),
    .out_valid_o(codes_valid),
    .out_ready_i(codes_take),
    .out_data_o (codes),
    .empty_o    (codes_empty)
  );

  logic unused_codes;
  assign unused_codes = ^{codes_empty, codes_room, codes_valid};

  group_first_t [2:0]  first;
  group_fourth_t [2:0] fourth;
  constant_t [2:0]     constant, constant_late;
  colour_t [2:0]       sum_step;

  flk_colour_group i_group (
    .clk_i,
    .en_i      (colour_en),
    .chunked_i (chunked_q),
    .basis_0_i (part_basis[0]),
    .basis_1_i (part_basis[1]),
    .basis_2_i (part_basis[2]),
    .basis_3_i (part_basis[3]),
    .raw_00_i  (part_q.raw[0][0]),
    .raw_01_i  (part_q.raw[0][1]),
    .raw_02_i  (part_q.raw[0][2]),
    .raw_10_i  (part_q.raw[1][0]),
    .raw_11_i  (part_q.raw[1][1]),
    .raw_12_i  (part_q.raw[1][2]),
    .raw_20_i  (part_q.raw[2][0]),
    .raw_21_i  (part_q.raw[2][1]),
    .raw_22_i  (part_q.raw[2][2]),
    .raw_30_i  (part_q.raw[3][0]),
    .raw_31_i  (part_q.raw[3][1]),
    .raw_32_i  (part_q.raw[3][2]),
    .zero_i    (header.sh_zero),
    .used_0_i  (part_q.used[0]),
    .used_1_i  (part_q.used[1]),
    .used_2_i  (part_q.used[2]),
    .used_3_i  (part_q.used[3]),
    .first_0_o (first[0]),
    .fourth_0_o(fourth[0]),
    .first_1_o (first[1]),
    .fourth_1_o(fourth[1]),
    .first_2_o (first[2]),
    .fourth_2_o(fourth[2])
  );

  flk_colour_constant i_constant (
    .clk_i,
    .en_i        (colour_en),
    .chunked_i   (chunked_q),
    .dc_0_i      (part_q.dc[0]),
    .dc_1_i      (part_q.dc[1]),
    .dc_2_i      (part_q.dc[2]),
    .low_0_i     (header.dc_low[0]),
    .low_1_i     (header.dc_low[1]),
    .low_2_i     (header.dc_low[2]),
    .step_0_i    (header.dc_step[0]),
    .step_1_i    (header.dc_step[1]),
    .step_2_i    (header.dc_step[2]),
    .constant_0_o(constant[0]),
    .constant_1_o(constant[1]),
    .constant_2_o(constant[2])
  );

  flk_delay #(
    .Width($bits(part_step)),
    .Depth(COLOUR_GROUP_LATENCY + 1)
  ) i_step (
    .clk_i,
    .en_i(colour_en),
    .d_i (part_step),
    .q_o (sum_step)
  );

  // ---- sums of the degrees --------------------------------------------------------------------------

  // Degree 1 ends with the third coefficient of part 0, degree 2 with part 1, degree 3 with part 3:
  // what comes before waits for it.
  typedef struct packed {
    logic       valid;
    logic       stored;
    logic       first;
    logic       last;
    logic [1:0] part;
  } tag_t;

  tag_t [COLOUR_GROUP_LATENCY-1:0] tag_q;
  tag_t                            tag;
  degree_sum_t [2:0]               sum_d, sum_q;  // of a degree that ends
  degree_sum_t [2:0]               held_d, held_sum_q;

  localparam int unsigned SumBits = $bits(degree_sum_t);

  assign tag = tag_q[COLOUR_GROUP_LATENCY-1];

  always_comb begin
    for (int unsigned c = 0; c < 3; c++) begin
      if (tag.part == 2'd0) begin
        sum_d[c]  = SumBits'($signed(first[c]));
        held_d[c] = SumBits'($signed(fourth[c]));
      end else begin
        held_d[c] = SumBits'($signed(first[c])) + SumBits'($signed(fourth[c]));
        sum_d[c]  = held_d[c] + held_sum_q[c];
      end
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      tag_q <= '0;
    end else if (colour_en) begin
      tag_q <= {tag_q[COLOUR_GROUP_LATENCY-2:0],
                part_valid_q && part_go, part_q.stored, part_q.first, part_q.last,
                part_q.part};
    end
  end

  always_ff @(posedge clk_i) begin
    if (colour_en && tag.valid) begin
      held_sum_q <= held_d;
      sum_q      <= sum_d;
    end
  end

  // ---- colour ---------------------------------------------------------------------------------------

  localparam int unsigned TermCycles = 1 + COLOUR_TERM_LATENCY;  // behind the group's sums
  localparam int unsigned TotalBits = $bits(term_t) + 3;        // the constant part and three terms
  // In a record: a code of 10 bits of which 9 are fraction, or FP16.
  localparam int unsigned ColourBits = (Form == FORM_FACTORED) ? 10 : 16;

  typedef struct packed {
    logic term;    // a degree has ended
    logic stored;
    logic first;
    logic last;
  } end_t;

  if (COLOUR_GROUP_LATENCY + TermCycles < COLOUR_CONSTANT_LATENCY + 2) begin : gen_check_latency
    $error("flk_preprocessing_core: the constant part is later than the first term");
  end

  end_t [TermCycles-1:0] end_q;
  end_t                  ended, ending;
  logic                  total_valid_q, rgb_valid_q;
  logic [2:0][ColourBits-1:0] rgb;
  logic [2:0]            clipped;
  logic                  rgb_valid, rgb_ready;

  flk_delay #(
    .Width($bits(constant)),
    .Depth(COLOUR_GROUP_LATENCY + TermCycles - 1 - COLOUR_CONSTANT_LATENCY)
  ) i_constant_late (
    .clk_i,
    .en_i(colour_en),
    .d_i (constant),
    .q_o (constant_late)
  );

  // What a colour begins with stands beside its first term.
  assign ended      = end_q[TermCycles-1];
  assign ending     = end_q[TermCycles-2];
  assign codes_take = colour_en && ending.term && ending.stored;

  logic unused_ends;
  assign unused_ends = ^{ended.stored, ending.first, ending.last};

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      end_q         <= '0;
      total_valid_q <= 1'b0;
      rgb_valid_q   <= 1'b0;
    end else if (colour_en) begin
      end_q         <= {end_q[TermCycles-2:0],
                        tag.valid && tag.part != 2'd2, tag.stored, tag.first, tag.last};
      total_valid_q <= ended.term && ended.last;
      rgb_valid_q   <= total_valid_q;
    end
  end

  for (genvar c = 0; c < 3; c++) begin : gen_channels
    term_t                       term;
    constant_t                   begin_q;  // constant part, or the stored colour
    logic signed [TotalBits-1:0] total_q;
    logic [ColourBits-1:0]       code_d, code_q;
    logic                        clipped_d, clipped_q;

    flk_colour_term i_term (
      .clk_i,
      .en_i     (colour_en),
      .chunked_i(chunked_q),
      .sum_i    ($signed(sum_q[c])),
      .step_i   (sum_step[c]),
      .term_o   (term)
    );

    if (Form == FORM_FACTORED) begin : gen_code
      localparam int unsigned Drop = TERM_FRACTION - 9;
      logic signed [TotalBits-1:0] rounded;

      assign rounded   = (total_q + TotalBits'(1 << (Drop - 1))) >>> Drop;
      assign clipped_d = rounded > TotalBits'(1023);

      always_comb begin
        if (rounded < 0) begin
          code_d = '0;
        end else begin
          code_d = rounded > TotalBits'(1023) ? '1 : rounded[9:0];
        end
      end
    end else begin : gen_fp16
      // A colour below 2^(TotalBits - 1 - TERM_FRACTION) = 512 has its FP16 number.
      logic [TotalBits-2:0] magnitude;

      assign magnitude = total_q[TotalBits-1] ? '0 : total_q[TotalBits-2:0];
      assign clipped_d = 1'b0;

      flk_fixed_to_fp #(
        .MagBits (TotalBits - 1),
        .FracBits(TERM_FRACTION),
        .ExpBits (5),
        .ManBits (10),
        .Fn      (1'b0)
      ) i_colour (
        .sign_i(1'b0),
        .mag_i (magnitude),
        .dst_o (code_d)
      );
    end

    always_ff @(posedge clk_i) begin
      if (colour_en && ended.term) begin
        total_q <= (ended.first ? TotalBits'($signed(begin_q)) : total_q)
                 + TotalBits'(term);
      end
      if (colour_en) begin
        begin_q   <= ending.stored ? constant_t'(codes[c]) <<< (TERM_FRACTION - 9)
                                   : constant_late[c];
        clipped_q <= clipped_d;
        code_q    <= code_d;
      end
    end

    assign rgb[c]     = code_q;
    assign clipped[c] = clipped_q;
  end

  // Opacity codes of a record come through the bounds' pipeline, which is longer: colours wait
  // for them here, not in their pipeline, which would stand.
  logic            rgb_room, colour_clipped;
  logic [2:0][ColourBits-1:0] colour;
  logic [3:0]      unused_usage_rgb;
  logic            unused_full_rgb, unused_empty_rgb;

  assign colour_en = !rgb_valid_q || rgb_room;

  flk_fifo #(
    .Width(1 + 3 * ColourBits),
    .Depth(8)
  ) i_rgb (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (rgb_valid_q),
    .in_ready_o (rgb_room),
    .in_data_i  ({|clipped, rgb}),
    .out_valid_o(rgb_valid),
    .out_ready_i(rgb_ready),
    .out_data_o ({colour_clipped, colour}),
    .usage_o    (unused_usage_rgb),
    .full_o     (unused_full_rgb),
    .empty_o    (unused_empty_rgb)
  );

  // ---- bounds ---------------------------------------------------------------------------------------

  typedef struct packed {
    logic signed [30:0] x;
    logic signed [30:0] y;
    shape_t             sx;
    shape_t             sy;
    shape_t             lean;
    shape_t             scale;
    logic [15:0]        opacity;
  } bounded_t;

  typedef struct packed {
    logic [SEQ_BITS-1:0]    seq;
    logic [NUMBER_BITS-1:0] number;
    logic [23:0]            key;
    logic signed [30:0]     x;
    logic signed [30:0]     y;
    shape_t                 l2;
    shape_t                 i0;
    shape_t                 kappa;
  } side_t;

  localparam int unsigned BoundsLatency = splat_bounds_latency(Interval);

  bounded_t                        bounded;
  side_t                           side;
  listed_t                         listed, walk;
  logic                            bounded_valid, side_valid, side_empty, outside_bounds;
  logic                            bounds_en, bounds_out, bounds_take;
  logic [PhaseBits-1:0]            bounds_phase_q;
  logic [BoundsLatency-1:0]        bounds_valid_q;
  logic [7:0]                      code;
  logic                            walk_room, walk_valid, walk_ready, code_room, code_valid;
  logic                            bounded_empty, walk_empty, code_empty;
  logic                            unused_full, unused_full_walk;
  logic [1:0]                      unused_usage, unused_usage_walk;

  flk_fifo #(
    .Width($bits(bounded_t)),
    .Depth(2)
  ) i_bounded (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (survivor_ready),
    .in_ready_o (bounds_room),
    .in_data_i  ({survivor.x, survivor.y, survivor.sx, survivor.sy, survivor.lean, survivor.scale,
                  part_q.opacity}),
    .out_valid_o(bounded_valid),
    .out_ready_i(bounds_take),
    .out_data_o (bounded),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (bounded_empty)
  );

  flk_sram_fifo #(
    .Width($bits(side_t)),
    .Depth(16)
  ) i_side (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (survivor_ready),
    .in_ready_o (side_room),
    .in_data_i  ({survivor.seq, survivor.number, survivor.key, survivor.x, survivor.y,
                  survivor.l2, survivor.i0, survivor.kappa}),
    .out_valid_o(side_valid),
    .out_ready_i(bounds_out && bounds_en),
    .out_data_o (side),
    .empty_o    (side_empty)
  );

  flk_splat_bounds #(
    .Interval(Interval)
  ) i_bounds (
    .clk_i,
    .en_i     (bounds_en),
    .phase_i  (bounds_phase_q),
    .x_i      (bounded.x),
    .y_i      (bounded.y),
    .sx_i     (bounded.sx),
    .sy_i     (bounded.sy),
    .lean_i   (bounded.lean),
    .scale_i  (bounded.scale),
    .box_i    (setup_i.box),
    .opacity_i(bounded.opacity),
    .width_i  (setup_i.width),
    .height_i (setup_i.height),
    .empty_o  (outside_bounds),
    .x0_o     (listed.x0),
    .x1_o     (listed.x1),
    .y0_o     (listed.y0),
    .y1_o     (listed.y1),
    .limit_o  (listed.limit),
    .right_o  (listed.right),
    .code_o   (code)
  );

  assign bounds_out  = bounds_valid_q[BoundsLatency-1];
  assign bounds_en   = !bounds_out || (side_valid && walk_room && code_room);
  assign bounds_take = bounds_en && bounds_phase_q == '0 && bounded_valid;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      bounds_phase_q <= '0;
      bounds_valid_q <= '0;
    end else if (bounds_en) begin
      bounds_phase_q <= bounds_phase_q + 1'b1;
      bounds_valid_q <= {bounds_valid_q[BoundsLatency-2:0], bounds_take};
    end
  end

  assign listed.seq    = side.seq;
  assign listed.number = side.number;
  assign listed.key    = side.key;
  assign listed.empty  = outside_bounds || code == '0;
  assign listed.x      = side.x;
  assign listed.y      = side.y;
  assign listed.l2     = side.l2;
  assign listed.i0     = side.i0;
  assign listed.kappa  = side.kappa;
  assign faint_o       = bounds_out && bounds_en && code == '0;

  // ---- entries --------------------------------------------------------------------------------------

  logic walker_idle, walked, any_q;

  flk_fifo #(
    .Width($bits(listed_t)),
    .Depth(2)
  ) i_walk (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (bounds_out && bounds_en),
    .in_ready_o (walk_room),
    .in_data_i  (listed),
    .out_valid_o(walk_valid),
    .out_ready_i(walk_ready),
    .out_data_o (walk),
    .usage_o    (unused_usage_walk),
    .full_o     (unused_full_walk),
    .empty_o    (walk_empty)
  );

  flk_tile_walker #(
    .Interval(Interval / 2)
  ) i_walker (
    .clk_i,
    .rst_ni,
    .box_i       (setup_i.box),
    .idle_o      (walker_idle),
    .in_valid_i  (walk_valid),
    .in_ready_o  (walk_ready),
    .in_data_i   (walk),
    .out_valid_o (entry_valid_o),
    .out_ready_i (entry_ready_i),
    .out_data_o  (entry_o),
    .done_valid_o(walked)
  );

  // Whether the splat that is being walked has an entry

  logic                entry_move, seq_valid, seqs_empty;
  logic [SEQ_BITS-1:0] oldest, progress_d, progress_q;

  assign entry_move = entry_valid_o && entry_ready_i;
  assign unlisted_o = walked && !any_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      any_q <= 1'b0;
    end else begin
      any_q <= entry_move || (any_q && !walked);
    end
  end

  flk_sram_fifo #(
    .Width(SEQ_BITS),
    .Depth(Unfinished)
  ) i_seqs (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (push_i),
    .in_ready_o (seq_room),
    .in_data_i  (seq_i),
    .out_valid_o(seq_valid),
    .out_ready_i(walked),
    .out_data_o (oldest),
    .empty_o    (seqs_empty)
  );

  always_comb begin
    progress_d = progress_q;
    if (seqs_empty) begin
      progress_d = issued_i;
    end else if (seq_valid && !walked) begin
      progress_d = oldest;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      progress_q <= '0;
    end else begin
      progress_q <= progress_d;
    end
  end

  assign progress_o = progress_q;

  // ---- record ---------------------------------------------------------------------------------------

  // Fields of a record but the colours: factored 23 bits an axis and l2, l1, l0; conic the mean as it is and, in FP16,
  // opacity, c / 2, b, a / 2.
  localparam int unsigned MeanBits = (Form == FORM_FACTORED) ? 23 : 31;
  localparam int unsigned ShapeBits = (Form == FORM_FACTORED) ? 14 + 15 + 14 : 4 * 16;

  typedef struct packed {
    place_t               place;
    logic                 spiky;
    logic [7:0]           opacity;
    logic [ShapeBits-1:0] shape;
    logic [MeanBits-1:0]  y;
    logic [MeanBits-1:0]  x;
  } fields_t;

  // The survivor stands a cycle in registers: the queue's memory is too slow for the fields.
  typedef struct packed {
    place_t             place;
    logic               spiky;
    logic [7:0]         opacity;
    logic signed [30:0] x;
    logic signed [30:0] y;
    shape_t [2:0]       shape;
  } recorded_t;

  recorded_t    recorded_q;
  shape_t [2:0] recorded_shape;
  fields_t      fields_in, fields;
  logic         fields_valid, fields_empty, fields_room, recorded_valid_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      recorded_valid_q <= 1'b0;
    end else begin
      recorded_valid_q <= survivor_ready;
    end
  end

  always_ff @(posedge clk_i) begin
    if (survivor_ready) begin
      recorded_q <= '{
        place: survivor.place, spiky: survivor.spiky, opacity: part_q.opacity[7:0],
        x: survivor.x, y: survivor.y,
        shape: recorded_shape
      };
    end
  end

  assign record_room = fields_room && !recorded_valid_q;

  assign fields_in.place = recorded_q.place;
  assign fields_in.spiky = recorded_q.spiky;
  assign fields_in.opacity = recorded_q.opacity;

  flk_sram_fifo #(
    .Width($bits(fields_t)),
    .Depth(32)
  ) i_fields (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (recorded_valid_q),
    .in_ready_o (fields_room),
    .in_data_i  (fields_in),
    .out_valid_o(fields_valid),
    .out_ready_i(record_valid_o && record_ready_i),
    .out_data_o (fields),
    .empty_o    (fields_empty)
  );

  // Codes of opacities, out of the bounds' pipeline: of factored records, and in antialiased scenes of all.
  logic       with_code, code_space, code_there, unused_full_code;
  logic [7:0] record_code;
  logic [4:0] unused_usage_code;

  assign with_code = Form == FORM_FACTORED || setup_i.antialiased;

  flk_fifo #(
    .Width(8),
    .Depth(16)
  ) i_codes (
    .clk_i,
    .rst_ni,
    .clear_i    (1'b0),
    .in_valid_i (with_code && bounds_out && side_valid && walk_room),
    .in_ready_o (code_space),
    .in_data_i  (code),
    .out_valid_o(code_there),
    .out_ready_i(with_code && record_valid_o && record_ready_i),
    .out_data_o (record_code),
    .usage_o    (unused_usage_code),
    .full_o     (unused_full_code),
    .empty_o    (code_empty)
  );

  assign code_room  = code_space || !with_code;
  assign code_valid = code_there || !with_code;

  if (Form == FORM_FACTORED) begin : gen_factored
    assign recorded_shape       = {survivor.l2, survivor.shape};
    assign fields_in.shape[28]  = recorded_q.shape[1][SHAPE_MAN_BITS+8];  // sign of l1

    flk_mean_field i_x_field (.x_i(recorded_q.x), .field_o(fields_in.x));
    flk_mean_field i_y_field (.x_i(recorded_q.y), .field_o(fields_in.y));
    flk_shape_field #(.ManBits(SHAPE_MAN_BITS)) i_l0_field (
      .x_i    (recorded_q.shape[0]),
      .field_o(fields_in.shape[13:0])
    );
    flk_shape_field #(.ManBits(SHAPE_MAN_BITS)) i_l1_field (
      .x_i    (recorded_q.shape[1]),
      .field_o(fields_in.shape[27:14])
    );
    flk_shape_field #(.ManBits(SHAPE_MAN_BITS)) i_l2_field (
      .x_i    (recorded_q.shape[2]),
      .field_o(fields_in.shape[42:29])
    );

    assign record_o = {fields.spiky, colour, record_code, fields.shape, fields.y, fields.x};
  end else begin : gen_conic
    // The opacity is in the record as it is in the image, in FP16: it waits for nothing. In antialiased scenes it is that
    // of the code that lists are made by.
    logic [15:0] opacity_q, opacity, coded;

    assign recorded_shape = survivor.shape;

    always_ff @(posedge clk_i) begin
      if (survivor_ready) begin
        opacity_q <= part_q.opacity;
      end
    end

    flk_opacity_to_fp16 i_opacity (
      .code_i   (opacity_q[7:0]),
      .opacity_o(opacity)
    );

    flk_opacity_to_fp16 i_coded (
      .code_i   (record_code),
      .opacity_o(coded)
    );

    for (genvar k = 0; k < 3; k++) begin : gen_shape
      flk_ff_to_fp16 #(
        .ManBits(SHAPE_MAN_BITS)
      ) i_shape (
        .x_i(recorded_q.shape[k]),
        .y_o(fields_in.shape[16*k+:16])
      );
    end

    assign fields_in.shape[63:48] = chunked_q ? opacity : opacity_q;
    assign fields_in.x            = recorded_q.x;
    assign fields_in.y            = recorded_q.y;

    assign record_o = {fields.spiky, colour,
                       setup_i.antialiased ? coded : fields.shape[63:48], fields.shape[47:0],
                       32'($signed(fields.y)), 32'($signed(fields.x))};
  end

  assign record_valid_o = rgb_valid && fields_valid && code_valid;
  assign rgb_ready      = record_ready_i && fields_valid && code_valid;
  assign record_place_o = fields.place;
  assign record_opacity_o = fields.opacity;
  assign clipped_o      = record_valid_o && record_ready_i && colour_clipped;

  assign idle_o = survivors_empty && directions_empty && !part_valid_q && fields_empty &&
                  !recorded_valid_q &&
                  code_empty && side_empty && bounded_empty && walk_empty && walker_idle &&
                  seqs_empty;

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) push_i |-> ready_o)
  else $error("flk_preprocessing_core: a survivor without a place");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      (part_move && part_q.stored |-> codes_room) and (codes_take |-> codes_valid))
  else $error("flk_preprocessing_core: a stored colour is lost");

  assert property (@(posedge clk_i) disable iff (!rst_ni) walked |-> seq_valid)
  else $error("flk_preprocessing_core: a splat is finished that was not waited for");
`endif

endmodule
