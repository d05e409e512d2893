// LPDDR4 at the level of commands: when the bursts of a memory move.
//
// Open-page policy. A channel has a queue of `window` reads and one of `writes` writes. Writes are gathered: they move while no read waits, or once three
// quarters of their places are taken, until a quarter is. Of a queue the burst whose data can move first is served, the oldest among equals, so that row hits go
// first and activates overlap with the data of other banks; a burst is passed over at most 4 x its queue's places times. With `writes` 0 both kinds share the
// `window`, and the bus turns as rarely as that allows.
// Urgent bursts enter a full queue before others; in it they are bursts like all.
// Refresh: all banks of a channel every tREFI, for tRFCab; or one bank every tREFI / banks, for tRFCpb, while the others go on: of those that the round has still
// to refresh the one that fewest bursts in the queue wait for. It counts as an activate for tRRD and tFAW.
// Consecutive addresses go to the channels in turn, `interleave_bytes` each; within a channel page by page to the banks in turn, the bank number exclusive-or'ed
// with the row. Left out: the command bus, latency of the controller, dependences between bursts.
//
// Times are clocks of the command bus. `run` takes a list of bursts that all wait from clock 0 on and enter the queues in this order, `run_behind` one of an owner with a narrow port; `Engine` takes them as they come
// (`push`, in order of time) and decides no column command before `advance` has reached its clock, so that whatever comes earlier can still go first.
// Numbers come from flicker/chip/constants.py through chip/dram.py; docs/reference/memory_model.md.
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
  int64_t channels, banks, interleave_bytes, page_bytes, burst_bytes, window, writes;
  int64_t rcd, rp, rp_all, ras, rrd, faw, ccd, ccd_masked, rtp;
  int64_t write_pre, write_read, read_write;  // write to precharge, write to read, read to write
  int64_t refi, rfc, rfc_bank;                // refi 0: no refresh; rfc_bank 0: all banks at once, for rfc
  int64_t rl, wl, half;                       // half: clocks of a burst's data
  int64_t clock_hz, chip_hz;                  // of the command bus, of the chip
};

// Tells whoever pushed a burst that its data have moved, or, of a write that is gathered, that it has a place: `waiting` bursts are still to come, those that
// came were through at `clock`; 0: they had their places when they were pushed.
struct Completion {
  int64_t clock = 0;
  int32_t waiting = 0;
};

struct Place {
  int64_t channel, bank, row;
};

// Of some bursts: rows that were opened for them, and clocks of their channels' buses that went to that (`Counts::rows`).
struct Rows {
  uint64_t opened = 0, clocks = 0;
};

// Of a channel's clocks up to its last column command each is one of: data (a burst's tCCD), nothing waits, the bus turns between reads and writes, a refresh
// holds the banks, or the rest: rows are opened, a masked write's bank.
struct Counts {
  int64_t clocks = 0;  // until the last data
  int64_t activates = 0, refreshes = 0, bursts = 0;
  int64_t data = 0, idle = 0, turning = 0, refreshing = 0, rows = 0;
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
      : t_(t), bank_(t.banks), queue_{Queue(t.window), Queue(t.writes)}, next_refresh_(t.rfc_bank > 0 ? t.refi / t.banks : t.refi) {}

  // Number of the queue that bursts of this kind are in.
  int queue_of(int8_t kind) const { return kind != READ && t_.writes > 0; }
  bool empty() const { return queue_[0].waiting + queue_[1].waiting == 0; }
  bool full(int queue) const { return queue_[queue].waiting == queue_[queue].places; }

  // A burst that waits from `clock` on, or from the column command that freed its place. Not when its queue is full.
  void push(int64_t bank, int64_t row, int8_t kind, int64_t clock = 0, Completion* done = nullptr, Rows* rows = nullptr) {
    Queue& q = queue_[queue_of(kind)];
    if (q.head + q.waiting == static_cast<int>(q.burst.size())) {  // at least half of the places lie before the queue
      std::copy(q.burst.begin() + q.head, q.burst.begin() + q.head + q.waiting, q.burst.begin());
      q.head = 0;
    }
    q.burst[q.head + q.waiting++] = {row, std::max({clock, last_column_, int64_t{0}}), done, rows, static_cast<int32_t>(bank), kind};
    chosen_ = false;
  }

  // Clock of the next column command. Not when empty.
  int64_t next() {
    if (!chosen_) choose();
    return column_;
  }

