// Harness of whole frames: feeds the sorted lists of a frame to the verilated rendering stage, collects pixels and counters.
//
// Called from Python through ctypes (render_stage.py); works on the arrays of flicker.golden.records.SubtileLists in place.
// Every pixel of every streamed sub-tile must arrive exactly once, from the core that has the sub-tile; anything else, a failed
// assertion, or HANG_CYCLES without any transfer ends the run with an error.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "Vtop.h"
#include "verilated.h"

namespace {

constexpr int CORES = 4;
constexpr int ELEM_WORDS = 5;
constexpr int PIXEL_WORDS = 3;
constexpr uint64_t HANG_CYCLES = 100000;
std::string g_fatal;  // message of a failed assertion

struct Frame {
  const uint16_t* gauss;      // (N, 9), feature_t order
  const uint8_t* spiky;       // (N)
  const int64_t* start;       // (S + 1)
  const int32_t* entry;       // (E)
  const uint16_t* mean;       // (E, 2)
  const int64_t* order;       // sub-tiles core by core
  const int64_t* core_start;  // (CORES + 1)
  int64_t cols;
  int64_t subtiles;
  uint16_t* pixels;  // (S, 64, 4): transmittance, red, green, blue
};

struct Random {
  uint64_t s;
  // True in `per256` of 256 draws.
  bool operator()(uint32_t per256) {
    if (per256 == 0) return false;
    s ^= s << 13;
    s ^= s >> 7;
    s ^= s << 17;
    return (s >> 24 & 255) < per256;
  }
};

class Simulation {
 public:
  Simulation(const Frame& frame, int mode, uint64_t seed, uint32_t idle, uint32_t stall)
      : frame_(frame), idle_(idle), stall_(stall), random_{seed * 2654435761u + 88172645463325252ull},
        seen_(frame.subtiles * 64, 0), owner_(frame.subtiles, -1) {
    g_fatal.clear();
    context_.randReset(2);
    context_.randSeed(static_cast<int>(seed & 0x7fffffff) + 1);
    top_ = std::make_unique<Vtop>(&context_);
    for (int k = 0; k < CORES; ++k) {
      next_[k] = frame.core_start[k];
      for (int64_t i = frame.core_start[k]; i < frame.core_start[k + 1]; ++i) owner_[frame.order[i]] = k;
      expected_ += 64 * (frame.core_start[k + 1] - frame.core_start[k]);
      item_[k] = next_[k] < frame.core_start[k + 1] ? frame.start[frame.order[next_[k]]] : 0;
      holding_[k] = false;
    }
    top_->mode_i = mode;
    top_->in_valid_i = 0;
    top_->out_ready_i = 0;
    top_->rst_ni = 1;
    top_->clk_i = 0;
    top_->eval();
    top_->rst_ni = 0;
    for (int i = 0; i < 4; ++i) edge();
    top_->rst_ni = 1;
  }
  ~Simulation() { top_->final(); }

  // Runs up to `cycles` cycles. 1: every pixel has arrived, 0: not yet, -1: error.
  int run(uint64_t cycles) {
    for (uint64_t n = 0; n < cycles && error_.empty(); ++n) {
      if (received_ == expected_) return drain() ? 1 : -1;
      cycle();
      if (!g_fatal.empty()) error_ = g_fatal;
      if (cycles_ - last_transfer_ > HANG_CYCLES) error_ = "no transfer for " + std::to_string(HANG_CYCLES) + " cycles";
    }
    if (!error_.empty()) return -1;
    return received_ == expected_ ? (drain() ? 1 : -1) : 0;
  }

  uint64_t cycles_ = 0;
  uint64_t received_ = 0;
  uint64_t expected_ = 0;
  std::string error_;
  const uint32_t* counters() { return counters_.data(); }
  size_t counter_words() { return sizeof(top_->counters_o) / sizeof(uint32_t); }

 private:
  void edge() {
    top_->clk_i = 0;
    top_->eval();
    top_->clk_i = 1;
    top_->eval();
  }

  // The element at the head of core k's list, into the input words.
  void load(int k) {
    const int64_t s = frame_.order[next_[k]];
    uint32_t* w = &top_->in_elem_i[k * ELEM_WORDS];
    std::memset(w, 0, ELEM_WORDS * sizeof(uint32_t));
    if (item_[k] == frame_.start[s + 1]) {
      w[0] = static_cast<uint32_t>((s / frame_.cols) << 12 | s % frame_.cols);
      w[4] = 1u << 17;
      return;
    }
    const int32_t i = frame_.entry[item_[k]];
    uint16_t f[10];
    std::memcpy(f, &frame_.gauss[i * 9], 18);
    f[0] = frame_.mean[item_[k] * 2];
    f[1] = frame_.mean[item_[k] * 2 + 1];
    f[9] = frame_.spiky[i] ? 1 : 0;
    for (int j = 0; j < ELEM_WORDS; ++j) w[j] = f[2 * j] | static_cast<uint32_t>(f[2 * j + 1]) << 16;
  }

