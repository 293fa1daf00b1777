// SPDX-License-Identifier: Apache-2.0

#include "led_watch.h"

#include <utility>

namespace card {

namespace {
const char* const kSolid[] = {"off", "red", "green", "orange"};
const char* const kFlash[] = {"", "red-flash", "green-flash", "orange-flash"};
constexpr int kHalfPeriodLeastUs = 400'000;
constexpr int kHalfPeriodMostUs = 600'000;
}  // namespace

LedWatch::LedWatch(std::string led, const SimClock& clock, Listener listener)
    : led_(std::move(led)),
      half_period_least_(clock.from_microseconds(kHalfPeriodLeastUs)),
      half_period_most_(clock.from_microseconds(kHalfPeriodMostUs)),
      listener_(std::move(listener)) {
  previous_.told = true;
}

void LedWatch::sample(bool red, bool green, Cycles now) {
  const unsigned colour = (red ? 1u : 0u) | (green ? 2u : 0u);
  if (colour != now_.colour) {
    phase_ended(now);
    previous_ = now_;
    now_ = Phase{colour, now, false};
  } else if (!now_.told && now - now_.start > half_period_most_) {
    solid(previous_);
    solid(now_);
  }
}

// A phase of half a flash period, lit or the dark one after it, is a flash. What is shorter may still be the
// first, cut-off half of one, so it is told only when the next phase shows that it is none.
void LedWatch::phase_ended(Cycles end) {
  const Cycles length = end - now_.start;
  if (now_.told) return;
  const bool half_period = length >= half_period_least_;
  if (half_period && now_.colour != 0) {
    solid(previous_);
    flash(now_);
  } else if (half_period && previous_.colour != 0) {
    flash(previous_);
  } else {
    solid(previous_);
    now_.told = flashing_ != 0 && (now_.colour == 0 || now_.colour == flashing_);
    return;
  }
  now_.told = true;
}

void LedWatch::solid(Phase& phase) {
  if (phase.told) return;
  phase.told = true;
  flashing_ = 0;
  show(kSolid[phase.colour], phase.start);
}

void LedWatch::flash(const Phase& lit) {
  flashing_ = lit.colour;
  show(kFlash[lit.colour], lit.start);
}

void LedWatch::show(const std::string& shows, Cycles at) {
  if (shows == shows_) return;
  shows_ = shows;
  listener_(LedChange{at, led_, shows});
}

}  // namespace card
