// SPDX-License-Identifier: Apache-2.0
// A card between two far ends: input edges in, output edges out. The callers in Python decide what the edges mean,
// who answers and what is measured.
//
// Unit of time: clocks since the release of the reset, or since power-up if the caller drives rst_n itself. An
// input edge at t is there just before clock edge t, an output edge at t comes from clock edge t.
#ifndef SIM_HARNESS_LINE_PLAYER_H
#define SIM_HARNESS_LINE_PLAYER_H

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "card_model.h"

namespace harness {

using Clocks = std::int64_t;
constexpr Clocks kNever = INT64_MAX;
constexpr Clocks kResetClocks = 16;

struct Edge {
  Clocks at;
  std::int32_t signal;  // a Signal of the card, or an Input
  std::int32_t level;
};

// Inputs that a caller sets. Same order as INPUTS in sim/harness/simulated_card.py.
enum Input : std::size_t {
  kModbusLine,
  kDriveLine,
  kCutToModbus,  // the wire between the ports is dead in this direction
  kCutToDrive,
  kFlipToModbus,  // the port hears the opposite level
  kFlipToDrive,
  kWiring,
  kResetN,
  kSwBaud,
  kSwAddr,
  kInputs
};

// kPairs: each port on an EIA-485 pair of its own, where it hears itself. kApart: each port hears its line only.
// kCrossed: the two ports wired to each other (LOOP-1). A line held at 0 wins, as a short circuit does.
enum Wiring { kPairs, kApart, kCrossed };

class LinePlayer {
 public:
  // watched: signals whose edges are kept. Other signals cost no time.
  LinePlayer(CardModel& card, unsigned watched) : card_(card), watched_(watched) {
    level_[kModbusLine] = level_[kDriveLine] = 1;
    level_[kSwBaud] = card.pins().sw_baud;
    level_[kSwAddr] = card.pins().sw_addr;
  }

  // Leaves the card in clock 0 without a past. `step` as in run().
  template <typename Step>
  void reset(Step step) {
    set(kResetN, 0);
    now_ = -kResetClocks;
    run(0, 0, 0, step);
    set(kResetN, 1);
    edges_.clear();
  }

  Clocks now() const { return now_; }

  // Edges of one input, none before now.
  void play(std::size_t input, const Edge* edges, std::size_t count) {
    std::vector<Edge>& queue = queue_[input];
    if (count == 0) return;
    const bool in_order = queue.empty() || queue.back().at <= edges[0].at;
    queue.insert(queue.end(), edges, edges + count);
    if (!in_order)
      std::stable_sort(queue.begin() + static_cast<std::ptrdiff_t>(played_[input]), queue.end(),
                       [](const Edge& a, const Edge& b) { return a.at < b.at; });
  }

  // Takes back the edges of a line that are not due yet; the line is idle from now on.
  void hush(std::size_t line) {
    queue_[line].clear();
    played_[line] = 0;
    level_[line] = 1;
    drive_lines();
  }

  // Runs to `until`, or to the first edge of a signal whose bit is set: in `rising`, in `falling`. `step` makes one
  // clock of the card.
  template <typename Step>
  Clocks run(Clocks until, unsigned rising, unsigned falling, Step step) {
    if (watched_ & kProbes) return run_watching<true>(until, rising, falling, step);
    return run_watching<false>(until, rising, falling, step);
  }

  // Keeps the edges since the last clock after a change from outside.
  void settle() { record(levels<true>() & watched_); }

  std::size_t take_edges(Edge* out, std::size_t room) {
    const std::size_t count = std::min(room, edges_.size());
    std::copy_n(edges_.begin(), count, out);
    edges_.erase(edges_.begin(), edges_.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }

 private:
  template <bool kWithProbes, typename Step>
  Clocks run_watching(Clocks until, unsigned rising, unsigned falling, Step step) {
    while (now_ < until) {
      const Clocks slice = std::min(until, take_input_edges());
      while (now_ < slice) {
        step();
        ++now_;
        const unsigned levels = this->levels<kWithProbes>() & watched_;
        if (levels == last_) continue;
        const unsigned changed = record(levels);
        if (changed & ((levels & rising) | (~levels & falling))) return now_;
      }
    }
    return now_;
  }

  template <bool kWithProbes>
  unsigned levels() {
    const unsigned pins = card_.line_pins();
    if (pins != line_pins_) {
      line_pins_ = pins;
      drive_lines();
    }
    unsigned levels = pins | card_.leds();
    if (kWithProbes)
      levels |= card_.probes() | unsigned{card_.pins().modbus_rx} << kModbusRx |
                unsigned{card_.pins().drive_rx} << kDriveRx;
    return levels;
  }

  // Keeps the edges between these levels and the last ones; returns the signals that changed.
  unsigned record(unsigned levels) {
    const unsigned changed = levels ^ last_;
    last_ = levels;
    for (unsigned signal = 0; changed >> signal != 0; ++signal)
      if (changed >> signal & 1u)
        edges_.push_back(
            Edge{now_ - 1, static_cast<std::int32_t>(signal), static_cast<std::int32_t>(levels >> signal & 1u)});
    return changed;
  }

  // Applies the edges that are due; returns when the next one is.
  Clocks take_input_edges() {
    Clocks next = kNever;
    for (std::size_t input = 0; input < kInputs; ++input) {
      std::vector<Edge>& queue = queue_[input];
      std::size_t& played = played_[input];
      while (played < queue.size() && queue[played].at <= now_) set(input, queue[played++].level);
      if (played < queue.size()) {
        next = std::min(next, queue[played].at);
      } else {
        queue.clear();
        played = 0;
      }
    }
    drive_lines();
    return next;
  }

  void set(std::size_t input, int level) {
    level_[input] = level;
    if (input == kResetN) card_.reset(level == 0);
    if (input == kSwBaud) card_.pins().sw_baud = static_cast<SData>(level);
    if (input == kSwAddr) card_.pins().sw_addr = static_cast<CData>(level);
  }

  // An undriven wire has level 1.
  static bool wire(bool tx, bool de) { return tx || !de; }

  void drive_lines() {
    Vrtu2fc& pins = card_.pins();
    bool modbus = level_[kModbusLine] != 0;
    bool drive = level_[kDriveLine] != 0;
    if (level_[kWiring] == kPairs) {
      modbus = modbus && wire(pins.modbus_tx, pins.modbus_de);
      drive = drive && wire(pins.drive_tx, pins.drive_de);
    } else if (level_[kWiring] == kCrossed) {
      modbus = modbus && (wire(pins.drive_tx, pins.drive_de) || level_[kCutToModbus]);
      drive = drive && (wire(pins.modbus_tx, pins.modbus_de) || level_[kCutToDrive]);
    }
    pins.modbus_rx = modbus != (level_[kFlipToModbus] != 0);
    pins.drive_rx = drive != (level_[kFlipToDrive] != 0);
  }

  CardModel& card_;
  const unsigned watched_;
  Clocks now_ = 0;
  unsigned last_ = 0;
  unsigned line_pins_ = 0;
  std::vector<Edge> edges_;
  std::array<std::vector<Edge>, kInputs> queue_;
  std::array<std::size_t, kInputs> played_{};
  std::array<int, kInputs> level_{};
};

}  // namespace harness

#endif
