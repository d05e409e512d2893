// Batch evaluation of arith_harness.sv, called through ctypes.
#include <cstdint>
#include <cstring>
#include <memory>

#include "Vtop.h"
#include "verilated.h"

double sc_time_stamp() { return 0; }

// Evaluates one group of units on n operand pairs; out holds n rows of 8 results.
extern "C" void arith_run(uint32_t group, uint64_t n, const uint16_t* a, const uint16_t* b,
                          uint16_t* out) {
  static const auto context = std::make_unique<VerilatedContext>();
  static const auto top = std::make_unique<Vtop>(context.get());
  for (uint64_t i = 0; i < n; i++) {
    top->a_i = a[i];
    top->b_i = b[i];
    top->clk_i = 0;
    top->eval();
    top->clk_i = 1u << group;
    top->eval();
    std::memcpy(out + 8 * i, &top->out_o[4 * group], 16);
  }
  top->clk_i = 0;
  top->eval();
}
