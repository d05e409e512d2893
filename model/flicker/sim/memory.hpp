// Memory behind AXI4 ports, for harnesses of verilated designs and for tests: contents (`Store`), time (`dram::Engine`), ports (`AxiPort`).
//
// Nothing here needs Verilator; the macros at the end, and `channels`, connect a port to the pins of a model. docs/reference/memory_model.md has the options, what is checked and how
// a harness calls it. A cycle n of the chip's clock:
//
//   top.clk_i = 0; FLK_AXI_DRIVE(port.reply(), top, prefix); top.eval();   // the design sees the replies of cycle n and settles
//   FLK_AXI_SAMPLE(request, top, prefix);                                  // what it drives in cycle n
//   memory.tick(); port.cycle(request);                                    // transfers of cycle n; replies of cycle n + 1
//   top.clk_i = 1; top.eval();                                             // the edge
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <deque>
#include <list>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "dram.hpp"

namespace flk {

constexpr int MAX_WORDS = 16;  // 512 bits
enum Resp : uint8_t { OKAY = 0, EXOKAY = 1, SLVERR = 2, DECERR = 3 };
enum AxiChannel { AW, W, B, AR, R, AXI_CHANNELS };
inline const char* const AXI_NAMES[AXI_CHANNELS] = {"AW", "W", "B", "AR", "R"};

inline std::string hex(uint64_t value) {
  char text[20];
  std::snprintf(text, sizeof text, "0x%llx", static_cast<unsigned long long>(value));
  return text;
}

// xorshift64*, seeded by anything.
class Random {
 public:
  explicit Random(uint64_t seed) : s_(seed * 0x9e3779b97f4a7c15u + 0x2545f4914f6cdd1du) {
    if (s_ == 0) s_ = 1;
    for (int i = 0; i < 4; ++i) next();
  }
  uint32_t next() {
    s_ ^= s_ >> 12;
    s_ ^= s_ << 25;
    s_ ^= s_ >> 27;
    return static_cast<uint32_t>(s_ * 0x2545f4914f6cdd1du >> 32);
  }
  uint32_t below(uint32_t n) { return static_cast<uint32_t>(static_cast<uint64_t>(next()) * n >> 32); }

 private:
  uint64_t s_;
};

// ---- contents ----------------------------------------------------------------------------------

// Bytes of the address ranges that were allocated; there are no others.
class Store {
 public:
  // A range of zeros, or, with `noise` not 0, of bytes that look random. False if it is empty, wraps around or overlaps another.
  bool allocate(uint64_t base, uint64_t size, uint64_t noise = 0) {
    if (size == 0 || base + size < base) return false;
    auto next = ranges_.lower_bound(base);
    if (next != ranges_.end() && next->first < base + size) return false;
    if (next != ranges_.begin() && std::prev(next)->first + std::prev(next)->second.size() > base) return false;
    std::vector<uint8_t>& bytes = ranges_[base];
    bytes.resize(size);
    if (noise) {
      Random random(noise ^ base);
      for (uint64_t i = 0; i < size; i += 4) {
        const uint32_t word = random.next();
        std::memcpy(&bytes[i], &word, std::min<uint64_t>(4, size - i));
      }
    }
    return true;
  }

  // The bytes at an address; nullptr if not all of them are in one range.
  uint8_t* find(uint64_t address, uint64_t size) {
    auto next = ranges_.upper_bound(address);
    if (next == ranges_.begin()) return nullptr;
    auto& [base, bytes] = *std::prev(next);
    const uint64_t at = address - base;
    return at < bytes.size() && size <= bytes.size() - at ? bytes.data() + at : nullptr;
  }

 private:
  std::map<uint64_t, std::vector<uint8_t>> ranges_;
};

// Contents and time that all ports share. `perfect`: no DRAM, every beat is there after its port's latency.
class Memory {
 public:
  Memory(const dram::Timing& timing, bool perfect) : perfect(perfect), engine(timing) {}

  // Begins a cycle: once, before the ports' `cycle`.
  void tick() {
    ++cycle;
    if (!perfect) engine.advance(engine.clock_of(static_cast<int64_t>(cycle)));
  }

  // Share of the peak rate that the DRAM has moved until now: a burst takes a channel's bus for `half` clocks.
  double efficiency() const {
    const dram::Timing& t = engine.timing();
    const int64_t clocks = engine.clock_of(static_cast<int64_t>(cycle));
    return clocks ? static_cast<double>(engine.counts().bursts * t.half) / static_cast<double>(t.channels * clocks) : 0.0;
  }

  // Transactions that are on their way, for the check of hazards.
  struct Pending {
    uint64_t first, last;
    uint32_t id;
    const void* port;
    bool write;
  };

