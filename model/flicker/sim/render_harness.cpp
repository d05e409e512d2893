// Harness of whole frames: feeds the sorted lists of a frame to the verilated rendering stage, collects pixels and counters.
//
// Called from Python through ctypes (render_stage.py). What it knows of sizes and bits comes from a generated header (generate.py).
// Every pixel of every streamed sub-tile must arrive exactly once, from the core that has the sub-tile; idle_o must be high when
// nothing is in the stage or offered, and low when something is inside; mode_i has the frame's mode only while idle_o is high, another one from the first element on. Anything else, a
// failed assertion (of a build that has them), or HANG_CYCLES without any transfer ends the run with an error.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "Vtop.h"
#include "flk_sim_layout.h"
#include "verilated.h"

namespace {

using namespace layout;
constexpr uint64_t HANG_CYCLES = 100000;
constexpr int64_t LIST_PIXELS = SHARE * SUBTILE_PIXELS;
std::string g_fatal;  // message of a failed assertion

struct Frame {
  const uint32_t* element;    // (E, ELEM_WORDS), packed, not tokens
  const int64_t* which;       // (E), of these, in the order of the lists
  const int64_t* member;      // (E), which sub-tile of the list each is for
  const int64_t* start;       // (L + 1), of each list
  const int64_t* subtile;     // (L, SHARE), sub-tiles of each list
  const int64_t* order;       // lists core by core
  const int64_t* core_start;  // (CORES + 1)
  int64_t cols;
  int64_t subtiles;
  uint16_t* pixels;  // (S, SUBTILE_PIXELS, 4): transmittance, red, green, blue
  int64_t leave;     // not 0: a finished sub-tile leaves its list
};

// A field of up to 32 bits.
inline uint32_t get(const uint32_t* w, Place p) {
  const int word = p.at / 32, shift = p.at % 32;
  uint64_t value = w[word] >> shift;
  if (shift + p.bits > 32) value |= static_cast<uint64_t>(w[word + 1]) << (32 - shift);
  return static_cast<uint32_t>(value & ((uint64_t{1} << p.bits) - 1));
}
inline void put(uint32_t* w, Place p, uint32_t value) {
  const int word = p.at / 32, shift = p.at % 32;
  w[word] |= value << shift;
  if (shift + p.bits > 32) w[word + 1] |= value >> (32 - shift);
}

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

// A place in a core's stream: list (index in the order) and element of it, or the token behind the last one.
struct Cursor {
  int64_t next, item;
};

class Simulation {
 public:
  Simulation(const Frame& frame, int mode, uint64_t seed, uint32_t idle, uint32_t stall)
      : frame_(frame), mode_(mode), idle_(idle), stall_(stall), random_{seed * 2654435761u + 88172645463325252ull},
        owner_(frame.subtiles, -1) {
    g_fatal.clear();
    context_.randReset(2);
    context_.randSeed(static_cast<int>(seed & 0x7fffffff) + 1);
    top_ = std::make_unique<Vtop>(&context_);
    for (int k = 0; k < CORES; ++k) {
      for (int64_t i = frame.core_start[k]; i < frame.core_start[k + 1]; ++i) {
        for (int m = 0; m < SHARE; ++m) owner_[frame.subtile[frame.order[i] * SHARE + m]] = k;
      }
      expected_ += LIST_PIXELS * (frame.core_start[k + 1] - frame.core_start[k]);
    }
    begin();
    top_->mode_i = mode;
    top_->clear_i = 0;
    top_->clear_counters_i = 0;
    top_->hold_counters_i = 0;
    top_->counter_addr_i = 0;
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
      if (received_ == expected_) return finish() ? 1 : -1;
      cycle();
      if (!g_fatal.empty()) error_ = g_fatal;
      if (cycles_ - last_transfer_ > HANG_CYCLES) error_ = "no transfer for " + std::to_string(HANG_CYCLES) + " cycles";
    }
    if (!error_.empty()) return -1;
    return received_ == expected_ ? (finish() ? 1 : -1) : 0;
  }

  // Runs `cycles` cycles or to the last pixel, then aborts the frame with clear_i for `length` cycles and begins it anew, counters cleared.
  bool abort(uint64_t cycles, int length) {
    for (uint64_t n = 0; n < cycles && error_.empty() && received_ < expected_; ++n) {
      cycle();
      if (!g_fatal.empty()) error_ = g_fatal;
    }
    const uint64_t before = cycles_;
    top_->clear_i = 1;
    for (int i = 0; i < length && error_.empty(); ++i) {
      offer();
      top_->clk_i = 0;
      top_->eval();
      if (top_->in_ready_o) error_ = "ready while clear_i is high";
      if (i > 0) check_empty("after clear_i");
      top_->clk_i = 1;
      top_->eval();
    }
    top_->clear_i = 0;
    top_->in_valid_i = 0;
    top_->mode_i = mode_;  // early enough for the first element not to wait
    std::vector<uint32_t> counters = read_counters();  // it checks that the stage stays empty, too
    for (int k = 0; k < CORES; ++k) {
      const uint32_t counted = counters[k * COUNTERS_PER_CORE + COUNTER_CYCLES];
      if (counted != static_cast<uint32_t>(before + length)) error_ = "clear_i changed a counter";
    }
    top_->clear_counters_i = 1;
    edge();
    top_->clear_counters_i = 0;
    if (!g_fatal.empty()) error_ = g_fatal;
    begin();
    return error_.empty();
  }

