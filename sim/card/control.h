// SPDX-License-Identifier: Apache-2.0
// Commands to a running virtual card. Each command is one line and gets one line back: "ok", "error: ..."
// or, for `state`, a JSON object. A command with an error changes nothing.

#pragma once

#include <string>
#include <vector>

#include "virtual_card.h"

namespace card {

class Control {
 public:
  struct Switches {
    unsigned baud;
    unsigned addr;
  };

  // `drive`: the simulated drive, or nullptr. `fixed_rate`: the network line's port cannot change its rate.
  Control(const SimClock& clock, const Switches& switches, VirtualCard& virtual_card, DriveEnd* drive,
          bool fixed_rate);
  std::string run(const std::string& command);
  Switches read() const { return read_; }

 private:
  using Words = std::vector<std::string>;
  void trip(const Words& words);
  void trouble(const Words& words);
  void set_switches(const Words& words);
  void power_cycle(const Words& words);
  std::string state() const;
  std::string line_state(LineId which) const;

  const SimClock clock_;
  VirtualCard& card_;
  DriveEnd* const drive_;
  const bool fixed_rate_;
  Switches switches_;  // present position
  Switches read_;      // position at the last power-up
};

// Reads complete lines from a descriptor; never blocks, and holds a line or two however many there are.
class CommandInput {
 public:
  explicit CommandInput(int fd);
  std::vector<std::string> take();
  bool ended() const { return ended_; }
  int fd() const { return ended_ ? -1 : fd_; }

 private:
  const int fd_;
  std::string rest_;
  bool ended_ = false;
};

}  // namespace card
