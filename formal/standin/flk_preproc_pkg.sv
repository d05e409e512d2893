// Small sizes of the preprocessing core's types, for the proofs of its units. A record's number has room
// for what a proof wants to find again.
package flk_preproc_pkg;

  localparam int unsigned LANES = 3;
  localparam int unsigned SEQ_BITS = 3;
  localparam int unsigned NUMBER_BITS = 5;
  localparam int unsigned BEAT_BITS = 2;
  localparam int unsigned PLACE_BEAT_BITS = 2;

  typedef struct packed {
    logic [PLACE_BEAT_BITS-1:0] beat;
    logic [1:0]                 quarter;
  } place_t;

  typedef struct packed {
    logic [SEQ_BITS-1:0]    seq;
    logic [7:0]             row;
    logic [7:0]             column;
    logic [23:0]            key;
    logic [NUMBER_BITS-1:0] number;
    logic [3:0]             mask;
  } entry_t;

  typedef struct packed {
    logic [BEAT_BITS-1:0] beat;
    logic [3:0]           quarters;
  } record_beat_t;

endpackage