  uint64_t cycles_ = 0;
  uint64_t received_ = 0;
  uint64_t expected_ = 0;
  std::string error_;
  std::vector<uint32_t> counters_;

 private:
  // Start of the frame, the stage being empty.
  void begin() {
    seen_.assign(frame_.subtiles * SUBTILE_PIXELS, 0);
    cycles_ = received_ = last_transfer_ = 0;
    owed_ = 0;
    for (int k = 0; k < CORES; ++k) {
      at_[k] = {frame_.core_start[k], 0};
      if (more(k, at_[k])) at_[k].item = frame_.start[frame_.order[at_[k].next]];
      holding_[k] = 0;
      open_[k] = false;
    }
  }

  void edge() {
    top_->clk_i = 0;
    top_->eval();
    top_->clk_i = 1;
    top_->eval();
  }

  void check_empty(const char* when) {
    if (top_->out_valid_o) error_ = std::string("pixels ") + when;
    if (!top_->idle_o) error_ = std::string("idle_o is low ") + when;
  }

  bool at_token(const Cursor& c) const { return c.item == frame_.start[frame_.order[c.next] + 1]; }
  bool more(int k, const Cursor& c) const { return c.next < frame_.core_start[k + 1]; }

  // The element of core k at c, into the words of input `way`. Where the element has room for it, every one names its sub-tile.
  void load(int k, int way, const Cursor& c) {
    uint32_t* w = &top_->in_elem_i[(k * IN_WIDTH + way) * ELEM_WORDS];
    const bool token = at_token(c);
    if (token) {
      std::memset(w, 0, ELEM_WORDS * sizeof(uint32_t));
      put(w, ELEM_EOS, 1);
    } else {
      std::memcpy(w, &frame_.element[frame_.which[c.item] * ELEM_WORDS], ELEM_WORDS * sizeof(uint32_t));
    }
    if (token || ELEM_SUBTILE) {
      // A token may name any of them.
      const int64_t s = frame_.subtile[frame_.order[c.next] * SHARE + (token ? cycles_ % SHARE : frame_.member[c.item])];
      put(w, ELEM_COL, static_cast<uint32_t>(s % frame_.cols));
      put(w, ELEM_ROW, static_cast<uint32_t>(s / frame_.cols));
    }
  }

  void step(int k, Cursor& c) {
    if (!at_token(c)) {
      ++c.item;
      return;
    }
    ++c.next;
    if (more(k, c)) c.item = frame_.start[frame_.order[c.next]];
  }

  // Elements of the list that is open at c go on to the first that is for a sub-tile that is not finished.
  void skip(int k, Cursor& c) const {
    if (c.next != at_[k].next) return;
    while (!at_token(c) && (top_->finished_o >> (frame_.member[c.item] * CORES + k) & 1)) ++c.item;
  }

  void accepted(int k) {
    for (int w = 0; w < holding_[k]; ++w) {
      open_[k] = !at_token(held_[k][w]);
      if (!open_[k]) owed_ += LIST_PIXELS;
    }
    at_[k] = after_[k];
    holding_[k] = 0;
  }

  void pixel(int k) {
    const uint32_t* w = &top_->out_data_o[k * PIXEL_WORDS];
    const int64_t index = get(w, PIXEL_MINITILE) * MINITILE_PIXELS + get(w, PIXEL_INDEX);
    const int64_t col = get(w, PIXEL_COL), row = get(w, PIXEL_ROW);
    const int64_t s = row * frame_.cols + col;
    if (col >= frame_.cols || s >= frame_.subtiles || owner_[s] != k) {
      error_ = "core " + std::to_string(k) + " sent a pixel of sub-tile (" + std::to_string(col) + ", " + std::to_string(row) + ")";
      return;
    }
    if (seen_[s * SUBTILE_PIXELS + index]++) {
      error_ = "pixel " + std::to_string(index) + " of sub-tile " + std::to_string(s) + " sent twice";
      return;
    }
    uint16_t* p = &frame_.pixels[(s * SUBTILE_PIXELS + index) * 4];
    p[0] = get(w, PIXEL_TRANSMITTANCE);
    p[1] = get(w, PIXEL_RED);
    p[2] = get(w, PIXEL_GREEN);
    p[3] = get(w, PIXEL_BLUE);
    ++received_;
    --owed_;
  }

