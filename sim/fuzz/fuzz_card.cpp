// SPDX-License-Identifier: Apache-2.0
// The fuzzer's inner loop: the Verilated card, edges in, edges out, nothing else.
//
// The caller (sim/fuzz/pins.py, through ctypes) puts edges onto the two receive pins and gets every edge of the
// outputs back, each with its clock. What they mean is the caller's. Built with FUZZ_WAVES it writes a waveform; with
// FUZZ_FLIPS the model's variables are public: the caller finds them by name and can turn any bit over in the run.
//
// Unit of time: clocks since the release of the reset. An input edge at t is there just before clock edge t, an
// output edge at t comes from clock edge t.
#include <verilated.h>
#ifdef FUZZ_WAVES
#include <verilated_fst_c.h>
#endif
#ifdef FUZZ_FLIPS
#include <verilated_sym_props.h>
#include <verilated_syms.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "Vrtu2fc.h"
#include "Vrtu2fc___024root.h"

#ifdef FUZZ_FLIPS
// Verilator's own, declared in none of its headers: evaluates everything between the registers.
void Vrtu2fc___024root___eval_settle(Vrtu2fc___024root* vlSelf);
#endif

namespace {

using Clocks = std::int64_t;
constexpr Clocks kNever = INT64_MAX;
constexpr Clocks kResetClocks = 16;
constexpr std::size_t kLines = 2;  // 0 network, 1 drive

struct Edge {
  Clocks at;
  std::int32_t signal;  // one of Signal, or the line of a far end
  std::int32_t level;
};

// In the order of SIGNALS in sim/fuzz/pins.py.
enum Signal {
  kModbusTx,
  kModbusDe,
  kDriveTx,
  kDriveDe,
  kModbusRed,
  kModbusGreen,
  kDriveRed,
  kDriveGreen,
  kSignals
};
constexpr unsigned kIdle = 1u << kModbusTx | 1u << kDriveTx;

#ifdef FUZZ_FLIPS
// A packed variable or a memory: `words` elements of `bits` bits, `stride` bytes apart.
struct Variable {
  std::string name;
  unsigned char* data;
  std::uint32_t words;
  std::uint32_t bits;
  std::uint32_t stride;
};
#endif

class FuzzCard {
 public:
  FuzzCard(unsigned sw_baud, unsigned sw_addr, const char* wave) {
    context_.randReset(0);
    top_ = std::make_unique<Vrtu2fc>(&context_);
    open_wave(wave);
    top_->sw_baud = static_cast<SData>(sw_baud);
    top_->sw_addr = static_cast<CData>(sw_addr);
    top_->modbus_rx = 1;
    top_->drive_rx = 1;
    top_->rst_n = 0;
    now_ = -kResetClocks;
    run(0, 0);
    top_->rst_n = 1;
    edges_.clear();
  }

  ~FuzzCard() {
    top_->final();
#ifdef FUZZ_WAVES
    trace_.close();
#endif
  }

  Clocks now() const { return now_; }

  // Edges of one far end in rising order, none before now and none before the last one given.
  void play(int line, const Edge* edges, std::size_t count) {
    std::vector<Edge>& queue = far_edges_[static_cast<std::size_t>(line)];
    queue.insert(queue.end(), edges, edges + count);
  }

  // Takes back what a far end has not sent yet; its line is idle from now on.
  void hush(int line) {
    far_edges_[static_cast<std::size_t>(line)].clear();
    played_[static_cast<std::size_t>(line)] = 0;
    far_level_[static_cast<std::size_t>(line)] = true;
    drive_inputs();
  }

  // Runs to `until`, or to the first change of a signal whose bit is set in `stops`.
  Clocks run(Clocks until, unsigned stops) {
    while (now_ < until) {
      const Clocks slice = std::min(until, take_far_edges());
      while (now_ < slice) {
        top_->clk = 1;
        top_->eval();
        dump(0);
        fall();
        look();
        const unsigned levels = signals();
        ++now_;
        if (levels != last_ && (record(levels) & stops) != 0) return now_;
      }
    }
    return now_;
  }

