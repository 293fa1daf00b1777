// SPDX-License-Identifier: Apache-2.0
// Writes frames and LED changes of both lines to --log and --pcap, in the order in which they began. A frame
// arrives here when it has ended, an LED change when it is decided. Listeners get the same events. Does not
// depend on the virtual card: test benches use it too.

#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "describe.h"
#include "led_watch.h"

namespace card {

class JsonLog;
class PcapngFile;

class Recording {
 public:
  // An empty file name means no file. Throws UserError.
  Recording(const SimClock& clock, const Describer& describer, const std::string& log_file,
            const std::string& pcap_file);
  ~Recording();
  void listen(std::function<void(const Frame&)> frames, std::function<void(const LedChange&)> leds);

  // New rate and format of the network line.
  void network_line(const std::string& settings) { settings_ = settings; }
  void frame(const Frame& frame);
  void led(const LedChange& change);
  // All events before `settled` have arrived; writes them.
  void write_until(Cycles settled);
  // Writes all events and ends the files.
  void close();
  // First error of a file in one line, or empty.
  std::string trouble() const;

 private:
  Describer describer_;
  std::string settings_;  // of the network line
  std::multimap<Cycles, std::function<void()>> waiting_;
  std::unique_ptr<JsonLog> log_;
  std::unique_ptr<PcapngFile> pcap_;
  std::function<void(const Frame&)> on_frame_;
  std::function<void(const LedChange&)> on_led_;
};

}  // namespace card
