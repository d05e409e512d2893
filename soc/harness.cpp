// A SoC of soc/soc.py, verilated, with the memory of model/flicker/sim/memory.hpp behind its two ports; called through ctypes by soc/simulation.py.
//
// One memory: the chip's AXI4 port and the CPU's Wishbone port meet in it, with the timing of its DRAM. The CPU's port reads a line of 64 bytes and gives the words
// of one burst from it; it keeps nothing beyond the burst. A write waits for its answer. The UART's bytes come and go without delay.
#include <cstring>
#include <deque>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "Vtop.h"
#include "Vtop_VexRiscv.h"
#include "Vtop___024root.h"
#include "Vtop_flk_soc.h"
#include "memory.hpp"
#include "verilated.h"
#ifdef FLK_SHIM
#include "svdpi.h"
#endif

namespace {

constexpr uint64_t LINE = 64;
enum { CHIP, CPU, PORTS };

#ifdef FLK_SHIM
// The chip's simulator, where it is another library (flk_top_axi_shim.sv).
using Pins = void (*)(void* chip, int reset, const uint32_t* in, uint32_t* out);
Pins g_pins;
thread_local void* g_chip;
#endif

struct Soc {
  Soc(const std::string& folder, const flk::dram::Timing& timing, bool perfect, const flk::AxiConfig* configs, uint64_t seed, void* chip)
      : memory(timing, perfect), chip(chip) {
    for (int k = 0; k < PORTS; ++k) ports[k] = std::make_unique<flk::AxiPort>(memory, configs[k]);
    context.randReset(2);
    context.randSeed(static_cast<int>(seed % 0x7fffffff) + 1);
    // The model reads its ROM's contents from the folder that it was emitted to.
    const auto here = std::filesystem::current_path();
    std::filesystem::current_path(folder);
    top = std::make_unique<Vtop>(&context);
    top->sys_clk = 0;
    top->sys_rst = 1;
    top->sim_trace = 0;
    top->serial_sink_valid = 0;
    top->serial_sink_data = 0;
    top->serial_source_ready = 1;
    top->ram_ack = top->ram_err = 0;
    top->ram_dat_r = 0;
    top->eval();
    std::filesystem::current_path(here);
    // Registers begin with anything: until the reset has reached them, assertions of them say nothing.
    context.assertOn(false);
    for (int k = 0; k < 16; ++k) cycle(true);
    context.assertOn(true);
  }

  ~Soc() { top->final(); }

  void drive() {
    const flk::AxiReply& p = ports[CHIP]->reply();
    top->mem_aw_ready = p.aw_ready;
    top->mem_w_ready = p.w_ready;
    top->mem_ar_ready = p.ar_ready;
    top->mem_b_valid = p.b_valid;
    top->mem_b_id = p.b_id;
    top->mem_b_resp = p.b_resp;
    top->mem_r_valid = p.r_valid;
    top->mem_r_id = p.r_id;
    top->mem_r_resp = p.r_resp;
    top->mem_r_last = p.r_last;
    if (p.r_valid) flk::pins::store(top->mem_r_data, p.r_data);
    top->serial_sink_valid = !input.empty();
    top->serial_sink_data = input.empty() ? 0 : input.front();
  }

  void sample() {
    flk::AxiRequest& q = requests[CHIP];
    q.aw = {top->mem_aw_addr, top->mem_aw_id, top->mem_aw_valid, top->mem_aw_len, top->mem_aw_size, top->mem_aw_burst, top->mem_aw_qos};
    q.ar = {top->mem_ar_addr, top->mem_ar_id, top->mem_ar_valid, top->mem_ar_len, top->mem_ar_size, top->mem_ar_burst, top->mem_ar_qos};
    q.w_valid = top->mem_w_valid;
    if (q.w_valid) {
      flk::pins::load(top->mem_w_data, q.w_data);
      q.w_strb = top->mem_w_strb;
      q.w_last = top->mem_w_last;
    }
    q.b_ready = top->mem_b_ready;
    q.r_ready = top->mem_r_ready;
  }

