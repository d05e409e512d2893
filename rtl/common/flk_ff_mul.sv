// Multiplier of ff numbers, pipelined: round to nearest even, no subnormals, saturating (docs/reference/ff.md).
//
// Multiply by each part of b | add pairs of products | add the products | round.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the third bar above, 3 also at the first, 4 at all. With less than 3 there
// is one product; with 4, for long mantissas, there are four. Registers load while en_i is high and are not reset.
module flk_ff_mul #(
  parameter  int unsigned ExpBits = 8,
  parameter  int unsigned ManBits = 19,
  parameter  int unsigned Stages  = 3,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] prod_o
);

  if (ExpBits < 2 || ManBits < 3) begin : gen_check_size
    $error("flk_ff_mul: ExpBits must be at least 2, ManBits at least 3");
  end
  if (Stages > 4) begin : gen_check_stages
    $error("flk_ff_mul: Stages must be 0 to 4");
  end

  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned ProdBits = 2 * SigBits;
  localparam int unsigned BIAS = 2 ** (ExpBits - 1) - 1;
  // Sum of two exponents less the bias, signed.
  localparam int unsigned SumBits = ExpBits + 2;
  // Parts of b; three where the product of a half would take too long.
  localparam int unsigned Parts = (Stages < 3) ? 1 : (Stages == 4) ? 4 : (SigBits > 16) ? 3 : 2;
  localparam int unsigned PartBits = (SigBits + Parts - 1) / Parts;
  // Lowest bits of the product that are known before the last addition: only whether any is set matters.
  localparam int unsigned RestBits = (Parts == 1) ? 1 : (Parts == 4) ? 2 * PartBits : PartBits;

  // ---- Multiply ----------------------------------------------------------------------------------------

  logic a_sign, b_sign, zero;
  logic [ExpBits-1:0] a_exp, b_exp;
  logic [ManBits-1:0] a_man, b_man;
  logic [SigBits-1:0] a_sig, b_sig;
  logic [ProdBits-1:0] product;
  logic rest;  // is any of its lowest bits set?
  logic sign_q, zero_q;
  logic [SumBits-1:0] exp, exp_q;

  assign {a_sign, a_exp, a_man} = a_i;
  assign {b_sign, b_exp, b_man} = b_i;
  assign a_sig = {1'b1, a_man};
  assign b_sig = {1'b1, b_man};
  assign zero = (a_exp == '0) || (b_exp == '0);
  assign exp = SumBits'(a_exp) + SumBits'(b_exp) - SumBits'(BIAS);

  if (Stages >= 3) begin : gen_parts
    logic [Parts-1:0][SigBits+PartBits-1:0] part, part_q;
    logic [Parts*PartBits-1:0] b_padded;

    assign b_padded = (Parts * PartBits)'(b_sig);
    for (genvar k = 0; k < Parts; k++) begin : gen_part
      assign part[k] = (SigBits + PartBits)'(a_sig)
                     * (SigBits + PartBits)'(b_padded[k*PartBits+:PartBits]);
    end

    flk_delay #(
      .Width(Parts * (SigBits + PartBits)),
      .Depth(1)
    ) i_parts (
      .clk_i,
      .en_i,
      .d_i(part),
      .q_o(part_q)
    );

    if (Parts == 4) begin : gen_four
      localparam int unsigned PairBits = SigBits + 2 * PartBits;
      logic [1:0][PairBits-1:0] pair, pair_q;

      for (genvar k = 0; k < 2; k++) begin : gen_pair
        assign pair[k] = PairBits'(part_q[2*k]) + (PairBits'(part_q[2*k+1]) << PartBits);
      end

      flk_delay #(
        .Width(2 * PairBits),
        .Depth(1)
      ) i_pairs (
        .clk_i,
        .en_i,
        .d_i(pair),
        .q_o(pair_q)
      );

      assign rest = |pair_q[0][RestBits-1:0];
      assign product = ProdBits'(pair_q[0]) + (ProdBits'(pair_q[1]) << (2 * PartBits));
    end else if (Parts == 3) begin : gen_three
      assign rest = |part_q[0][RestBits-1:0];
      assign product = ProdBits'(part_q[0]) + (ProdBits'(part_q[1]) << PartBits)
                     + (ProdBits'(part_q[2]) << (2 * PartBits));
    end else begin : gen_two
      assign rest = |part_q[0][RestBits-1:0];
      assign product = ProdBits'(part_q[0]) + (ProdBits'(part_q[1]) << PartBits);
    end
  end else begin : gen_whole
    assign product = ProdBits'(a_sig) * ProdBits'(b_sig);
    assign rest = |product[RestBits-1:0];
  end

  flk_delay #(
    .Width(2 + SumBits),
    .Depth((Stages >= 3) ? Stages - 2 : 0)
  ) i_exp (
    .clk_i,
    .en_i,
    .d_i({a_sign ^ b_sign, zero, exp}),
    .q_o({sign_q, zero_q, exp_q})
  );

  // ---- Bar ---------------------------------------------------------------------------------------------

  typedef struct packed {
    logic                       sign;
    logic                       zero;
    logic [SumBits-1:0]         exp;  // of the result if the product's top bit is clear
    logic [ProdBits-1:RestBits] sig;  // product of the significands
    logic                       rest;
  } product_t;

  product_t product_q;

  logic unused_product;
  assign unused_product = ^product[RestBits-1:0];

  flk_delay #(
    .Width($bits(product_t)),
    .Depth(32'(Stages >= 2))
  ) i_product (
    .clk_i,
    .en_i,
    .d_i({sign_q, zero_q, exp_q, product[ProdBits-1:RestBits], rest}),
    .q_o(product_q)
  );

  // ---- Round to nearest even -----------------------------------------------------------------------------

  localparam int unsigned CodeBits = ExpBits + ManBits;
  localparam logic [CodeBits-1:0] TOP = {{ExpBits - 1{1'b1}}, 1'b0, {ManBits{1'b1}}};

  // The result's exponent, and what it means, if nothing raises it (0) or something does (1).
  typedef struct packed {
    logic               zero;
    logic               too_large;
    logic [ExpBits-1:0] exp;
  } range_t;

  range_t [1:0] range;
  range_t result_range;
  logic top, guard, sticky;
  logic [ManBits-1:0] man;
  logic [SigBits-1:0] sig;
  logic [Width-1:0] packed_prod;

  for (genvar k = 0; k < 2; k++) begin : gen_range
    logic [SumBits-1:0] exp_k;
    assign exp_k = product_q.exp + SumBits'(k);
    assign range[k].zero = product_q.zero || exp_k[SumBits-1] || exp_k == '0;
    assign range[k].too_large = exp_k[ExpBits] || (&exp_k[ExpBits-1:0]);
    assign range[k].exp = exp_k[ExpBits-1:0];
  end

  assign top = product_q.sig[ProdBits-1];
  assign {man, guard} = top ? product_q.sig[ProdBits-2-:SigBits]
                            : product_q.sig[ProdBits-3-:SigBits];
  assign sticky = product_q.rest || (|product_q.sig[ProdBits-3-SigBits:RestBits])
               || (top && product_q.sig[ProdBits-2-SigBits]);
  // The top bit or a carry out of the mantissa raises the exponent, never both: no product comes within an ulp of 4.
  assign sig = {top, man} + SigBits'(guard && (sticky || man[0]));
  assign result_range = range[sig[ManBits]];

  always_comb begin
    if (result_range.zero) begin
      packed_prod = '0;
    end else if (result_range.too_large) begin
      packed_prod = {product_q.sign, TOP};
    end else begin
      packed_prod = {product_q.sign, result_range.exp, sig[ManBits-1:0]};
    end
  end

  flk_delay #(
    .Width(Width),
    .Depth(32'(Stages >= 1))
  ) i_prod (
    .clk_i,
    .en_i,
    .d_i(packed_prod),
    .q_o(prod_o)
  );

endmodule
