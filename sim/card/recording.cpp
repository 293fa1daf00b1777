// SPDX-License-Identifier: Apache-2.0

#include "recording.h"

#include <utility>

namespace card {

Recording::Recording(const SimClock& clock, const Describer& describer, const std::string& log_file,
                     const std::string& pcap_file)
    : describer_(describer) {
  if (!log_file.empty()) log_ = std::make_unique<JsonLog>(log_file, clock);
  if (!pcap_file.empty()) pcap_ = std::make_unique<PcapngFile>(pcap_file, clock, describer.drive());
}

void Recording::listen(std::function<void(const Frame&)> frames, std::function<void(const LedChange&)> leds) {
  on_frame_ = std::move(frames);
  on_led_ = std::move(leds);
}

void Recording::network_line(const std::string& settings) { settings_ = settings; }

void Recording::frame(const Frame& frame) {
  waiting_.emplace(frame.start, [this, frame, settings = settings_] { write_frame(frame, settings); });
}

void Recording::led(const LedChange& change) {
  waiting_.emplace(change.at, [this, change] { write_led(change); });
}

void Recording::write_until(Cycles settled) {
  while (!waiting_.empty() && waiting_.begin()->first <= settled) {
    waiting_.begin()->second();
    waiting_.erase(waiting_.begin());
  }
}

void Recording::close() {
  write_until(kNever);
  if (log_) log_->file().close();
  if (pcap_) pcap_->close(settings_);
}

std::string Recording::trouble() const {
  if (log_ && !log_->file().trouble().empty()) return log_->file().trouble();
  return pcap_ ? pcap_->file().trouble() : "";
}

void Recording::write_frame(Frame frame, const std::string& settings) {
  describer_.describe(frame);
  if (log_) log_->frame(frame);
  if (pcap_) pcap_->frame(frame, settings);
  if (on_frame_) on_frame_(frame);
}

void Recording::write_led(const LedChange& change) {
  if (log_) log_->led(change);
  if (on_led_) on_led_(change);
}

}  // namespace card