  // Issues the next column command; the queue that has a place now. Not when empty.
  int step() {
    if (!chosen_) choose();
    Queue& q = queue_[writing_];
    const Burst burst = q.burst[q.head + best_];
    Bank& bank = bank_[burst.bank];
    q.passed_over = best_ > 0 ? q.passed_over + 1 : 0;
    if (activate_ >= 0) {
      activated(activate_);
      ++counts.activates;
      bank.row = burst.row;
      bank.column = activate_ + t_.rcd;
      bank.precharge = activate_ + t_.ras;
    }
    const int64_t waited = account(burst.kind);
    if (burst.rows) {
      burst.rows->opened += activate_ >= 0;
      burst.rows->clocks += waited;
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
    for (int w = best_; w > 0; --w) q.burst[q.head + w] = q.burst[q.head + w - 1];
    ++q.head;
    --q.waiting;
    chosen_ = false;
    return writing_;
  }

  int64_t last_column() const { return last_column_; }  // clock of the last column command

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
    Rows* rows;
    int32_t bank;
    int8_t kind;
  };
  struct Queue {
    explicit Queue(int64_t n) : places(static_cast<int>(n)), burst(2 * n) {}
    int places;
    std::vector<Burst> burst;  // `waiting` from `head` on, oldest first
    int head = 0, waiting = 0;
    int64_t passed_over = 0;
  };

  // What the clocks since the last column command went to, before the one of a burst of this kind; those of them that went to rows.
  int64_t account(int8_t kind) {
    int64_t from = std::max<int64_t>(last_column_ + t_.ccd, 0), arrived = NEVER;
    for (const Queue& q : queue_) {
      if (q.waiting > 0) arrived = std::min(arrived, q.burst[q.head].arrived);
    }
    const auto until = [&](int64_t clock, int64_t& sum) {
      clock = std::min(clock, column_);
      sum += std::max<int64_t>(clock - from, 0);
      from = std::max(from, clock);
    };
    until(arrived, counts.idle);
    if ((kind == READ) != (last_kind_ == READ)) until(last_column_ + (kind == READ ? t_.write_read : t_.read_write), counts.turning);
    until(refreshed_, counts.refreshing);
    const int64_t before = counts.rows;
    until(column_, counts.rows);
    counts.data += t_.ccd;
    return counts.rows - before;
  }

  // Whether writes or reads move next.
  void turn() {
    const int reads = queue_[0].waiting, writes = queue_[1].waiting;
    if (writes == 0 || (reads > 0 && writes <= queue_[1].places / 4)) writing_ = false;
    if (writes > 0 && (reads == 0 || writes >= queue_[1].places - queue_[1].places / 4)) writing_ = true;
  }

  void refresh(const Queue& q) {
    while (t_.refi > 0 && std::max(last_column_ + t_.ccd, q.burst[q.head].arrived) >= next_refresh_) {
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
    refreshed_ = start + t_.rp_all + t_.rfc;
    next_refresh_ += t_.refi;
  }

  void refresh_bank() {
    for (Bank& bank : bank_) bank.waiting = 0;
    for (const Queue& q : queue_) {
      for (int w = 0; w < q.waiting; ++w) ++bank_[q.burst[q.head + w].bank].waiting;
    }
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
    turn();
    const Queue& q = queue_[writing_];
    refresh(q);
    const int64_t activate_min = std::max(activates_[3] + t_.rrd, activates_[0] + t_.faw);
    const int64_t read_min = last_column_ + (last_kind_ != READ ? t_.write_read : t_.ccd);
    const int64_t write_min = last_column_ + (last_kind_ == READ ? t_.read_write : t_.ccd);
    const bool patient = q.passed_over < 4 * q.places;
    best_ = 0;
    activate_ = 0;
    int64_t best = NEVER;
    for (int w = 0; w < q.waiting; ++w) {
      const Burst& burst = q.burst[q.head + w];
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
      if (column < best) {
        best_ = w;
        best = column_ = column;
        activate_ = activate;
        if (column == last_column_ + t_.ccd) break;  // nothing can be earlier
      }
      if (!patient) break;  // the oldest has waited long enough
    }
    chosen_ = true;
  }

  Timing t_;
  std::vector<Bank> bank_;
  Queue queue_[2];        // reads, or all bursts if writes have no places; writes
  bool writing_ = false;  // which of them is served
  int64_t activates_[4] = {FAR, FAR, FAR, FAR};  // the last four
  int64_t last_column_ = FAR, next_refresh_;
  int64_t round_ = 0;                            // of refreshes, every bank once
  int64_t refreshed_ = FAR;                      // the last one of all banks ends
  int8_t last_kind_ = READ;
  bool chosen_ = false;  // the next command is known: that of the served queue's entry `best_`
  int best_ = 0;
  int64_t column_ = 0, activate_ = 0;  // its clocks; no activate: -1
};

// Bursts that all wait from clock 0 on and enter the queues in this order: one whose queue is full holds those behind it back. counts: of each channel.
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
      while (channel.full(channel.queue_of(kind[i]))) channel.step();
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

