// SPDX-License-Identifier: Apache-2.0
// The Verilated card: model, clock, reset, probes, and optional waveform and bit flips.
//
// Used by the library for Python (card_library.cpp) and by the virtual card (sim/card). Built by
// sim/harness/library.py. CARD_WAVES: the model can write a waveform. CARD_FLIPS: its registers are public.
#ifndef SIM_HARNESS_CARD_MODEL_H
#define SIM_HARNESS_CARD_MODEL_H

#include <verilated.h>
#ifdef CARD_WAVES
#include <verilated_fst_c.h>
#endif
#ifdef CARD_FLIPS
#include <verilated_sym_props.h>
#include <verilated_syms.h>
#endif

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "Vrtu2fc.h"
#include "Vrtu2fc___024root.h"

// Verilator's own functions, declared in none of its headers: the clocked logic of the triggers that are set,
// and all logic between the registers.
void Vrtu2fc___024root___eval_nba(Vrtu2fc___024root* vlSelf);
void Vrtu2fc___024root___eval_settle(Vrtu2fc___024root* vlSelf);

namespace harness {

#define BANK(k) rtu2fc__DOT__ram_i__DOT__g_bank__BRA__##k##__KET____DOT__g_part__DOT__bank_i__DOT__words

// The part of the memory that holds a byte of a word. Each part has an array of all words (rtl/ram_bank.v). A
// card has four lanes, three banks or one, and the model with more parts is chosen where it compiles.
template <int N>
struct Rank : Rank<N - 1> {};
template <>
struct Rank<0> {};

template <class Root>
auto part_of(const Root& root, std::size_t, unsigned byte, Rank<2>) -> const decltype(root.BANK(3))& {
  switch (byte) {
    case 0: return root.BANK(0);
    case 1: return root.BANK(1);
    case 2: return root.BANK(2);
    default: return root.BANK(3);
  }
}
template <class Root>
auto part_of(const Root& root, std::size_t word, unsigned, Rank<1>) -> const decltype(root.BANK(2))& {
  switch (3 * word / root.BANK(0).size()) {
    case 0: return root.BANK(0);
    case 1: return root.BANK(1);
    default: return root.BANK(2);
  }
}
template <class Root>
auto part_of(const Root& root, std::size_t, unsigned, Rank<0>) -> const decltype(root.BANK(0))& {
  return root.BANK(0);
}

#undef BANK

// Signals of the card, each a bit in a word of levels. Same order as SIGNALS in sim/harness/simulated_card.py.
enum Signal : unsigned {
  kModbusTx,
  kModbusDe,
  kDriveTx,
  kDriveDe,
  kModbusRedLed,
  kModbusGreenLed,
  kDriveRedLed,
  kDriveGreenLed,
  kModbusRx,
  kDriveRx,
  kCandidate,
  kCommit,
  kRevoke,
  kOrderReply,
  kOrderTelegram,
  kReplyQueued,
  kTelegramQueued,
  kDriveCandidate,
  kDriveGood,
  kSignals
};
constexpr unsigned kLinePins = (1u << (kDriveDe + 1)) - 1u;
constexpr unsigned kProbes = ((1u << kSignals) - 1u) & ~((1u << kCandidate) - 1u);

struct PowerUp {
  unsigned sw_baud = 0;
  unsigned sw_addr = 0;
  // Of what the registers hold at power-up, the soft core's register file too; 0: zeros. Each run has the same
  // contents, unless the caller chooses. The firmware memory holds the image.
  int seed = 1;
};

// A register or a memory: `words` elements of `bits` bits, `stride` bytes apart.
struct Variable {
  std::string name;
  unsigned char* data;
  std::uint32_t words;
  std::uint32_t bits;
  std::uint32_t stride;
};

class CardModel {
 public:
  // Both lines idle, in reset. The firmware image is read from the working directory.
  explicit CardModel(const PowerUp& how) {
    context_.randReset(how.seed != 0 ? 2 : 0);
    if (how.seed != 0) context_.randSeed(how.seed);
#ifdef CARD_WAVES
    context_.traceEverOn(true);
#endif
    top_ = std::make_unique<Vrtu2fc>(&context_);
    top_->sw_baud = static_cast<SData>(how.sw_baud);
    top_->sw_addr = static_cast<CData>(how.sw_addr);
    top_->modbus_rx = 1;
    top_->drive_rx = 1;
  }
  ~CardModel() {
    finish();
    // The model takes its names out of the thread's context, which may be that of another card, and freed.
    Verilated::threadContextp(&context_);
  }
  CardModel(const CardModel&) = delete;
  CardModel& operator=(const CardModel&) = delete;

  // Inputs to be set and outputs to be read; rst_n by reset().
  Vrtu2fc& pins() { return *top_; }
  const Vrtu2fc& pins() const { return *top_; }

  // Fills the registers, reads the firmware image, and holds rst_n at 0 before the first clock. A simulator
  // clears reset_sync with the edge of rst_n only, hence the edge.
  void power_on() {
    top_->rst_n = 1;
    top_->eval();
    top_->rst_n = 0;
    top_->eval();
    on_ = true;
  }

  // Level of rst_n from the next clock on.
  void reset(bool asserted) {
    if (asserted && top_->rst_n != 0) triggers_ |= kResetFalls;
    top_->rst_n = !asserted;
  }

