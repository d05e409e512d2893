// Runs flk_preprocessing, with FLK_RENDERING flk_rendering, with FLK_CHIP flk_top against a memory (memory.hpp); called through ctypes by sim/half.py and
// sim/chip.py. Both halves have the same pins beside their AXI ports: start_i, idle_o, registers_i, done_o, error_o, counters_o; the chip has
// registers behind AXI4-Lite and an interrupt. FLK_SORT_UNITS, FLK_PREPROC_LANES, FLK_LIST_WRITERS: parameters of the half.
#include <algorithm>
#include <cstring>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "Vtop.h"
#ifndef FLK_CHIP
#include "Vtop___024root.h"
#endif
#include "memory.hpp"
#include "verilated.h"
#include <stdexcept>

namespace {

#if defined(FLK_CHIP)
constexpr int PORTS = 1;
#else
// Numbers of the ports behind the half's readers and writers, in the order of flk_rendering_pkg and flk_preproc_pkg.
#if defined(FLK_RENDERING)
constexpr int READERS[] = {1, 0}, WRITERS[] = {2};  // records, lists; frame buffer
constexpr int PORTS = 3;
#else
constexpr int READERS[] = {3, 2, 1, 0}, WRITERS[] = {3, 4};  // pointers, colours, geometry, table; pointers, lines
constexpr int PORTS = 5;
#endif
#endif

struct Sim {
  Sim(const flk::dram::Timing& timing, bool perfect, const flk::AxiConfig* configs, uint64_t seed) : memory(timing, perfect) {
    for (int k = 0; k < PORTS; ++k) ports[k] = std::make_unique<flk::AxiPort>(memory, configs[k]);
    context.randReset(2);
    context.randSeed(static_cast<int>(seed % 0x7fffffff) + 1);
    top = std::make_unique<Vtop>(&context);
    top->clk_i = 0;
    top->rst_ni = 1;
    stop();
#ifdef FLK_CHIP
    top->test_en_i = 1;  // resets of the halves follow rst_ni: its edge reaches them, whatever registers begin with
#endif
    top->eval();
    top->rst_ni = 0;
    top->eval();
    stop();
    for (int k = 0; k < 4; ++k) cycle(true);
    top->rst_ni = 1;
  }

  ~Sim() { top->final(); }

  // Nothing is asked of the design.
  void stop() {
#ifdef FLK_CHIP
    top->reg_aw_valid_i = top->reg_w_valid_i = top->reg_ar_valid_i = 0;
    top->reg_b_ready_i = top->reg_r_ready_i = 1;
    top->reg_aw_prot_i = top->reg_ar_prot_i = 0;
    top->reg_w_strb_i = 15;
    top->test_en_i = 0;
#else
    top->start_i = 0;
#endif
  }

  void drive() {
#ifdef FLK_CHIP
    FLK_AXI_DRIVE(ports[0]->reply(), *top, );
#else
    for (size_t k = 0; k < std::size(READERS); ++k) flk::channels::drive_read(ports[READERS[k]]->reply(), *top, k);
    for (size_t k = 0; k < std::size(WRITERS); ++k) flk::channels::drive_write(ports[WRITERS[k]]->reply(), *top, k);
#endif
  }

  void sample() {
#ifdef FLK_CHIP
    FLK_AXI_SAMPLE(requests[0], *top, );
    FLK_AXI_SAMPLE_QOS(requests[0], *top, );
#else
    for (size_t k = 0; k < std::size(READERS); ++k) flk::channels::sample_read(requests[READERS[k]], *top, k);
    for (size_t k = 0; k < std::size(WRITERS); ++k) flk::channels::sample_write(requests[WRITERS[k]], *top, k);
#endif
  }

  void cycle(bool reset) {
    top->rst_ni = !reset;
    settle();
    edge(reset);
  }

  // The two halves of a cycle: outputs as the edge sees them; the edge.
  void settle() {
    drive();
    top->clk_i = 0;
    top->eval();
  }