  // ---- the CPU's port ----

  // In a cycle whose outputs have settled without an answer: gives one if it is there.
  void answer_cpu() {
    if (!top->ram_cyc || !top->ram_stb) {
      line_there = false;
      return;
    }
    const uint64_t address = uint64_t{top->ram_adr} << 2;
    if (top->ram_we) {
      if (!write_done) return;
    } else {
      if (!line_there || address / LINE != line / LINE) return;
      std::memcpy(&top->ram_dat_r, reinterpret_cast<const uint8_t*>(data) + address % LINE, 4);
    }
    top->ram_ack = resp == flk::OKAY;
    top->ram_err = resp != flk::OKAY;
    top->eval();
  }

  // The edge that ends a cycle: requests follow from what the CPU drove in it.
  void follow_cpu(bool reset) {
    const bool answered = top->ram_ack || top->ram_err;
    flk::AxiRequest& q = requests[CPU];
    const flk::AxiReply& p = ports[CPU]->reply();
    if (reset) {
      q = {};
      busy = line_there = write_done = false;
      return;
    }
    if (answered) {
      write_done = false;
      if (top->ram_we || top->ram_cti != 2) line_there = false;
    }
    if (q.ar.valid && p.ar_ready) q.ar.valid = 0;
    if (q.aw.valid && p.aw_ready) q.aw.valid = 0;
    if (q.w_valid && p.w_ready) q.w_valid = 0;
    if (p.r_valid) {
      std::memcpy(data, p.r_data, sizeof data);
      resp = p.r_resp;
      line_there = true;
      busy = false;
    }
    if (p.b_valid) {
      resp = p.b_resp;
      write_done = true;
      busy = false;
    }
    if (busy || answered || write_done || !top->ram_cyc || !top->ram_stb) return;
    const uint64_t address = uint64_t{top->ram_adr} << 2;
    if (!top->ram_we && line_there && address / LINE == line / LINE) return;
    busy = true;
    line_there = false;
    line = address / LINE * LINE;
    const flk::AxiAddress a = {line, 0, 1, 0, 6, 1, 15};
    if (!top->ram_we) {
      next_ar = a;
      return;
    }
    next_aw = a;
    const uint32_t word = top->ram_dat_w;
    std::memset(next_data, 0, sizeof next_data);
    next_data[address % LINE / 4] = word;
    next_strb = uint64_t{top->ram_sel} << address % LINE;
  }

  void present() {
    flk::AxiRequest& q = requests[CPU];
    q.b_ready = q.r_ready = 1;
    if (next_ar.valid) {
      q.ar = next_ar;
      next_ar.valid = 0;
    }
    if (next_aw.valid) {
      q.aw = next_aw;
      q.w_valid = q.w_last = 1;
      q.w_strb = next_strb;
      std::memcpy(q.w_data, next_data, sizeof next_data);
      next_aw.valid = 0;
    }
  }

  // ---- cycles ----

  void cycle(bool reset) {
#ifdef FLK_SHIM
    g_chip = chip;
#endif
    top->sys_rst = reset;
    drive();
    top->ram_ack = top->ram_err = 0;
    top->sys_clk = 0;
    top->eval();
    answer_cpu();
    sample();
    present();
    memory.tick();
    if (top->serial_source_valid) output.push_back(static_cast<char>(top->serial_source_data));
    if (!reset && !input.empty() && top->serial_sink_ready) input.pop_front();
    asleep += top->rootp->flk_soc->VexRiscv->CsrPlugin_inWfi;
    const flk::AxiRequest cpu = requests[CPU];
    follow_cpu(reset);
    if (reset) {
      for (int k = 0; k < PORTS; ++k) ports[k]->reset(k == CPU ? cpu : requests[k], false);
    } else {
      ports[CHIP]->cycle(requests[CHIP]);
      ports[CPU]->cycle(cpu);
    }
    top->sys_clk = 1;
    top->eval();
  }

