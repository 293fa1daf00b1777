// SPDX-License-Identifier: Apache-2.0

#include "frame.h"

#include <cstdio>
#include <utility>

#include "describe.h"

namespace card {

const char* line_name(LineId line) { return line == LineId::kModbus ? "modbus" : "drive"; }

const char* sender_name(const Frame& frame) {
  if (frame.sender == Sender::kCard) return "card";
  return frame.line == LineId::kModbus ? "master" : "drive";
}

FrameGrouper::FrameGrouper(LineId line, const Silences& silences, Listener listener)
    : line_(line), silences_(silences), listener_(std::move(listener)) {}

void FrameGrouper::silence(Cycles gap) {
  if (gap > silences_.between) {
    flush();
  } else if (gap > silences_.inside && frame_.gap_characters == 0) {
    frame_.gap_characters = static_cast<double>(gap) / static_cast<double>(silences_.character);
    frame_.gap_at = frame_.bytes.size();
    if (frame_.bad_byte != 0 || !complete_adu(frame_.bytes)) flush();
  }
}

void FrameGrouper::add(const LineByte& byte) {
  if (!frame_.bytes.empty() && frame_.sender != byte.sender) flush();
  if (!frame_.bytes.empty()) silence(byte.start - frame_.end);
  if (frame_.bytes.empty()) {
    frame_.line = line_;
    frame_.sender = byte.sender;
    frame_.start = byte.start;
  }
  frame_.bytes.push_back(byte.value);
  if (byte.bad() && frame_.bad_byte == 0) {
    frame_.bad_byte = frame_.bytes.size();
    frame_.bad_parity = byte.bad_parity;
  }
  frame_.end = byte.end;
}

void FrameGrouper::tick(Cycles now) {
  if (!frame_.bytes.empty() && now - frame_.end > silences_.between) flush();
}

void FrameGrouper::flush() {
  if (frame_.bytes.empty()) return;
  const Frame done = std::exchange(frame_, Frame{});
  listener_(done);
}

std::string hex_text(const Bytes& bytes) {
  std::string text;
  char byte_text[4];
  for (std::uint8_t byte : bytes) {
    std::snprintf(byte_text, sizeof byte_text, text.empty() ? "%02X" : " %02X", byte);
    text += byte_text;
  }
  return text;
}

}  // namespace card
