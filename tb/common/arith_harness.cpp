// Batch evaluation of the units in arith_harness.sv, called through ctypes (arith_bench.py).
// Every array holds n rows of uint16.
#include <cstdint>

#include "Vtop.h"
#include "verilated.h"

namespace {

VerilatedContext context;

Vtop& top() {
  static Vtop model{&context};
  return model;
}

template <typename T, std::size_t N>
constexpr int size(const VlUnpacked<T, N>&) {
  return N;
}

const int FORMATS = size(top().conv_o);

// Give the operands to the units behind bit `group` of the clock.
void step(int group, uint16_t a, uint16_t b) {
  Vtop& model = top();
  model.a_i = a;
  model.b_i = b;
  model.clk_i ^= 1U << group;
  model.eval();
}

}  // namespace

extern "C" {

void arith_reset() {
  top().clk_i = 0;
  top().eval();
}

void arith_pairs(int format, int64_t n, const uint16_t* a, const uint16_t* b, uint16_t* sum,
                 uint16_t* like, uint16_t* product, uint16_t* less) {
  for (int64_t i = 0; i < n; i++) {
    step(format, a[i], b[i]);
    sum[i] = top().sum_o[format];
    like[i] = top().like_o[format];
    product[i] = top().prod_o[format];
    less[i] = top().lt_o[format];
  }
}

// out: n rows of one number per target format.
void arith_convert(int format, int64_t n, const uint16_t* a, uint16_t* out) {
  for (int64_t i = 0; i < n; i++) {
    step(FORMATS + format, a[i], 0);
    for (int t = 0; t < FORMATS; t++) *out++ = top().conv_o[format][t];
  }
}

// exp: n rows of natural, base 2. log: n rows of both bases in every format.
void arith_functions(int64_t n, const uint16_t* a, uint16_t* exp, uint16_t* log) {
  for (int64_t i = 0; i < n; i++) {
    step(2 * FORMATS, a[i], 0);
    for (int base2 = 0; base2 < 2; base2++) {
      *exp++ = top().exp_o[base2];
      for (int t = 0; t < FORMATS; t++) *log++ = top().log_o[base2][t];
    }
  }
}
}
