// SPDX-License-Identifier: Apache-2.0
// What was seen on the lines and LEDs, in words and in the order in which it began, into --log and --pcap:
// a frame comes here when it has ended, an LED change when it is clear what the LED shows. Whoever wants to
// see the same gives listeners. Knows nothing of how the card runs: test benches record with it too.

#ifndef RECORDING_H
#define RECORDING_H

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "describe.h"
#include "json_log.h"
#include "led_watch.h"
#include "pcapng.h"

namespace card {

class Recording {
 public:
  // File names may be empty: none. Throws UserError.
  Recording(const SimClock& clock, const Describer& describer, const std::string& log_file,
            const std::string& pcap_file);
  void listen(std::function<void(const Frame&)> frames, std::function<void(const LedChange&)> leds);

  // Rate and format of the network line from now on.
  void network_line(const std::string& settings);
  void frame(const Frame& frame);
  void led(const LedChange& change);
  // Nothing older than `settled` will come any more.
  void write_until(Cycles settled);
  // All of it, and the end of the files.
  void close();
  // Empty, or why a file could not be written.
  std::string trouble() const;

 private:
  void write_frame(Frame frame, const std::string& settings);
  void write_led(const LedChange& change);

  Describer describer_;
  std::string settings_;  // of the network line
  std::multimap<Cycles, std::function<void()>> waiting_;
  std::unique_ptr<JsonLog> log_;
  std::unique_ptr<PcapngFile> pcap_;
  std::function<void(const Frame&)> on_frame_;
  std::function<void(const LedChange&)> on_led_;
};

}  // namespace card

#endif
