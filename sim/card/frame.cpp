// SPDX-License-Identifier: Apache-2.0

#include "frame.h"

#include <cstdio>
#include <utility>

namespace card {

const char* line_name(LineId line) { return line == LineId::kModbus ? "modbus" : "drive"; }

const char* sender_name(const Frame& frame) {
  if (frame.sender == Sender::kCard) return "card";
  return frame.line == LineId::kModbus ? "master" : "drive";
}

FrameGrouper::FrameGrouper(LineId line, Cycles frame_gap, Listener listener)
    : line_(line), frame_gap_(frame_gap), listener_(std::move(listener)) {}

void FrameGrouper::add(const LineByte& byte) {
  if (!frame_.bytes.empty() && (frame_.sender != byte.sender || byte.start - frame_.end > frame_gap_))
    flush();
  if (frame_.bytes.empty()) {
    frame_.line = line_;
    frame_.sender = byte.sender;
    frame_.start = byte.start;
  }
  frame_.bytes.push_back(byte.value);
  frame_.byte_error = frame_.byte_error || byte.error;
  frame_.end = byte.end;
}

void FrameGrouper::tick(Cycles now) {
  if (!frame_.bytes.empty() && now - frame_.end > frame_gap_) flush();
}

void FrameGrouper::flush() {
  if (frame_.bytes.empty()) return;
  const Frame done = std::exchange(frame_, Frame{});
  listener_(done);
}

std::string hex_text(const std::vector<std::uint8_t>& bytes) {
  std::string text;
  char byte_text[4];
  for (std::uint8_t byte : bytes) {
    std::snprintf(byte_text, sizeof byte_text, text.empty() ? "%02X" : " %02X", byte);
    text += byte_text;
  }
  return text;
}

}  // namespace card
