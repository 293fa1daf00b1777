// SPDX-License-Identifier: Apache-2.0
// A Verilated card between two far ends: edges in, edges out, nothing else. The inner loop of the measuring bench
// (campaigns/bench) and of the fuzzer (campaigns/fuzz); what the edges mean, who answers and what is measured is theirs.
//
// Both lines are half duplex, as on an EIA-485 pair: the card hears what it sends.
// Unit of time: clocks since the release of the reset. An input edge at t is there just before clock edge t, an
// output edge at t comes from clock edge t: nothing is rounded in the card's favour.
#ifndef SIM_LINES_LINE_PLAYER_H
#define SIM_LINES_LINE_PLAYER_H

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lines {

using Clocks = std::int64_t;
constexpr Clocks kNever = INT64_MAX;
constexpr Clocks kResetClocks = 16;
constexpr std::size_t kLines = 2;  // 0 network, 1 drive

struct Edge {
  Clocks at;
  std::int32_t signal;  // of the card, or the line of a far end
  std::int32_t level;
};

// The first signals of each caller; its own follow.
enum Pin { kModbusTx, kModbusDe, kDriveTx, kDriveDe, kPins };

// `Card` is a Verilated one with these pins; it is the caller's.
template <typename Card>
class LinePlayer {
 public:
  explicit LinePlayer(Card& card) : card_(card) {}

  // Both lines idle; `step` as in run(). Leaves the card in clock 0 with its past forgotten.
  template <typename Step>
  void reset(Step step) {
    card_.modbus_rx = 1;
    card_.drive_rx = 1;
    card_.rst_n = 0;
    now_ = -kResetClocks;
    run(0, 0, 0, step);
    card_.rst_n = 1;
    edges_.clear();
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

  // Runs to `until`, or to the first edge of a signal whose bit is set: in `rising`, in `falling`. `step` makes one
  // clock of the card and returns the levels of all signals.
  template <typename Step>
  Clocks run(Clocks until, unsigned rising, unsigned falling, Step step) {
    while (now_ < until) {
      const Clocks slice = std::min(until, take_far_edges());
      while (now_ < slice) {
        const unsigned levels = step();
        ++now_;
        if (levels == last_) continue;
        const unsigned changed = record(levels);
        if (changed & ((levels & rising) | (~levels & falling))) return now_;
      }
    }
    return now_;
  }

  // Keeps the edges between these levels and the last ones; returns the signals that changed.
  unsigned record(unsigned levels) {
    const unsigned changed = levels ^ last_;
    last_ = levels;
    for (unsigned signal = 0; changed >> signal != 0; ++signal)
      if (changed >> signal & 1u)
        edges_.push_back(
            Edge{now_ - 1, static_cast<std::int32_t>(signal), static_cast<std::int32_t>(levels >> signal & 1u)});
    if (changed & ((1u << kPins) - 1u)) drive_inputs();
    return changed;
  }

  std::size_t take_edges(Edge* out, std::size_t room) {
    const std::size_t count = std::min(room, edges_.size());
    std::copy_n(edges_.begin(), count, out);
    edges_.erase(edges_.begin(), edges_.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }

  // Levels of the transmit pins and drivers, each at its place.
  unsigned pins() const {
    return unsigned{card_.modbus_tx} << kModbusTx | unsigned{card_.modbus_de} << kModbusDe |
           unsigned{card_.drive_tx} << kDriveTx | unsigned{card_.drive_de} << kDriveDe;
  }

 private:
  // Before the reset: both transmitters high, both drivers off.
  static constexpr unsigned kIdle = 1u << kModbusTx | 1u << kDriveTx;

  // A driven line has the card's level, an undriven one the far end's; low wins if both send.
  void drive_inputs() {
    card_.modbus_rx = far_level_[0] && (!card_.modbus_de || card_.modbus_tx);
    card_.drive_rx = far_level_[1] && (!card_.drive_de || card_.drive_tx);
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

  Card& card_;
  Clocks now_ = 0;
  unsigned last_ = kIdle;
  std::vector<Edge> edges_;
  std::array<std::vector<Edge>, kLines> far_edges_;
  std::array<std::size_t, kLines> played_{};
  std::array<bool, kLines> far_level_{true, true};
};

}  // namespace lines

#endif
