// SPDX-License-Identifier: Apache-2.0
// Keeps simulated time at wall time and measures the speed that this machine could reach.

#pragma once

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <vector>

#include "sim_clock.h"

namespace card {

class Pacer {
 public:
  explicit Pacer(const SimClock& clock)
      : clock_(clock), began_(now()), ahead_base_(began_), window_began_(began_) {}

  // Simulated time has advanced by `cycles` since the last call. If it is ahead of wall time, sleeps until
  // wall time has caught up or a descriptor is readable. If it is behind, makes up for a little of the delay;
  // the rest is dropped and counted.
  void keep_to_wall_time(Cycles cycles, const std::vector<int>& wake_up) {
    simulated_ += clock_.seconds(cycles);
    const double ahead = ahead_base_ + simulated_ - now();
    if (ahead > kSleepWorthwhile) {
      std::vector<pollfd> descriptors;
      for (int fd : wake_up) descriptors.push_back(pollfd{fd, POLLIN, 0});  // poll ignores those below 0
      const timespec timeout{0, static_cast<long>(std::min(ahead, 0.5) * 1e9)};
      ppoll(descriptors.data(), descriptors.size(), &timeout, nullptr);
    } else if (-ahead > kCatchUp) {
      dropped_ += -ahead - kCatchUp;
      ahead_base_ += -ahead - kCatchUp;
    }
  }

  // As keep_to_wall_time(), but without sleeping.
  void run_free(Cycles cycles) {
    simulated_ += clock_.seconds(cycles);
    ahead_base_ = now() - simulated_;
  }

  // Simulated seconds per second of processor time so far: above 1, one free core keeps up.
  double possible_ratio() const {
    timespec used{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
    const double computing = static_cast<double>(used.tv_sec) + static_cast<double>(used.tv_nsec) / 1e9;
    return computing > 0 ? simulated_ / computing : 0;
  }

  // Simulated seconds per wall second since the last call; 1 if no time was dropped.
  double take_shortfall() {
    const double wall = now() - window_began_;
    const double ratio = wall > 0 ? 1 - dropped_ / wall : 1;
    dropped_ = 0;
    window_began_ = now();
    return ratio;
  }

  double simulated_seconds() const { return simulated_; }
  double wall_seconds() const { return now() - began_; }

 private:
  static constexpr double kSleepWorthwhile = 0.0005;  // seconds ahead
  static constexpr double kCatchUp = 0.020;           // longest delay made up for, in seconds

  static double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }

  const SimClock clock_;
  const double began_;
  double simulated_ = 0;
  double ahead_base_;   // wall time that corresponds to simulated_ == 0
  double dropped_ = 0;  // wall seconds since take_shortfall()
  double window_began_;
};

}  // namespace card
