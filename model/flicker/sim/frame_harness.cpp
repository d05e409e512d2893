// Runs frames of flk_preprocessing, or with FLK_RENDERING of flk_rendering, against a memory (memory.hpp); called through ctypes by sim/half.py.
// Both halves have the same pins beside their AXI ports: start_i, idle_o, registers_i, done_o, error_o, counters_o.
#include <cstring>
#include <memory>
#include <string>

#include "Vtop.h"
#include "memory.hpp"
#include "verilated.h"
#include <stdexcept>

namespace {

// Ports that read and write: number, prefix of their pins.
#ifdef FLK_RENDERING
#define FLK_READERS(X) X(0, list_) X(1, record_)
#define FLK_WRITERS(X) X(2, )
constexpr int PORTS = 3;
#else
#define FLK_READERS(X) X(0, table_) X(1, geometry_) X(2, colour_)
#define FLK_WRITERS(X) X(3, )
constexpr int PORTS = 4;
#endif

struct Sim {
  Sim(const flk::dram::Timing& timing, bool perfect, const flk::AxiConfig* configs, uint64_t seed) : memory(timing, perfect) {
    for (int k = 0; k < PORTS; ++k) ports[k] = std::make_unique<flk::AxiPort>(memory, configs[k]);
    context.randReset(2);
    context.randSeed(static_cast<int>(seed % 0x7fffffff) + 1);
    top = std::make_unique<Vtop>(&context);
    top->clk_i = 0;
    top->rst_ni = 1;
    top->start_i = 0;
    top->eval();
    top->rst_ni = 0;
    for (int k = 0; k < 4; ++k) cycle(true);
  }

  ~Sim() { top->final(); }

#define FLK_DRIVE_R(k, prefix) FLK_AXI_DRIVE_READ(ports[k]->reply(), *top, prefix);
#define FLK_DRIVE_W(k, prefix) FLK_AXI_DRIVE_WRITE(ports[k]->reply(), *top, prefix);
#define FLK_SAMPLE_R(k, prefix) FLK_AXI_SAMPLE_READ(requests[k], *top, prefix);
#define FLK_SAMPLE_W(k, prefix) FLK_AXI_SAMPLE_WRITE(requests[k], *top, prefix);

  void drive() {
    FLK_READERS(FLK_DRIVE_R)
    FLK_WRITERS(FLK_DRIVE_W)
  }

  void sample() {
    FLK_READERS(FLK_SAMPLE_R)
    FLK_WRITERS(FLK_SAMPLE_W)
  }

  void cycle(bool reset) {
    top->rst_ni = !reset;
    drive();
    top->clk_i = 0;
    top->eval();
    sample();
    memory.tick();
    for (int k = 0; k < PORTS; ++k) reset ? ports[k]->reset(requests[k]) : ports[k]->cycle(requests[k]);
    top->clk_i = 1;
    top->eval();
  }

  bool broken() {
    for (auto& port : ports) {
      if (!port->errors().empty()) {
        error = port->errors().front();
        return true;
      }
    }
    return false;
  }

  VerilatedContext context;
  flk::Memory memory;
  std::unique_ptr<flk::AxiPort> ports[PORTS];
  flk::AxiRequest requests[PORTS] = {};
  std::unique_ptr<Vtop> top;
  std::string error;
};

std::string g_failure;

}  // namespace

// Called by the model where an assertion fails.
void vl_stop(const char* file, int line, const char*) VL_MT_UNSAFE { throw std::runtime_error(std::string(file) + ":" + std::to_string(line) + ": assertion failed"); }
void vl_fatal(const char* file, int line, const char*, const char* text) VL_MT_UNSAFE { throw std::runtime_error(std::string(file) + ":" + std::to_string(line) + ": " + text); }

extern "C" {

const char* flk_half_failure() { return g_failure.c_str(); }

Sim* flk_half_new(const flk::dram::Timing* timing, int perfect, const flk::AxiConfig* configs, uint64_t seed) {
  try {
    return new Sim(*timing, perfect != 0, configs, seed);
  } catch (const std::exception& e) {
    g_failure = e.what();
    return nullptr;
  }
}

void flk_half_delete(Sim* sim) { delete sim; }

// Allocates a range, filled with bytes that look random, and puts `size` bytes at its beginning.
int flk_half_load(Sim* sim, uint64_t base, uint64_t allocated, const uint8_t* bytes, uint64_t size, uint32_t purpose) {
  if (!sim->memory.store.allocate(base, allocated, 0x5eed)) return 0;
  if (size) std::memcpy(sim->memory.store.find(base, size), bytes, size);
  for (auto& port : sim->ports) port->purpose(base, allocated, purpose);
  return 1;
}

int flk_half_read(Sim* sim, uint64_t base, uint64_t size, uint8_t* bytes) {
  const uint8_t* at = sim->memory.store.find(base, size);
  if (!at) return 0;
  std::memcpy(bytes, at, size);
  return 1;
}

void flk_half_fail(Sim* sim, uint64_t base, uint64_t size) {
  for (auto& port : sim->ports) port->fail_range(base, size, true, true, flk::SLVERR);
}

void flk_half_mend(Sim* sim) {
  for (auto& port : sim->ports) port->mend_ranges();
}

// A frame: 1 done, 0 not within `limit` cycles, -1: a rule was broken (flk_half_failure). counters: words of counters_o; error: error_o.
int flk_half_frame(Sim* sim, const uint32_t* registers, int words, uint64_t limit, uint32_t* counters, int counter_words, uint32_t* error) {
  try {
    std::memcpy(&sim->top->registers_i[0], registers, sizeof(uint32_t) * words);
    const uint64_t begin = sim->memory.cycle;
    while (!sim->top->idle_o && sim->memory.cycle - begin < limit) sim->cycle(false);
    sim->top->start_i = 1;
    sim->cycle(false);
    sim->top->start_i = 0;
    bool done = false;
    for (uint64_t n = 0; n < limit && !done; ++n) {
      sim->cycle(false);
      done = sim->top->done_o;
      if ((n & 255) == 0 && sim->broken()) break;
    }
    if (sim->broken()) {
      g_failure = sim->error;
      return -1;
    }
    std::memcpy(counters, &sim->top->counters_o[0], sizeof(uint32_t) * counter_words);
    *error = sim->top->error_o;
    return done;
  } catch (const std::exception& e) {
    g_failure = e.what();
    return -1;
  }
}

double flk_half_efficiency(Sim* sim) { return sim->memory.efficiency(); }

// AxiCounts of a purpose over all ports, as uint64.
void flk_half_counts(Sim* sim, uint32_t purpose, uint64_t* out) {
  constexpr int N = sizeof(flk::AxiCounts) / sizeof(uint64_t);
  std::memset(out, 0, sizeof(flk::AxiCounts));
  for (auto& port : sim->ports) {
    auto found = port->counts().find(purpose);
    if (found == port->counts().end()) continue;
    const uint64_t* from = reinterpret_cast<const uint64_t*>(&found->second);
    for (int i = 0; i < N; ++i) out[i] += from[i];
  }
}
}