  const bool perfect;
  uint64_t cycle = 0;
  Store store;
  dram::Engine engine;
  std::list<Pending> pending;
};

// ---- pins --------------------------------------------------------------------------------------

struct AxiAddress {
  uint64_t addr;
  uint32_t id;
  uint8_t valid, len, size, burst, qos;
};

// What the design (the manager) drives in a cycle.
struct AxiRequest {
  AxiAddress aw, ar;
  uint32_t w_data[MAX_WORDS];
  uint64_t w_strb;
  uint8_t w_valid, w_last, b_ready, r_ready;
};

// What the memory drives in a cycle.
struct AxiReply {
  uint32_t r_data[MAX_WORDS];
  uint32_t b_id, r_id;
  uint8_t aw_ready, w_ready, ar_ready;
  uint8_t b_valid, b_resp;
  uint8_t r_valid, r_resp, r_last;
};

// ---- port --------------------------------------------------------------------------------------

// Options of a port; sim/memory.py has the same fields in the same order and says what they mean.
struct AxiConfig {
  int64_t data_bits = 512, id_bits = 4, latency = 1, max_reads = 32, max_writes = 32, max_beats = 256;
  int64_t order = 0;        // 0: answers in the order of the addresses; 1: by id, seeded choice; 2: also beats of several ids interleaved; 3: as 1, bursts once whole
  int64_t write_order = 0;  // 0: data may come before addresses; 1: data wait for their address; 2: addresses wait for data
  int64_t hazards = 1, urgent = 16, seed = 1;
  int64_t stall[AXI_CHANNELS] = {};                            // 256ths of the cycles
  int64_t run[AXI_CHANNELS] = {1, 1, 1, 1, 1};                 // mean cycles of a stall
  int64_t stop_after[AXI_CHANNELS] = {-1, -1, -1, -1, -1};     // transfers after which a channel answers no more; -1: never stops
};

// Traffic of one purpose.
struct AxiCounts {
  uint64_t read_bursts, read_beats, read_bytes, write_bursts, write_beats, write_bytes;  // write_bytes: those with a strobe
  uint64_t dram_read_bytes, dram_write_bytes, dram_masked_bytes;                         // whole bursts of the DRAM; masked ones are among the written
  uint64_t errors;                                                                      // bursts answered with SLVERR or DECERR
  dram::Rows rows;                                                                      // of its bursts of the DRAM
};

// One port. It must live as long as its memory ticks: the DRAM tells it what has moved.
class AxiPort {
 public:
  AxiPort(Memory& memory, const AxiConfig& config) : memory_(memory), c_(config), bytes_(config.data_bits / 8), random_(config.seed) {
    if (c_.data_bits < 32 || c_.data_bits > 32 * MAX_WORDS || (c_.data_bits & (c_.data_bits - 1))) throw std::invalid_argument("data_bits must be 32, 64, ... 512");
    if (c_.id_bits < 0 || c_.id_bits > 16) throw std::invalid_argument("id_bits must be 0 to 16");
    if (c_.latency < 1) throw std::invalid_argument("latency must be at least 1");
    if (c_.max_reads < 1 || c_.max_writes < 1 || c_.max_beats < 1 || c_.max_beats > 256) throw std::invalid_argument("max_reads, max_writes and max_beats must be at least 1, max_beats at most 256");
    for (int k = 0; k < AXI_CHANNELS; ++k) {
      if (c_.stall[k] < 0 || c_.stall[k] > 256 || c_.run[k] < 1) throw std::invalid_argument("stall must be 0 to 256, run at least 1");
    }
    while (uint64_t{1} << size_ < bytes_) ++size_;
  }

  AxiPort(const AxiPort&) = delete;
  AxiPort& operator=(const AxiPort&) = delete;

  const AxiReply& reply() const { return reply_; }
  const std::vector<std::string>& errors() const { return errors_; }  // rules broken by the design, at most 100
  // Nothing is on its way. What a design leaves when it says that it is idle is a fault of it.
  bool idle() const { return reads_.empty() && writes_.empty() && data_.empty(); }
  uint64_t transfers(AxiChannel channel) const { return transfers_[channel]; }
  uint64_t waits(AxiChannel channel) const { return waits_[channel]; }  // cycles of valid without ready
  const std::map<uint32_t, AxiCounts>& counts() const { return counts_; }

  // Purpose of the transactions that begin in a range; of all others the purpose is their id.
  void purpose(uint64_t base, uint64_t size, uint32_t number) { purposes_.push_back({base, base + (size - 1), number}); }
  // Bursts that touch a range, or the nth of their kind (from 0), are answered with `resp`; a write that fails changes nothing.
  void fail_range(uint64_t base, uint64_t size, bool reads, bool writes, Resp resp = SLVERR) { fails_.push_back({base, base + (size - 1), reads, writes, resp}); }
  void mend_ranges() { fails_.clear(); }
  // Channels that had stopped go on.
  void resume() { std::fill(c_.stop_after, c_.stop_after + AXI_CHANNELS, -1); }
  void fail_read(uint64_t nth, Resp resp = SLVERR) { fail_read_[nth] = resp; }
  void fail_write(uint64_t nth, Resp resp = SLVERR) { fail_write_[nth] = resp; }

