// SPDX-License-Identifier: Apache-2.0

#include "far_end.h"

#include <algorithm>
#include <utility>

namespace card {

namespace {
constexpr int kJitterUs = 1000;             // pauses of a program that writes byte by byte
constexpr std::size_t kMostWaiting = 4096;  // bytes; the rest of a flood stays in the pty
constexpr std::size_t kLge = 1;             // index of LGE in a telegram
constexpr std::size_t kNotInLge = 2;        // STX and LGE itself
}  // namespace

PortFarEnd::PortFarEnd(std::unique_ptr<BytePort> port, const LineSettings& settings, const SimClock& clock,
                       Cycles answer_time)
    : port_(std::move(port)),
      clock_(clock),
      settings_(settings),
      collect_(clock.from_microseconds(port_->collect_us())),
      answer_time_(answer_time) {
  use(settings);
}

void PortFarEnd::use(const LineSettings& settings) {
  settings_ = settings;
  pause_limit_ = std::max(collect_, settings.silences.inside + clock_.from_microseconds(kJitterUs));
}

void PortFarEnd::from_card(const LineByte& byte) {
  port_->write(byte.value);
  last_word_ours_ = false;
  answer_until_ = byte.end + answer_time_;
}

bool PortFarEnd::answer_expected(Cycles now) const { return answer_time_ > 0 && now < answer_until_; }

bool PortFarEnd::goes_on(const UartLine& line, Cycles now) const {
  if (!bursts_.empty() || !last_word_ours_ || now - last_arrival_ > pause_limit_) return false;
  return line.far_end_sending() || now - line.silent_since() < settings_.silences.inside;
}

void PortFarEnd::arrived(const Bytes& bytes, UartLine& line, Cycles now) {
  if (goes_on(line, now)) {
    line.send(bytes, now);
  } else {
    if (bursts_.empty() || now - last_arrival_ > pause_limit_) bursts_.emplace_back();
    bursts_.back().insert(bursts_.back().end(), bytes.begin(), bytes.end());
    waiting_bytes_ += bytes.size();
  }
  last_arrival_ = now;
  answer_until_ = -1;
}

void PortFarEnd::step(UartLine& line, Cycles now) {
  if (waiting_bytes_ < kMostWaiting) {
    const Bytes bytes = port_->read_all();
    if (!bytes.empty()) arrived(bytes, line, now);
  }
  if (bursts_.empty() || line.busy() || now - line.silent_since() < settings_.burst_gap) return;
  const bool complete =
      bursts_.size() > 1 || now - last_arrival_ >= collect_ || waiting_bytes_ >= kMostWaiting;
  if (!complete) return;
  line.send(bursts_.front(), now);
  waiting_bytes_ -= bursts_.front().size();
  bursts_.pop_front();
  last_word_ours_ = true;
}

DriveEnd::DriveEnd(const drive_profile_t& profile, bool example, const LineSettings& settings,
                   const SimClock& clock, Cycles response_time)
    : name_(example ? "example" : "sim"),
      clock_(clock),
      settings_(settings),
      response_time_(response_time) {
  drive_init(&drive_, &profile);
  if (example) drive_example_state(&drive_);
}

// A gap of more than 2 characters inside a telegram, a parity error or a stop bit error spoils it (FC-8).
void DriveEnd::from_card(const LineByte& byte) {
  if (byte.start - last_byte_end_ > settings_.silences.between) {
    telegram_.clear();
    damaged_ = false;
  }
  last_byte_end_ = byte.end;
  damaged_ = damaged_ || byte.bad();
  if (telegram_.size() < DRIVE_REQUEST_MAX) telegram_.push_back(byte.value);
  reply_due_ = kNever;  // the card is sending: a reply to an earlier telegram would collide
  if (complete() && !damaged_) take_telegram();
}

void DriveEnd::power_cycle() {
  drive_power_cycle(&drive_);
  telegram_.clear();
  damaged_ = false;
  reply_due_ = kNever;
}

bool DriveEnd::complete() const {
  return telegram_.size() > kLge && telegram_.size() == telegram_[kLge] + kNotInLge;
}

// Steps in whole microseconds, as the log prints them: a second drive can then be stepped identically.
void DriveEnd::let_time_pass(Cycles until) {
  const std::int64_t until_us = clock_.microseconds(until);
  if (until_us <= stepped_us_) return;
  drive_step(&drive_, static_cast<std::uint32_t>(until_us - stepped_us_));
  stepped_us_ = until_us;
}

void DriveEnd::take_telegram() {
  let_time_pass(last_byte_end_);
  std::uint8_t reply[DRIVE_REPLY_MAX];
  std::size_t length = 0;
  if (drive_telegram(&drive_, telegram_.data(), telegram_.size(), reply, &length) != DRIVE_REPLIED) return;
  reply_.assign(reply, reply + length);
  reply_due_ = last_byte_end_ + response_time_;
}

void DriveEnd::step(UartLine& line, Cycles now) {
  let_time_pass(now);
  if (now < reply_due_) return;
  reply_due_ = kNever;
  line.send(reply_, now);
}

}  // namespace card
