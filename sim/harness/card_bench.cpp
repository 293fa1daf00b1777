// SPDX-License-Identifier: Apache-2.0
// The measuring bench's card: its pins and a few probes, as edges in and edges out (sim/harness/line_player.h).
//
// The caller (campaigns/bench/card.py, through ctypes) puts edges onto the two far ends and gets every edge of the
// card's pins and probes back, each with its time.

#include <verilated.h>

#include <cstddef>
#include <cstdint>

#include "Vrtu2fc.h"
#include "Vrtu2fc___024root.h"
#include "line_player.h"

namespace {

using lines::Clocks;
using lines::Edge;

// Order of campaigns/bench/card.py, from the pins on.
enum Probe { kCandidate = lines::kPins, kCommit, kQueueReply, kQueueTelegram, kDriveCandidate };

class CardBench {
 public:
  CardBench(unsigned sw_baud, unsigned sw_addr) : top_(&context_), player_(top_) {
    context_.randReset(0);
    top_.sw_baud = static_cast<SData>(sw_baud);
    top_.sw_addr = static_cast<CData>(sw_addr);
    player_.reset([this] { return step(); });
  }
  ~CardBench() { top_.final(); }

  lines::LinePlayer<Vrtu2fc>& player() { return player_; }

  // Runs to `until`, or to the first falling edge of a signal whose bit is set in `stops`.
  Clocks run(Clocks until, unsigned stops) {
    return player_.run(until, 0, stops, [this] { return step(); });
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
  unsigned step() {
    top_.clk = 1;
    top_.eval();
    top_.clk = 0;
    top_.eval();
    const Vrtu2fc___024root& root = *top_.rootp;
    return player_.pins() | unsigned{root.rtu2fc__DOT__candidate} << kCandidate |
           unsigned{root.rtu2fc__DOT__commit} << kCommit |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__queue_reply} << kQueueReply |
           unsigned{root.rtu2fc__DOT__mailbox_i__DOT__queue_telegram} << kQueueTelegram |
           unsigned{root.rtu2fc__DOT__drive_candidate} << kDriveCandidate;
  }

  VerilatedContext context_;
  Vrtu2fc top_;
  lines::LinePlayer<Vrtu2fc> player_;
};

CardBench* as_bench(void* bench) { return static_cast<CardBench*>(bench); }

}  // namespace

extern "C" {

// Fingerprint of the sources it was built from.
const char* bench_card() { return BENCH_CARD; }
// The firmware image is looked for where the build says, from the working directory.
void* bench_open(unsigned sw_baud, unsigned sw_addr) { return new CardBench(sw_baud, sw_addr); }
void bench_close(void* bench) { delete as_bench(bench); }
std::int64_t bench_now(void* bench) { return as_bench(bench)->player().now(); }
void bench_play(void* bench, int line, const Edge* edges, std::size_t count) {
  as_bench(bench)->player().play(line, edges, count);
}
std::int64_t bench_run(void* bench, std::int64_t until, unsigned stops) { return as_bench(bench)->run(until, stops); }
std::size_t bench_take_edges(void* bench, Edge* out, std::size_t room) {
  return as_bench(bench)->player().take_edges(out, room);
}
std::uint32_t bench_memory_word(void* bench, std::size_t word) { return as_bench(bench)->memory_word(word); }
}
