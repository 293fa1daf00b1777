// SPDX-License-Identifier: Apache-2.0
// --log: one JSON object a line. Frames: t and end (simulated seconds: first start bit, end of the last stop
// bit), line, from, bytes, ok, what. LEDs: t, led, shows.

#ifndef JSON_LOG_H
#define JSON_LOG_H

#include <string>

#include "frame.h"
#include "led_watch.h"
#include "output_file.h"

namespace card {

class JsonLog {
 public:
  JsonLog(const std::string& path, const SimClock& clock);  // throws UserError
  void frame(const Frame& frame);
  void led(const LedChange& change);
  OutputFile& file() { return file_; }

 private:
  void line(const std::string& object);

  const SimClock clock_;
  OutputFile file_;
};

}  // namespace card

#endif