  // One clock. The card has no logic on the falling edge and none from an input past a register, so a rising edge
  // is all there is to evaluate; library.py refuses a model for which this does not hold.
  void clock() {
    Vrtu2fc___024root& root = *top_->rootp;
    root.__VnbaTriggered[0] = triggers_;
    Vrtu2fc___024root___eval_nba(&root);
    root.__VnbaTriggered[0] = 0;
    triggers_ = kClkRises;
  }

  unsigned line_pins() const {
    return unsigned{top_->modbus_tx} << kModbusTx | unsigned{top_->modbus_de} << kModbusDe |
           unsigned{top_->drive_tx} << kDriveTx | unsigned{top_->drive_de} << kDriveDe;
  }
  unsigned leds() const {
    return unsigned{top_->led_modbus_red} << kModbusRedLed | unsigned{top_->led_modbus_green} << kModbusGreenLed |
           unsigned{top_->led_drive_red} << kDriveRedLed | unsigned{top_->led_drive_green} << kDriveGreenLed;
  }
  unsigned probes() const {
    const Vrtu2fc___024root& root = *top_->rootp;
    return unsigned{root.rtu2fc__DOT__candidate} << kCandidate | unsigned{root.rtu2fc__DOT__commit} << kCommit |
           unsigned{root.rtu2fc__DOT__revoke} << kRevoke |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__order_reply} << kOrderReply |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__order_telegram} << kOrderTelegram |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__reply_queued} << kReplyQueued |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__telegram_queued} << kTelegramQueued |
           unsigned{root.rtu2fc__DOT__drive_candidate} << kDriveCandidate |
           unsigned{root.rtu2fc__DOT__drive_good} << kDriveGood;
  }

  // A word of the firmware memory, without the parity bit of each byte.
  std::uint32_t memory_word(std::size_t word) const {
    std::uint32_t data = 0;
    for (unsigned byte = 0; byte < 4; ++byte) {
      const auto& words = part_of(*top_->rootp, word, byte, Rank<2>());
      if (word < words.size()) data |= static_cast<std::uint32_t>(words[word] >> (9 * byte) & 0xFF) << (8 * byte);
    }
    return data;
  }

#ifdef CARD_WAVES
  void open_wave(const char* path) {
    wave_ = std::make_unique<VerilatedFstC>();
    top_->trace(wave_.get(), kWaveDepth);
    wave_->open(path);
  }
  bool has_wave() const { return wave_ != nullptr; }
  // One clock written to the waveform at the times of its two edges. eval() marks for the waveform what changes.
  void clock_into_wave(std::uint64_t rise, std::uint64_t fall) {
    triggers_ = kClkRises;
    top_->clk = 1;
    top_->eval();
    wave_->dump(rise);
    top_->clk = 0;
    top_->eval();
    wave_->dump(fall);
  }
  // Hands what was dumped to the file. The writer itself waits until it has 128 MB of changes.
  void flush_wave() { wave_->flush(); }
#endif

#ifdef CARD_FLIPS
  const std::vector<Variable>& variables() {
    if (!variables_.empty()) return variables_;
    for (const auto& scope : *context_.scopeNameMap()) {
      VerilatedVarNameMap* vars = scope.second->varsp();
      if (vars == nullptr) continue;
      for (const auto& var : *vars) add(scope.second->name(), var.first, var.second);
    }
    return variables_;
  }

  // Of every byte of the model, by FNV-1a over words of eight bytes.
  std::uint64_t digest() const {
    const auto* bytes = reinterpret_cast<const unsigned char*>(top_->rootp);
    std::uint64_t sum = 0xcbf29ce484222325u;
    for (std::size_t at = 0; at + sizeof sum <= sizeof *top_->rootp; at += sizeof sum) {
      std::uint64_t word;
      std::memcpy(&word, bytes + at, sizeof word);
      sum = (sum ^ word) * 0x100000001b3u;
    }
    return sum;
  }

  // The logic after the bit follows at once, as in hardware.
  void flip(std::size_t variable, std::uint32_t word, std::uint32_t bit) {
    const Variable& v = variables().at(variable);
    v.data[v.stride * word + bit / 8] ^= static_cast<unsigned char>(1u << bit % 8);
    Vrtu2fc___024root___eval_settle(top_->rootp);
  }
#endif

  // Ends the waveform; no clock may follow.
  void finish() {
    if (!on_) return;
    on_ = false;
#ifdef CARD_WAVES
    if (wave_) wave_->close();
    wave_.reset();
#endif
    top_->final();
  }

 private:
  // Bits of __VnbaTriggered.
  static constexpr std::uint64_t kClkRises = 1, kResetFalls = 2;
  static constexpr int kWaveDepth = 99;  // levels of hierarchy

#ifdef CARD_FLIPS
  void add(const char* scope, const char* name, const VerilatedVar& var) {
    if (var.isParam()) return;
    std::uint32_t bits = 1, words = 1;
    for (const VerilatedRange& range : var.packedRanges()) bits *= static_cast<std::uint32_t>(range.elements());
    for (const VerilatedRange& range : var.unpackedRanges()) words *= static_cast<std::uint32_t>(range.elements());
    variables_.push_back(
        {std::string(scope) + "." + name, static_cast<unsigned char*>(var.datap()), words, bits, var.entSize()});
  }
#endif

  VerilatedContext context_;
  std::unique_ptr<Vrtu2fc> top_;
  std::uint64_t triggers_ = kClkRises;
  bool on_ = false;
#ifdef CARD_WAVES
  std::unique_ptr<VerilatedFstC> wave_;
#endif
#ifdef CARD_FLIPS
  std::vector<Variable> variables_;
#endif
};

}  // namespace harness

#endif