  void edge(bool reset = false) {
    sample();
#ifdef FLK_RENDERING
    count_records();
#endif
#ifndef FLK_CHIP
    count_waits();
#endif
    memory.tick();
    for (int k = 0; k < PORTS; ++k) reset || away ? ports[k]->reset(requests[k], reset) : ports[k]->cycle(requests[k]);
    top->clk_i = 1;
    top->eval();
  }

#ifdef FLK_RENDERING
  // Records that delivery gives for each sub-tile of a tile, FLK_RENDERING a core at a time at most, by tile (rendering_watched.vlt). Sub-tile s is of core
  // s mod FLK_CORES.
  void count_records() {
    const auto& root = *top->rootp;
    for (int e = 0; root.flk_rendering__DOT__record_valid >> e; ++e) {
      const int k = e / FLK_RENDERING;
      if (!(root.flk_rendering__DOT__record_valid >> e & root.flk_rendering__DOT__record_ready >> k & 1)) continue;
      if (root.flk_rendering__DOT__record_end >> e & 1) {
        for (int s = k; s < SUBTILES; s += FLK_CORES) {
          given[s].push_back(records[s]);
          records[s] = 0;
        }
      } else {
        ++records[root.flk_rendering__DOT__record_subtile >> 2 * e & 3];
      }
    }
  }
#endif

#ifndef FLK_CHIP
  static int ones(unsigned bits) { return __builtin_popcount(bits); }