  // In reset: forgets what is on its way. The design's valids must be low if it is in reset too (checked).
  void reset(const AxiRequest& q, bool checked = true) {
    if (checked && (q.aw.valid || q.w_valid || q.ar.valid)) error("valid in reset");
    orphans_.splice(orphans_.end(), reads_);  // the DRAM has not told all of them yet
    orphan_writes_.splice(orphan_writes_.end(), writes_);
    for (auto it = memory_.pending.begin(); it != memory_.pending.end();) it = it->port == this ? memory_.pending.erase(it) : std::next(it);
    data_.clear();
    filling_ = writes_.end();
    owed_ = 0;
    current_ = nullptr;
    last_ = AxiRequest{};
    reply_ = AxiReply{};
    std::fill(held_, held_ + AXI_CHANNELS, false);
  }

  // The edge that ends a cycle: `q` is what the design drove in it, `reply()` before the call what it saw, after it what it is to see next.
  void cycle(const AxiRequest& q) {
    const AxiReply& p = reply_;
    now_ = memory_.cycle;
    check_stable(q);
    const bool valid[AXI_CHANNELS] = {q.aw.valid != 0, q.w_valid != 0, p.b_valid != 0, q.ar.valid != 0, p.r_valid != 0};
    const bool ready[AXI_CHANNELS] = {p.aw_ready != 0, p.w_ready != 0, q.b_ready != 0, p.ar_ready != 0, q.r_ready != 0};
    bool moved[AXI_CHANNELS];
    for (int k = 0; k < AXI_CHANNELS; ++k) {
      moved[k] = valid[k] && ready[k];
      transfers_[k] += moved[k];
      waits_[k] += valid[k] && !ready[k];
    }
    if (moved[B]) written();
    if (moved[R]) delivered();
    if (moved[AR]) accept_read(q.ar);
    if (moved[AW]) accept_write(q.aw);
    if (moved[W]) accept_data(q);
    match();
    last_ = q;
    for (int k = 0; k < AXI_CHANNELS; ++k) held_[k] = valid[k] && !ready[k];
    answer(q, moved[B], moved[R]);
  }

 private:
  struct Range {
    uint64_t first, last;
    uint32_t number;
  };
  struct Fail {
    uint64_t first, last;
    bool reads, writes;
    Resp resp;
  };
  struct Transaction {
    AxiAddress a;
    int beats;
    Resp resp;
    uint32_t purpose;
    std::vector<dram::Completion> done;  // reads: of every beat; writes: one
    std::vector<uint64_t> ready;         // reads, perfect memory: cycle of every beat; writes: one
    int next = 0;                        // reads: beat to give; writes: beats taken
    std::list<Memory::Pending>::iterator pending;
    struct Beat {
      uint32_t data[MAX_WORDS];
      uint64_t strb;
    };
    std::vector<Beat> data;  // writes: until the last one is there
  };
  using List = std::list<Transaction>;
  struct Data {
    Transaction::Beat beat;
    bool last;
  };

  void error(const std::string& text) {
    if (errors_.size() < 100) errors_.push_back("cycle " + std::to_string(memory_.cycle) + ": AXI: " + text);
  }

  static std::string show(const AxiAddress& a) { return hex(a.addr) + ", " + std::to_string(a.len + 1) + " beats, id " + std::to_string(a.id); }

  // ---- rules ----

  static bool same(const AxiAddress& a, const AxiAddress& b) {
    return a.addr == b.addr && a.id == b.id && a.len == b.len && a.size == b.size && a.burst == b.burst && a.qos == b.qos;
  }

  void check_stable(const AxiRequest& q) {
    auto held = [&](AxiChannel k, bool valid, bool same) {
      if (!held_[k]) return;
      if (!valid) {
        error(std::string(AXI_NAMES[k]) + ": valid fell before the transfer");
      } else if (!same) {
        error(std::string(AXI_NAMES[k]) + ": payload changed before the transfer");
      }
    };
    held(AW, q.aw.valid, same(q.aw, last_.aw));
    held(AR, q.ar.valid, same(q.ar, last_.ar));
    held(W, q.w_valid, q.w_last == last_.w_last && q.w_strb == last_.w_strb && std::memcmp(q.w_data, last_.w_data, bytes_) == 0);
  }

  void check_address(const char* name, const AxiAddress& a, bool write) {
    const std::string what = std::string(name) + " " + show(a) + ": ";
    if (a.burst != 1) error(what + "burst type " + std::to_string(a.burst) + ", only INCR (1) is modelled");
    if (a.size > size_ || (write && a.size != size_)) {
      error(what + "size " + std::to_string(a.size) + ", " + (write ? "only whole beats are modelled: " : "a beat has ") + std::to_string(size_));
    }
    if (a.addr % step(a)) error(what + "address is not a multiple of " + std::to_string(step(a)));
    if (a.len + 1 > c_.max_beats) error(what + "more than " + std::to_string(c_.max_beats) + " beats");
    if (a.id >> c_.id_bits) error(what + "id has more than " + std::to_string(c_.id_bits) + " bits");
    if (a.addr / 4096 != last_byte(a) / 4096) error(what + "crosses a 4 KB boundary");
  }

