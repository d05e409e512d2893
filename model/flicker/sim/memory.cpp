// Functions of dram.hpp and memory.hpp for Python (memory.py, through ctypes).
#include "memory.hpp"

namespace {

struct Channels {  // an engine with the completions of its bursts
  explicit Channels(const flk::dram::Timing& timing) : engine(timing) {}
  flk::dram::Engine engine;
  std::deque<flk::dram::Completion> done;
};

struct System {
  System(const flk::dram::Timing& timing, bool perfect) : memory(timing, perfect) {}
  flk::Memory memory;
  std::vector<std::unique_ptr<flk::AxiPort>> ports;
};

thread_local std::string g_error;

}  // namespace

extern "C" {
using flk::AxiPort;
using flk::dram::Counts;
using flk::dram::Timing;

void flk_dram_run(const Timing* timing, int64_t size, const int64_t* burst, const int8_t* kind, Counts* counts) {
  flk::dram::run(*timing, size, burst, kind, counts);
}

int64_t flk_dram_run_behind(const Timing* timing, int64_t size, const int64_t* burst, const int8_t* kind, const flk::dram::Behind* port) {
  return flk::dram::run_behind(*timing, size, burst, kind, *port);
}

Channels* flk_dram_new(const Timing* timing) { return new Channels(*timing); }
void flk_dram_delete(Channels* c) { delete c; }
int64_t flk_dram_push(Channels* c, int64_t clock, uint64_t address, int kind) {
  c->done.emplace_back();
  c->engine.push(clock, address, static_cast<int8_t>(kind), &c->done.back());
  return static_cast<int64_t>(c->done.size()) - 1;
}
void flk_dram_advance(Channels* c, int64_t clock) { c->engine.advance(clock); }
int64_t flk_dram_done(const Channels* c, int64_t index) { return c->done[index].waiting ? -1 : c->done[index].clock; }
void flk_dram_counts(const Channels* c, Counts* counts) { *counts = c->engine.counts(); }

System* flk_memory_new(const Timing* timing, int perfect) { return new System(*timing, perfect != 0); }
void flk_memory_delete(System* s) { delete s; }
void flk_memory_tick(System* s) { s->memory.tick(); }
int flk_memory_allocate(System* s, uint64_t base, uint64_t size, uint64_t noise) { return s->memory.store.allocate(base, size, noise); }
int flk_memory_read(System* s, uint64_t address, uint64_t size, uint8_t* to) {
  const uint8_t* from = s->memory.store.find(address, size);
  if (from) std::memcpy(to, from, size);
  return from != nullptr;
}
int flk_memory_write(System* s, uint64_t address, uint64_t size, const uint8_t* from) {
  uint8_t* to = s->memory.store.find(address, size);
  if (to) std::memcpy(to, from, size);
  return to != nullptr;
}
double flk_memory_efficiency(const System* s) { return s->memory.efficiency(); }
void flk_memory_counts(const System* s, Counts* counts) { *counts = s->memory.engine.counts(); }

AxiPort* flk_axi_new(System* s, const flk::AxiConfig* config) try {
  s->ports.push_back(std::make_unique<AxiPort>(s->memory, *config));
  return s->ports.back().get();
} catch (const std::invalid_argument& problem) {
  g_error = problem.what();
  return nullptr;
}
const char* flk_axi_problem() { return g_error.c_str(); }
void flk_axi_purpose(AxiPort* p, uint64_t base, uint64_t size, uint32_t number) { p->purpose(base, size, number); }
void flk_axi_fail_range(AxiPort* p, uint64_t base, uint64_t size, int reads, int writes, int resp) {
  p->fail_range(base, size, reads, writes, static_cast<flk::Resp>(resp));
}
void flk_axi_fail_read(AxiPort* p, uint64_t nth, int resp) { p->fail_read(nth, static_cast<flk::Resp>(resp)); }
void flk_axi_fail_write(AxiPort* p, uint64_t nth, int resp) { p->fail_write(nth, static_cast<flk::Resp>(resp)); }
const flk::AxiReply* flk_axi_reply(const AxiPort* p) { return &p->reply(); }
void flk_axi_cycle(AxiPort* p, const flk::AxiRequest* request) { p->cycle(*request); }
void flk_axi_reset(AxiPort* p, const flk::AxiRequest* request) { p->reset(*request); }
int flk_axi_idle(const AxiPort* p) { return p->idle(); }
int64_t flk_axi_errors(const AxiPort* p) { return static_cast<int64_t>(p->errors().size()); }
const char* flk_axi_error(const AxiPort* p, int64_t index) { return p->errors()[index].c_str(); }
void flk_axi_channels(const AxiPort* p, uint64_t* transfers, uint64_t* waits) {
  for (int k = 0; k < flk::AXI_CHANNELS; ++k) {
    transfers[k] = p->transfers(static_cast<flk::AxiChannel>(k));
    waits[k] = p->waits(static_cast<flk::AxiChannel>(k));
  }
}
int flk_axi_counts(const AxiPort* p, uint32_t purpose, flk::AxiCounts* counts) {
  const auto found = p->counts().find(purpose);
  if (found == p->counts().end()) return 0;
  *counts = found->second;
  return 1;
}
}
