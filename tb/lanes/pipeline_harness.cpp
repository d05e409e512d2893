// A pipeline behind one vector of inputs and one of outputs (pipeline_bench.py): elements through it, one in every cycle with enable.
#include <cstdint>
#include <cstring>

#include "Vtop.h"
#include "verilated.h"

namespace {

VerilatedContext context;

Vtop& top() {
  static Vtop model{&context};
  return model;
}

uint64_t state;

uint32_t noise() {
  state = state * 6364136223846793005ULL + 1442695040888963407ULL;
  return static_cast<uint32_t>(state >> 32);
}

}  // namespace

// in: n rows of IN_WORDS, out: of OUT_WORDS. Inputs are noise in cycles without enable, and behind the last element. enable: cycles, repeated.
extern "C" void run(int64_t n, int latency, const uint32_t* in, uint32_t* out, const uint8_t* enable, int64_t enables, uint64_t seed) {
  Vtop& model = top();
  state = seed;
  model.clk_i = 0;
  model.eval();
  for (int64_t clock = 0, cycle = 0; cycle < n + latency; clock++) {
    const bool on = enable[clock % enables];
    for (int w = 0; w < IN_WORDS; w++) model.in_i[w] = noise();
    if (on && cycle < n) std::memcpy(&model.in_i[0], in + cycle * IN_WORDS, sizeof(uint32_t) * IN_WORDS);
    model.en_i = on;
    model.eval();
    if (on && cycle >= latency) std::memcpy(out + (cycle - latency) * OUT_WORDS, &model.out_o[0], sizeof(uint32_t) * OUT_WORDS);
    model.clk_i = 1;
    model.eval();
    model.clk_i = 0;
    model.eval();
    if (on) cycle++;
  }
}