  void check_hazard(const AxiAddress& a, bool write) {
    if (!c_.hazards) return;
    for (const Memory::Pending& p : memory_.pending) {
      if (!(write || p.write) || p.last < a.addr || last_byte(a) < p.first) continue;
      if (write && p.write && p.id == a.id && p.port == this) continue;  // in order
      error(std::string(write ? "AW " : "AR ") + show(a) + ": overlaps a " + (p.write ? "write" : "read") + " at " + hex(p.first) + " that has no answer yet");
      return;
    }
  }

  // ---- accepting ----

  // Its bursts take places of the DRAM's queues before others, its answer goes before others.
  bool urgent(const AxiAddress& a) const { return a.qos >= c_.urgent; }

  // Bytes that a beat moves; reads may be narrower than the port.
  uint64_t step(const AxiAddress& a) const { return std::min<uint64_t>(bytes_, uint64_t{1} << a.size); }
  uint64_t last_byte(const AxiAddress& a) const { return a.addr + static_cast<uint64_t>(a.len + 1) * step(a) - 1; }

  Transaction begin(const AxiAddress& a, bool write, uint64_t nth) {
    Transaction t;
    t.a = a;
    t.a.addr -= a.addr % step(a);
    t.beats = a.len + 1;
    t.resp = OKAY;
    const auto& numbered = write ? fail_write_ : fail_read_;
    if (auto found = numbered.find(nth); found != numbered.end()) t.resp = found->second;
    for (const Fail& f : fails_) {
      if ((write ? f.writes : f.reads) && f.first <= last_byte(t.a) && t.a.addr <= f.last && t.resp == OKAY) t.resp = f.resp;
    }
    t.purpose = a.id;
    for (const Range& r : purposes_) {
      if (r.first <= a.addr && a.addr <= r.last) {
        t.purpose = r.number;
        break;
      }
    }
    t.done.resize(write ? 1 : t.beats);
    t.ready.assign(t.done.size(), 0);
    memory_.pending.push_back({t.a.addr, last_byte(t.a), a.id, this, write});
    t.pending = std::prev(memory_.pending.end());
    return t;
  }

  // Bytes of a beat; nullptr when the memory has none there. No burst goes beyond the end of the address space.
  uint8_t* bytes_of(const Transaction& t, int beat) { return memory_.store.find(t.a.addr + static_cast<uint64_t>(beat) * step(t.a), step(t.a)); }

  void accept_read(const AxiAddress& a) {
    check_address("AR", a, false);
    check_hazard(a, false);
    reads_.push_back(begin(a, false, read_count_++));
    Transaction& t = reads_.back();
    AxiCounts& count = counts_[t.purpose];
    ++count.read_bursts;
    bool bad = t.resp != OKAY;
    for (int k = 0; k < t.beats; ++k) {
      ++count.read_beats;
      count.read_bytes += step(a);
      const bool there = bytes_of(t, k) != nullptr;
      bad |= !there;
      if (memory_.perfect || !there || t.resp != OKAY) {
        t.ready[k] = now_ + c_.latency;
        continue;
      }
      if (leader(t, k) < k) continue;  // its burst of the DRAM moves for an earlier beat
      count.dram_read_bytes += to_dram(t.a.addr + static_cast<uint64_t>(k) * step(a), step(a), ~uint64_t{0}, dram::READ, urgent(a), t.done[k], count);
    }
    count.errors += bad;
  }

  void accept_write(const AxiAddress& a) {
    check_address("AW", a, true);
    check_hazard(a, true);
    writes_.push_back(begin(a, true, write_count_++));
    if (filling_ == writes_.end()) filling_ = std::prev(writes_.end());
    owed_ += a.len + 1;
    ++counts_[writes_.back().purpose].write_bursts;
  }

  void accept_data(const AxiRequest& q) {
    Data d;
    std::memcpy(d.beat.data, q.w_data, sizeof d.beat.data);
    d.beat.strb = q.w_strb;
    d.last = q.w_last != 0;
    if (bytes_ < 64 && q.w_strb >> bytes_) error("W: strobes beyond the width");
    data_.push_back(d);
    --owed_;
  }

  // Data to their addresses: both come in order.
  void match() {
    while (!data_.empty() && filling_ != writes_.end()) {
      Transaction& t = *filling_;
      const Data& d = data_.front();
      const bool last = ++t.next == t.beats;
      if (d.last != last) error("W: beat " + std::to_string(t.next) + " of the write at " + show(t.a) + (d.last ? " is marked last" : " is not marked last"));
      t.data.push_back(d.beat);
      data_.pop_front();
      if (last) {
        filling_ = std::next(filling_);
        perform(t);
      }
    }
  }

