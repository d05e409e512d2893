// LPDDR4 at the level of commands: when the bursts of a memory move.
//
// Open-page policy, one queue of `window` bursts a channel. Of those waiting the one whose data can move first is served, the oldest among equals, so that row
// hits go first, activates overlap with the data of other banks and the bus turns as rarely as the window allows; a burst is passed over at most 4 x window times.
// Urgent bursts are chosen as if their data could move `lead` clocks earlier.
// Refresh: all banks of a channel every tREFI, for tRFCab; or one bank every tREFI / banks, for tRFCpb, while the others go on: of those that the round has still
// to refresh the one that fewest bursts in the queue wait for. It counts as an activate for tRRD and tFAW.
// Consecutive addresses go to the channels in turn, `interleave_bytes` each; within a channel page by page to the banks in turn, the bank number exclusive-or'ed
// with the row. Left out: the command bus, latency of the controller, dependences between bursts.
//
// Times are clocks of the command bus. Two ways to use it: `run` takes a list of bursts that all wait from clock 0 on; `Engine` takes them as they come
// (`push`, in order of time) and decides no column command before `advance` has reached its clock, so that whatever comes earlier can still go first.
// Numbers come from flicker/chip/constants.py through chip/dram.py; docs/memory_model.md.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <numeric>
#include <thread>
#include <vector>

namespace flk::dram {

enum Kind : int8_t { READ = 0, WRITE = 1, MASKED_WRITE = 2 };

// Organisation and timing, as chip/dram.py hands them in: sim/memory.py has the same fields in the same order. Clocks unless named otherwise.
struct Timing {
  int64_t channels, banks, interleave_bytes, page_bytes, burst_bytes, window, lead;
  int64_t rcd, rp, rp_all, ras, rrd, faw, ccd, ccd_masked, rtp;
  int64_t write_pre, write_read, read_write;  // write to precharge, write to read, read to write
  int64_t refi, rfc, rfc_bank;                // refi 0: no refresh; rfc_bank 0: all banks at once, for rfc
  int64_t rl, wl, half;                       // half: clocks of a burst's data
  int64_t clock_hz, chip_hz;                  // of the command bus, of the chip
};

// Tells whoever pushed a burst that its data have moved: `waiting` bursts are still to come, those that came were through at `clock`.
struct Completion {
  int64_t clock = 0;
  int32_t waiting = 0;
};

struct Place {
  int64_t channel, bank, row;
};

struct Counts {
  int64_t clocks = 0;  // until the last data
  int64_t activates = 0, refreshes = 0, bursts = 0;
};

// Where a burst (address / burst_bytes) lies.
class Map {
 public:
  explicit Map(const Timing& t)
      : granule_(shift(t.interleave_bytes / t.burst_bytes)), channels_(shift(t.channels)), columns_(shift(t.page_bytes / t.burst_bytes)), banks_(shift(t.banks)) {}
  int64_t channel(int64_t burst) const { return burst >> granule_ & low(channels_); }
  Place operator()(int64_t burst) const {
    const int64_t page = (burst >> (granule_ + channels_) << granule_ | (burst & low(granule_))) >> columns_;
    const int64_t row = page >> banks_;
    return {channel(burst), (page ^ row) & low(banks_), row};
  }

 private:
  static int shift(int64_t power) {
    int n = 0;
    while (int64_t{1} << n < power) ++n;
    return n;
  }
  static int64_t low(int bits) { return (int64_t{1} << bits) - 1; }
  int granule_, channels_, columns_, banks_;
};

// One channel: its banks, its bus, the bursts its controller sees.
class Channel {
 public:
  static constexpr int64_t FAR = -(int64_t{1} << 40), NEVER = int64_t{1} << 60;

  explicit Channel(const Timing& t)
      : t_(t), bank_(t.banks), queue_(2 * t.window), next_refresh_(t.rfc_bank > 0 ? t.refi / t.banks : t.refi) {}

  bool empty() const { return waiting_ == 0; }
  bool full() const { return waiting_ == t_.window; }

  // A burst that waits from `clock` on, or from the column command that freed its place. Not when full.
  void push(int64_t bank, int64_t row, int8_t kind, int64_t clock = 0, Completion* done = nullptr, bool urgent = false) {
    if (head_ + waiting_ == static_cast<int>(queue_.size())) {  // at least half of the places lie before the queue
      std::copy(queue_.begin() + head_, queue_.begin() + head_ + waiting_, queue_.begin());
      head_ = 0;
    }
    queue_[head_ + waiting_++] = {row, std::max({clock, last_column_, int64_t{0}}), done, static_cast<int32_t>(bank), kind, urgent};
    urgent_ += urgent;
    chosen_ = false;
  }

  // Clock of the next column command. Not when empty.
  int64_t next() {
    if (!chosen_) choose();
    return column_;
  }

