// Runs flk_delivery alone (delivery.py): units that always have an entry, cores that take a record a cycle, the records behind an AXI4 port of 256 bits.
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "Vtop.h"
#include "memory.hpp"
#include "verilated.h"

namespace {

// Sub-tile s of a tile is of core s mod FLK_CORES.
constexpr int UNITS = 4, SUBTILES = 4, NUMBER_BITS = 24, ENTRY_BITS = NUMBER_BITS + SUBTILES;

// Bits of a port that Verilator makes of 32-bit words.
void put(WData* words, int low, int bits, uint64_t value) {
  for (int b = 0; b < bits; ++b) {
    const int at = low + b;
    words[at / 32] = (words[at / 32] & ~(1u << at % 32)) | static_cast<uint32_t>(value >> b & 1) << at % 32;
  }
}

std::string g_error;

}  // namespace

extern "C" {

struct Lists {
  int64_t tiles, limit;
  const int64_t* start;      // of each tile of the walk, and behind the last: its entries
  const uint32_t* entry;     // record number above mask
  const int32_t* finished;   // tiles x sub-tiles: records after which a sub-tile is finished, -1: never
  const uint8_t* borders;    // tiles x 2: sub-tiles that touch the next tile, and the one behind it
  int64_t records;           // in memory
};

struct Result {
  int64_t cycles, lines;
  int64_t given[SUBTILES];
};

const char* delivery_error() { return g_error.c_str(); }

// Until every core has taken its last end. 1: done; 0: not within `limit` cycles; -1: something is wrong.
int delivery_run(const flk::dram::Timing* timing, int perfect, const flk::AxiConfig* config, const Lists* lists, uint64_t seed, Result* result) {
  g_error.clear();
  auto fail = [&](const std::string& text) {
    if (g_error.empty()) g_error = text;
  };
  flk::Memory memory(*timing, perfect != 0);
  flk::AxiPort port(memory, *config);
  flk::AxiRequest request{};
  constexpr uint64_t BASE = 1 << 20;
  constexpr int RECORD_BYTES = 16;
  const uint64_t size = (lists->records * RECORD_BYTES + 31) / 32 * 32;
  memory.store.allocate(BASE, size, 1);
  for (int64_t r = 0; r < lists->records; ++r) {
    const auto number = static_cast<uint32_t>(r);
    std::memcpy(memory.store.find(BASE + RECORD_BYTES * r, 4), &number, 4);
  }
  VerilatedContext context;
  context.fatalOnError(false);
  context.randReset(2);
  context.randSeed(static_cast<int>(seed % 0x7fffffff) + 1);
  auto top = std::make_unique<Vtop>(&context);
  top->record_base_i = BASE / 32;
  top->start_i = top->clear_i = 0;
  top->in_valid_i = top->in_end_i = 0;
  top->out_ready_i = top->finished_i = 0;
  top->clk_i = 0;
  top->rst_ni = 1;
  top->eval();

  struct Unit {
    int64_t tile, at, end, offered = 0;
  };
  std::vector<Unit> units(UNITS);
  for (int u = 0; u < UNITS; ++u) {
    units[u].tile = u;
    if (u < lists->tiles) units[u].at = lists->start[u], units[u].end = lists->start[u + 1];
  }
  struct Subtile {
    int64_t tile = 0, at, got = 0;  // at: entry that the next record is of, or one before it
  };
  std::vector<Subtile> subtiles(SUBTILES);
  for (Subtile& of : subtiles) of.at = lists->start[0];
  *result = {};

  constexpr int BEFORE = 100;  // cycles until the start: reset, tags are cleared
  bool ready = false;
  int64_t turn = 0;  // tile whose entries are taken
  int64_t cycle = -BEFORE;
  for (; cycle < lists->limit; ++cycle) {
    const bool reset = cycle < 4 - BEFORE;
    bool over = true;
    for (const Subtile& of : subtiles) over = over && of.tile == lists->tiles;
    if (over) break;
    top->rst_ni = !reset;
    top->start_i = cycle == 0;
    top->out_ready_i = ready ? (1 << FLK_CORES) - 1 : 0;
    int valid = 0, end = 0, finished = 0;
    for (int u = 0; u < UNITS && ready; ++u) {
      Unit& unit = units[u];
      unit.offered = unit.tile >= lists->tiles ? 0 : std::min<int64_t>(2, unit.end - unit.at + 1);
      for (int k = 0; k < unit.offered; ++k) {
        const bool last = unit.at + k == unit.end;
        valid |= 1 << (2 * u + k);
        end |= last << (2 * u + k);
        put(&top->in_entry_i[0], ENTRY_BITS * (2 * u + k), ENTRY_BITS, last ? 0 : lists->entry[unit.at + k]);
      }
    }
    for (int s = 0; s < SUBTILES; ++s) {
      if (subtiles[s].tile == lists->tiles) continue;
      const int32_t limit = lists->finished[SUBTILES * subtiles[s].tile + s];
      if (limit >= 0 && subtiles[s].got >= limit) finished |= 1 << s;
    }
    top->in_valid_i = valid;
    top->in_end_i = end;
    top->finished_i = finished;
    top->border_i = turn < lists->tiles ? lists->borders[2 * turn] | lists->borders[2 * turn + 1] << 4 : 0;
    FLK_AXI_DRIVE_READ(port.reply(), *top, );
    top->clk_i = 0;
    top->eval();
    FLK_AXI_SAMPLE_READ(request, *top, );
    if (cycle == 0 && !top->idle_o) fail("not idle at the start");
    if (!reset && top->taken_o) ++turn;
    for (int u = 0; u < UNITS; ++u) {
      Unit& unit = units[u];
      if (unit.offered && (top->in_ready_o >> u & 1)) {
        unit.at += unit.offered;
        if (unit.at > unit.end) {
          unit.tile += UNITS;
          if (unit.tile < lists->tiles) unit.at = lists->start[unit.tile], unit.end = lists->start[unit.tile + 1];
        }
      } else if (unit.offered && (top->finish_o >> u & 1)) {
        unit.end = std::min(unit.end, unit.at + unit.offered);  // the rest of the list is dropped, but for what is offered
      }
    }
    for (int k = 0; k < FLK_CORES && !reset; ++k) {
      if (!(top->out_valid_o >> k & 1) || !(top->out_ready_i >> k & 1)) continue;
      if (subtiles[k].tile == lists->tiles) {
        fail("more than the last end");
        break;
      }
      const bool end = top->out_end_o >> k & 1;
      const int for_subtile = top->out_subtile_o >> 2 * k & 3;
      if (!end && for_subtile % FLK_CORES != k) fail("core " + std::to_string(k) + " gets a record for sub-tile " + std::to_string(for_subtile));
      for (int s = k; s < SUBTILES; s += FLK_CORES) {
        if (!end && s != for_subtile) continue;
        Subtile& of = subtiles[s];
        const int64_t stop = lists->start[of.tile + 1];
        const int32_t limit = lists->finished[SUBTILES * of.tile + s];
        while (of.at < stop && !(lists->entry[of.at] >> s & 1)) ++of.at;
        if (end) {
          if (of.at < stop && (limit < 0 || of.got < limit)) fail("sub-tile " + std::to_string(s) + " lacks records of tile " + std::to_string(of.tile));
          ++of.tile;
          of.at = stop;
          of.got = 0;
        } else {
          const uint32_t number = top->out_record_o[4 * k];
          if (of.at == stop || number != lists->entry[of.at] >> SUBTILES) fail("sub-tile " + std::to_string(s) + ": record " + std::to_string(number) + " in tile " + std::to_string(of.tile));
          ++of.at;
          ++of.got;
          ++result->given[s];
        }
      }
    }
    ready = cycle > 0 && (ready || top->idle_o);
    memory.tick();
    reset ? port.reset(request) : port.cycle(request);
    top->clk_i = 1;
    top->eval();
    if (context.gotError()) fail("an assertion of the design");
    if (!port.errors().empty()) fail(port.errors().front());
    if (top->error_o && !reset) fail("error_o");
    if (!g_error.empty()) break;
  }
  result->cycles = cycle;
  result->lines = top->lines_o;
  top->final();
  if (!g_error.empty()) {
    g_error += " (cycle " + std::to_string(cycle) + ")";
    return -1;
  }
  return cycle < lists->limit;
}
}
