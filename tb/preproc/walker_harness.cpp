// flk_tile_walker: splats in, entries out, with the patterns of idle and back-pressure cycles of the test (test_tile_walker.py).
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "Vtop.h"
#include "verilated.h"

namespace {

VerilatedContext context;
std::string failure;
uint64_t state;

Vtop& top() {
  static Vtop* model = [] {
    context.randReset(2);
    context.randSeed(SEED);
    return new Vtop{&context};
  }();
  return *model;
}

uint32_t noise() {
  state = state * 6364136223846793005ULL + 1442695040888963407ULL;
  return static_cast<uint32_t>(state >> 32);
}

}  // namespace

void vl_stop(const char* file, int line, const char*) VL_MT_UNSAFE {
  if (failure.empty()) failure = std::string("assertion failed at ") + file + ":" + std::to_string(line);
}

void vl_fatal(const char* file, int line, const char*, const char* message) VL_MT_UNSAFE {
  std::fprintf(stderr, "%s:%d: %s\n", file, line, message);
  std::abort();
}

extern "C" const char* error() { return failure.c_str(); }

// From a reset on, n splats, rows of IN_WORDS. out: rows of OUT_WORDS, at most `room`. done: for each splat that is finished, the entries taken before.
// idle, stall: cycles, repeated. result: entries, splats finished, cycles from the first splat offered to the last of both, first entry's cycle.
// Ends after `limit` cycles, or when idle with all splats taken.
extern "C" void run(int64_t n, const uint32_t* in, uint32_t* out, int64_t room, int64_t* done, int box, const uint8_t* idle, const uint8_t* stall,
                    int64_t pattern, int64_t limit, uint64_t seed, int64_t* result) {
  Vtop& model = top();
  failure.clear();
  state = seed;
  const auto tick = [&] {
    model.clk_i = 1;
    model.eval();
    model.clk_i = 0;
    model.eval();
  };
  model.clk_i = 0;
  model.rst_ni = 1;  // a reset is an edge
  model.eval();
  model.rst_ni = 0;
  model.in_valid_i = 0;
  model.out_ready_i = 0;
  model.box_i = box;
  model.eval();
  tick();
  tick();
  model.rst_ni = 1;
  int64_t sent = 0, entries = 0, finished = 0, first = -1, last = 0;
  bool offered = false;
  for (int64_t cycle = 0; cycle < limit; cycle++) {
    offered = offered || (sent < n && !idle[cycle % pattern]);
    model.in_valid_i = offered;
    for (int w = 0; w < IN_WORDS; w++) model.in_data_i[w] = noise();
    model.in_data_i[IN_WORDS - 1] &= IN_MASK;
    if (offered) std::memcpy(&model.in_data_i[0], in + sent * IN_WORDS, sizeof(uint32_t) * IN_WORDS);
    model.out_ready_i = !stall[cycle % pattern];
    model.eval();
    if (model.done_valid_o) {
      if (finished < n) done[finished] = entries;
      finished++;
      last = cycle;
    }
    if (model.out_valid_o && model.out_ready_i) {
      if (entries < room) std::memcpy(out + entries * OUT_WORDS, &model.out_data_o[0], sizeof(uint32_t) * OUT_WORDS);
      if (entries == 0) first = cycle;
      entries++;
      last = cycle;
    }
    const bool quiet = model.idle_o && !offered && sent == n;
    if (offered && model.in_ready_o) {
      sent++;
      offered = false;
    }
    tick();
    if (quiet || !failure.empty()) break;
  }
  result[0] = entries;
  result[1] = finished;
  result[2] = last;
  result[3] = first;
}
