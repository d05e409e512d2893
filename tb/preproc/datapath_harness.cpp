// A pipeline of flicker.datapath behind one vector of inputs and one of outputs (test_datapath.py): elements through it under a pattern of enables.
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

// in: n rows of IN_WORDS, out: of OUT_WORDS. Inputs are noise but in the cycle in which an element is taken. enable: cycles, repeated.
extern "C" int64_t run(int64_t n, int interval, int latency, int fixed_words, const uint32_t* fixed, const uint32_t* in, uint32_t* out,
                       const uint8_t* enable, int64_t enables, uint64_t seed) {
  Vtop& model = top();
  state = seed;
  int64_t cycle = 0, clocks = 0;
  // Phase 0 stands for a clock before the first element.
  model.en_i = 0;
  model.phase_i = 0;
  model.rst_ni = 1;  // a reset is an edge
  model.eval();
  model.rst_ni = 0;
  model.eval();
  model.rst_ni = 1;
  model.clk_i = 1;
  model.eval();
  model.clk_i = 0;
  model.eval();
  for (int64_t done = 0; done < n; clocks++) {
    const bool on = enable[clocks % enables];
    const int phase = static_cast<int>(cycle % interval);
    const int64_t element = cycle / interval;
    for (int w = 0; w < IN_WORDS; w++) model.in_i[w] = noise();
    std::memcpy(&model.in_i[0], fixed, sizeof(uint32_t) * fixed_words);
    if (phase == 0 && element < n) std::memcpy(&model.in_i[fixed_words], in + element * (IN_WORDS - fixed_words), sizeof(uint32_t) * (IN_WORDS - fixed_words));
    model.en_i = on;
    model.phase_i = phase;
    model.eval();
    if (on && cycle >= latency && (cycle - latency) % interval == 0) {
      std::memcpy(out + done * OUT_WORDS, &model.out_o[0], sizeof(uint32_t) * OUT_WORDS);
      done++;
    }
    model.clk_i = 1;
    model.eval();
    model.clk_i = 0;
    model.eval();
    if (on) cycle++;
  }
  return clocks;
}