  // Issues the next column command. Not when empty.
  void step() {
    if (!chosen_) choose();
    const Burst burst = queue_[head_ + best_];
    Bank& bank = bank_[burst.bank];
    passed_over_ = best_ > 0 ? passed_over_ + 1 : 0;
    if (activate_ >= 0) {
      activated(activate_);
      ++counts.activates;
      bank.row = burst.row;
      bank.column = activate_ + t_.rcd;
      bank.precharge = activate_ + t_.ras;
    }
    const bool read = burst.kind == READ;
    bank.precharge = std::max(bank.precharge, column_ + (read ? t_.rtp : t_.write_pre));
    if (!read) bank.wrote = column_;
    const int64_t end = column_ + (read ? t_.rl : t_.wl) + t_.half;
    counts.clocks = std::max(counts.clocks, end);
    ++counts.bursts;
    if (burst.done) {
      burst.done->clock = std::max(burst.done->clock, end);
      --burst.done->waiting;
    }
    last_column_ = column_;
    last_kind_ = burst.kind;
    urgent_ -= burst.urgent;
    for (int w = best_; w > 0; --w) queue_[head_ + w] = queue_[head_ + w - 1];
    ++head_;
    --waiting_;
    chosen_ = false;
  }

  Counts counts;

 private:
  struct Bank {
    int64_t row = -1;       // open one
    int64_t activate = 0;   // earliest, when closed
    int64_t precharge = 0;  // earliest, when open
    int64_t column = 0;     // earliest, when open
    int64_t wrote = FAR;    // last write's column command
    int64_t round = 0;      // its next refresh's, if banks are refreshed one by one
    int waiting = 0;        // bursts, when that is chosen
  };
  struct Burst {
    int64_t row, arrived;
    Completion* done;
    int32_t bank;
    int8_t kind;
    bool urgent;
  };

  void refresh() {
    while (t_.refi > 0 && std::max(last_column_ + t_.ccd, queue_[head_].arrived) >= next_refresh_) {
      if (t_.rfc_bank > 0) {
        refresh_bank();
      } else {
        refresh_all();
      }
      ++counts.refreshes;
    }
  }

  void refresh_all() {
    int64_t start = next_refresh_;
    for (const Bank& bank : bank_) {
      if (bank.row >= 0) start = std::max(start, bank.precharge);
    }
    for (Bank& bank : bank_) {
      bank.row = -1;
      bank.activate = start + t_.rp_all + t_.rfc;
    }
    next_refresh_ += t_.refi;
  }

  void refresh_bank() {
    for (Bank& bank : bank_) bank.waiting = 0;
    for (int w = 0; w < waiting_; ++w) ++bank_[queue_[head_ + w].bank].waiting;
    Bank* best = nullptr;
    for (Bank& bank : bank_) {
      if (bank.round == round_ && (!best || bank.waiting < best->waiting)) best = &bank;
    }
    const int64_t precharged = best->row >= 0 ? std::max(next_refresh_, best->precharge) + t_.rp : best->activate;
    const int64_t start = std::max({next_refresh_, activates_[3] + t_.rrd, activates_[0] + t_.faw, precharged});
    best->row = -1;
    best->activate = start + t_.rfc_bank;
    activated(start);
    next_refresh_ += t_.refi / t_.banks;
    ++best->round;
    if (std::all_of(bank_.begin(), bank_.end(), [&](const Bank& bank) { return bank.round != round_; })) ++round_;
  }

  void activated(int64_t clock) {
    std::copy(activates_ + 1, activates_ + 4, activates_);
    activates_[3] = clock;
  }

  void choose() {
    refresh();
    const int64_t activate_min = std::max(activates_[3] + t_.rrd, activates_[0] + t_.faw);
    const int64_t read_min = last_column_ + (last_kind_ != READ ? t_.write_read : t_.ccd);
    const int64_t write_min = last_column_ + (last_kind_ == READ ? t_.read_write : t_.ccd);
    const bool patient = passed_over_ < 4 * t_.window;
    best_ = 0;
    activate_ = 0;
    int64_t best = NEVER;
    for (int w = 0; w < waiting_; ++w) {
      const Burst& burst = queue_[head_ + w];
      const Bank& bank = bank_[burst.bank];
      int64_t activate = -1, column = bank.column;
      if (bank.row != burst.row) {
        activate = std::max(burst.arrived, bank.activate);
        if (bank.row >= 0) activate = std::max(activate, std::max(burst.arrived, bank.precharge) + t_.rp);
        activate = std::max(activate, activate_min);
        column = activate + t_.rcd;
      }
      column = std::max({column, burst.arrived, burst.kind == READ ? read_min : write_min});
      if (burst.kind == MASKED_WRITE) column = std::max(column, bank.wrote + t_.ccd_masked);
      const int64_t rank = column - (burst.urgent ? t_.lead : 0);
      if (rank < best) {
        best_ = w;
        best = rank;
        column_ = column;
        activate_ = activate;
        if (column == last_column_ + t_.ccd && (burst.urgent || urgent_ == 0)) break;  // nothing can be earlier
      }
      if (!patient) break;  // the oldest has waited long enough
    }
    chosen_ = true;
  }