  void accepted(int k) {
    holding_[k] = false;
    const int64_t s = frame_.order[next_[k]];
    if (item_[k] == frame_.start[s + 1]) {
      ++next_[k];
      if (next_[k] < frame_.core_start[k + 1]) item_[k] = frame_.start[frame_.order[next_[k]]];
    } else {
      ++item_[k];
    }
  }

  void pixel(int k) {
    const uint32_t* w = &top_->out_data_o[k * PIXEL_WORDS];
    const int64_t index = w[2] & 63;  // mini-tile and pixel
    const int64_t col = w[2] >> 6 & 4095;
    const int64_t row = w[2] >> 18 & 4095;
    const int64_t s = row * frame_.cols + col;
    if (col >= frame_.cols || s >= frame_.subtiles || owner_[s] != k) {
      error_ = "core " + std::to_string(k) + " sent a pixel of sub-tile (" + std::to_string(col) + ", " + std::to_string(row) + ")";
      return;
    }
    if (seen_[s * 64 + index]++) {
      error_ = "pixel " + std::to_string(index) + " of sub-tile " + std::to_string(s) + " sent twice";
      return;
    }
    uint16_t* p = &frame_.pixels[(s * 64 + index) * 4];
    p[0] = w[1] >> 16;
    p[1] = w[1] & 0xffff;
    p[2] = w[0] >> 16;
    p[3] = w[0] & 0xffff;
    ++received_;
  }

  void cycle() {
    // Once offered, an element stays until taken.
    for (int k = 0; k < CORES; ++k) {
      if (!holding_[k] && next_[k] < frame_.core_start[k + 1] && !random_(idle_)) {
        load(k);
        holding_[k] = true;
      }
    }
    uint8_t valid = 0, ready = 0;
    for (int k = 0; k < CORES; ++k) {
      valid |= holding_[k] << k;
      ready |= !random_(stall_) << k;
    }
    top_->in_valid_i = valid;
    top_->out_ready_i = ready;
    top_->clk_i = 0;
    top_->eval();
    const uint8_t taken = valid & top_->in_ready_o;
    const uint8_t given = ready & top_->out_valid_o;
    for (int k = 0; k < CORES; ++k) {
      if (given >> k & 1) pixel(k);
    }
    top_->clk_i = 1;
    top_->eval();
    ++cycles_;
    for (int k = 0; k < CORES; ++k) {
      if (taken >> k & 1) accepted(k);
    }
    if (taken || given) last_transfer_ = cycles_;
    if (received_ == expected_) {
      // The counters are one cycle late.
      top_->in_valid_i = 0;
      edge();
      save_counters();
    }
  }

  void save_counters() {
    const uint32_t* first = reinterpret_cast<const uint32_t*>(&top_->counters_o);
    counters_.assign(first, first + counter_words());
  }

  // After the last pixel: every list must be consumed, and nothing more may come.
  bool drain() {
    for (int k = 0; k < CORES; ++k) {
      if (next_[k] != frame_.core_start[k + 1]) error_ = "core " + std::to_string(k) + " did not take its whole list";
    }
    top_->in_valid_i = 0;
    top_->out_ready_i = (1 << CORES) - 1;
    for (int i = 0; i < 64; ++i) {
      edge();
      if (top_->out_valid_o) error_ = "pixels after the last one";
    }
    if (counters_.empty()) save_counters();
    return error_.empty();
  }

  Frame frame_;
  uint32_t idle_, stall_;
  Random random_;
  std::vector<uint8_t> seen_;
  std::vector<int> owner_;
  VerilatedContext context_;
  std::unique_ptr<Vtop> top_;
  int64_t next_[CORES], item_[CORES];
  bool holding_[CORES];
  uint64_t last_transfer_ = 0;
  std::vector<uint32_t> counters_;
};

}  // namespace

// Failed assertions must not end the Python process.
void vl_stop(const char* file, int line, const char*) VL_MT_UNSAFE {
  if (g_fatal.empty()) g_fatal = std::string("assertion failed at ") + file + ":" + std::to_string(line);
}
void vl_fatal(const char* file, int line, const char*, const char* message) VL_MT_UNSAFE {
  if (g_fatal.empty()) g_fatal = std::string(message) + " at " + file + ":" + std::to_string(line);
}

extern "C" {
void* flk_sim_new(const Frame* frame, int mode, uint64_t seed, uint32_t idle, uint32_t stall) {
  return new Simulation(*frame, mode, seed, idle, stall);
}
int flk_sim_run(void* sim, uint64_t cycles) { return static_cast<Simulation*>(sim)->run(cycles); }
uint64_t flk_sim_cycles(void* sim) { return static_cast<Simulation*>(sim)->cycles_; }
uint64_t flk_sim_received(void* sim) { return static_cast<Simulation*>(sim)->received_; }
const char* flk_sim_error(void* sim) { return static_cast<Simulation*>(sim)->error_.c_str(); }
void flk_sim_counters(void* sim, uint32_t* out) {
  auto* s = static_cast<Simulation*>(sim);
  std::memcpy(out, s->counters(), s->counter_words() * sizeof(uint32_t));
}
void flk_sim_delete(void* sim) { delete static_cast<Simulation*>(sim); }
}