  // Sets valid and ready of this cycle; once offered, an element stays until taken.
  void offer() {
    valid_ = ready_ = 0;
    for (int k = 0; k < CORES; ++k) {
      if (!holding_[k]) {
        Cursor c = at_[k];
        const bool leaves = frame_.leave && open_[k];
        while (holding_[k] < IN_WIDTH && more(k, c) && !random_(idle_)) {
          if (leaves) skip(k, c);
          load(k, holding_[k], c);
          held_[k][holding_[k]++] = c;
          step(k, c);
        }
        after_[k] = c;
      }
      valid_ |= ((1 << holding_[k]) - 1) << (k * IN_WIDTH);
      ready_ |= !random_(stall_) << k;
    }
    top_->in_valid_i = valid_;
    top_->out_ready_i = ready_;
  }

  void cycle() {
    bool empty = owed_ == 0, offered = false;  // an offered element may have begun its test
    for (int k = 0; k < CORES; ++k) {
      empty &= !open_[k];
      offered |= holding_[k] > 0;
    }
    if (top_->idle_o && !empty) error_ = "idle_o is high, but something is inside";
    if (!top_->idle_o && empty && !offered) error_ = "idle_o is low, but nothing is inside";
    top_->mode_i = top_->idle_o ? mode_ : (mode_ + 1) % MODES;
    offer();
    top_->clk_i = 0;
    top_->eval();
    const uint8_t taken = top_->in_ready_o;
    const uint8_t given = ready_ & top_->out_valid_o;
    for (int k = 0; k < CORES; ++k) {
      if (given >> k & 1) pixel(k);
    }
    top_->clk_i = 1;
    top_->eval();
    ++cycles_;
    bool moved = given;
    for (int k = 0; k < CORES; ++k) {
      if (!(taken >> k & 1) || !holding_[k]) continue;
      accepted(k);
      moved = true;
    }
    if (moved) last_transfer_ = cycles_;
  }

  // All counters, one after the other; they stand still meanwhile. Nothing may be in the stage.
  std::vector<uint32_t> read_counters() {
    std::vector<uint32_t> counters(CORES * COUNTERS_PER_CORE);
    top_->hold_counters_i = 1;
    edge();  // the events of the cycle before are added
    for (int k = 0; k < CORES; ++k) {
      for (int i = 0; i < COUNTERS_PER_CORE; ++i) {
        top_->counter_addr_i = k << COUNTER_INDEX_BITS | i;
        for (int n = 0; n < COUNTER_LATENCY; ++n) edge();
        counters[k * COUNTERS_PER_CORE + i] = top_->counter_data_o;
        check_empty("while nothing is inside");
      }
    }
    top_->hold_counters_i = 0;
    return counters;
  }

  // After the last pixel: every list must be consumed, and nothing more may come.
  bool finish() {
    for (int k = 0; k < CORES; ++k) {
      if (more(k, at_[k])) error_ = "core " + std::to_string(k) + " did not take its whole list";
    }
    top_->in_valid_i = 0;
    top_->out_ready_i = (1 << CORES) - 1;
    if (counters_.empty()) counters_ = read_counters();
    if (!g_fatal.empty()) error_ = g_fatal;
    return error_.empty();
  }

  Frame frame_;
  int mode_;
  uint32_t idle_, stall_;
  Random random_;
  std::vector<uint8_t> seen_;
  std::vector<int> owner_;
  VerilatedContext context_;
  std::unique_ptr<Vtop> top_;
  uint8_t valid_, ready_;
  int64_t owed_;  // pixels of lists that were taken as a whole
  Cursor at_[CORES];         // the oldest element that has not been taken
  Cursor held_[CORES][IN_WIDTH], after_[CORES];  // those that are offered, and the one behind
  int holding_[CORES];       // elements that are offered
  bool open_[CORES];
  uint64_t last_transfer_ = 0;
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
int flk_sim_abort(void* sim, uint64_t cycles, int length) { return static_cast<Simulation*>(sim)->abort(cycles, length); }
uint64_t flk_sim_cycles(void* sim) { return static_cast<Simulation*>(sim)->cycles_; }
uint64_t flk_sim_received(void* sim) { return static_cast<Simulation*>(sim)->received_; }
const char* flk_sim_error(void* sim) { return static_cast<Simulation*>(sim)->error_.c_str(); }
void flk_sim_counters(void* sim, uint32_t* out) {
  const auto& counters = static_cast<Simulation*>(sim)->counters_;
  std::memcpy(out, counters.data(), counters.size() * sizeof(uint32_t));
}
void flk_sim_delete(void* sim) { delete static_cast<Simulation*>(sim); }
}