  VerilatedContext context;
  flk::Memory memory;
  std::unique_ptr<flk::AxiPort> ports[PORTS];
  flk::AxiRequest requests[PORTS] = {};
  std::unique_ptr<Vtop> top;
  void* chip = nullptr;  // its simulator, if that is another library
  std::string output;
  std::deque<uint8_t> input;
  uint64_t asleep = 0;  // cycles of the CPU in wfi
  // The CPU's port.
  bool busy = false, line_there = false, write_done = false;
  uint64_t line = 0, next_strb = 0;
  uint32_t data[LINE / 4] = {}, next_data[LINE / 4] = {};
  uint8_t resp = 0;
  flk::AxiAddress next_ar = {}, next_aw = {};
};

std::string g_failure;

}  // namespace

// Called by the model where an assertion fails.
void vl_stop(const char* file, int line, const char*) VL_MT_UNSAFE { throw std::runtime_error(std::string(file) + ":" + std::to_string(line) + ": assertion failed"); }
void vl_fatal(const char* file, int line, const char*, const char* text) VL_MT_UNSAFE { throw std::runtime_error(std::string(file) + ":" + std::to_string(line) + ": " + text); }

extern "C" {

#ifdef FLK_SHIM
void flk_soc_pins(Pins pins) { g_pins = pins; }

void flk_shim_cycle(const svBitVecVal* reset, const svBitVecVal* in, svBitVecVal* out) { g_pins(g_chip, *reset & 1, in, out); }
#endif

const char* flk_soc_failure() { return g_failure.c_str(); }

// folder: where the SoC was emitted to. configs: of the chip's port, of the CPU's. chip: its simulator, if that is another library.
Soc* flk_soc_new(const char* folder, const flk::dram::Timing* timing, int perfect, const flk::AxiConfig* configs, uint64_t seed, void* chip) {
  try {
    return new Soc(folder, *timing, perfect != 0, configs, seed, chip);
  } catch (const std::exception& e) {
    g_failure = e.what();
    return nullptr;
  }
}

void flk_soc_delete(Soc* soc) { delete soc; }

// RAM, filled with bytes that look random.
int flk_soc_allocate(Soc* soc, uint64_t base, uint64_t size) { return soc->memory.store.allocate(base, size, 0x5eed); }

int flk_soc_write(Soc* soc, uint64_t base, uint64_t size, const uint8_t* bytes) {
  uint8_t* at = soc->memory.store.find(base, size);
  if (at) std::memcpy(at, bytes, size);
  return at != nullptr;
}

int flk_soc_read(Soc* soc, uint64_t base, uint64_t size, uint8_t* bytes) {
  const uint8_t* at = soc->memory.store.find(base, size);
  if (at) std::memcpy(bytes, at, size);
  return at != nullptr;
}

// So many cycles: 1, or 0 with flk_soc_failure: a rule of AXI or an assertion was broken.
int flk_soc_run(Soc* soc, uint64_t cycles) {
  try {
    for (uint64_t n = 0; n < cycles; ++n) soc->cycle(false);
    for (auto& port : soc->ports) {
      if (port->errors().empty()) continue;
      g_failure = port->errors().front();
      return 0;
    }
    return 1;
  } catch (const std::exception& e) {
    g_failure = e.what();
    return 0;
  }
}

// What the UART has sent since the last call, at most `size` bytes: how many.
int flk_soc_output(Soc* soc, char* to, int size) {
  const int n = std::min<int>(size, static_cast<int>(soc->output.size()));
  std::memcpy(to, soc->output.data(), n);
  soc->output.erase(0, n);
  return n;
}

void flk_soc_input(Soc* soc, const uint8_t* bytes, int size) { soc->input.insert(soc->input.end(), bytes, bytes + size); }

uint64_t flk_soc_cycles(Soc* soc) { return soc->memory.cycle; }
uint64_t flk_soc_asleep(Soc* soc) { return soc->asleep; }
}