  // A write whose data are complete.
  void perform(Transaction& t) {
    AxiCounts& count = counts_[t.purpose];
    for (int k = 0; k < t.beats && t.resp == OKAY; ++k) {
      if (!bytes_of(t, k)) t.resp = DECERR;
    }
    t.ready[0] = now_ + c_.latency;
    for (int k = 0; k < t.beats; ++k) {
      const Transaction::Beat& beat = t.data[k];
      ++count.write_beats;
      for (uint64_t b = 0; b < bytes_; ++b) count.write_bytes += beat.strb >> b & 1;
      if (t.resp != OKAY) continue;
      uint8_t* to = bytes_of(t, k);
      const auto* from = reinterpret_cast<const uint8_t*>(beat.data);
      for (uint64_t b = 0; b < bytes_; ++b) {
        if (beat.strb >> b & 1) to[b] = from[b];
      }
      if (memory_.perfect) continue;
      // Beats that share a burst of the DRAM go there together, with the last of them.
      const int first = leader(t, k);
      if (k + 1 < t.beats && leader(t, k + 1) == first) continue;
      uint64_t strb = 0;
      for (int j = first; j <= k; ++j) strb |= t.data[j].strb << (j - first) * bytes_ % 64;
      count.dram_write_bytes += to_dram(t.a.addr + static_cast<uint64_t>(first) * bytes_, (k - first + 1) * bytes_, strb, dram::WRITE, urgent(t.a), t.done[0], count);
    }
    count.errors += t.resp != OKAY;
    t.data.clear();
  }

  // The first beat that lies in the same burst of the DRAM as beat `k`: beats narrower than one share it.
  int leader(const Transaction& t, int k) const {
    const uint64_t burst = memory_.engine.timing().burst_bytes, bytes = step(t.a), at = t.a.addr + static_cast<uint64_t>(k) * bytes;
    return bytes >= burst ? k : k - static_cast<int>(std::min<uint64_t>(k, at % burst / bytes));
  }

  // Bytes as bursts of the DRAM; bytes moved. A write without strobes moves none, one with some of a burst's bytes is masked.
  uint64_t to_dram(uint64_t address, uint64_t bytes, uint64_t strb, int8_t kind, bool urgent, dram::Completion& done, AxiCounts& count) {
    const uint64_t burst = memory_.engine.timing().burst_bytes, step = std::min(burst, bytes);
    const uint64_t all = step < 64 ? (uint64_t{1} << step) - 1 : ~uint64_t{0};
    uint64_t moved = 0;
    for (uint64_t at = 0; at < bytes; at += step) {
      const uint64_t part = strb >> at & all;
      int8_t how = kind;
      if (kind != dram::READ) {
        if (part == 0) continue;
        if (part != all || step < burst) how = dram::MASKED_WRITE;
      }
      memory_.engine.push(memory_.engine.clock_of(static_cast<int64_t>(now_)), address + at, how, &done, urgent, &count.rows);
      moved += burst;
      if (how == dram::MASKED_WRITE) count.dram_masked_bytes += burst;
    }
    return moved;
  }

  // ---- answering ----

  // Whether data of `k` (or its write) are there in the next cycle.
  bool there(const Transaction& t, int k) const {
    const int first = memory_.perfect ? k : leader(t, k);
    const dram::Completion& done = t.done[first];
    if (done.waiting) return false;
    const uint64_t from = done.clock ? static_cast<uint64_t>(memory_.engine.cycle_of(done.clock)) + c_.latency : t.ready[first];
    return now_ + 1 >= from;
  }

  bool stalled(AxiChannel k) {
    if (c_.stop_after[k] >= 0 && transfers_[k] >= static_cast<uint64_t>(c_.stop_after[k])) return true;
    if (c_.stall[k] == 0) return false;
    if (c_.stall[k] == 256) return true;
    const uint32_t one = 1u << 24;
    if (stalled_[k]) {  // two states: mean stay `run`, share `stall`
      stalled_[k] = c_.run[k] > 1 ? random_.below(one) >= one / c_.run[k] : random_.below(256) < c_.stall[k];
    } else if (c_.run[k] > 1) {
      stalled_[k] = random_.below(one) < std::min<double>(one, one * (c_.stall[k] / (256.0 - c_.stall[k])) / c_.run[k]);
    } else {
      stalled_[k] = random_.below(256) < c_.stall[k];
    }
    return stalled_[k];
  }

