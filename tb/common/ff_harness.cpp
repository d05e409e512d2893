// Batch evaluation of the units in ff_harness.sv, called through ctypes (test_ff.py).
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>

#include "Vtop.h"
#include "verilated.h"

namespace {

constexpr int UNITS = 13, ADDER = 0, FIRST_CONVERSION = 7, STAGES = 4;
constexpr int COMPARISON = 11;  // from there on units have no pipelines

VerilatedContext context;

Vtop& top() {
  static Vtop model{&context};
  return model;
}

}  // namespace

extern "C" {

void ff_reset() {
  top().load_i = 0;
  top().clk_i = 0;
  top().eval();
}

// out: n rows of UNITS numbers of the combinational units of a format.
void ff_batch(int format, int64_t n, const uint32_t* a, const uint32_t* b, uint32_t* out) {
  Vtop& model = top();
  for (int64_t i = 0; i < n; i++) {
    model.a_i = a[i];
    model.b_i = b[i];
    model.load_i ^= 1U << format;
    model.eval();
    for (int u = 0; u < UNITS; u++) *out++ = model.y_o[format][0][u];
  }
}

// Pipelines against the combinational units, an operand pair in each cycle, in which they load where enable says so.
// bad: by stages and unit, cycles in which they differ.
void ff_pipes(int format, int64_t n, const uint32_t* a, const uint32_t* b, const uint8_t* enable, int64_t* bad) {
  Vtop& model = top();
  uint32_t line[STAGES + 1][UNITS] = {};  // results taken, the youngest first
  int64_t taken = 0;
  for (int64_t i = 0; i < n; i++) {
    model.a_i = a[i];
    model.b_i = b[i];
    model.en_i = enable[i];
    model.load_i ^= 1U << format;
    model.eval();
    if (enable[i]) {
      std::memmove(line[1], line[0], sizeof(line) - sizeof(line[0]));
      for (int u = 0; u < UNITS; u++) line[0][u] = model.y_o[format][0][u];
      taken++;
    }
    model.clk_i |= 1U << format;
    model.eval();
    model.clk_i &= ~(1U << format);
    model.eval();
    for (int s = 1; s <= STAGES; s++) {
      for (int u = 0; u < COMPARISON; u++) {
        const int latency = std::min(s, u >= FIRST_CONVERSION ? 2 : u == ADDER ? 3 : 4);
        if (taken >= latency && model.y_o[format][s][u] != line[latency - 1][u]) bad[(s - 1) * UNITS + u]++;
      }
    }
  }
}
}
