// Runs axi_traffic against a memory port; test_memory_port.py. The loop is the one of docs/reference/memory_model.md.
#include <cstring>
#include <string>

#include "Vtop.h"
#include "memory.hpp"
#include "verilated.h"

namespace {
std::string g_error;
}

extern "C" {

struct Result {
  uint64_t cycles, bad_beats, bad_answers, read_beats, write_beats, bursts;
};

const char* traffic_error() { return g_error.c_str(); }

// 1: done, 0: not within `limit` cycles, -1: a rule was broken.
int traffic_run(const flk::dram::Timing* timing, int perfect, const flk::AxiConfig* config, uint64_t base, uint64_t size, int fill, int64_t fail_write, uint64_t limit, Result* result) {
  g_error.clear();
  flk::Memory memory(*timing, perfect != 0);
  flk::AxiPort port(memory, *config);
  memory.store.allocate(base, size);
  std::memset(memory.store.find(base, size), fill, size);
  if (fail_write >= 0) port.fail_write(static_cast<uint64_t>(fail_write));
  VerilatedContext context;
  Vtop top(&context);
  flk::AxiRequest request{};
  top.base_i = base;
  top.fill_i = static_cast<uint8_t>(fill);
  top.clk_i = 0;
  top.rst_ni = 1;
  top.eval();
  top.rst_ni = 0;

  auto cycle = [&](bool reset) {
    top.rst_ni = !reset;
    FLK_AXI_DRIVE(port.reply(), top, mem_);
    top.clk_i = 0;
    top.eval();
    FLK_AXI_SAMPLE(request, top, mem_);
    memory.tick();
    reset ? port.reset(request) : port.cycle(request);
    top.clk_i = 1;
    top.eval();
  };

  for (int k = 0; k < 3; ++k) cycle(true);
  while (!top.done_o && memory.cycle < limit && port.errors().empty()) cycle(false);
  *result = {memory.cycle, top.bad_beats_o, top.bad_answers_o, port.transfers(flk::R), port.transfers(flk::W), static_cast<uint64_t>(memory.engine.counts().bursts)};
  if (!port.errors().empty()) g_error = port.errors().front();
  const bool done = top.done_o;
  top.final();
  return g_error.empty() ? done : -1;
}
}