  // The transaction whose turn it is, by the options `order` and `urgent`; nullptr: none. `done(t)`: it has something to give.
  template <class Done>
  Transaction* choose(List& list, Done done) {
    if (list.empty()) return nullptr;
    if (c_.order == 0) return done(list.front()) ? &list.front() : nullptr;
    std::vector<Transaction*> ready;
    std::vector<uint32_t> seen;
    for (Transaction& t : list) {
      if (std::find(seen.begin(), seen.end(), t.a.id) != seen.end()) continue;
      seen.push_back(t.a.id);  // the oldest of its id
      if (done(t)) ready.push_back(&t);
    }
    if (std::any_of(ready.begin(), ready.end(), [&](const Transaction* t) { return urgent(t->a); })) {
      ready.erase(std::remove_if(ready.begin(), ready.end(), [&](const Transaction* t) { return !urgent(t->a); }), ready.end());
    }
    return ready.empty() ? nullptr : ready[ready.size() == 1 ? 0 : random_.below(static_cast<uint32_t>(ready.size()))];
  }

  void erase(List& list, Transaction* t) {
    memory_.pending.erase(t->pending);
    list.erase(std::find_if(list.begin(), list.end(), [t](const Transaction& x) { return &x == t; }));
  }

  void written() {
    erase(writes_, answering_);
    reply_.b_valid = 0;
  }

  void delivered() {
    Transaction* t = reading_;
    reply_.r_valid = 0;
    if (++t->next == t->beats) {
      erase(reads_, t);
      current_ = nullptr;
    }
  }

  void answer(const AxiRequest& q, bool moved_b, bool moved_r) {
    // Ready of the addresses and data.
    const bool stall[AXI_CHANNELS] = {stalled(AW), stalled(W), stalled(B), stalled(AR), stalled(R)};
    const bool data_waits = q.w_valid || !data_.empty();
    reply_.ar_ready = !stall[AR] && reads_.size() < static_cast<size_t>(c_.max_reads);
    reply_.aw_ready = !stall[AW] && writes_.size() < static_cast<size_t>(c_.max_writes) && (c_.write_order != 2 || data_waits);
    reply_.w_ready = !stall[W] && data_.size() < 16 && (c_.write_order != 1 || owed_ > 0);
    // A response that is offered stays.
    if (!reply_.b_valid && !stall[B]) {
      answering_ = choose(writes_, [&](const Transaction& t) { return t.next == t.beats && there(t, 0); });
      if (answering_) {
        reply_.b_valid = 1;
        reply_.b_id = answering_->a.id;
        reply_.b_resp = answering_->resp;
      }
    }
    if (!reply_.b_valid && moved_b) {  // garbage
      reply_.b_id = random_.below(1u << c_.id_bits);
      reply_.b_resp = static_cast<uint8_t>(random_.below(4));
    }
    if (!reply_.r_valid && !stall[R]) {
      // The next beat, or all that the option `order` wants.
      auto done = [&](const Transaction& t) {
        int k = c_.order == 3 ? t.beats : t.next + 1;
        while (k > t.next && there(t, k - 1)) --k;
        return k == t.next;
      };
      reading_ = current_ && c_.order != 2 ? (done(*current_) ? current_ : nullptr) : choose(reads_, done);
      if (reading_) offer(*reading_);
    }
    if (!reply_.r_valid && moved_r) {
      for (uint64_t i = 0; i < bytes_ / 4; ++i) reply_.r_data[i] = random_.next();
      reply_.r_id = random_.below(1u << c_.id_bits);
      reply_.r_resp = static_cast<uint8_t>(random_.below(4));
      reply_.r_last = static_cast<uint8_t>(random_.below(2));
    }
    retire();
  }

  void offer(Transaction& t) {
    current_ = &t;
    const uint8_t* from = bytes_of(t, t.next);
    reply_.r_valid = 1;
    reply_.r_id = t.a.id;
    reply_.r_last = t.next + 1 == t.beats;
    reply_.r_resp = t.resp != OKAY ? t.resp : from ? OKAY : DECERR;
    const uint64_t moved = step(t.a);
    if (reply_.r_resp != OKAY || moved < bytes_) {  // lanes that the beat does not move too
      for (uint64_t i = 0; i < bytes_ / 4; ++i) reply_.r_data[i] = random_.next();
    }
    if (reply_.r_resp == OKAY) {
      const uint64_t lane = (t.a.addr + static_cast<uint64_t>(t.next) * moved) % bytes_;
      std::memcpy(reinterpret_cast<uint8_t*>(reply_.r_data) + lane, from, moved);
    }
  }

  // Transactions of before a reset go once the DRAM is through with them.
  void retire() {
    for (List* list : {&orphans_, &orphan_writes_}) {
      list->remove_if([](const Transaction& t) { return std::all_of(t.done.begin(), t.done.end(), [](const dram::Completion& d) { return d.waiting == 0; }); });
    }
  }

