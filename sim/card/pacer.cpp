// SPDX-License-Identifier: Apache-2.0

#include "pacer.h"

#include <poll.h>
#include <time.h>

#include <algorithm>

namespace card {

namespace {
constexpr double kSleepWorthwhile = 0.0005;  // seconds ahead
constexpr double kCatchUp = 0.020;           // longest delay made up for, in seconds
}  // namespace

Pacer::Pacer(const SimClock& clock)
    : clock_(clock), began_(now()), ahead_base_(began_), window_began_(began_) {}

double Pacer::now() { return std::chrono::duration<double>(Wall::now().time_since_epoch()).count(); }

double Pacer::wall_seconds() const { return now() - began_; }

void Pacer::run_free(Cycles cycles) {
  simulated_ += clock_.seconds(cycles);
  ahead_base_ = now() - simulated_;
}

void Pacer::keep_to_wall_time(Cycles cycles, const std::vector<int>& wake_up) {
  simulated_ += clock_.seconds(cycles);
  const double ahead = ahead_base_ + simulated_ - now();
  if (ahead > kSleepWorthwhile) {
    std::vector<pollfd> descriptors;
    for (int fd : wake_up)
      if (fd >= 0) descriptors.push_back(pollfd{fd, POLLIN, 0});
    const auto nanoseconds = static_cast<long>(std::min(ahead, 0.5) * 1e9);
    const timespec timeout{0, nanoseconds};
    ppoll(descriptors.data(), descriptors.size(), &timeout, nullptr);
  } else if (-ahead > kCatchUp) {
    dropped_ += -ahead - kCatchUp;
    ahead_base_ += -ahead - kCatchUp;
  }
}

double Pacer::possible_ratio() const {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  const double computing = static_cast<double>(used.tv_sec) + static_cast<double>(used.tv_nsec) / 1e9;
  return computing > 0 ? simulated_ / computing : 0;
}

double Pacer::take_shortfall() {
  const double wall = now() - window_began_;
  const double ratio = wall > 0 ? 1 - dropped_ / wall : 1;
  dropped_ = 0;
  window_began_ = now();
  return ratio;
}

}  // namespace card
