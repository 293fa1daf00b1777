// SPDX-License-Identifier: Apache-2.0
// The fuzzer's card: its pins and LEDs, as edges in and edges out (sim/harness/line_player.h).
//
// The caller (sim/harness/pins.py, through ctypes) puts edges onto the two receive pins and gets every edge of the
// outputs back, each with its clock. Built with FUZZ_WAVES it writes a waveform; with FUZZ_FLIPS the model's variables
// are public: the caller finds them by name and can turn any bit over in the run.
#include <verilated.h>
#ifdef FUZZ_WAVES
#include <verilated_fst_c.h>
#endif
#ifdef FUZZ_FLIPS
#include <verilated_sym_props.h>
#include <verilated_syms.h>
#endif

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "Vrtu2fc.h"
#include "Vrtu2fc___024root.h"
#include "line_player.h"

#ifdef FUZZ_FLIPS
// Verilator's own, declared in none of its headers: evaluates everything between the registers.
void Vrtu2fc___024root___eval_settle(Vrtu2fc___024root* vlSelf);
#endif

namespace {

using lines::Clocks;
using lines::Edge;

// Order of SIGNALS in sim/harness/pins.py, from the pins on.
enum Led { kModbusRed = lines::kPins, kModbusGreen, kDriveRed, kDriveGreen };

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
    open_wave(wave);
    top_.sw_baud = static_cast<SData>(sw_baud);
    top_.sw_addr = static_cast<CData>(sw_addr);
    player_.reset([this] { return step(); });
  }

  ~FuzzCard() {
    top_.final();
#ifdef FUZZ_WAVES
    trace_.close();
#endif
  }

  lines::LinePlayer<Vrtu2fc>& player() { return player_; }

  // Runs to `until`, or to the first change of a signal whose bit is set in `stops`.
  Clocks run(Clocks until, unsigned stops) {
    return player_.run(until, stops, stops, [this] { return step(); });
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
    Vrtu2fc___024root___eval_settle(top_.rootp);
    player_.record(signals());
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

  unsigned step() {
    top_.clk = 1;
    top_.eval();
    dump(0);
    fall();
    look();
    return signals();
  }

#ifdef FUZZ_FLIPS
  void look() { watched_clocks_ += watched_ != nullptr && *watched_ != 0; }
#else
  void look() {}
#endif

#ifdef FUZZ_WAVES
  void fall() {
    top_.clk = 0;
    top_.eval();
    dump(1);
  }
#else
  // Nothing in the card looks at the falling edge: the model is just told that it was there.
  void fall() { top_.rootp->__Vtrigprevexpr___TOP__clk__0 = 0; }
#endif

#ifdef FUZZ_WAVES
  void open_wave(const char* wave) {
    context_.traceEverOn(true);
    top_.trace(&trace_, 99);
    trace_.open(wave);
  }
  // Two moments a clock: its rising and its falling edge.
  void dump(int half) { trace_.dump(static_cast<std::uint64_t>(2 * (player_.now() + lines::kResetClocks) + half)); }
#else
  void open_wave(const char*) {}
  void dump(int) {}
#endif

  unsigned signals() const {
    return player_.pins() | unsigned{top_.led_modbus_red} << kModbusRed |
           unsigned{top_.led_modbus_green} << kModbusGreen | unsigned{top_.led_drive_red} << kDriveRed |
           unsigned{top_.led_drive_green} << kDriveGreen;
  }

  VerilatedContext context_;
  Vrtu2fc top_{&context_};
#ifdef FUZZ_WAVES
  VerilatedFstC trace_;
#endif
  lines::LinePlayer<Vrtu2fc> player_{top_};
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
std::int64_t fuzz_now(void* card) { return as_card(card)->player().now(); }
void fuzz_play(void* card, int line, const Edge* edges, std::size_t count) {
  as_card(card)->player().play(line, edges, count);
}
void fuzz_hush(void* card, int line) { as_card(card)->player().hush(line); }
std::int64_t fuzz_run(void* card, std::int64_t until, unsigned stops) { return as_card(card)->run(until, stops); }
std::size_t fuzz_take_edges(void* card, Edge* out, std::size_t room) {
  return as_card(card)->player().take_edges(out, room);
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