  Memory& memory_;
  AxiConfig c_;
  uint64_t bytes_;
  int size_ = 0;
  Random random_;
  uint64_t now_ = 0;
  AxiRequest last_{};
  AxiReply reply_{};
  bool held_[AXI_CHANNELS] = {}, stalled_[AXI_CHANNELS] = {};
  uint64_t transfers_[AXI_CHANNELS] = {}, waits_[AXI_CHANNELS] = {};
  List reads_, writes_, orphans_, orphan_writes_;  // oldest first
  List::iterator filling_ = writes_.end();         // the write that the next data belong to
  std::deque<Data> data_;                          // data whose address is not there yet
  int64_t owed_ = 0;                               // beats of accepted addresses that have not come
  Transaction* current_ = nullptr;                 // read burst that has begun
  Transaction *reading_ = nullptr, *answering_ = nullptr;
  uint64_t read_count_ = 0, write_count_ = 0;
  std::vector<Range> purposes_;
  std::vector<Fail> fails_;
  std::map<uint64_t, Resp> fail_read_, fail_write_;
  std::map<uint32_t, AxiCounts> counts_;
  std::vector<std::string> errors_;
};

// ---- pins of a verilated model -----------------------------------------------------------------

namespace pins {

// 32-bit word of a port: Verilator has ports of up to 64 bits as integers, wider ones as arrays of words.
template <class T>
uint32_t word(const T& port, int i) {
  if constexpr (std::is_integral_v<T>) {
    return static_cast<uint32_t>(static_cast<uint64_t>(port) >> (32 * i));
  } else {
    return port[i];
  }
}
template <class T>
void load(const T& port, uint32_t* words) {
  for (size_t i = 0; i < (sizeof(T) + 3) / 4; ++i) words[i] = word(port, static_cast<int>(i));
}
template <class T>
void store(T& port, const uint32_t* words) {
  if constexpr (std::is_integral_v<T>) {
    uint64_t value = words[0];
    if (sizeof(T) > 4) value |= static_cast<uint64_t>(words[1]) << 32;
    port = static_cast<T>(value);
  } else {
    for (size_t i = 0; i < sizeof(T) / 4; ++i) port[i] = words[i];
  }
}

// At most 64 bits of a port, from bit `low` on.
template <class T>
uint64_t bits(const T& port, int low, int count) {
  uint64_t value = 0;
  for (int k = 0, at = low; k < count; k += 32 - at % 32, at = low + k) value |= static_cast<uint64_t>(word(port, at / 32) >> at % 32) << k;
  return count < 64 ? value & ((1ull << count) - 1) : value;
}
// Any number of bits of a port, to and from bit 0 of `words`.
template <class T>
void take(const T& port, int low, int count, uint32_t* words) {
  for (int k = 0; k < count; k += 32) words[k / 32] = static_cast<uint32_t>(bits(port, low + k, std::min(count - k, 32)));
}
template <class T>
void put(T& port, int low, int count, const uint32_t* words) {
  for (int k = 0; k < count; k += 32) {
    const int size = std::min(count - k, 32), at = low + k, shift = at % 32;
    const uint64_t mask = ((1ull << size) - 1) << shift, value = static_cast<uint64_t>(words[k / 32]) << shift & mask;
    if constexpr (std::is_integral_v<T>) {
      port = static_cast<T>((port & ~mask) | value);  // of at most 32 bits
    } else {
      port[at / 32] = static_cast<uint32_t>((port[at / 32] & ~mask) | value);
      if (size > 32 - shift) port[at / 32 + 1] = static_cast<uint32_t>((port[at / 32 + 1] & ~(mask >> 32)) | value >> 32);
    }
  }
}
template <class T>
void put(T& port, int low, int count, uint32_t value) {
  put(port, low, count, &value);
}

}  // namespace pins

// Channels of flk_axi_pkg, packed structs of model/flicker/layout.py: element `k` of the ports `ar_valid_o`, `ar_o`, ... of a model (arrays; a single one is element 0).
namespace channels {

constexpr int ID = 4, ADDR = 40, DATA = 512, STRB = DATA / 8;
constexpr int AX = ID + ADDR + 8 + 3 + 2, R = ID + 1 + 2 + DATA, W = 1 + STRB + DATA, B = ID + 2;

template <class T>
void sample_address(AxiAddress& to, bool valid, const T& port, int k) {
  to.valid = valid;
  if (!valid) return;
  const uint64_t ax = pins::bits(port, k * AX, AX);
  to.burst = ax & 3;
  to.size = ax >> 2 & 7;
  to.len = ax >> 5 & 255;
  to.addr = ax >> 13 & ((1ull << ADDR) - 1);
  to.id = static_cast<uint32_t>(ax >> (13 + ADDR));
}
template <class Top>
void sample_read(AxiRequest& request, const Top& top, int k) {
  sample_address(request.ar, top.ar_valid_o >> k & 1, top.ar_o, k);
  request.r_ready = top.r_ready_o >> k & 1;
}
template <class Top>
void sample_write(AxiRequest& request, const Top& top, int k) {
  sample_address(request.aw, top.aw_valid_o >> k & 1, top.aw_o, k);
  request.w_valid = top.w_valid_o >> k & 1;
  if (request.w_valid) {
    pins::take(top.w_o, k * W, DATA, request.w_data);
    request.w_strb = pins::bits(top.w_o, k * W + DATA, STRB);
    request.w_last = pins::bits(top.w_o, k * W + DATA + STRB, 1);
  }
  request.b_ready = top.b_ready_o >> k & 1;
}
template <class Top>
void drive_read(const AxiReply& reply, Top& top, int k) {
  pins::put(top.ar_ready_i, k, 1, reply.ar_ready);
  pins::put(top.r_valid_i, k, 1, reply.r_valid);
  pins::put(top.r_i, k * R, DATA, reply.r_data);
  pins::put(top.r_i, k * R + DATA, ID + 3, reply.r_id << 3 | reply.r_last << 2 | reply.r_resp);
}
template <class Top>
void drive_write(const AxiReply& reply, Top& top, int k) {
  pins::put(top.aw_ready_i, k, 1, reply.aw_ready);
  pins::put(top.w_ready_i, k, 1, reply.w_ready);
  pins::put(top.b_valid_i, k, 1, reply.b_valid);
  pins::put(top.b_i, k * B, B, reply.b_id << 2 | reply.b_resp);
}

}  // namespace channels
}  // namespace flk