  std::size_t take_edges(Edge* out, std::size_t room) {
    const std::size_t count = std::min(room, edges_.size());
    std::copy_n(edges_.begin(), count, out);
    edges_.erase(edges_.begin(), edges_.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }

#ifdef FUZZ_FLIPS
  const std::vector<Variable>& variables() {
    if (!variables_.empty()) return variables_;
    for (const auto& scope : *context_.scopeNameMap()) {
      VerilatedVarNameMap* vars = scope.second->varsp();
      if (vars == nullptr) continue;
      for (const auto& var : *vars) add(scope.second->name(), var.first, var.second);
    }
    return variables_;
  }

  // Whatever hangs on the bit follows at once, as it does in hardware.
  void flip(std::size_t variable, std::uint32_t word, std::uint32_t bit) {
    const Variable& v = variables().at(variable);
    v.data[v.stride * word + bit / 8] ^= static_cast<unsigned char>(1u << bit % 8);
    Vrtu2fc___024root___eval_settle(top_->rootp);
    const unsigned levels = signals();
    if (levels != last_) record(levels);
  }

  // Counts the clocks in which this variable is not 0.
  void watch(std::size_t variable) { watched_ = variables().at(variable).data; }
  std::uint64_t watched() const { return watched_clocks_; }
#endif

 private:
#ifdef FUZZ_FLIPS
  void add(const char* scope, const char* name, const VerilatedVar& var) {
    if (var.isParam()) return;
    std::uint32_t bits = 1, words = 1;
    for (const VerilatedRange& range : var.packedRanges()) bits *= static_cast<std::uint32_t>(range.elements());
    for (const VerilatedRange& range : var.unpackedRanges()) words *= static_cast<std::uint32_t>(range.elements());
    variables_.push_back(
        {std::string(scope) + "." + name, static_cast<unsigned char*>(var.datap()), words, bits, var.entSize()});
  }
#endif

#ifdef FUZZ_FLIPS
  void look() { watched_clocks_ += watched_ != nullptr && *watched_ != 0; }
#else
  void look() {}
#endif

#ifdef FUZZ_WAVES
  void fall() {
    top_->clk = 0;
    top_->eval();
    dump(1);
  }
#else
  // Nothing in the card looks at the falling edge: the model is just told that it was there.
  void fall() { top_->rootp->__Vtrigprevexpr___TOP__clk__0 = 0; }
#endif

#ifdef FUZZ_WAVES
  void open_wave(const char* wave) {
    context_.traceEverOn(true);
    top_->trace(&trace_, 99);
    trace_.open(wave);
  }
  // Two moments a clock: its rising and its falling edge.
  void dump(int half) { trace_.dump(static_cast<std::uint64_t>(2 * (now_ + kResetClocks) + half)); }
#else
  void open_wave(const char*) {}
  void dump(int) {}
#endif

  unsigned signals() const {
    return unsigned{top_->modbus_tx} << kModbusTx | unsigned{top_->modbus_de} << kModbusDe |
           unsigned{top_->drive_tx} << kDriveTx | unsigned{top_->drive_de} << kDriveDe |
           unsigned{top_->led_modbus_red} << kModbusRed | unsigned{top_->led_modbus_green} << kModbusGreen |
           unsigned{top_->led_drive_red} << kDriveRed | unsigned{top_->led_drive_green} << kDriveGreen;
  }

  // Returns the signals that changed.
  unsigned record(unsigned levels) {
    const unsigned changed = levels ^ last_;
    last_ = levels;
    for (int signal = 0; signal < kSignals; ++signal)
      if (changed >> signal & 1u)
        edges_.push_back(Edge{now_ - 1, signal, static_cast<std::int32_t>(levels >> signal & 1u)});
    if (changed & (1u << kModbusTx | 1u << kModbusDe | 1u << kDriveTx | 1u << kDriveDe)) drive_inputs();
    return changed;
  }

  // A driven line has the card's level, an undriven one the far end's; low wins if both send.
  void drive_inputs() {
    top_->modbus_rx = far_level_[0] && (!top_->modbus_de || top_->modbus_tx);
    top_->drive_rx = far_level_[1] && (!top_->drive_de || top_->drive_tx);
  }

  // Applies what is due; returns when the next edge is.
  Clocks take_far_edges() {
    Clocks next = kNever;
    for (std::size_t line = 0; line < kLines; ++line) {
      std::vector<Edge>& queue = far_edges_[line];
      std::size_t& played = played_[line];
      while (played < queue.size() && queue[played].at <= now_) far_level_[line] = queue[played++].level != 0;
      if (played < queue.size()) {
        next = std::min(next, queue[played].at);
      } else {
        queue.clear();
        played = 0;
      }
    }
    drive_inputs();
    return next;
  }

  VerilatedContext context_;
  std::unique_ptr<Vrtu2fc> top_;
#ifdef FUZZ_WAVES
  VerilatedFstC trace_;
#endif
  Clocks now_ = 0;
  unsigned last_ = kIdle;
  std::vector<Edge> edges_;
  std::array<std::vector<Edge>, kLines> far_edges_;
  std::array<std::size_t, kLines> played_{};
  std::array<bool, kLines> far_level_{true, true};
#ifdef FUZZ_FLIPS
  std::vector<Variable> variables_;
  const unsigned char* watched_ = nullptr;
  std::uint64_t watched_clocks_ = 0;
#endif
};

FuzzCard* as_card(void* card) { return static_cast<FuzzCard*>(card); }

}  // namespace

extern "C" {

// The firmware image is read from the working directory. wave: FST file, for a build with FUZZ_WAVES.
void* fuzz_open(unsigned sw_baud, unsigned sw_addr, const char* wave) {
  return new FuzzCard(sw_baud, sw_addr, wave);
}
void fuzz_close(void* card) { delete as_card(card); }
std::int64_t fuzz_now(void* card) { return as_card(card)->now(); }
void fuzz_play(void* card, int line, const Edge* edges, std::size_t count) {
  as_card(card)->play(line, edges, count);
}
void fuzz_hush(void* card, int line) { as_card(card)->hush(line); }
std::int64_t fuzz_run(void* card, std::int64_t until, unsigned stops) { return as_card(card)->run(until, stops); }
std::size_t fuzz_take_edges(void* card, Edge* out, std::size_t room) {
  return as_card(card)->take_edges(out, room);
}

#ifdef FUZZ_FLIPS
std::size_t fuzz_variables(void* card) { return as_card(card)->variables().size(); }
const char* fuzz_variable(void* card, std::size_t i, std::uint32_t* words, std::uint32_t* bits) {
  const Variable& v = as_card(card)->variables().at(i);
  *words = v.words;
  *bits = v.bits;
  return v.name.c_str();
}
void fuzz_watch(void* card, std::size_t i) { as_card(card)->watch(i); }
std::uint64_t fuzz_watched(void* card) { return as_card(card)->watched(); }
void fuzz_flip(void* card, std::size_t i, std::uint32_t word, std::uint32_t bit) {
  as_card(card)->flip(i, word, bit);
}
#endif
}