  // A burst (byte address, taken down to a multiple of burst_bytes) at a clock not before that of `advance` nor of another push. `done` stays until it has been told, `rows` with the engine.
  // `urgent`: it takes the next place in its channel's queue before all that are not.
  void push(int64_t clock, uint64_t address, int8_t kind, Completion* done = nullptr, bool urgent = false, Rows* rows = nullptr) {
    const Place p = map_(static_cast<int64_t>(address / static_cast<uint64_t>(t_.burst_bytes)));
    Lane& lane = lane_[p.channel];
    const int queue = lane.channel.queue_of(kind);
    const Waiting burst{p.bank, p.row, clock, done, rows, kind};
    if (lane.channel.full(queue)) {
      if (done) ++done->waiting;
      lane.later[queue][!urgent].push_back(burst);
    } else {  // then none waits for a place
      if (done && queue == 0) ++done->waiting;
      enter(lane, burst);
    }
  }

  // Whether the queue that a burst (address / burst_bytes) of this kind goes to has a place.
  bool space(int64_t burst, int8_t kind) const {
    const Channel& channel = lane_[map_.channel(burst)].channel;
    return !channel.full(channel.queue_of(kind));
  }

  // Issues the column commands before `clock`.
  void advance(int64_t clock) {
    for (Lane& lane : lane_) {
      while (!lane.channel.empty() && lane.channel.next() < clock) {
        const int queue = lane.channel.step();
        for (std::deque<Waiting>& later : lane.later[queue]) {
          if (later.empty()) continue;
          const Waiting& burst = later.front();
          if (burst.done && queue == 1) {
            burst.done->clock = std::max(burst.done->clock, lane.channel.last_column());
            --burst.done->waiting;
          }
          enter(lane, burst);
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
      sum.data += lane.channel.counts.data;
      sum.idle += lane.channel.counts.idle;
      sum.turning += lane.channel.counts.turning;
      sum.refreshing += lane.channel.counts.refreshing;
      sum.rows += lane.channel.counts.rows;
    }
    return sum;
  }

 private:
  struct Waiting {
    int64_t bank, row, clock;
    Completion* done;
    Rows* rows;
    int8_t kind;
  };
  struct Lane {
    Channel channel;
    std::deque<Waiting> later[2][2];  // bursts that a queue of the controller has no place for yet, by queue: urgent ones, others
  };

  // Writes that are gathered tell of their place, not of their data.
  static void enter(Lane& lane, const Waiting& w) {
    lane.channel.push(w.bank, w.row, w.kind, w.clock, lane.channel.queue_of(w.kind) == 1 ? nullptr : w.done, w.rows);
  }

  Timing t_;
  Map map_;
  std::vector<Lane> lane_;
  int64_t clocks_, cycles_;
};

// What lies between the bursts' owner and the channels. bytes: that its port moves in a cycle of the chip, of reads and of writes each; reads: bursts under
// way at most; ahead: places in the list by which a read may be asked for before the oldest write that has not left.
struct Behind {
  int64_t bytes, reads, ahead;
};

// Bursts of one owner behind a port that is narrower than the memory: cycles of the chip until all have moved. burst, kind: in the order in which their owner comes to
// them; a write leaves when the port has moved its data and all reads before it have come. Read data come in any order.
inline int64_t run_behind(const Timing& t, int64_t size, const int64_t* burst, const int8_t* kind, const Behind& port) {
  Engine engine(t);
  std::vector<Completion> done(size);
  std::vector<char> come(size, 0);
  std::vector<int64_t> under_way;  // reads
  const auto next = [&](int64_t i, bool read) {
    while (i < size && (kind[i] == READ) != read) ++i;
    return i;
  };
  const int64_t most = std::max(port.bytes, t.burst_bytes);
  int64_t read = next(0, true), write = next(0, false), oldest = read, cycle = 0, in = 0, out = 0;  // in, out: bytes that the port has moved, of the next bursts
  for (; read < size || write < size || !under_way.empty(); ++cycle) {
    const int64_t clock = engine.clock_of(cycle);
    engine.advance(clock);
    in = std::min(in + port.bytes, most);
    out = std::min(out + port.bytes, most);
    const auto comes = [&](int64_t i) {
      if (in < t.burst_bytes || done[i].waiting != 0 || done[i].clock > clock) return false;
      in -= t.burst_bytes;
      return static_cast<bool>(come[i] = 1);
    };
    under_way.erase(std::remove_if(under_way.begin(), under_way.end(), comes), under_way.end());
    while (oldest < size && come[oldest]) oldest = next(oldest + 1, true);
    while (read < size && static_cast<int64_t>(under_way.size()) < port.reads && (write == size || read - write < port.ahead)) {
      under_way.push_back(read);
      engine.push(clock, burst[read] * t.burst_bytes, READ, &done[read]);
      read = next(read + 1, true);
    }
    while (write < size && out >= t.burst_bytes && write < oldest && engine.space(burst[write], kind[write])) {
      out -= t.burst_bytes;
      engine.push(clock, burst[write] * t.burst_bytes, kind[write]);
      write = next(write + 1, false);
    }
  }
  engine.finish();
  return std::max(cycle, engine.cycle_of(engine.counts().clocks));
}

}  // namespace flk::dram
