// SPDX-License-Identifier: Apache-2.0

#include "far_end.h"

#include <algorithm>
#include <utility>

namespace card {

namespace {
constexpr int kJitterUs = 1000;             // pauses of a program that writes byte by byte
constexpr std::size_t kMostWaiting = 4096;  // bytes; the rest of a flood stays in the pty
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

void PortFarEnd::arrived(const std::vector<std::uint8_t>& bytes, UartLine& line, Cycles now) {
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
    const std::vector<std::uint8_t> bytes = port_->read_all();
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

}  // namespace card
