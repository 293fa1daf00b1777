// SPDX-License-Identifier: Apache-2.0
// A frame or telegram as seen on a line, and how bytes become one: by the silence that ends it (FRAME-1,
// FC-8).

#ifndef FRAME_H
#define FRAME_H

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "sim_clock.h"
#include "uart_line.h"

namespace card {

enum class LineId { kModbus, kDrive };

struct Frame {
  LineId line = LineId::kModbus;
  Sender sender = Sender::kFarEnd;
  Cycles start = 0;  // start bit of the first byte
  Cycles end = 0;    // end of the last stop bit
  std::vector<std::uint8_t> bytes;
  bool byte_error = false;  // parity or stop bit wrong somewhere
  bool ok = false;          // good as a whole: length, CRC or BCC, every byte
  std::string what;         // in words
};

const char* line_name(LineId line);
const char* sender_name(const Frame& frame);

class FrameGrouper {
 public:
  using Listener = std::function<void(const Frame&)>;
  FrameGrouper(LineId line, Cycles frame_gap, Listener listener);
  void add(const LineByte& byte);
  void tick(Cycles now);  // ends the frame when the line has been silent long enough
  void flush();           // ends it now
  // Start of the frame that has not ended yet, kNever when there is none.
  Cycles open_since() const { return frame_.bytes.empty() ? kNever : frame_.start; }

 private:
  const LineId line_;
  const Cycles frame_gap_;
  Listener listener_;
  Frame frame_;
};

// "01 03 14 13"
std::string hex_text(const std::vector<std::uint8_t>& bytes);

}  // namespace card

#endif
