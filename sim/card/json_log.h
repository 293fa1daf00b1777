// SPDX-License-Identifier: Apache-2.0
// --log: one JSON object a line. Frames: t and end (simulated seconds: first start bit, end of the last stop
// bit), line, from, bytes, ok, what. LEDs: t, led, shows.

#ifndef JSON_LOG_H
#define JSON_LOG_H

#include <cstdio>
#include <string>

#include "frame.h"
#include "led_watch.h"

namespace card {

class JsonLog {
 public:
  JsonLog(const std::string& path, const SimClock& clock);  // throws UserError
  ~JsonLog();
  JsonLog(const JsonLog&) = delete;
  JsonLog& operator=(const JsonLog&) = delete;
  void frame(const Frame& frame);
  void led(const LedChange& change);

 private:
  const SimClock clock_;
  std::FILE* file_;
};

}  // namespace card

#endif
