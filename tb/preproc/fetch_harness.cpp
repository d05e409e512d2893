// A unit that reads memory, takes a stream and gives a stream, frame by frame: cluster_cull_bench and geometry_fetch_bench (fetch_bench.py).
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>

#include "Vtop.h"
#include "memory.hpp"
#include "verilated.h"

namespace {

std::string g_error;

struct Bench {
  flk::Memory memory;
  flk::AxiPort port;
  VerilatedContext context;
  std::unique_ptr<Vtop> top;
  flk::AxiRequest request{};
  flk::Random random;

  Bench(const flk::dram::Timing& timing, bool perfect, const flk::AxiConfig& config, uint64_t seed) : memory(timing, perfect), port(memory, config), random(seed) {
    context.fatalOnError(false);
    context.randReset(2);
    context.randSeed(static_cast<int>(seed % 0x7fffffff) + 1);
    top = std::make_unique<Vtop>(&context);
  }

  // A cycle up to the edge; `edge` ends it.
  void settle(bool reset) {
    top->rst_ni = !reset;
    FLK_AXI_DRIVE_READ(port.reply(), *top, mem_);
    top->clk_i = 0;
    top->eval();
    FLK_AXI_SAMPLE_READ(request, *top, mem_);
  }
  void edge(bool reset) {
    memory.tick();
    reset ? port.reset(request) : port.cycle(request);
    top->clk_i = 1;
    top->eval();
  }
};

std::unique_ptr<Bench> bench;

// Pauses of a stream: `share` 256ths of the cycles, `run` cycles each in the mean.
struct Pauses {
  flk::Random& random;
  int share, run, left = 0;
  bool next() {
    if (left > 0) return --left, true;
    if (share == 0 || static_cast<int>(random.below(256 * run)) >= share) return false;
    left = run > 1 ? static_cast<int>(random.below(2 * run)) : 0;
    return true;
  }
};

}  // namespace

extern "C" {

struct Frame {
  int64_t items, limit, room;
  int32_t idle, idle_run, stall, stall_run, reset_at;
};

struct Result {
  int64_t cycles, taken, given;
  uint32_t status[6];
};

const char* bench_error() { return g_error.c_str(); }

void bench_open(const flk::dram::Timing* timing, int perfect, const flk::AxiConfig* config, uint64_t seed) {
  bench = std::make_unique<Bench>(*timing, perfect != 0, *config, seed);
  Vtop& top = *bench->top;
  top.start_i = 0;
  top.in_valid_i = 0;
  top.out_ready_i = 0;
  std::memset(&top.registers_i, 0, sizeof top.registers_i);
  top.clk_i = 0;
  top.rst_ni = 1;
  top.eval();
  for (int k = 0; k < 3; ++k) {
    bench->settle(true);
    bench->edge(true);
  }
}

int bench_store(uint64_t base, uint64_t size, const uint8_t* bytes) {
  if (!bench->memory.store.allocate(base, size)) return 0;
  std::memcpy(bench->memory.store.find(base, size), bytes, size);
  return 1;
}

void bench_fail(uint64_t base, uint64_t size) { bench->port.fail_range(base, size, true, false); }
uint64_t bench_beats() { return bench->port.transfers(flk::R); }
uint64_t bench_waits() { return bench->port.waits(flk::R); }

// A frame. in: items of 3 words; out: room for `room` items, when: cycle of each, from the start. 1: done, 0: not within `limit` cycles, or reset in the
// cycle `reset_at`, -1: something is wrong.
int bench_frame(const Frame* frame, const uint32_t* registers, const uint32_t* in, uint32_t* out, int64_t* when, Result* result) {
  Bench& b = *bench;
  Vtop& top = *b.top;
  g_error.clear();
  auto fail = [&](const std::string& text) {
    if (g_error.empty()) g_error = text;
  };
  std::memcpy(&top.registers_i, registers, sizeof top.registers_i);
  Pauses idle{b.random, frame->idle, frame->idle_run}, stall{b.random, frame->stall, frame->stall_run};
  int64_t taken = 0, given = 0, cycle = 0;
  bool offered = false, done = false, held = false;
  std::string before;
  for (; cycle < frame->limit && !done; ++cycle) {
    if (cycle == frame->reset_at) {
      top.start_i = 0;
      top.in_valid_i = 0;
      for (int k = 0; k < 3; ++k) {
        b.settle(true);
        b.edge(true);
      }
      break;
    }
    top.start_i = cycle == 0;
    if (!offered) offered = taken < frame->items && !idle.next();
    top.in_valid_i = offered;
    if (offered) {
      std::memcpy(&top.in_data_i[0], in + 3 * taken, 12);
    } else {
      for (int w = 0; w < 3; ++w) top.in_data_i[w] = b.random.next();
    }
    top.out_ready_i = !stall.next();
    b.settle(false);
    if (cycle == 0 && !top.idle_o) fail("not idle at the start");
    const std::string data(reinterpret_cast<const char*>(&top.out_data_o[0]), 4 * OUT_WORDS);
    if (held && (!top.out_valid_o || data != before)) fail("output changed before its transfer");
    held = top.out_valid_o && !top.out_ready_i;
    before = data;
    if (top.out_valid_o && top.out_ready_i) {
      if (given == frame->room) {
        fail("more outputs than there is room for");
        break;
      }
      std::memcpy(out + OUT_WORDS * given, data.data(), 4 * OUT_WORDS);
      when[given++] = cycle;
    }
    if (offered && top.in_ready_o) {
      ++taken;
      offered = false;
    }
    if (top.done_o) {
      done = true;
      if (!top.idle_o) fail("done but not idle");
      if (!b.port.idle()) fail("done, and reads are on their way");
      if (taken != frame->items) fail("done, and items are left");
    }
    b.edge(false);
    if (b.context.gotError()) fail("an assertion of the design");
    if (!b.port.errors().empty()) fail(b.port.errors().front());
    if (!g_error.empty()) break;
  }
  top.in_valid_i = 0;
  *result = {cycle, taken, given, {}};
  std::memcpy(result->status, &top.status_o[0], sizeof result->status);
  return g_error.empty() ? done : -1;
}

void bench_close() {
  if (bench) bench->top->final();
  bench.reset();
}
}
