// SPDX-License-Identifier: Apache-2.0
// Frames and telegrams on a line, and the grouping of bytes into frames by silence (FRAME-1, FC-8). A silence
// may be too long inside a frame and too short to end one. Such a silence ends an incomplete frame (FRAME-2)
// and spoils a complete one, which goes on (FRAME-3); the frame records it.

#pragma once

#include "uart_line.h"

namespace card {

enum class LineId { kModbus, kDrive };

// Defect of a frame; the first that applies.
enum class Flaw {
  kNone,
  kRevoked,  // complete and good, but a character followed before the silence that ends a frame
  kParity,
  kStopBit,
  kGap,    // cut short by a silence
  kStart,  // no STX
  kShort,
  kLong,
  kLength,  // LGE does not fit
  kCheck,   // CRC or BCC
};

struct Frame {
  LineId line = LineId::kModbus;
  Sender sender = Sender::kFarEnd;
  Cycles start = 0;  // start bit of the first byte
  Cycles end = 0;    // end of the last stop bit
  Bytes bytes;
  std::size_t bad_byte = 0;  // number of the first byte with a wrong parity or stop bit, from 1; 0: none
  bool bad_parity = false;   // bad_byte has a wrong parity bit; false: a wrong stop bit
  double gap_characters = 0;  // the silence that cut the frame short or revoked it, 0: none
  std::size_t gap_at = 0;    // bytes before that silence
  Flaw flaw = Flaw::kNone;   // of the frame as a whole: length, CRC or BCC, every byte
  std::string what;          // description

  bool ok() const { return flaw == Flaw::kNone; }
  bool revoked() const { return gap_characters > 0 && gap_at < bytes.size(); }
};

const char* line_name(LineId line);
const char* sender_name(const Frame& frame);

class FrameGrouper {
 public:
  using Listener = std::function<void(const Frame&)>;
  FrameGrouper(LineId line, const Silences& silences, Listener listener);
  // Applies from the next silence on.
  void use(const Silences& silences) { silences_ = silences; }
  void add(const LineByte& byte);
  void tick(Cycles now);  // ends the frame when the line has been silent long enough
  void flush();           // ends the frame now
  // Start of the frame that has not ended yet, kNever when there is none.
  Cycles open_since() const { return frame_.bytes.empty() ? kNever : frame_.start; }

 private:
  void silence(Cycles gap);

  const LineId line_;
  Silences silences_;
  Listener listener_;
  Frame frame_;
};

// "01 03 14 13"
std::string hex_text(const Bytes& bytes);

}  // namespace card
