// SPDX-License-Identifier: Apache-2.0

#include "json_log.h"

namespace card {

namespace {

// Descriptions are plain ASCII: only the quote and the backslash need care.
std::string json_string(const std::string& plain) {
  std::string quoted = "\"";
  for (char c : plain) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}

}  // namespace

JsonLog::JsonLog(const std::string& path, const SimClock& clock) : clock_(clock), file_(path) {}

void JsonLog::line(const std::string& object) {
  const std::string whole = object + "\n";
  file_.write(whole.data(), whole.size());
}

void JsonLog::frame(const Frame& frame) {
  line("{\"t\":" + clock_.text(frame.start) + ",\"end\":" + clock_.text(frame.end) + ",\"line\":\"" +
       line_name(frame.line) + "\",\"from\":\"" + sender_name(frame) + "\",\"bytes\":\"" +
       hex_text(frame.bytes) + "\",\"ok\":" + (frame.ok() ? "true" : "false") +
       ",\"what\":" + json_string(frame.what) + "}");
}

void JsonLog::led(const LedChange& change) {
  line("{\"t\":" + clock_.text(change.at) + ",\"led\":\"" + change.led + "\",\"shows\":\"" + change.shows +
       "\"}");
}

}  // namespace card
