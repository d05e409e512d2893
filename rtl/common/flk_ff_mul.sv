// Multiplier of ff numbers, pipelined: round to nearest even, no subnormals, saturating (docs/ff.md).
//
// Multiply by either half of b | add the two products | round.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the second bar above, 3 at both. With less than 3 the product is one.
// Registers load while en_i is high and are not reset.
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

  if (ExpBits < 2 || ManBits < 2) begin : gen_check_size
    $error("flk_ff_mul: ExpBits and ManBits must be at least 2");
  end
  if (Stages > 3) begin : gen_check_stages
    $error("flk_ff_mul: Stages must be 0 to 3");
  end

  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned ProdBits = 2 * SigBits;
  localparam int unsigned BIAS = 2 ** (ExpBits - 1) - 1;
  // Sum of two exponents less the bias, signed.
  localparam int unsigned SumBits = ExpBits + 2;

  // ---- Multiply ----------------------------------------------------------------------------------------

  logic a_sign, b_sign, zero;
  logic [ExpBits-1:0] a_exp, b_exp;
  logic [ManBits-1:0] a_man, b_man;
  logic [SigBits-1:0] a_sig, b_sig;
  logic [ProdBits-1:0] product;
  logic sign_q, zero_q;
  logic [SumBits-1:0] exp, exp_q;

  assign {a_sign, a_exp, a_man} = a_i;
  assign {b_sign, b_exp, b_man} = b_i;
  assign a_sig = {1'b1, a_man};
  assign b_sig = {1'b1, b_man};
  assign zero = (a_exp == '0) || (b_exp == '0);
  assign exp = SumBits'(a_exp) + SumBits'(b_exp) - SumBits'(BIAS);

  if (Stages >= 3) begin : gen_halves
    localparam int unsigned LowBits = SigBits / 2;
    localparam int unsigned HighBits = SigBits - LowBits;
    logic [SigBits+LowBits-1:0] low_q;
    logic [SigBits+HighBits-1:0] high_q;

    flk_delay #(
      .Width(2 * SigBits + LowBits + HighBits),
      .Depth(1)
    ) i_halves (
      .clk_i,
      .en_i,
      .d_i({
        (SigBits + LowBits)'(a_sig) * (SigBits + LowBits)'(b_sig[LowBits-1:0]),
        (SigBits + HighBits)'(a_sig) * (SigBits + HighBits)'(b_sig[SigBits-1:LowBits])
      }),
      .q_o({low_q, high_q})
    );

    assign product = ProdBits'(low_q) + {high_q, LowBits'(0)};
  end else begin : gen_whole
    assign product = ProdBits'(a_sig) * ProdBits'(b_sig);
  end

  flk_delay #(
    .Width(2 + SumBits),
    .Depth(32'(Stages >= 3))
  ) i_exp (
    .clk_i,
    .en_i,
    .d_i({a_sign ^ b_sign, zero, exp}),
    .q_o({sign_q, zero_q, exp_q})
  );

  // ---- Bar ---------------------------------------------------------------------------------------------

  typedef struct packed {
    logic                sign;
    logic                zero;
    logic [SumBits-1:0]  exp;  // of the result if the product's top bit is clear
    logic [ProdBits-1:0] product;
  } product_t;

  product_t product_q;

  flk_delay #(
    .Width($bits(product_t)),
    .Depth(32'(Stages >= 2))
  ) i_product (
    .clk_i,
    .en_i,
    .d_i({sign_q, zero_q, exp_q, product}),
    .q_o(product_q)
  );

  // ---- Round to nearest even -----------------------------------------------------------------------------

  localparam int unsigned CodeBits = ExpBits + ManBits;
  localparam logic [CodeBits-1:0] TOP = {{ExpBits - 1{1'b1}}, 1'b0, {ManBits{1'b1}}};

  logic top, guard, sticky, raised;
  logic [ManBits-1:0] man;
  logic [SigBits-1:0] sig;
  logic [SumBits-1:0] result_exp;
  logic [Width-1:0] packed_prod;

  assign top = product_q.product[ProdBits-1];
  assign {man, guard} = top ? product_q.product[ProdBits-2-:SigBits]
                            : product_q.product[ProdBits-3-:SigBits];
  assign sticky = (|product_q.product[ProdBits-3-SigBits:0])
               || (top && product_q.product[ProdBits-2-SigBits]);
  // The top bit or a carry out of the mantissa raises the exponent, never both: no product comes within an ulp of 4.
  assign sig = {top, man} + SigBits'(guard && (sticky || man[0]));
  assign raised = sig[ManBits];
  assign result_exp = product_q.exp + SumBits'(raised);

  always_comb begin
    if (product_q.zero || result_exp[SumBits-1] || result_exp == '0) begin
      packed_prod = '0;
    end else if (result_exp[ExpBits] || (&result_exp[ExpBits-1:0])) begin
      packed_prod = {product_q.sign, TOP};
    end else begin
      packed_prod = {product_q.sign, result_exp[ExpBits-1:0], sig[ManBits-1:0]};
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