  // What the design's counters of waits should say, in their order; those of which it knows nothing stay -1.
  void count_waits() {
    const auto& root = *top->rootp;
#ifdef FLK_RENDERING
#define FLK_OF(name) root.flk_rendering__DOT__##name
    unsigned first = 0;
    for (int k = 0; k < FLK_CORES; ++k) first |= (FLK_OF(record_valid) >> k * FLK_RENDERING & 1) << k;
    const unsigned valid = FLK_OF(entry_valid) >> 2 * turn & 3, ready = FLK_OF(entry_ready) >> turn & 1;
    const int now[WAITS] = {
        ones(FLK_OF(list_valid) & ~FLK_OF(list_ready)), ones(FLK_OF(sorted_valid) & ~FLK_OF(sorted_ready)), ready && !valid && !FLK_OF(pixels_done),
        valid && !ready, -1, -1, ones(first & ~FLK_OF(record_ready)), ones(FLK_OF(has) & ~FLK_OF(open)), FLK_OF(line_valid) && !FLK_OF(line_ready),
    };
    if (ready && (valid & FLK_OF(entry_end) >> 2 * turn)) turn = (turn + 1) % FLK_SORT_UNITS;
#else
#define FLK_OF(name) root.flk_preprocessing__DOT__##name
    const bool leaves = FLK_OF(exit_valid), lanes = FLK_OF(lane_ready) == (1 << FLK_PREPROC_LANES) - 1, places = FLK_OF(record_room);
    const int now[WAITS] = {
        FLK_OF(kept_valid) && !FLK_OF(kept_ready), -1, leaves && !lanes, leaves && lanes && !places, leaves && lanes && places && !FLK_OF(colour_room),
        ones(FLK_OF(part_valid) & ~FLK_OF(part_ready)), ones(FLK_OF(record_valid) & ~FLK_OF(record_ready)), ones(FLK_OF(entry_valid) & ~FLK_OF(entry_ready)),
        ones(FLK_OF(merged_valid) & ~FLK_OF(merged_ready)), ones(FLK_OF(out_valid) & ~FLK_OF(out_ready) & ((1 << FLK_LIST_WRITERS) - 1)),
        FLK_OF(line_valid) && !FLK_OF(line_ready),
    };
#endif
#undef FLK_OF
    for (int k = 0; k < WAITS; ++k) waits[k] = now[k] < 0 ? -1 : waits[k] + now[k];
  }
#endif

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
  static constexpr int SUBTILES = 4;      // of a tile
  std::vector<uint32_t> given[SUBTILES];  // in this frame, of each list that has ended
  uint32_t records[SUBTILES] = {};
#ifdef FLK_RENDERING
  static constexpr int WAITS = 9;
  int turn = 0;  // sorting unit that delivery takes from
#else
  static constexpr int WAITS = 11;
#endif
#ifndef FLK_CHIP
  int64_t waits[WAITS] = {};  // in this frame
#endif
  std::string error;
  bool away = false;  // the memory is in reset, the design is not
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

// Into a range that is allocated.
int flk_half_write(Sim* sim, uint64_t base, uint64_t size, const uint8_t* bytes) {
  uint8_t* at = sim->memory.store.find(base, size);
  if (at) std::memcpy(at, bytes, size);
  return at != nullptr;
}

int flk_half_read(Sim* sim, uint64_t base, uint64_t size, uint8_t* bytes) {
  const uint8_t* at = sim->memory.store.find(base, size);
  if (!at) return 0;
  std::memcpy(bytes, at, size);
  return 1;
}

void flk_half_fail(Sim* sim, uint64_t base, uint64_t size, int writes) {
  for (auto& port : sim->ports) port->fail_range(base, size, true, writes != 0, flk::SLVERR);
}

void flk_half_mend(Sim* sim) {
  for (auto& port : sim->ports) {
    port->mend_ranges();
    port->resume();
  }
}

#ifdef FLK_CHIP
// A register is written, or read into *value: 1; -1: a rule was broken, or no answer within 1,000 cycles (flk_half_failure); -2: an answer other than OKAY.
int flk_chip_register(Sim* sim, uint32_t offset, int write, uint32_t* value) {
  try {
    Vtop& top = *sim->top;
    bool address = true, data = write != 0;
    for (int n = 0; n < 1000; ++n) {
      top.reg_aw_valid_i = write && address;
      top.reg_w_valid_i = data;
      top.reg_ar_valid_i = !write && address;
      top.reg_aw_addr_i = top.reg_ar_addr_i = offset;
      top.reg_w_data_i = *value;
      // Ready and valid as the edge sees them: inputs have settled.
      sim->settle();
      const bool address_moves = address && (write ? top.reg_aw_ready_o : top.reg_ar_ready_o), data_moves = data && top.reg_w_ready_o;
      const bool answers = write ? top.reg_b_valid_o : top.reg_r_valid_o;
      const int answer = write ? top.reg_b_resp_o : top.reg_r_resp_o;
      const uint32_t read = top.reg_r_data_o;
      sim->edge();
      address &= !address_moves;
      data &= !data_moves;
      if (!answers) continue;
      sim->stop();
      if (!write) *value = read;
      return answer == 0 ? 1 : -2;
    }
    g_failure = "a register does not answer";
  } catch (const std::exception& e) {
    g_failure = e.what();
  }
  sim->stop();
  return -1;
}

// Cycles until the interrupt is high (with `interrupt`), at most `limit`: how many; -1: a rule was broken.
int64_t flk_chip_wait(Sim* sim, uint64_t limit, int interrupt) {
  try {
    uint64_t n = 0;
    while (n < limit && !(interrupt && sim->top->irq_o)) {
      sim->cycle(false);
      if ((++n & 255) == 0 && sim->broken()) break;
    }
    if (sim->broken()) {
      g_failure = sim->error;
      return -1;
    }
    return static_cast<int64_t>(n);
  } catch (const std::exception& e) {
    g_failure = e.what();
    return -1;
  }
}

// A cycle of the chip between somebody else's pins, not its own memory: inputs as the edge sees them, outputs behind it. Words as in soc/flk_top_axi_shim.sv.
void flk_chip_pins(Sim* sim, int reset, const uint32_t* in, uint32_t* out) {
  Vtop& top = *sim->top;
  auto bits = [&](int word, int low, int count) { return in[word] >> low & ((1u << count) - 1); };
  top.rst_ni = !reset;
  top.test_en_i = bits(0, 0, 1);
  top.ar_ready_i = bits(0, 1, 1);
  top.w_ready_i = bits(0, 2, 1);
  top.aw_ready_i = bits(0, 3, 1);
  top.reg_r_ready_i = bits(0, 4, 1);
  top.reg_ar_valid_i = bits(0, 5, 1);
  top.reg_b_ready_i = bits(0, 6, 1);
  top.reg_w_valid_i = bits(0, 7, 1);
  top.reg_aw_valid_i = bits(0, 8, 1);
  top.reg_w_strb_i = bits(0, 9, 4);
  top.reg_aw_addr_i = bits(1, 0, 10);
  top.reg_ar_addr_i = bits(1, 10, 10);
  top.reg_w_data_i = in[2];
  top.b_id_i = bits(3, 0, 7);
  top.b_resp_i = bits(3, 7, 2);
  top.b_valid_i = bits(3, 9, 1);
  top.r_id_i = bits(3, 10, 7);
  top.r_resp_i = bits(3, 17, 2);
  top.r_valid_i = bits(3, 19, 1);
  top.r_last_i = bits(3, 20, 1);
  if (top.r_valid_i) flk::pins::store(top.r_data_i, in + 4);
  top.clk_i = 0;
  top.eval();
  top.clk_i = 1;
  top.eval();
  auto join = [](std::initializer_list<std::pair<uint32_t, int>> fields) {
    uint32_t word = 0;
    for (auto [value, count] : fields) word = word << count | value;
    return word;
  };
  std::memset(out, 0, 4 * 29);
  out[0] = join({{top.irq_o, 1}, {top.reg_aw_ready_o, 1}, {top.reg_w_ready_o, 1}, {top.reg_b_valid_o, 1}, {top.reg_b_resp_o, 2}, {top.reg_ar_ready_o, 1},
                 {top.reg_r_valid_o, 1}, {top.reg_r_resp_o, 2}, {top.b_ready_o, 1}, {top.r_ready_o, 1}, {top.w_valid_o, 1}, {top.w_last_o, 1}});
  out[1] = top.reg_r_data_o;
  const uint64_t aw = top.aw_addr_o, ar = top.ar_addr_o, strb = top.w_strb_o;
  std::memcpy(out + 2, &aw, 8);
  out[4] = join({{top.aw_id_o, 7}, {top.aw_len_o, 8}, {top.aw_size_o, 3}, {top.aw_burst_o, 2}, {top.aw_qos_o, 4}, {top.aw_valid_o, 1}});
  std::memcpy(out + 5, &ar, 8);
  out[7] = join({{top.ar_id_o, 7}, {top.ar_len_o, 8}, {top.ar_size_o, 3}, {top.ar_burst_o, 2}, {top.ar_qos_o, 4}, {top.ar_valid_o, 1}});
  std::memcpy(out + 8, &strb, 8);
  if (top.w_valid_o) flk::pins::load(top.w_data_o, out + 10);
}

// The memory's side of the port is held in reset (1) or no more (0).
void flk_chip_hold_memory(Sim* sim, int hold) { sim->away = hold != 0; }

// Whether nothing is under way.
int flk_chip_quiet(Sim* sim) { return sim->ports[0]->idle(); }
#else
// A frame: 1 done, 0 not within `limit` cycles, -1: a rule was broken (flk_half_failure). counters: words of counters_o; error: error_o.
int flk_half_frame(Sim* sim, const uint32_t* registers, int words, uint64_t limit, uint32_t* counters, int counter_words, uint32_t* error) {
  try {
    std::memcpy(&sim->top->registers_i[0], registers, sizeof(uint32_t) * words);
    const uint64_t begin = sim->memory.cycle;
    while (!sim->top->idle_o && sim->memory.cycle - begin < limit) sim->cycle(false);
    for (int s = 0; s < Sim::SUBTILES; ++s) {
      sim->given[s].clear();
      sim->records[s] = 0;
    }
    sim->top->start_i = 1;
    sim->cycle(false);
    sim->top->start_i = 0;
    std::fill_n(sim->waits, Sim::WAITS, 0);
#ifdef FLK_RENDERING
    sim->turn = 0;
#endif
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

// Cycles of the last frame in which something waited, as the harness counted them.
int flk_half_waits(Sim* sim, int64_t* out) {
  std::copy_n(sim->waits, Sim::WAITS, out);
  return Sim::WAITS;
}
#endif

// Records that a core got for a sub-tile of each list of the last frame; at most `size` lists. How many lists there were.
int flk_half_given(Sim* sim, int subtile, uint32_t* out, int size) {
  const auto& lists = sim->given[subtile];
  std::copy_n(lists.begin(), std::min<size_t>(lists.size(), size), out);
  return static_cast<int>(lists.size());
}

// Of all frames until now.
void flk_half_dram(Sim* sim, flk::dram::Counts* out) { *out = sim->memory.engine.counts(); }

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
