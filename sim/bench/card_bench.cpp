// SPDX-License-Identifier: Apache-2.0
// The measuring bench's inner loop: the Verilated card, edges in, edges out, nothing else.
//
// The caller (sim/bench/card.py, through ctypes) puts edges onto the two far ends and gets every edge of the
// card's pins and probes back, each with its time. What the edges mean, who answers and what is measured is the
// caller's. Both lines are half duplex, as on an EIA-485 pair: the card hears what it sends.
//
// Times are cycles of the card's clock since the release of the reset. An input edge at t is there just before
// clock edge t, an output edge at t comes from clock edge t: nothing is rounded in the card's favour.

#include <verilated.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "Vrtu2fc.h"
#include "Vrtu2fc___024root.h"

namespace {

using Cycles = std::int64_t;
constexpr Cycles kNever = std::numeric_limits<Cycles>::max();
constexpr int kResetCycles = 16;
constexpr int kLines = 2;  // 0 network, 1 drive

struct Edge {
  Cycles at;
  std::int32_t signal;  // one of Signal, or the line of a far end
  std::int32_t level;
};

// Order of sim/bench/card.py.
enum Signal {
  kModbusTx,
  kModbusDe,
  kDriveTx,
  kDriveDe,
  kCandidate,
  kCommit,
  kQueueReply,
  kQueueTelegram,
  kDriveCandidate,
  kSignals
};

// Idle before the reset: both transmitters high, both drivers off.
constexpr unsigned kIdle = 1u << kModbusTx | 1u << kDriveTx;

class CardBench {
 public:
  CardBench(unsigned sw_baud, unsigned sw_addr) : top_(&context_) {
    context_.randReset(0);
    top_.sw_baud = static_cast<SData>(sw_baud);
    top_.sw_addr = static_cast<CData>(sw_addr);
    top_.rst_n = 0;
    now_ = -kResetCycles;
    drive_inputs();
    run(0, 0);
    top_.rst_n = 1;
    edges_.clear();
  }
  ~CardBench() { top_.final(); }

  Cycles now() const { return now_; }

  // Edges of one far end in rising order, none before now and none before the last one given.
  void play(int line, const Edge* edges, std::size_t count) {
    std::vector<Edge>& queue = far_edges_[static_cast<std::size_t>(line)];
    queue.insert(queue.end(), edges, edges + count);
  }

  // Runs to `until`, or to the first falling edge of a signal whose bit is set in `stops`.
  Cycles run(Cycles until, unsigned stops) {
    while (now_ < until) {
      take_far_edges();
      const Cycles slice = std::min(until, next_far_edge());
      while (now_ < slice) {
        top_.clk = 1;
        top_.eval();
        top_.clk = 0;
        top_.eval();
        const unsigned levels = signals();
        ++now_;
        if (levels != last_ && record(levels, now_ - 1) & stops) return now_;
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

  // Without the parity above each byte.
  std::uint32_t memory_word(std::size_t word) const {
    const auto& words = top_.rootp->rtu2fc__DOT__ram_i__DOT__words;
    std::uint32_t data = 0;
    for (unsigned byte = 0; byte < 4 && word < words.size(); ++byte)
      data |= static_cast<std::uint32_t>(words[word] >> (9 * byte) & 0xFF) << (8 * byte);
    return data;
  }

 private:
  unsigned signals() const {
    const Vrtu2fc___024root& root = *top_.rootp;
    return unsigned{top_.modbus_tx} << kModbusTx | unsigned{top_.modbus_de} << kModbusDe |
           unsigned{top_.drive_tx} << kDriveTx | unsigned{top_.drive_de} << kDriveDe |
           unsigned{root.rtu2fc__DOT__candidate} << kCandidate | unsigned{root.rtu2fc__DOT__commit} << kCommit |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__queue_reply} << kQueueReply |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__queue_telegram} << kQueueTelegram |
           unsigned{root.rtu2fc__DOT__drive_candidate} << kDriveCandidate;
  }

  // Returns the signals that fell.
  unsigned record(unsigned levels, Cycles at) {
    const unsigned changed = levels ^ last_;
    last_ = levels;
    for (int signal = 0; signal < kSignals; ++signal)
      if (changed >> signal & 1u)
        edges_.push_back(Edge{at, signal, static_cast<std::int32_t>(levels >> signal & 1u)});
    if (changed & (1u << kModbusTx | 1u << kModbusDe | 1u << kDriveTx | 1u << kDriveDe)) drive_inputs();
    return changed & ~levels;
  }

  // A driven line has the card's level, an undriven one the far end's; low wins if both send.
  void drive_inputs() {
    top_.modbus_rx = far_level_[0] && (!top_.modbus_de || top_.modbus_tx);
    top_.drive_rx = far_level_[1] && (!top_.drive_de || top_.drive_tx);
  }

  Cycles next_far_edge() const {
    Cycles next = kNever;
    for (std::size_t line = 0; line < kLines; ++line)
      if (played_[line] < far_edges_[line].size()) next = std::min(next, far_edges_[line][played_[line]].at);
    return next;
  }

  void take_far_edges() {
    for (std::size_t line = 0; line < kLines; ++line) {
      std::vector<Edge>& queue = far_edges_[line];
      std::size_t& played = played_[line];
      while (played < queue.size() && queue[played].at <= now_) far_level_[line] = queue[played++].level != 0;
      if (played == queue.size()) {
        queue.clear();
        played = 0;
      }
    }
    drive_inputs();
  }

  VerilatedContext context_;
  Vrtu2fc top_;
  Cycles now_ = 0;
  unsigned last_ = kIdle;
  std::vector<Edge> edges_;
  std::array<std::vector<Edge>, kLines> far_edges_;
  std::array<std::size_t, kLines> played_{};
  std::array<bool, kLines> far_level_{true, true};
};

}  // namespace

extern "C" {

// Fingerprint of the sources it was built from.
const char* bench_card() { return BENCH_CARD; }
// The firmware image is looked for where the build says, from the working directory.
void* bench_open(unsigned sw_baud, unsigned sw_addr) { return new CardBench(sw_baud, sw_addr); }
void bench_close(void* bench) { delete static_cast<CardBench*>(bench); }
std::int64_t bench_now(const void* bench) { return static_cast<const CardBench*>(bench)->now(); }
void bench_play(void* bench, int line, const Edge* edges, std::size_t count) {
  static_cast<CardBench*>(bench)->play(line, edges, count);
}
std::int64_t bench_run(void* bench, std::int64_t until, unsigned stops) {
  return static_cast<CardBench*>(bench)->run(until, stops);
}
std::size_t bench_take_edges(void* bench, Edge* out, std::size_t room) {
  return static_cast<CardBench*>(bench)->take_edges(out, room);
}
std::uint32_t bench_memory_word(const void* bench, std::size_t word) {
  return static_cast<const CardBench*>(bench)->memory_word(word);
}
}
