// SPDX-License-Identifier: Apache-2.0

#include "led_watch.h"

#include <utility>

namespace card {

namespace {
constexpr unsigned kDark = 0;
constexpr unsigned kOrange = 3;  // never flashes
const char* const kSolid[] = {"off", "red", "green", "orange"};
const char* const kFlash[] = {"", "red-flash", "green-flash"};
constexpr int kHalfPeriodLeastUs = 400'000;
constexpr int kHalfPeriodMostUs = 600'000;
}  // namespace

LedWatch::LedWatch(std::string led, const SimClock& clock, Listener listener)
    : led_(std::move(led)),
      half_period_least_(clock.from_microseconds(kHalfPeriodLeastUs)),
      half_period_most_(clock.from_microseconds(kHalfPeriodMostUs)),
      listener_(std::move(listener)) {}

void LedWatch::sample(unsigned colour, Cycles now) {
  if (colour != colour_) {
    changed(colour, now);
    colour_ = colour;
    since_ = now;
  } else if (now - since_ > half_period_most_) {
    lasting(now);
  }
}

void LedWatch::changed(unsigned colour, Cycles now) {
  if (lit_ != 0) decide(colour, now);
  if (lit_ != 0) return;
  if (flashing_ != 0 && colour != kOrange) {
    if (colour != kDark && colour != flashing_) flash(colour, now);
  } else if (colour == kDark || colour == kOrange) {
    solid(colour, now);
  } else {
    lit_ = colour;
    lit_since_ = now;
  }
}

// The phase that ends now, lit or the dark one after it, is a flash if it lasted half a period. A shorter lit
// phase may be the end of a flash that began earlier: the dark phase decides.
void LedWatch::decide(unsigned next, Cycles now) {
  const bool half_period = now - since_ >= half_period_least_;
  const bool was_dark = colour_ == kDark;
  if (half_period && (was_dark || next == kDark)) {
    flash(lit_, lit_since_);
  } else if (was_dark || next != kDark) {
    solid(lit_, lit_since_);
    if (was_dark) solid(kDark, since_);
  }
}

// Handles a phase that has become too long for a flash.
void LedWatch::lasting(Cycles now) {
  if (lit_ != 0) {
    solid(lit_, lit_since_);
    solid(colour_, since_);
  } else if (flashing_ != 0) {
    solid(colour_, now);
  }
}

void LedWatch::solid(unsigned colour, Cycles at) {
  lit_ = 0;
  flashing_ = 0;
  show(kSolid[colour], at);
}

void LedWatch::flash(unsigned colour, Cycles at) {
  lit_ = 0;
  flashing_ = colour;
  show(kFlash[colour], at);
}

void LedWatch::show(const std::string& shows, Cycles at) {
  if (shows == shows_) return;
  shows_ = shows;
  listener_(LedChange{at, led_, shows});
}

}  // namespace card