// Ports `<prefix>aw_valid_o`, ... of a model with Verilator's names, for example FLK_AXI_SAMPLE(request, *top_, dram_). Separate ones for designs that only
// read or only write; `_id`: a design without ids has id 0.
#define FLK_AXI_SAMPLE_READ(request, top, prefix)       \
  do {                                                  \
    (request).ar.valid = (top).prefix##ar_valid_o;      \
    (request).ar.id = (top).prefix##ar_id_o;            \
    (request).ar.addr = (top).prefix##ar_addr_o;        \
    (request).ar.len = (top).prefix##ar_len_o;          \
    (request).ar.size = (top).prefix##ar_size_o;        \
    (request).ar.burst = (top).prefix##ar_burst_o;      \
    (request).r_ready = (top).prefix##r_ready_o;        \
  } while (0)
#define FLK_AXI_SAMPLE_WRITE(request, top, prefix)      \
  do {                                                  \
    (request).aw.valid = (top).prefix##aw_valid_o;      \
    (request).aw.id = (top).prefix##aw_id_o;            \
    (request).aw.addr = (top).prefix##aw_addr_o;        \
    (request).aw.len = (top).prefix##aw_len_o;          \
    (request).aw.size = (top).prefix##aw_size_o;        \
    (request).aw.burst = (top).prefix##aw_burst_o;      \
    (request).w_valid = (top).prefix##w_valid_o;        \
    flk::pins::load((top).prefix##w_data_o, (request).w_data); \
    (request).w_strb = (top).prefix##w_strb_o;          \
    (request).w_last = (top).prefix##w_last_o;          \
    (request).b_ready = (top).prefix##b_ready_o;        \
  } while (0)
#define FLK_AXI_DRIVE_READ(reply, top, prefix)          \
  do {                                                  \
    (top).prefix##ar_ready_i = (reply).ar_ready;        \
    (top).prefix##r_valid_i = (reply).r_valid;          \
    (top).prefix##r_id_i = (reply).r_id;                \
    flk::pins::store((top).prefix##r_data_i, (reply).r_data); \
    (top).prefix##r_resp_i = (reply).r_resp;            \
    (top).prefix##r_last_i = (reply).r_last;            \
  } while (0)
#define FLK_AXI_DRIVE_WRITE(reply, top, prefix)         \
  do {                                                  \
    (top).prefix##aw_ready_i = (reply).aw_ready;        \
    (top).prefix##w_ready_i = (reply).w_ready;          \
    (top).prefix##b_valid_i = (reply).b_valid;          \
    (top).prefix##b_id_i = (reply).b_id;                \
    (top).prefix##b_resp_i = (reply).b_resp;            \
  } while (0)
// Of a design that has them; without it they are 0.
#define FLK_AXI_SAMPLE_QOS(request, top, prefix)        \
  do {                                                  \
    (request).ar.qos = (top).prefix##ar_qos_o;          \
    (request).aw.qos = (top).prefix##aw_qos_o;          \
  } while (0)
#define FLK_AXI_SAMPLE(request, top, prefix)            \
  do {                                                  \
    FLK_AXI_SAMPLE_READ(request, top, prefix);          \
    FLK_AXI_SAMPLE_WRITE(request, top, prefix);         \
  } while (0)
#define FLK_AXI_DRIVE(reply, top, prefix)               \
  do {                                                  \
    FLK_AXI_DRIVE_READ(reply, top, prefix);             \
    FLK_AXI_DRIVE_WRITE(reply, top, prefix);            \
  } while (0)