  Timing t_;
  std::vector<Bank> bank_;
  std::vector<Burst> queue_;  // `waiting_` from `head_` on, oldest first
  int head_ = 0, waiting_ = 0, urgent_ = 0;
  int64_t activates_[4] = {FAR, FAR, FAR, FAR};  // the last four
  int64_t last_column_ = FAR, next_refresh_;
  int64_t round_ = 0;                            // of refreshes, every bank once
  int64_t passed_over_ = 0;
  int8_t last_kind_ = READ;
  bool chosen_ = false;  // the next command is known: that of the queue's entry `best_`
  int best_ = 0;
  int64_t column_ = 0, activate_ = 0;  // its clocks; no activate: -1
};

// Bursts that all wait from clock 0 on, in this order; counts: of each channel.
inline void run(const Timing& t, int64_t size, const int64_t* burst, const int8_t* kind, Counts* counts) {
  const Map map(t);
  const int64_t cores = std::max(1u, std::thread::hardware_concurrency());
  const int64_t threads = size < 50'000 ? 1 : std::min(cores, t.channels);
  auto work = [&](int64_t first) {
    std::vector<Channel> channels(t.channels, Channel(t));
    for (int64_t i = 0; i < size; ++i) {
      if (threads > 1 && map.channel(burst[i]) % threads != first) continue;
      const Place p = map(burst[i]);
      Channel& channel = channels[p.channel];
      if (channel.full()) channel.step();
      channel.push(p.bank, p.row, kind[i]);
    }
    for (int64_t k = first; k < t.channels; k += threads) {
      while (!channels[k].empty()) channels[k].step();
      counts[k] = channels[k].counts;
    }
  };
  std::vector<std::thread> pool;
  for (int64_t k = 1; k < threads; ++k) pool.emplace_back(work, k);
  work(0);
  for (std::thread& thread : pool) thread.join();
}

// All channels, fed while time goes on.
class Engine {
 public:
  explicit Engine(const Timing& t) : t_(t), map_(t), lane_(t.channels, Lane{Channel(t), {}}) {
    const int64_t common = std::gcd(t.clock_hz, t.chip_hz);
    clocks_ = t.clock_hz / common;
    cycles_ = t.chip_hz / common;
  }

  const Timing& timing() const { return t_; }
  // First clock at or after the beginning of a cycle of the chip; first cycle that begins at or after a clock.
  int64_t clock_of(int64_t cycle) const { return (cycle * clocks_ + cycles_ - 1) / cycles_; }
  int64_t cycle_of(int64_t clock) const { return (clock * cycles_ + clocks_ - 1) / clocks_; }

  // A burst (byte address, taken down to a multiple of burst_bytes) at a clock not before that of `advance` nor of another push. `done` stays until it has been told.
  // `urgent`: it takes the next place in its channel's queue before all that are not, and has a lead there.
  void push(int64_t clock, uint64_t address, int8_t kind, Completion* done = nullptr, bool urgent = false) {
    const Place p = map_(static_cast<int64_t>(address / static_cast<uint64_t>(t_.burst_bytes)));
    Lane& lane = lane_[p.channel];
    if (done) ++done->waiting;
    if (!lane.channel.full()) {  // then none waits for a place
      lane.channel.push(p.bank, p.row, kind, clock, done, urgent);
    } else {
      lane.later[!urgent].push_back({p.bank, p.row, clock, done, kind, urgent});
    }
  }

  // Issues the column commands before `clock`.
  void advance(int64_t clock) {
    for (Lane& lane : lane_) {
      while (!lane.channel.empty() && lane.channel.next() < clock) {
        lane.channel.step();
        for (std::deque<Waiting>& later : lane.later) {
          if (later.empty()) continue;
          const Waiting& w = later.front();
          lane.channel.push(w.bank, w.row, w.kind, w.clock, w.done, w.urgent);
          later.pop_front();
          break;
        }
      }
    }
  }

  void finish() { advance(std::numeric_limits<int64_t>::max()); }

  bool empty() const {
    return std::all_of(lane_.begin(), lane_.end(), [](const Lane& lane) { return lane.channel.empty(); });
  }

  Counts counts() const {
    Counts sum;
    for (const Lane& lane : lane_) {
      sum.clocks = std::max(sum.clocks, lane.channel.counts.clocks);
      sum.activates += lane.channel.counts.activates;
      sum.refreshes += lane.channel.counts.refreshes;
      sum.bursts += lane.channel.counts.bursts;
    }
    return sum;
  }

 private:
  struct Waiting {
    int64_t bank, row, clock;
    Completion* done;
    int8_t kind;
    bool urgent;
  };
  struct Lane {
    Channel channel;
    std::deque<Waiting> later[2];  // bursts that the controller's queue has no place for yet: urgent ones, others
  };
  Timing t_;
  Map map_;
  std::vector<Lane> lane_;
  int64_t clocks_, cycles_;
};

}  // namespace flk::dram
