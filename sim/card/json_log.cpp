// SPDX-License-Identifier: Apache-2.0

#include "json_log.h"

#include "user_error.h"

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

JsonLog::JsonLog(const std::string& path, const SimClock& clock)
    : clock_(clock), file_(std::fopen(path.c_str(), "we")) {
  if (file_ == nullptr) throw system_error("cannot write " + path);
}

JsonLog::~JsonLog() { std::fclose(file_); }

void JsonLog::frame(const Frame& frame) {
  std::fprintf(
      file_,
      "{\"t\":%s,\"end\":%s,\"line\":\"%s\",\"from\":\"%s\",\"bytes\":\"%s\",\"ok\":%s,\"what\":%s}\n",
      clock_.text(frame.start).c_str(), clock_.text(frame.end).c_str(), line_name(frame.line),
      sender_name(frame), hex_text(frame.bytes).c_str(), frame.ok() ? "true" : "false", json_string(frame.what).c_str());
  std::fflush(file_);  // others read along
}

void JsonLog::led(const LedChange& change) {
  std::fprintf(file_, "{\"t\":%s,\"led\":\"%s\",\"shows\":\"%s\"}\n", clock_.text(change.at).c_str(),
               change.led.c_str(), change.shows.c_str());
  std::fflush(file_);
}

}  // namespace card
