// SPDX-License-Identifier: Apache-2.0
// Command line of the virtual card.

#pragma once

#include <string>

#include "dialect.h"
#include "vlt_drive.h"

namespace card {

struct Options {
  std::string modbus_link;
  std::string modbus_device;
  std::string drive_link;  // empty: the simulated drive, unless drive_device is set
  bool example = false;    // the simulated drive keeps the state of its document's examples
  std::string drive_device;
  const Dialect* dialect = nullptr;
  std::size_t image = 0;  // of Dialect::images
  const drive_profile_t* profile = nullptr;
  unsigned sw_baud = 0;  // bit n-1 = switch n, 1 = ON
  unsigned sw_addr = 0;
  bool real_time = true;
  double seconds = 0;  // simulated seconds to run, 0: until a signal
  std::string wave_file;
  std::string pcap_file;
  std::string log_file;
  bool control = false;  // commands on standard input
  bool quiet = false;
  bool help = false;
  bool version = false;
};

// Throws UserError for anything that is not in help_text().
Options parse_options(int argc, char** argv);

constexpr std::size_t kBaudSwitches = 9, kAddrSwitches = 8;
// Switch digits as in help_text(), bit n-1 = switch n. `option`: what the error names. Throws UserError.
unsigned switches(const std::string& option, const std::string& text, std::size_t count);

std::string help_text();

}  // namespace card
