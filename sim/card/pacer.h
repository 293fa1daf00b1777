// SPDX-License-Identifier: Apache-2.0
// Holds simulated time to wall time, and measures how much faster this machine could go.

#ifndef PACER_H
#define PACER_H

#include <chrono>
#include <vector>

#include "sim_clock.h"

namespace card {

class Pacer {
 public:
  explicit Pacer(const SimClock& clock);

  // Simulated time has gone on by `cycles` since the last call. When it is ahead of the wall clock, sleeps
  // until it no longer is, or until a descriptor becomes readable. When it is behind, catches up only a
  // little: the rest is given up and counted.
  void keep_to_wall_time(Cycles cycles, const std::vector<int>& wake_up);
  // Likewise, but this stretch may take as little time as it can.
  void run_free(Cycles cycles);

  // Simulated seconds for each second of processor time so far: above 1 one free core keeps up.
  double possible_ratio() const;
  // Simulated seconds for each wall second, over the time given up since the last call; 1 when nothing was.
  double take_shortfall();
  double simulated_seconds() const { return simulated_; }
  double wall_seconds() const;

 private:
  using Wall = std::chrono::steady_clock;
  static double now();

  const SimClock clock_;
  const double began_;
  double simulated_ = 0;
  double ahead_base_;    // wall time at which simulated_ == 0 would fit
  double given_up_ = 0;  // wall seconds since take_shortfall()
  double window_began_;
};

}  // namespace card

#endif
